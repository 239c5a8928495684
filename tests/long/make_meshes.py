"""Solids of trimesh and cadquery as STL and OBJ files, with random sizes of a fixed seed.

    python make_meshes.py FOLDER
"""

import random
import sys
from pathlib import Path

import cadquery as cq
import numpy as np
import trimesh
from shapely.geometry import Point, Polygon

draw = random.Random(20261121)


def size(low=1.0, high=20.0):
    return draw.uniform(low, high)


def star(points, outer, inner):
    angles = np.arange(2 * points) * np.pi / points
    radii = np.where(np.arange(2 * points) % 2 == 0, outer, inner)
    return Polygon(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]))


def of_trimesh():
    make = trimesh.creation
    for n in range(4):
        yield f"box_{n}", make.box([size(), size(), size()])
        yield f"icosphere_{n}", make.icosphere(subdivisions=n, radius=size())
        yield f"uv_sphere_{n}", make.uv_sphere(radius=size(), count=[8 + 7 * n, 9 + 5 * n])
        yield f"capsule_{n}", make.capsule(height=size(), radius=size(1, 5), count=[6 + 4 * n, 6 + 4 * n])
        yield f"cylinder_{n}", make.cylinder(radius=size(), height=size(), sections=3 + 9 * n)
        yield f"cone_{n}", make.cone(radius=size(), height=size(), sections=3 + 8 * n)
        inner = size(1, 5)
        yield f"annulus_{n}", make.annulus(inner, inner + size(0.1, 5), height=size(0.1))
        yield f"torus_{n}", make.torus(size(6, 9), size(1, 4), major_sections=8 + 9 * n, minor_sections=5 + 5 * n)
        yield f"extruded_star_{n}", make.extrude_polygon(star(3 + 4 * n, 8, size(1, 7)), size(0.1, 9))
        holed = Point(0, 0).buffer(9).difference(Point(1, 1).buffer(size(1, 5)))
        yield f"holed_disc_{n}", make.extrude_polygon(holed, size(0.05, 3))
        path = np.cumsum(np.random.default_rng(n).normal(size=(5, 3)), axis=0) * 9
        yield f"swept_{n}", make.sweep_polygon(Point(0, 0).buffer(0.5), path)
        points = np.random.default_rng(100 + n).normal(size=(12 + 40 * n, 3))
        yield f"hull_{n}", trimesh.convex.convex_hull(points)
        yield f"soup_{n}", make.random_soup(20)
        a, b = make.box([9, 9, 9]), make.cylinder(radius=size(1, 4), height=20, sections=32)
        yield f"difference_{n}", trimesh.boolean.difference([a, b])
        yield f"union_{n}", trimesh.boolean.union([a, b])
        yield f"intersection_{n}", trimesh.boolean.intersection([a, make.icosphere(2, radius=size(3, 6))])
        yield f"overlapping_{n}", trimesh.util.concatenate([a, b])
        shell = [make.icosphere(2, radius=9), make.icosphere(1, radius=size(1, 8))]
        shell[1].invert()
        yield f"hollow_{n}", trimesh.util.concatenate(shell)
        many = [make.box([1, 1, 1]).apply_translation([1.5 * i, 1.7 * j, 0]) for i in range(5) for j in range(5)]
        yield f"many_{n}", trimesh.util.concatenate(many[: 5 * (n + 1)])
        noisy = make.icosphere(2, radius=9)
        noisy.vertices += np.random.default_rng(n).normal(scale=0.3, size=noisy.vertices.shape)
        yield f"noisy_sphere_{n}", noisy
    yield "axis", make.axis()
    yield "sheet", trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def of_cadquery():
    for n in range(5):
        box = cq.Workplane().box(size(5), size(5), size(5))
        yield f"filleted_{n}", box.edges().fillet(size(0.1, 2))
        yield f"chamfered_{n}", box.edges("|Z").chamfer(size(0.1, 2))
        yield f"drilled_{n}", box.faces(">Z").workplane().hole(size(0.2, 4))
        yield f"shelled_{n}", box.faces(">Z").shell(-size(0.1, 1))
        yield f"countersunk_{n}", box.faces(">Z").workplane().cskHole(1, 3, 82)
        yield f"lofted_{n}", cq.Workplane().rect(size(), size()).workplane(offset=size()).circle(size(1, 9)).loft()
        yield f"revolved_{n}", cq.Workplane().moveTo(size(5, 9), 0).circle(size(1, 4)).revolve(size(30, 360), (0, 0, 0), (0, 1, 0))
        path = cq.Workplane("XZ").spline([(0, 0), (size(), size()), (size(20, 30), size())])
        yield f"swept_{n}", cq.Workplane().circle(size(0.2, 2)).sweep(path)
        yield f"twisted_{n}", cq.Workplane().polygon(5, size()).twistExtrude(size(), size(10, 300))
        yield f"text_{n}", cq.Workplane().text("edge"[: n + 1], 10, size(0.3, 3))
        yield f"sphere_{n}", cq.Workplane().sphere(size())
        yield f"wedge_{n}", cq.Workplane().wedge(9, 9, 9, 2, size(1, 2), size(3, 8), 7)
        yield f"tapered_{n}", cq.Workplane().polygon(3 + n, 20).extrude(size(1, 5), taper=size(1, 20))
        plate = cq.Workplane().box(30, 30, 2).faces(">Z").workplane().rarray(5, 5, n + 1, n + 1).hole(size(0.2, 4))
        yield f"plate_{n}", plate
        helix = cq.Wire.makeHelix(2, 6, 5)
        yield f"spring_{n}", cq.Workplane("XZ").center(5, 0).circle(size(0.2, 0.8)).sweep(cq.Workplane(obj=helix), isFrenet=True)


def main(folder):
    made = 0
    for name, mesh in of_trimesh():
        for kind in ("stl", "obj"):
            mesh.export(folder / f"trimesh_{name}.{kind}")
            made += 1
    for name, solid in of_cadquery():
        cq.exporters.export(solid, str(folder / f"cadquery_{name}.stl"), tolerance=draw.choice([0.01, 0.1, 0.5]))
        made += 1
    print(made, "meshes", file=sys.stderr)


main(Path(sys.argv[1]))
