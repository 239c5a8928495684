"""Makes the assembly of tests/physics/assemblies/cad.rs: a gasket and a tube between two flanges,
one bolt with its nut, each part exported as it stands. Needs cadquery (PyPI)."""

import sys
from pathlib import Path

import cadquery as cq

AXIS, ANGLE = cq.Vector(1, 2, 3), 37.3
ORIGIN = cq.Vector(0, 0, 0)


def flange(z):
    plate = cq.Workplane("XY").circle(2.0).extrude(0.8).faces(">Z").workplane()
    plate = plate.center(1.45, 0).hole(0.5).faces(">Z").workplane().center(-1.45, 0).hole(1.5)
    return plate.translate((0, 0, z))


def parts():
    """Name and shape, in the order of the scene: the later one wins."""
    lower, upper = flange(-0.8), flange(0.1)
    gasket = cq.Workplane("XY").circle(1.15).circle(0.75).extrude(0.1)
    tube = cq.Workplane("XY").circle(0.75).circle(0.55).extrude(2.6).translate((0, 0, -1.3))
    at = cq.Workplane("XY").center(1.45, 0)
    # The thread is one cylinder, 20 um wider than the bore of the nut.
    nut = at.polygon(6, 0.8).circle(0.23).extrude(0.3).translate((0, 0, -1.1))
    bolt = at.circle(0.25).extrude(2.0).translate((0, 0, -1.1))
    bolt = bolt.union(at.polygon(6, 0.8).extrude(0.3).translate((0, 0, 0.9)))
    named = {"lower": lower, "upper": upper, "gasket": gasket, "tube": tube, "nut": nut, "bolt": bolt}
    return {name: part.val() for name, part in named.items()}


def main():
    out = Path(sys.argv[1])
    for name, part in parts().items():
        # Turned: coordinates of faces that coincide are rounded apart in f32.
        turned = cq.Workplane(obj=part.rotate(ORIGIN, AXIS, ANGLE))
        cq.exporters.export(turned, str(out / f"{name}.stl"), tolerance=0.01, angularTolerance=0.3)


main()
