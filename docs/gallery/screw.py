"""Makes screw.stl: a screw of 4.8 mm as a closed mesh, its surface given over angle and height."""

import math

AROUND, ALONG = 96, 200
HEIGHTS = [-2.6 + 3.8 * i / (ALONG - 1) for i in range(ALONG)] + [1.2, 2.0, 2.2]


def radius(i, j):
    """mm from the axis: a shaft of 1.5 mm with a thread, then a hexagonal head with a chamfer."""
    turn = j / AROUND
    if i < ALONG:
        thread = (HEIGHTS[i] / 0.5 - turn) % 1.0
        return min(0.75 + 0.44 * (1.0 - abs(2.0 * thread - 1.0)), 1.05, 0.55 + 1.2 * (HEIGHTS[i] + 2.6))
    side = (2.0 * math.pi * turn + math.pi / 6) % (math.pi / 3) - math.pi / 6
    chamfer = 0.93 if i == len(HEIGHTS) - 1 else 1.0
    return 1.7 * math.cos(math.pi / 6) / math.cos(side) * chamfer


def point(i, j):
    angle, r = 2.0 * math.pi * (j % AROUND) / AROUND, radius(i, j % AROUND)
    return r * math.cos(angle), r * math.sin(angle), HEIGHTS[i]


def facets():
    last = len(HEIGHTS) - 1
    for j in range(AROUND):
        for i in range(last):
            a, b, c, d = point(i, j), point(i, j + 1), point(i + 1, j + 1), point(i + 1, j)
            yield a, b, c
            yield a, c, d
        yield (0.0, 0.0, HEIGHTS[0]), point(0, j + 1), point(0, j)
        yield (0.0, 0.0, HEIGHTS[last]), point(last, j), point(last, j + 1)


with open("screw.stl", "w") as out:
    out.write("solid screw\n")
    for facet in facets():
        corners = "".join("vertex %.6f %.6f %.6f\n" % corner for corner in facet)
        out.write(f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    out.write("endsolid screw\n")
