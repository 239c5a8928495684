"""Draws sampling.svg: a patch cut along a silhouette by splits in three.

Each rectangle errs by the share of its area on the smaller side of the silhouette; the worst is split
along its longer side until the sum of squares is below a tolerance.
"""

from pathlib import Path

WIDTH, HEIGHT, POINTS = 720.0, 300.0, 60


def edge(z: float) -> float:
    """x of the silhouette at the height z, both from 0 to 1."""
    return 0.35 + 0.3 * z - 0.25 * z * z


def covered(x0: float, x1: float, z0: float, z1: float) -> float:
    """Share of a rectangle that the body covers."""
    total = 0.0
    for i in range(POINTS):
        z = z0 + (z1 - z0) * (i + 0.5) / POINTS
        total += min(max((x1 - edge(z)) / (x1 - x0), 0.0), 1.0)
    return total / POINTS


def error(region: tuple[float, float, float, float]) -> float:
    x0, x1, z0, z1 = region
    share = covered(*region)
    return min(share, 1 - share) * (x1 - x0) * (z1 - z0)


regions = [(i / 6, (i + 1) / 6, 0.0, 1.0) for i in range(6)]
while sum(error(region) ** 2 for region in regions) > 2e-7:
    worst = max(regions, key=error)
    regions.remove(worst)
    x0, x1, z0, z1 = worst
    if (x1 - x0) * WIDTH > (z1 - z0) * HEIGHT:
        cuts = [x0 + (x1 - x0) * i / 3 for i in range(4)]
        regions += [(cuts[i], cuts[i + 1], z0, z1) for i in range(3)]
    else:
        cuts = [z0 + (z1 - z0) * i / 3 for i in range(4)]
        regions += [(x0, x1, cuts[i], cuts[i + 1]) for i in range(3)]

lines = [
    f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-10 -10 {WIDTH + 20:.0f} {HEIGHT + 50:.0f}" '
    'font-family="sans-serif" font-size="16">',
    f'<rect x="-10" y="-10" width="{WIDTH + 20:.0f}" height="{HEIGHT + 50:.0f}" fill="white"/>',
]
for x0, x1, z0, z1 in sorted(regions):
    shade = round(245 - 110 * covered(x0, x1, z0, z1))
    lines.append(
        f'<rect x="{x0 * WIDTH:.2f}" y="{(1 - z1) * HEIGHT:.2f}" width="{(x1 - x0) * WIDTH:.2f}" '
        f'height="{(z1 - z0) * HEIGHT:.2f}" fill="rgb({shade},{shade},250)" stroke="#456" stroke-width="0.6"/>'
    )
points = " ".join(f"{edge(z / 40) * WIDTH:.2f},{(1 - z / 40) * HEIGHT:.2f}" for z in range(41))
lines += [
    f'<polyline points="{points}" fill="none" stroke="#c22" stroke-width="2.5"/>',
    f'<text x="0" y="{HEIGHT + 28:.0f}">{len(regions)} rectangles; x: one beamlet, z: one detector row; red: silhouette</text>',
    "</svg>",
]
Path(__file__).with_suffix(".svg").write_text("\n".join(lines) + "\n")
