"""Places and handedness of `beamlet convert --to astra`, by the astra-toolbox (2-D fan on the CPU).

    astra_export.py FOLDER     FOLDER has what `convert --to astra` writes of tests/peers/astra_export.toml

Three rods of different radii at places without symmetry are projected by ASTRA along the exported vectors and
compared with the exported transmission, and are found where they are in a reconstruction (CGLS). Ends with 1
where they are not, or where a mirrored phantom or vectors of the other handedness would pass as well.
"""

import json
import sys
from pathlib import Path

import astra
import numpy as np

# x, y, radius (mm), as in astra_export.toml.
RODS = [(1.6, 0.4, 0.5), (-0.9, 1.3, 0.3), (0.2, -1.1, 0.8)]
SIDE = 600

folder = Path(sys.argv[1])
about = json.loads((folder / "astra.json").read_text())
vectors = np.array(about["cone_vec_mm"])
transmission = np.load(folder / "transmission.npy")  # [row][view][column]
attenuation = -np.log(transmission[0].astype(float))
views, columns = attenuation.shape
x0, x1, y0, y1, _, _ = about["volume_mm"]
# Columns x and y of source, detector and column.
fan = vectors[:, [0, 1, 3, 4, 6, 7]]


def phantom(rods, side=SIDE):
    """Share of each pixel inside of a rod; row 0 at the largest y."""
    fine = 3
    across = x0 + (np.arange(side * fine) + 0.5) * (x1 - x0) / (side * fine)
    up = y1 - (np.arange(side * fine) + 0.5) * (y1 - y0) / (side * fine)
    inside = np.zeros((side * fine, side * fine))
    for x, y, radius in rods:
        inside[np.hypot(across[None, :] - x, up[:, None] - y) < radius] = 1
    return inside.reshape(side, fine, side, fine).mean((1, 3))


def projected(rods, fan):
    """Lengths in the rods, mm: means over a third of a column each, as the rays of a pixel."""
    volume = astra.create_vol_geom(SIDE, SIDE, x0, x1, y0, y1)
    total = 0
    for part in (-1 / 3, 0, 1 / 3):
        moved = fan.copy()
        moved[:, 2:4] += part * APERTURE * moved[:, 4:6]
        scan = astra.create_proj_geom("fanflat_vec", columns, moved)
        projector = astra.create_projector("line_fanflat", scan, volume)
        number, sinogram = astra.create_sino(phantom(rods), projector)
        astra.data2d.delete(number)
        astra.projector.delete(projector)
        total = total + sinogram / 3
    return total


# Part of a column that light passes.
APERTURE = 30 / 150


def difference(lengths):
    """Root mean square of the difference, as a share of the largest value, and the attenuation found, 1/mm.

    Pixels within a column of an edge of a rod are left out: the mask steps move the light of a pixel by up to
    25 um over the edge.
    """
    bend = np.abs(np.diff(lengths, 2, axis=1, prepend=0, append=0))
    smooth = (bend < 0.06) & (np.roll(bend, 1, 1) < 0.3) & (np.roll(bend, -1, 1) < 0.3)
    measured, lengths = attenuation[smooth], lengths[smooth]
    mu = (lengths * measured).sum() / (lengths * lengths).sum()
    return np.sqrt(np.mean((measured - mu * lengths) ** 2)) / measured.max(), mu


failed = False
right, mu = difference(projected(RODS, fan))
print(f"sinogram: {100 * right:.2f} % of the largest value, mu {mu:.5f} /mm")
# Chords bend over the 80 um of a pixel that its light reaches at the mask steps.
failed |= right > 0.04
other = fan.copy()
other[:, 4:6] *= -1
turned = fan * [1, -1, 1, -1, 1, -1]
for name, rods, geometry in [
    ("x mirrored", [(-x, y, r) for x, y, r in RODS], fan),
    ("y mirrored", [(x, -y, r) for x, y, r in RODS], fan),
    ("columns reversed", RODS, other),
    ("turned the other way", RODS, turned),
]:
    wrong, _ = difference(projected(rods, geometry))
    print(f"{name}: {100 * wrong:.1f} %")
    failed |= wrong < 5 * right

side = 128
volume = astra.create_vol_geom(side, side, x0, x1, y0, y1)
scan = astra.create_proj_geom("fanflat_vec", columns, fan)
config = astra.astra_dict("CGLS")
config["ProjectorId"] = astra.create_projector("line_fanflat", scan, volume)
config["ProjectionDataId"] = astra.data2d.create("-sino", scan, attenuation)
config["ReconstructionDataId"] = astra.data2d.create("-vol", volume, 0)
astra.algorithm.run(astra.algorithm.create(config), 15)
image = astra.data2d.get(config["ReconstructionDataId"])
places = x0 + (np.arange(side) + 0.5) * (x1 - x0) / side
xs, ys = np.meshgrid(places, -places)
for x, y, radius in RODS:
    near = np.hypot(xs - x, ys - y) < radius + 0.25
    weight = np.clip(image, 0, None) * near
    found = [(weight * at).sum() / weight.sum() for at in (xs, ys)]
    off = np.hypot(found[0] - x, found[1] - y)
    print(f"rod at {x}, {y} mm: found at {found[0]:.3f}, {found[1]:.3f} mm")
    # Half a column at the axis.
    failed |= off > 0.05
sys.exit(int(failed))
