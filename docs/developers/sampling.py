"""Draws sampling.svg: a row of a beamlet, its lines, and the cells of their pieces.

A body with a leaning edge ends within the row. The light of a line is the part that the body leaves open;
intervals between lines are halved where the bend of that light is large.
"""

from pathlib import Path

WIDTH, HEIGHT, LIMIT = 720.0, 300.0, 2e-3
TOP = 0.37


def edge(z: float) -> float:
    """x of the silhouette at the height z, from 0 (upper border) to 1; beyond its end the body covers nothing."""
    return 1.0 if z < TOP else 0.3 + 0.35 * (z - 0.5) ** 2


def worst(lines: list[float]) -> tuple[float, int]:
    """Largest error of an interval, and its number."""
    slopes = [(edge(b) - edge(a)) / (b - a) for a, b in zip(lines, lines[1:])]
    errors = []
    for number, (a, b) in enumerate(zip(lines, lines[1:])):
        beside = [slopes[i] for i in (number - 1, number + 1) if 0 <= i < len(slopes)]
        bend = min(abs(slope - slopes[number]) for slope in beside)
        errors.append((0.29 * (b - a) ** 2 * bend, number))
    return max(errors)


lines = [0.0, TOP - 1e-4, TOP + 1e-4, 0.5, 1.0]
while worst(lines)[0] > LIMIT:
    number = worst(lines)[1]
    lines.insert(number + 1, (lines[number] + lines[number + 1]) / 2)

out = [
    f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-10 -10 {WIDTH + 20:.0f} {HEIGHT + 50:.0f}" '
    'font-family="sans-serif" font-size="16">',
    f'<rect x="-10" y="-10" width="{WIDTH + 20:.0f}" height="{HEIGHT + 50:.0f}" fill="white"/>',
]
borders = [0.0] + [(a + b) / 2 for a, b in zip(lines, lines[1:])] + [1.0]
for z, top, bottom in zip(lines, borders, borders[1:]):
    for x0, x1, shade in ((0.0, edge(z), 245), (edge(z), 1.0, 165)):
        if x1 > x0:
            out.append(
                f'<rect x="{x0 * WIDTH:.2f}" y="{top * HEIGHT:.2f}" width="{(x1 - x0) * WIDTH:.2f}" '
                f'height="{(bottom - top) * HEIGHT:.2f}" fill="rgb({shade},{shade},250)" stroke="#456" '
                'stroke-width="0.6"/>'
            )
    out.append(f'<path d="M0,{z * HEIGHT:.2f} H{WIDTH:.2f}" stroke="#222" stroke-dasharray="5 4"/>')
points = " ".join(f"{edge(z) * WIDTH:.2f},{z * HEIGHT:.2f}" for z in (TOP + (1 - TOP) * i / 40 for i in range(41)))
out += [
    f'<polyline points="{WIDTH:.2f},{TOP * HEIGHT:.2f} {points}" fill="none" stroke="#c22" stroke-width="2.5"/>',
    f'<text x="0" y="{HEIGHT + 28:.0f}">x: one beamlet, z: one detector row; dashed: {len(lines)} lines; '
    "rectangles: cells of their pieces; red: silhouette</text>",
    "</svg>",
]
Path(__file__).with_suffix(".svg").write_text("\n".join(out) + "\n")
