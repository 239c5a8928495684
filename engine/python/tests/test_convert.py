"""Files of other tools, read by nxtomo and h5py."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import beamlet as bl
from beamlet import convert


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> bl.Run:
    """A scan of 5 views, and its images in the run directory."""
    from conftest import SCENE

    scene = bl.Scene.from_dict(SCENE | {"title": "a rod"})
    turned = scene.replace("scan.angles", {"from": "0 deg", "to": "360 deg", "count": 5})
    # Openings off the middle of the pixels.
    turned = turned.replace("detector_mask.offset", "20 um")
    path = tmp_path_factory.mktemp("scan") / "run"
    with bl.Engine() as engine:
        run = engine.simulate_to(turned, path)
    subprocess.run([sys.executable, "-m", "beamlet", "retrieve", str(path), "-q"], check=True)
    return run


def images(run: bl.Run) -> bl.Images:
    return bl.Images.open(run.path or "")


def test_images_of_folders_are_those_in_memory(run: bl.Run) -> None:
    opened, made = images(run), bl.Run.open(run.path or "").retrieve()
    assert set(opened) == set(made) and opened.units == made.units
    assert opened.title == "a rod" and opened.energy == 30.0
    for name in made:
        assert np.array_equal(opened[name], made[name], equal_nan=True), name
    assert opened.geometry == made.geometry == run.scene.geometry


def test_nxtomo_reads_nxtomo(run: bl.Run, tmp_path: Path) -> None:
    from nxtomo.application.nxtomo import NXtomo

    path = tmp_path / "scan.nx"
    convert.to_nxtomo(images(run), path)
    read = NXtomo().load(str(path), "entry0000")
    detector = read.instrument.detector
    assert [int(key.value) for key in detector.image_key_control] == [2, 1, 0, 0, 0, 0, 0]
    assert np.allclose(np.asarray(read.sample.rotation_angle.magnitude), [0, 0, 0, 72, 144, 216, 288])
    assert str(read.sample.rotation_angle.units) == "degree"
    assert detector.x_pixel_size.to("m").magnitude == pytest.approx(150e-6, rel=1e-6)
    assert detector.distance.to("m").magnitude == pytest.approx(1.8 - 1.21)
    assert read.energy.to("keV").magnitude == pytest.approx(30)
    assert NXtomo.check_consistency(read) is None or NXtomo.check_consistency(read)
    with h5py.File(path) as file:
        data = file["entry0000/data/data"]
        assert data.chunks is None and data.compression is None
        assert np.array_equal(data[2:], images(run).transmission)
        assert (data[0] == 0).all() and (data[1] == 1).all()
    with pytest.raises(bl.FileError, match="exists"):
        convert.to_nxtomo(images(run), path)


@pytest.mark.parametrize("rows", [4, 1])
def test_cil_has_the_geometry_of_astra(run: bl.Run, tmp_path: Path, rows: int) -> None:
    taken = images(run)
    if rows == 1:
        with bl.Engine() as engine:
            taken = engine.simulate(run.scene.replace("detector.pixels", [24, 1])).retrieve()
    path = tmp_path / "scan.nxs"
    convert.to_cil(taken, path, "refraction")
    # What NEXUSDataReader reads, and what CIL makes of it for ASTRA.
    with h5py.File(path) as file:
        assert np.bytes_(file.attrs["creator"]) == np.bytes_("NEXUSDataWriter.py")
        entry = file["entry1/tomo_entry"]
        data, config = entry["data/data"], entry["config"]
        names = [data.attrs[f"dim{index}"] for index in range(data.ndim)]
        assert names == (["angle", "vertical", "horizontal"] if rows > 1 else ["angle", "horizontal"])
        assert data.attrs["data_type"] == "AcquisitionData" and data.attrs["num_channels"] == 1
        assert np.array_equal(data[()].reshape(5, rows, 24), taken.refraction)
        angles = config["angles"]
        assert angles.attrs["angle_unit"] == "degree" and angles.attrs["initial_angle"] == 0
        sides = 3 if rows > 1 else 2
        assert all(config[name].shape == (sides,) for name in
                   ("source/position", "detector/position", "rotation_axis/position"))
        if rows == 1:
            assert "num_pixels_v" not in data.attrs
            return
        turn = np.radians(-angles[()])
        column = data.attrs["pixel_size_h"] * config["detector/direction_x"][()]
        # Rows begin at the top.
        assert data.attrs["panel_origin"] == "top-left"
        row = -data.attrs["pixel_size_v"] * config["detector/direction_y"][()]
        vectors = [
            np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]]) @ v
            for t in turn
            for v in (config["source/position"][()], config["detector/position"][()], column, row)
        ]
    expected = convert.to_astra(taken)["vectors"]
    assert np.allclose(np.array(vectors).reshape(5, 12), expected, rtol=1e-6, atol=1e-4)


def test_dxchange_has_all_contrasts(run: bl.Run, tmp_path: Path) -> None:
    path = tmp_path / "scan.h5"
    words = [sys.executable, "-m", "beamlet.convert", run.path or "", "--to", "dxchange", "-o", str(path)]
    subprocess.run(words, check=True)
    with h5py.File(path) as file:
        for group, name in (("exchange", "transmission"), ("exchange1", "refraction"),
                            ("exchange2", "dark_field")):
            data = file[f"{group}/data"]
            assert np.array_equal(data[()], images(run)[name]) and data.chunks is None
            assert data.attrs["units"] == images(run).units[name]
            assert np.allclose(file[f"{group}/theta"][()], [0, 72, 144, 216, 288])
        assert (file["exchange/data_white"][()] == 1).all()
        assert (file["exchange/data_dark"][()] == 0).all()
    again = subprocess.run(words, capture_output=True, text=True, check=False)
    assert again.returncode == 1 and "exists" in again.stderr
    assert not list(tmp_path.glob("*.part"))


def test_silx_finds_what_to_plot(run: bl.Run, tmp_path: Path) -> None:
    import silx.io
    from silx.io.nxdata import get_default

    path = tmp_path / "scan.nx"
    convert.to_nxtomo(images(run), path, "refraction")
    with silx.io.open(str(path)) as file:
        plot = get_default(file)
        assert plot is not None and plot.is_valid, plot and plot.issues
        assert plot.signal.shape == (5, 4, 24)
        assert np.array_equal(plot.signal[()], images(run).refraction)
    for name in ("cil", "dxchange"):
        other = tmp_path / f"scan.{name}"
        write = convert.to_cil if name == "cil" else convert.to_dxchange
        write(images(run), other)
        with silx.io.open(str(other)) as file:
            place = {"cil": "entry1/tomo_entry/data/data", "dxchange": "exchange/data"}[name]
            assert np.array_equal(file[place][()], images(run).transmission)


def test_tifffile_reads_retrieved_images(run: bl.Run, tmp_path: Path) -> None:
    import tifffile

    out = tmp_path / "images"
    words = [sys.executable, "-m", "beamlet", "retrieve", run.path or "", "-o", str(out), "--format", "tiff", "-q"]
    subprocess.run(words, check=True)
    for name in ("transmission", "refraction", "dark_field"):
        read = tifffile.imread(out / f"{name}.tif")
        assert read.dtype == np.float32 and np.array_equal(read, images(run)[name], equal_nan=True)


def test_astra_gets_rows_first(run: bl.Run) -> None:
    taken = convert.to_astra(images(run), "refraction")
    assert taken["projections"].shape == (4, 5, 24)
    assert np.array_equal(taken["projections"][:, 2], images(run).refraction[2])
    assert taken["proj_geom"]["type"] == "cone_vec" and taken["vectors"].shape == (5, 12)
