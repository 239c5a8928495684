"""The program ``beamlet``."""

from __future__ import annotations

import sys

from . import _beamlet, _vulkan


def main() -> int:
    """Runs the program with the arguments of the process; its exit code."""
    _vulkan.find_driver()
    return _beamlet.program(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
