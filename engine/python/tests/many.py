"""Simulations in one process against processes of their own: throughput, and memory over the time.

    python many.py COUNT

At most 30 processes are run. Fails where one process is less than three times as fast, or where
its memory grows by more than 64 MiB after the first tenth.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

from conftest import SCENE

import beamlet as bl

ONE = """
import sys; sys.path.insert(0, sys.argv[1])
import beamlet as bl
from conftest import SCENE
bl.Engine().simulate(bl.Scene.from_dict(SCENE), seed=1)
"""


def resident() -> float:
    """Memory of this process, MiB."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / (1 << 20)


def main() -> int:
    count = int(sys.argv[1])
    scene = bl.Scene.from_dict(SCENE)
    processes = min(count, 30)
    began = time.monotonic()
    for _ in range(processes):
        subprocess.run([sys.executable, "-c", ONE, os.path.dirname(os.path.abspath(__file__))], check=True)
    apart = (time.monotonic() - began) / processes

    sizes = []
    began = time.monotonic()
    with bl.Engine() as engine:
        for run in engine.simulate_many([scene] * count, seeds=range(count)):
            assert run.sample.size
            sizes.append(resident())
    together = (time.monotonic() - began) / count
    growth = sizes[-1] - sizes[count // 10]
    ratio = apart / together
    print(
        f"{count} simulations: {1 / together:.1f} a second in one process, {1 / apart:.2f} in processes "
        f"({processes} of them), {ratio:.1f} times; memory {sizes[count // 10]:.0f} to {sizes[-1]:.0f} MiB"
    )
    return int(ratio < 3 or growth > 64)


if __name__ == "__main__":
    sys.exit(main())
