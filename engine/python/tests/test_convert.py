"""Files of other tools, read by nxtomo and h5py."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import beamlet as bl
from beamlet import cil, convert


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


def images_of_rows(run: bl.Run, rows: int) -> bl.Images:
    """The images, or for 1 those of a scan with a single row."""
    if rows > 1:
        return images(run)
    with bl.Engine() as engine:
        return engine.simulate(run.scene.replace("detector.pixels", [24, 1])).retrieve()


def with_gaps(run: bl.Run) -> bl.Images:
    """The images with pixels that a reconstruction fills, a row of them among them."""
    taken = images(run)
    changed = {name: taken[name].copy() for name in taken}
    for name in ("transmission", "refraction", "dark_field"):
        changed[name][0, 1, 7] = np.nan
        changed[name][3, 2] = np.nan
    changed["transmission"][1, 0, 3] = -0.25
    # A misfit, of which a half of the light is gone.
    changed["transmission"][2, 3, 11] /= 2
    changed["flags"][2, 3, 11] = next(
        bit for bit, meaning in taken.flag_meanings.items() if "misfit" in meaning
    )
    return bl.Images(changed, taken.record, taken.geometry, taken.scene, None)


def reconstructed_from(taken: bl.Images, name: str) -> np.ndarray:
    """A contrast that has the values from which beamlet reconstructs."""
    quantity = {"transmission": "mu", "refraction": "delta", "dark_field": "dark_field"}[name]
    sinograms, _ = taken.sinograms(quantity)  # type: ignore[arg-type]
    return np.exp(-sinograms) if name == "transmission" else sinograms


def written(path: Path, place: str) -> tuple[np.ndarray, int | None]:
    """A dataset, and its number of filled pixels."""
    with h5py.File(path) as file:
        count = file[place].attrs.get("filled_pixels")
        return file[place][()], None if count is None else int(count)


PLACES = {
    "nxtomo": "entry0000/instrument/detector/data",
    "cil": "entry1/tomo_entry/data/data",
    "dxchange": "exchange/data",
}


@pytest.mark.parametrize("name", ["transmission", "refraction"])
def test_all_tools_get_the_data_of_reconstruct(run: bl.Run, tmp_path: Path, name: Any) -> None:
    taken = with_gaps(run)
    expected = reconstructed_from(taken, name)
    gaps = ~np.isfinite(taken[name])
    if name == "transmission":
        misfits = (taken.flags.astype(int) & (1 << 20)) != 0
        assert misfits[2, 3, 11]
        gaps |= misfits | (taken[name] <= 0)
    assert gaps.sum() >= 25
    found = {}
    for fill in (True, False):
        for tool in PLACES:
            path = tmp_path / f"{tool}.{fill}"
            if tool == "dxchange":
                convert.to_dxchange(taken, path, fill=fill)
                place = PLACES[tool] if name == "transmission" else "exchange1/data"
            else:
                write = convert.to_nxtomo if tool == "nxtomo" else convert.to_cil
                write(taken, path, name, fill=fill)
                place = PLACES[tool]
            data, count = written(path, place)
            assert count == (gaps.sum() if fill else None), tool
            # Flat and dark frame of NXtomo come first.
            found[tool, fill] = data[-5:]
    for tool in PLACES:
        assert np.array_equal(found[tool, False], taken[name], equal_nan=True), tool
        # Rounding to float32 of T and of -ln T.
        assert np.allclose(found[tool, True], expected, rtol=1e-6, atol=0), tool
        assert np.array_equal(found[tool, True][~gaps], taken[name][~gaps]), tool
    quantity: Any = "mu" if name == "transmission" else "delta"
    astra = convert.to_astra(taken, name)["projections"]
    assert np.allclose(astra.transpose(1, 0, 2), taken.sinograms(quantity)[0], rtol=1e-6, atol=1e-6)
    bare = convert.to_astra(taken, name, fill=False)["projections"].transpose(1, 0, 2)
    lacks = ~(taken[name] > 0) if name == "transmission" else np.isnan(taken[name])
    assert np.array_equal(np.isnan(bare), lacks)
    assert name != "transmission" or abs(bare[2, 3, 11] + np.log(taken[name][2, 3, 11])) < 1e-6


def test_views_without_any_value_cannot_be_filled(run: bl.Run, tmp_path: Path) -> None:
    taken = with_gaps(run)
    taken.refraction[4] = np.nan
    for write in (
        lambda: convert.to_nxtomo(taken, tmp_path / "a", "refraction"),
        lambda: convert.to_cil(taken, tmp_path / "a", "refraction"),
        lambda: convert.to_dxchange(taken, tmp_path / "a"),
        lambda: convert.to_astra(taken, "refraction"),
    ):
        with pytest.raises(bl.ArgumentError, match="view 4"):
            write()  # type: ignore[no-untyped-call]
    assert not list(tmp_path.iterdir())
    convert.to_nxtomo(taken, tmp_path / "a", "refraction", fill=False)
    with pytest.raises(bl.ArgumentError, match="transmission, refraction, dark_field"):
        convert.to_astra(taken, "flags")  # type: ignore[arg-type]


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
        assert np.allclose(data[2:], reconstructed_from(images(run), "transmission"), rtol=1e-6, atol=0)
        assert (data[0] == 0).all() and (data[1] == 1).all()
    with pytest.raises(bl.FileError, match="exists"):
        convert.to_nxtomo(images(run), path)


@pytest.mark.parametrize("rows", [4, 1])
def test_cil_has_the_geometry_of_astra(run: bl.Run, tmp_path: Path, rows: int) -> None:
    taken = images_of_rows(run, rows)
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
        assert np.array_equal(data[()].reshape(5, rows, 24), reconstructed_from(taken, "refraction"))
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


@pytest.mark.parametrize("rows", [4, 1])
def test_cil_data_is_that_of_the_file(run: bl.Run, tmp_path: Path, rows: int) -> None:
    """With CIL alone, which conda installs."""
    io = pytest.importorskip("cil.io")
    taken = images_of_rows(run, rows)
    path = tmp_path / "scan.nxs"
    convert.to_cil(taken, path, "refraction")
    found, expected = cil.read(taken, "refraction"), io.NEXUSDataReader(file_name=str(path)).read()
    assert found.geometry == expected.geometry
    assert np.array_equal(found.as_array(), expected.as_array())


def test_dxchange_has_all_contrasts(run: bl.Run, tmp_path: Path) -> None:
    path = tmp_path / "scan.h5"
    words = [sys.executable, "-m", "beamlet.convert", run.path or "", "--to", "dxchange", "-o", str(path),
             "--as-retrieved"]
    subprocess.run(words, check=True)
    with h5py.File(path) as file:
        for group, name in (("exchange", "transmission"), ("exchange1", "refraction"),
                            ("exchange2", "dark_field")):
            data = file[f"{group}/data"]
            assert np.array_equal(data[()], images(run)[name], equal_nan=True) and data.chunks is None
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
    convert.to_nxtomo(images(run), path, "refraction", fill=False)
    with silx.io.open(str(path)) as file:
        plot = get_default(file)
        assert plot is not None and plot.is_valid, plot and plot.issues
        assert plot.signal.shape == (5, 4, 24)
        assert np.array_equal(plot.signal[()], images(run).refraction, equal_nan=True)
    for name in ("cil", "dxchange"):
        other = tmp_path / f"scan.{name}"
        write = convert.to_cil if name == "cil" else convert.to_dxchange
        write(images(run), other, fill=False)
        with silx.io.open(str(other)) as file:
            values = file[PLACES[name]][()]
            assert np.array_equal(values, images(run).transmission, equal_nan=True)


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
    assert np.array_equal(taken["projections"][:, 2], reconstructed_from(images(run), "refraction")[2])
    assert taken["proj_geom"]["type"] == "cone_vec" and taken["vectors"].shape == (5, 12)


def test_both_programs_write_for_astra_and_name_what_they_cannot(run: bl.Run, tmp_path: Path) -> None:
    place = run.path or ""
    for module, out in (("beamlet", "program"), ("beamlet.convert", "package")):
        verb = ["convert"] if module == "beamlet" else []
        words = [sys.executable, "-m", module, *verb, place, "--to", "astra", "-o", str(tmp_path / out)]
        subprocess.run(words, check=True, capture_output=True)
    names = sorted(path.name for path in (tmp_path / "program").iterdir())
    assert "astra.json" in names and "refraction.npy" in names
    assert names == sorted(path.name for path in (tmp_path / "package").iterdir())
    for name in names:
        assert (tmp_path / "program" / name).read_bytes() == (tmp_path / "package" / name).read_bytes(), name
    for name in ("nxtomo", "cil", "dxchange"):
        out = tmp_path / f"it's.{name}"
        words = [sys.executable, "-m", "beamlet", "convert", place, "--to", name, "-o", str(out)]
        refused = subprocess.run(words, check=False, capture_output=True, text=True)
        assert refused.returncode == 2 and not out.exists()
        # The printed line does it.
        line = next(line for line in refused.stderr.splitlines() if line.startswith("  python -m"))
        line = line.replace("python -m", f"{sys.executable} -m", 1)
        subprocess.run(line, shell=True, check=True)
        assert h5py.is_hdf5(out)
