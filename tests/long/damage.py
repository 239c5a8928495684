"""Runs whose files are damaged at random, through the real program: every command ends with an
answer or a reason.

    python tests/long/damage.py target/release/beamlet [ROUNDS [SEED]]

Each round changes some bytes of one file of a run (progress.log, run.json, retrieved.json,
scene.toml, frames) and asks every command that reads runs for its answer. Ends with 1 where one crashed, hung or gave no reason.
"""

import collections
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile

SCENE = pathlib.Path(__file__).parent.parent / "fuzz" / "scene.toml"
SECONDS = 120
COMMANDS = [
    ["check", "run"],
    ["compare", "run", "whole"],
    ["retrieve", "run", "-o", "images", "--overwrite", "-q"],
    ["view", "run", "-o", "pictures", "--overwrite"],
    ["report", "run", "-o", "report.html", "--overwrite"],
    ["simulate", "scene.toml", "-o", "run", "--resume", "-q"],
]
NUMBERS = [0, 1, 2, 0x7F, 0x80, 0xFF]


def call(program, place, words):
    """What is wrong with the end of a command, if anything is; and its exit code."""
    try:
        done = subprocess.run([program, *words], cwd=place, capture_output=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return f"no answer within {SECONDS} s", None
    message = done.stderr.decode(errors="replace")
    if done.returncode not in (0, 1, 2) or "panicked" in message:
        return f"exit code {done.returncode}: {message[:400]}", done.returncode
    differs = words[0] == "compare" and done.returncode == 1
    if done.returncode and not differs and "error: " not in message:
        return f"no reason: {message[:400]}", done.returncode
    return None, done.returncode


def damage(path, draw):
    """Changes a file; says how."""
    data = bytearray(path.read_bytes())
    end = len(data)
    for _ in range(draw.choice([1, 1, 2, 5])):
        # Heads hold what is counted: half of the changes go there.
        at = draw.randrange(min(end, 400) if draw.random() < 0.5 else end)
        kind = draw.randrange(4)
        if kind == 0:
            data[at] = draw.choice(NUMBERS)
        elif kind == 1:
            data[at] ^= 1 << draw.randrange(8)
        elif kind == 2:
            del data[at : at + draw.randrange(1, 9)]
        else:
            word = draw.choice([0, 1, 0xFFFFFFFF, 0x7FFFFFFF, 0x7F800000, 0x7FC00000, 0x42C80000])
            data[at & ~3 : (at & ~3) + 4] = word.to_bytes(4, "little")
        end = min(end, len(data))
    path.write_bytes(data)


def main(program, rounds="100", seed="1"):
    program, draw = str(pathlib.Path(program).resolve()), random.Random(seed)
    faults, codes = 0, collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder)
        text = SCENE.read_text()
        (place / "scene.toml").write_text(text.replace("count = 3", "count = 5"))
        for words in (["simulate", "scene.toml", "-o", "whole", "-q"], ["retrieve", "whole", "-q"]):
            wrong, code = call(program, place, words)
            if wrong or code:
                sys.exit(f"{words}: {wrong or code}")
        files = sorted(p.relative_to(place / "whole") for p in (place / "whole").rglob("*") if p.is_file())
        kinds = collections.defaultdict(list)
        for path in files:
            kinds["frame" if path.suffix == ".exr" else path.name].append(path)
        for number in range(int(rounds)):
            shutil.rmtree(place / "run", ignore_errors=True)
            shutil.copytree(place / "whole", place / "run")
            path = place / "run" / draw.choice(kinds[draw.choice(sorted(kinds))])
            damage(path, draw)
            for words in COMMANDS:
                wrong, code = call(program, place, words)
                codes[words[0], code] += 1
                if wrong:
                    faults += 1
                    print(f"FAULT round {number}, {path.relative_to(place)}: {' '.join(words)}: {wrong}", flush=True)
    for (command, code), count in sorted(codes.items(), key=str):
        print(f"{count:5} {command}: exit code {code}")
    print(f"{rounds} damaged runs, {sum(codes.values())} commands: {faults} without an answer")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
