#!/usr/bin/env python3
"""Writes bracket.stl and core.stl, in mm: a part as a CAD program would export it.

A moulded angle bracket with fillets, a rib, countersunk holes and a boss, and inside its base
a core that touches no surface of it. Needs `pip install manifold3d numpy`.
"""

import pathlib
import struct

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold

FACETS = 64
LENGTH, WIDTH, HEIGHT, WALL = 9.0, 6.0, 9.0, 2.4


def rounded(section, radius):
    """Rounds the corners of a section that point outwards."""
    return section.offset(-radius, JoinType.Round, 2, FACETS).offset(
        radius, JoinType.Round, 2, FACETS
    )


def filleted(section, radius):
    """Rounds the corners of a section that point inwards."""
    return section.offset(radius, JoinType.Round, 2, FACETS).offset(
        -radius, JoinType.Round, 2, FACETS
    )


def bore(radius, length):
    """A hole along z through the origin with a countersink at its upper end at z = 0."""
    hole = Manifold.cylinder(length, radius, radius, FACETS).translate((0, 0, -length + 1))
    sink = Manifold.cylinder(0.7, radius, radius + 0.7, FACETS).translate((0, 0, -0.6))
    return hole + sink


def bracket():
    # The L of base and upright, seen from the side: x to the right, z up.
    side = CrossSection.square((LENGTH, WALL)) + CrossSection.square((WALL, HEIGHT))
    side = rounded(filleted(side, 1.2), 0.5)
    body = side.extrude(WIDTH).rotate((90, 0, 0)).translate((0, WIDTH, 0))
    # Seen from above, the corners are round too.
    plan = rounded(CrossSection.square((LENGTH, WIDTH)), 1.0)
    body = body ^ plan.extrude(HEIGHT)
    # A rib in the inner corner.
    rib = CrossSection([[(1.5, 1.5), (5.4, 1.5), (1.5, 6.6)]]).extrude(0.9)
    body = body + rib.rotate((90, 0, 0)).translate((0, WIDTH / 2 + 0.45, 0))
    # A boss on the upright, with a bore through both.
    across = Manifold.cylinder(WALL + 0.8, 1.7, 1.7, FACETS).rotate((0, 90, 0))
    body = body + across.translate((0, WIDTH / 2, 7.2))
    through = Manifold.cylinder(9, 0.8, 0.8, FACETS).rotate((0, 90, 0))
    body = body - through.translate((-2, WIDTH / 2, 7.2))
    # Two countersunk holes in the base and a slot.
    for y in (1.45, WIDTH - 1.45):
        body = body - bore(0.55, 5).translate((7.3, y, WALL))
    slot = Manifold.batch_hull(
        [
            Manifold.cylinder(5, 0.35, 0.35, FACETS).translate((4.4, y, -1))
            for y in (0.9, 1.8)
        ]
    )
    body = body - slot - slot.mirror((0, 1, 0)).translate((0, WIDTH, 0))
    # A chamfer under the front edge of the base.
    wedge = CrossSection([[(LENGTH - 0.6, 0), (LENGTH + 1, 0), (LENGTH + 1, 1.6)]])
    wedge = wedge.translate((0, -0.01)).extrude(WIDTH + 2)
    return body - wedge.rotate((90, 0, 0)).translate((0, WIDTH + 1, 0))


def core():
    """A rod with round ends in the upright and base, at least 0.3 mm from any surface."""
    ball = Manifold.sphere(0.55, 40)
    foot = Manifold.batch_hull(
        [ball.translate((1.2, 1.3, 1.1)), ball.translate((1.2, WIDTH - 1.3, 1.1))]
    )
    leg = Manifold.batch_hull(
        [ball.translate((1.2, WIDTH / 2, 1.1)), ball.translate((1.2, WIDTH / 2, 5.2))]
    )
    return foot + leg


def write(name, body):
    # The middle of the bracket's box is the origin of both meshes.
    body = body.translate((-LENGTH / 2, -WIDTH / 2, -HEIGHT / 2))
    mesh = body.to_mesh()
    corners = np.asarray(mesh.vert_properties, dtype="<f4")[:, :3][np.asarray(mesh.tri_verts)]
    records = b"".join(
        struct.pack("<3f", 0, 0, 0) + triangle.tobytes() + b"\0\0" for triangle in corners
    )
    header = f"beamlet: {name}, unit mm".encode().ljust(80)
    path = pathlib.Path(__file__).parent / f"{name}.stl"
    path.write_bytes(header + struct.pack("<I", len(corners)) + records)
    print(f"{path.name}: {len(corners)} triangles, {body.volume():.4f} mm3, genus {body.genus()}")


if __name__ == "__main__":
    outer, inner = bracket(), core()
    assert (inner - outer).is_empty(), "the core sticks out"
    write("bracket", outer)
    write("core", inner)
