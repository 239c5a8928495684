"""Projections and geometry of this folder for the ASTRA toolbox.

    import load_astra
    data = load_astra.load("transmission")           # [row][view][column]
    projections = load_astra.link(-np.log(data))     # an id of ASTRA's data3d
    volume = load_astra.astra.data3d.create("-vol", load_astra.vol_geom)    # [z][y][x], all ascending

Lengths are in mm: what a reconstruction of -ln(transmission) gives is mu in 1/mm. filled_pixels of astra.json
are the pixels of transmission, refraction and dark_field that have no usable result and are filled, as in
`beamlet reconstruct`. Other arrays, and all of `convert --as-retrieved`, have NaN there.
"""

import json
import pathlib

import astra
import numpy as np

folder = pathlib.Path(__file__).resolve().parent
about = json.loads((folder / "astra.json").read_text())
rows, views, columns = about["shape"]
nx, ny, nz = about["volume_size"]
vol_geom = astra.create_vol_geom(ny, nx, nz, *about["volume_mm"])
proj_geom = astra.create_proj_geom("cone_vec", rows, columns, np.array(about["cone_vec_mm"]))


def load(name):
    """An array of this folder, [row][view][column]."""
    return np.load(folder / f"{name}.npy")


def link(data):
    """The id of projections in ASTRA."""
    data = np.ascontiguousarray(data, dtype=np.float32)
    return astra.data3d.create("-sino", proj_geom, data)
