#!/usr/bin/env python3
"""Writes cylinder.stl: 8 mm across, 16 mm high, along z, in mm. Needs nothing but Python.

The polygon's corners lie outside the circle by as much as its sides lie inside, so that its
area is the circle's. Each lid is cut into triangles by taking away every second corner again
and again, which needs no vertex in the middle and makes fewer slivers than a fan.
"""

import math
import pathlib
import struct

RADIUS, HEIGHT, SIDES = 4.0, 16.0, 2048


def triangles():
    step = 2 * math.pi / SIDES
    corner = RADIUS * math.sqrt(step / math.sin(step))
    ring = [(corner * math.cos(k * step), corner * math.sin(k * step)) for k in range(SIDES)]
    low = [(x, y, -HEIGHT / 2) for x, y in ring]
    high = [(x, y, HEIGHT / 2) for x, y in ring]
    for a in range(SIDES):
        b = (a + 1) % SIDES
        yield low[a], low[b], high[b]
        yield low[a], high[b], high[a]
    lid = list(range(SIDES))
    while len(lid) >= 3:
        for k in range(1, len(lid), 2):
            a, b, c = lid[k - 1], lid[k], lid[(k + 1) % len(lid)]
            yield high[a], high[b], high[c]
            yield low[a], low[c], low[b]
        lid = lid[::2]


def main():
    records = [struct.pack("<12fH", 0, 0, 0, *a, *b, *c, 0) for a, b, c in triangles()]
    header = b"beamlet: cylinder, 8 mm x 16 mm, unit mm".ljust(80)
    data = header + struct.pack("<I", len(records)) + b"".join(records)
    (pathlib.Path(__file__).parent / "cylinder.stl").write_bytes(data)


if __name__ == "__main__":
    main()
