"""Lists the licences of the crates in the wheel.

    python engine/python/licences.py [--check]     writes python/beamlet/LICENCES.txt, or compares it
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
FILE = HERE / "python/beamlet/LICENCES.txt"


def listed() -> str:
    """A line for each crate that is linked."""
    words = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform",
             "x86_64-unknown-linux-gnu", "--manifest-path", str(HERE / "Cargo.toml")]
    found = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    packages = {package["id"]: package for package in found["packages"]}
    nodes = {node["id"]: node for node in found["resolve"]["nodes"]}
    ends = [key for key, package in packages.items() if package["name"] == "beamlet-python"]
    linked: set[str] = set()
    while ends:
        key = ends.pop()
        # Crates that build others are not inside.
        is_macro = any("proc-macro" in target["kind"] for target in packages[key]["targets"])
        if key in linked or is_macro:
            continue
        linked.add(key)
        for other in nodes[key]["deps"]:
            if any(kind["kind"] is None for kind in other["dep_kinds"]):
                ends.append(other["pkg"])
    rows = sorted(
        (package["name"], package["version"], package["license"] or "see its repository",
         package["repository"] or "")
        for key, package in packages.items()
        if key in linked and not package["name"].startswith("beamlet")
    )
    head = "Crates in the wheel of beamlet (MIT OR Apache-2.0), and their licences.\n" \
           "Data and typefaces: DejaVu Sans (its own free licence), uPlot (MIT).\n\n"
    return head + "".join(f"{name} {version}: {terms} {place}".rstrip() + "\n" for name, version, terms, place in rows)


def main() -> int:
    text = listed()
    if sys.argv[1:] == ["--check"]:
        if FILE.read_text(encoding="utf-8") != text:
            print(f"{FILE} is out of date: run {Path(__file__).name}", file=sys.stderr)
            return 1
        return 0
    FILE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
