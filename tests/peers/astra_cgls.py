"""CGLS of ASTRA (line_fanflat) beside that of beamlet: the same sinogram, errors and processor time.

    astra_cgls.py FOLDER     FOLDER has what the test `files_for_astra` writes

Ends with 1 where the error of beamlet is larger after 5, 10 or 20 iterations. The processor time of its two
projections is printed beside that of an iteration of ASTRA.
"""

import csv
import sys
import time
from pathlib import Path

import astra
import numpy as np

SIDE = 256
folder = Path(sys.argv[1])
with open(folder / "beamlet.csv") as text:
    own = {row["figure"]: float(row["value"]) for row in csv.DictReader(text)}
voxel = own["voxel"]
read = lambda name, *shape: np.fromfile(folder / name, np.float32).reshape(shape)
sinogram, truth = read("sinogram.f32", 180, SIDE), read("truth.f32", SIDE, SIDE)
places = (np.arange(SIDE) - (SIDE - 1) / 2) * voxel
inside = np.hypot(*np.meshgrid(places, places)) < 8.5e-3


def solver(views):
    """An algorithm, and the numbers of its data."""
    edge = SIDE / 2 * voxel
    volume = astra.create_vol_geom(SIDE, SIDE, -edge, edge, -edge, edge)
    angles = np.arange(views) / views * 2 * np.pi
    scan = astra.create_proj_geom("fanflat", 150e-6, SIDE, angles, 1.213, 1.8 - 1.213)
    projector = astra.create_projector("line_fanflat", scan, volume)
    rays, image = astra.data2d.create("-sino", scan, 0), astra.data2d.create("-vol", volume, 0)
    config = astra.astra_dict("CGLS")
    config |= {"ProjectorId": projector, "ProjectionDataId": rays, "ReconstructionDataId": image}
    return config, projector, rays, image


def images(counts):
    config, _, rays, image = solver(180)
    for count in counts:
        astra.data2d.store(rays, sinogram)
        astra.data2d.store(image, 0)
        algorithm = astra.algorithm.create(config)
        astra.algorithm.run(algorithm, count)
        # ASTRA has the row of the largest y first.
        yield count, astra.data2d.get(image)[::-1]


failed = False
for count, image in images((5, 10, 20)):
    theirs = np.sqrt(np.mean((image - truth)[inside] ** 2))
    ours = own[f"rmse_{count}"]
    failed |= ours > theirs
    print(f"CGLS {count:2}: RMSE {ours:.4f}, ASTRA {theirs:.4f}")

config, projector, rays, image = solver(360)
_, made = astra.create_sino(truth[::-1], projector)
astra.data2d.store(rays, made)
algorithm = astra.algorithm.create(config)
astra.algorithm.run(algorithm, 1)
began = time.process_time()
astra.algorithm.run(algorithm, 10)
theirs = (time.process_time() - began) / 10
ours = own["forward"] + own["back"]
print(
    f"256 columns × 360 views: {own['forward']:.3f} + {own['back']:.3f} s of processor time, "
    f"an iteration of ASTRA {theirs:.3f} s: {ours / theirs:.2f}"
)
sys.exit(failed)
