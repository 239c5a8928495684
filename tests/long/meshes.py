"""Other people's meshes through the real program: accepted or refused with a reason, and accepted
ones balanced.

    python tests/long/meshes.py target/release/beamlet FOLDER [SEED [PART]]

Every STL and OBJ file below FOLDER is scaled to a diagonal of 0.8 mm, turned at random about all
three axes, and simulated at two angles on both backends. A mesh that is refused is simulated once
more with `allow_defects = true`. PART keeps the files whose path contains it. Prints a line per
mesh and the counts; ends with 1 where a mesh is a fault of beamlet: the program ended in a way
that is no answer, rays were out of balance or not finite, or the backends differ.
"""

import array
import collections
import json
import pathlib
import random
import re
import subprocess
import sys
import tempfile

SCENE = """[source]
distance = "1.21 m"
spot = ["30 um", "26 um"]
energy = "30 keV"
[sample_mask]
distance = "1.2 m"
material = "gold"
thickness = "225 um"
projected_aperture = "30 um"
[detector_mask]
material = "gold"
thickness = "225 um"
projected_aperture = "30 um"
[detector]
distance = "1.8 m"
pixels = [12, 8]
pitch = "150 um"
[sampling]
tolerance = 2e-3
[scan]
mask_offsets = ["-15 um", "5 um"]
angles = ["0 deg", "77 deg"]
[[object]]
name = "part"
material = "water"
unit = "mm"
"""
# Nothing in a tally but these may be other than zero.
COUNTS = {"rays", "exact", "retraced", "reflected", "saturated", "patches", "lines", "patch_rays",
          "most_patch_rays", "error_squares", "worst_error"}
# Open beam. Sums of a ray run in the order of its candidates, which differs between backends.
SAME_LIGHT = 1e-6
SECONDS = 600


class Fault(Exception):
    """What beamlet must not do."""


class Refusal(Exception):
    """Why beamlet does not take a mesh."""


def beamlet(program, place, *words):
    command = [program, *words]
    try:
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=SECONDS)
    except subprocess.TimeoutExpired as error:
        raise Fault(f"{words[0]}: no answer within {SECONDS} s") from error
    message = done.stderr.strip()
    if done.returncode not in (0, 1) or "panicked" in message:
        raise Fault(f"{words[0]}: exit code {done.returncode}: {message[:300]}")
    if done.returncode == 1 and not message.startswith("error: "):
        raise Fault(f"{words[0]}: no reason: {message[:300]}")
    return done.returncode, done.stdout, message


def reason(message):
    """The kind of a refusal: its first line without names and numbers."""
    line = message.splitlines()[0].removeprefix("error: ")
    line = re.sub(r'^(object\[\d+\]: )?(?:"part" \()?.*?\.(?:stl|obj)\)?:? ?', "", line, flags=re.I)
    return re.sub(r"[-+]?\d[\d.e+-]*", "N", line).split(";")[0].strip()


def bounds(program, place):
    """The box of the object, metres."""
    code, out, message = beamlet(program, place, "check", "scene.toml", "--json")
    if code:
        raise Refusal(message)
    return json.loads(out)["objects"][0]["bounds"]


def simulate(program, place, backend):
    """Frames and tally."""
    words = ["simulate", "scene.toml", "-o", backend, "-q", "--format", "npy", "--backend", backend]
    code, _, message = beamlet(program, place, *words)
    if code:
        raise Refusal(message)
    tally = json.loads((place / backend / "run.json").read_text())["tally"]
    values = (place / backend / "sample.npy").read_bytes()
    header = 10 + int.from_bytes(values[8:10], "little")
    return array.array("f", values[header:]), tally


def try_mesh(program, mesh, draw):
    """What came of a mesh: the word for it, and more of it."""
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder)

        def write(*keys):
            text = SCENE + f"mesh = {json.dumps(str(mesh))}\n" + "\n".join(keys)
            (place / "scene.toml").write_text(text)

        turns = []
        for _ in range(3):
            axis = [draw.gauss(0, 1) for _ in range(3)]
            turns.append(f'{{ axis = {axis}, angle = "{draw.uniform(-180, 180)} deg" }}')
        turned = f"rotate = [{', '.join(turns)}]"

        def placed(*more):
            """Scales and centres the mesh by what `check` tells of it."""
            write("scale = 1e-4", *more)
            low, high = bounds(program, place)
            diagonal = sum((b - a) ** 2 for a, b in zip(low, high)) ** 0.5
            scale = 1e-4 * 0.8e-3 / diagonal
            write(f"scale = {scale!r}", turned, *more)
            low, high = bounds(program, place)
            centre = [f'"{-0.5e3 * (a + b)!r} mm"' for a, b in zip(low, high)]
            write(f"scale = {scale!r}", turned, f"position = [{', '.join(centre)}]", *more)

        try:
            placed()
            runs = {backend: simulate(program, place, backend) for backend in ("bvh", "ray-query")}
        except Refusal as refusal:
            why = reason(str(refusal))
            try:
                placed("allow_defects = true")
                simulate(program, place, "bvh")
            except Refusal as again:
                return "refused", f"{why}; with allow_defects: {reason(str(again))}"
            return "refused", why
        for backend, (_, tally) in runs.items():
            wrong = {key: n for key, n in tally.items() if n and key not in COUNTS}
            if wrong:
                raise Fault(f"{backend}: {wrong}")
        difference = max(abs(a - b) for a, b in zip(*(values for values, _ in runs.values())))
        # Also true of what is not a number.
        if not difference <= SAME_LIGHT:
            raise Fault(f"the backends differ by {difference} of open beam")
        return "accepted", f"{runs['bvh'][1]['rays']} rays"


def main(program, folder, seed="1", part=""):
    program, folder = str(pathlib.Path(program).resolve()), pathlib.Path(folder).resolve()
    found = (p for p in folder.rglob("*") if p.suffix.lower() in (".stl", ".obj"))
    meshes = sorted(p for p in found if p.is_file() and "venv" not in p.parts and part in str(p))
    counts, reasons = collections.Counter(), collections.Counter()
    for mesh in meshes:
        name = mesh.relative_to(folder)
        try:
            word, more = try_mesh(program, mesh, random.Random(f"{seed} {name}"))
        except Fault as fault:
            word, more = "FAULT", str(fault)
        counts[word] += 1
        if word == "refused":
            reasons[more] += 1
        print(f"{word:9} {name}: {more}", flush=True)
    for why, count in reasons.most_common():
        print(f"{count:5} refused: {why}")
    print(f"{len(meshes)} meshes:", ", ".join(f"{n} {word}" for word, n in sorted(counts.items())))
    return 1 if counts["FAULT"] or not meshes else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
