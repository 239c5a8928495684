"""Draws sampling.svg: a row of a beamlet that a tilted fin crosses, its first lines and their cells.

The light of a line is the part that the fin leaves open. Lines lie at the borders of the row, where an outline crosses
a border of the opening and the surface within ends there, at the corners of the fin, and between two of these.
"""

from pathlib import Path

WIDTH, HEIGHT = 720.0, 340.0
# Lower and upper outline of the fin, from (x, z) to (x, z); its tip lies in the opening.
OUTLINES = (((0.0, 0.30), (0.72, 0.52)), ((0.0, 0.22), (0.72, 0.44)))
CORNERS = [0.44, 0.52]
# An outline of a surface below it begins within where it falls inwards, one of a surface above it ends where it rises.
CROSSINGS = [0.22, 0.30]


def covered(z: float) -> list[float]:
    """Interval of x that the fin covers at a height z; nothing above and below it."""
    (x0, low0), (x1, low1) = OUTLINES[1]
    tilt = (low1 - low0) / (x1 - x0)
    thickness = OUTLINES[0][0][1] - low0
    first, last = max(0.0, (z - low0 - thickness) / tilt), min(x1, (z - low0) / tilt)
    return [first, last] if last > first else []


known = [0.0, *CROSSINGS, *CORNERS, 1.0]
lines = sorted(known + [(a + b) / 2 for a, b in zip(known, known[1:])])
out = [
    f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-10 -10 {WIDTH + 20:.0f} {HEIGHT + 50:.0f}" '
    'font-family="sans-serif" font-size="16">',
    f'<rect x="-10" y="-10" width="{WIDTH + 20:.0f}" height="{HEIGHT + 50:.0f}" fill="white"/>',
]
borders = [0.0] + [(a + b) / 2 for a, b in zip(lines, lines[1:])] + [1.0]
for z, top, bottom in zip(lines, borders, borders[1:]):
    ends = [0.0, *covered(z), 1.0]
    for number, (x0, x1) in enumerate(zip(ends, ends[1:])):
        if x1 > x0:
            shade = 165 if number == 1 and len(ends) == 4 else 245
            out.append(
                f'<rect x="{x0 * WIDTH:.2f}" y="{top * HEIGHT:.2f}" width="{(x1 - x0) * WIDTH:.2f}" '
                f'height="{(bottom - top) * HEIGHT:.2f}" fill="rgb({shade},{shade},250)" stroke="#456" '
                'stroke-width="0.6"/>'
            )
    dashes = "" if z in known else ' stroke-dasharray="5 4"'
    out.append(f'<path d="M0,{z * HEIGHT:.2f} H{WIDTH:.2f}" stroke="#222"{dashes}/>')
corners = [OUTLINES[0][0], OUTLINES[0][1], OUTLINES[1][1], OUTLINES[1][0]]
points = " ".join(f"{x * WIDTH:.2f},{z * HEIGHT:.2f}" for x, z in corners)
out += [
    f'<polygon points="{points}" fill="none" stroke="#c22" stroke-width="2.5"/>',
    *(f'<circle cx="{x * WIDTH:.2f}" cy="{z * HEIGHT:.2f}" r="5" fill="#c22"/>' for x, z in corners),
    f'<text x="0" y="{HEIGHT + 28:.0f}">x: one opening, z: one row; red: a fin; dashed: lines between '
    "known heights</text>",
    "</svg>",
]
Path(__file__).with_suffix(".svg").write_text("\n".join(out) + "\n")
