"""Options of volumes and retrievals, against the program on the same run."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENE

import beamlet as bl

VOXELS = ["--voxel", "200 um", "--size", "18,18,2", "--format", "npy"]
GRID: dict[str, Any] = {"voxel": "200 um", "size": [18, 18, 2]}


@pytest.fixture(scope="module")
def run(engine: bl.Engine, tmp_path_factory: pytest.TempPathFactory) -> bl.Run:
    """A scan with counts under a spectrum, in a directory."""
    scene = bl.Scene.from_dict(SCENE).replace("detector.photons", 20_000)
    folder = tmp_path_factory.mktemp("volumes")
    (folder / "tube.csv").write_text("energy_keV,weight\n25,1\n35,2\n45,1\n")
    scene = scene.replace("source.spectrum", str(folder / "tube.csv"))
    turns = {"from": "0 deg", "to": "360 deg", "count": 16}
    scene = scene.replace("scan.angles", turns).replace("detector.pixels", [48, 4])
    return engine.simulate_to(scene, folder / "run", seed=1)


@pytest.fixture(scope="module")
def clear(engine: bl.Engine, run: bl.Run) -> bl.Run:
    """The same with little noise."""
    return engine.simulate_to(run.scene.replace("detector.photons", 1_000_000), f"{run.path}-clear", seed=1)


def program(*words: str) -> None:
    done = subprocess.run([sys.executable, "-m", "beamlet", *words, "-q"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def retrieved(run: bl.Run) -> bl.Images:
    """Images of a run, by the program."""
    program("retrieve", str(run.path), "--counts", "--method", "exact-curve", "--format", "npy")
    return bl.Images.open(str(run.path))


@pytest.fixture(scope="module")
def images(run: bl.Run) -> bl.Images:
    return retrieved(run)


@pytest.fixture(scope="module")
def clear_images(clear: bl.Run) -> bl.Images:
    return retrieved(clear)


def of_program(run: bl.Run, name: str, *words: str) -> Path:
    """Folder of volumes of the program."""
    folder = Path(f"{run.path}-{name}")
    program("reconstruct", str(run.path), "-o", str(folder), *VOXELS, *words)
    return folder


def table(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def test_volumes_are_those_of_the_program(run: bl.Run, images: bl.Images) -> None:
    folder = of_program(
        run, "fbp", "--quantity", "mu,delta", "--rings", "--beam-hardening", "resin@30keV",
        "--centre", "23.4", "--truth",
    )
    options: dict[str, Any] = {**GRID, "rings": True, "centre": 23.4, "truth": True}
    mu = images.reconstruct("mu", beam_hardening="resin@30keV", **options)
    delta = images.reconstruct("delta", gradient_bias=mu, **options)
    assert mu.energy == 30.0 and delta.energy is None and delta.bias and delta.bias > 0
    errors = table(folder / "errors.csv")
    for volume in (mu, delta):
        name = volume.quantity
        assert np.array_equal(volume.values, np.load(folder / f"{name}.npy")), name
        truth = volume.truth
        assert truth is not None and truth.labels.dtype == np.uint16
        labels = np.load(folder / "labels.npy")
        assert labels.dtype == np.uint16 and np.array_equal(truth.labels, labels) and labels.any()
        assert truth.names[1] == "rod (resin)"
        assert truth.values is not None and np.array_equal(truth.values, np.load(folder / f"{name}_truth.npy"))
        ours = [line for line in truth.errors if line["object"] == "rod"]
        theirs = [line for line in errors if line["object"] == "rod" and line["quantity"] == name]
        for column in ("truth", "mean", "error_percent", "rms_error"):
            assert ours[0][column] == float(theirs[0][column]), column
        assert volume.lost_views == ()
    for other in (replace(mu, values=mu.values[:, 1:]), replace(mu, voxel=(1e-4, 1e-4, 1e-4))):
        with pytest.raises(bl.ArgumentError) as raised:
            images.reconstruct("delta", gradient_bias=other, **options)
        assert raised.value.key == "gradient_bias"


@pytest.mark.parametrize("method", ["fbp", "cgls"])
def test_views_that_lost_their_refraction_are_those_of_the_program(
    clear: bl.Run, clear_images: bl.Images, tmp_path: Path, method: str
) -> None:
    refraction = clear_images.refraction.copy()
    refraction[[3, 9]] *= -0.2
    shutil.copytree(Path(str(clear.path)) / "retrieved", tmp_path / "lost")
    np.save(tmp_path / "lost" / "refraction.npy", refraction)
    lost = bl.Images.open(tmp_path / "lost")
    words = ["--quantity", "delta", "--method", method]
    words += ["--iterations", "4"] if method == "cgls" else []
    options: dict[str, Any] = {**GRID, "method": method}
    options |= {"iterations": 4} if method == "cgls" else {}
    for name, keep in (("out", False), ("kept", True)):
        folder = tmp_path / name
        program("reconstruct", str(tmp_path / "lost"), "-o", str(folder), *VOXELS, *words, *["--keep-views"] * keep)
        record = json.loads((folder / "volume.json").read_text())["refraction_moment"]
        volume = lost.reconstruct("delta", keep_views=keep, **options)
        assert volume.lost_views == tuple(view["view"] for view in record["lost_views"]) == (3, 9)
        assert np.array_equal(volume.values, np.load(folder / "delta.npy")), name


def test_arrays_of_pixels_have_the_shape_of_the_sinograms(images: bl.Images) -> None:
    sinograms, _ = images.sinograms("delta")
    assert images.geometry is not None
    cgls = {"method": "cgls"}
    for name, options in (("attenuation", {}), ("weights", cgls)):
        with pytest.raises(bl.ArgumentError) as raised:
            bl.reconstruct(sinograms, images.geometry, "delta", **GRID, **options, **{name: sinograms[:, :, 1:]})
        assert raised.value.key == name


def test_iterations_take_weights_and_shapes(clear: bl.Run, clear_images: bl.Images) -> None:
    shape = "cylinder:0 mm,0 mm,1.2 mm"
    folder = of_program(clear, "cgls", "--quantity", "mu", "--method", "cgls", "--iterations", "4",
                        "--mask", shape, "--centre", "auto")
    options: dict[str, Any] = {**GRID, "method": "cgls", "iterations": 4, "mask": shape, "centre": "auto"}
    volume = clear_images.reconstruct("mu", **options)
    assert np.array_equal(volume.values, np.load(folder / "mu.npy"))
    assert (volume.values[:, 0, 0] == 0).all() and volume.axis != 0
    weighed = clear_images.reconstruct("mu", weights=clear_images.weights("mu"), **options)
    assert not np.array_equal(weighed.values, volume.values) and np.isfinite(weighed.values).all()


def test_sinograms_have_the_options_of_images(images: bl.Images) -> None:
    sinograms, _ = images.sinograms("mu")
    assert images.scene is not None and images.geometry is not None
    given: dict[str, Any] = {**GRID, "rings": True, "truth": True, "beam_hardening": "resin"}
    of_scene = bl.reconstruct(sinograms, images.scene, **given)
    assert np.array_equal(of_scene.values, images.reconstruct("mu", **given).values)
    with pytest.raises(bl.ArgumentError) as raised:
        bl.reconstruct(sinograms, images.geometry, **given)
    assert raised.value.key == "beam_hardening"
    with pytest.raises(TypeError, match="sharpness"):
        images.reconstruct("mu", sharpness=3)


def test_retrievals_are_those_of_the_program(run: bl.Run) -> None:
    images = f"{run.path}-corrected"
    program("retrieve", str(run.path), "-o", images, "--counts", "--format", "npy", "--columns", "2:46:1", "--bin",
            "2,1", "--empty-beam", "0:6", "--correct", "offset,dose", "--phase", "--gain", "1.5", "--weights",
            "poisson", "--read-noise", "3", "--saturation", "60000")
    theirs = bl.Images.open(images)
    ours = run.retrieve(
        counts=True, columns=slice(2, 46), bin=(2, 1), empty_beam=(0, 6), correct=("offset", "dose"), phase=True,
        gain=1.5, weights="poisson", read_noise=3, saturation=60_000,
    )
    assert sorted(ours) == sorted(theirs) and "phase" in ours and ours.transmission.shape == (16, 4, 22)
    for name in ours:
        assert np.array_equal(ours[name], theirs[name], equal_nan=True), name
    for key in ("gain", "read_noise", "kept_columns", "bin", "correct", "corrections", "empty_beam", "warnings"):
        assert ours.record.get(key) == theirs.record.get(key), key
    assert ours.record["corrections"]
    assert ours.record["options"]["gain"] == theirs.record["options"]["gain"] == "1.5"


def test_steps_of_measured_stacks_are_left_out(engine: bl.Engine) -> None:
    scene = bl.Scene.from_dict(SCENE).replace("scan.mask_offsets", {"from": "-20 um", "to": "20 um", "count": 7})
    run = engine.simulate(scene)
    flat, sample, offsets = 1e4 * run.flat, 1e4 * run.sample, scene.mask_offsets
    kept = [0, 1, 3, 4, 6]
    wanted = bl.retrieve(flat[kept], sample[:, kept], offsets[kept], scene, engine=engine)
    # Frames that are left out may be anything.
    flat[2], sample[:, 5] = 0, 0
    found = bl.retrieve(flat, sample, offsets, scene, omit_steps=[5, 2], engine=engine)
    assert sorted(found) == sorted(wanted) and found.record["omitted_steps"] == [2, 5]
    for name in wanted:
        assert np.array_equal(found[name], wanted[name], equal_nan=True), name
    for steps in ([7], range(7), 3, ["1"], [-1]):
        with pytest.raises(bl.ArgumentError) as raised:
            bl.retrieve(flat, sample, offsets, scene, omit_steps=steps, engine=engine)
        assert raised.value.key == "omit_steps"


def test_several_flats_are_interpolated(engine: bl.Engine) -> None:
    scene = bl.Scene.from_dict(SCENE).replace("scan.angles", {"from": "0 deg", "to": "90 deg", "count": 4})
    run = engine.simulate(scene)
    flats = np.stack([run.flat, 1.1 * run.flat, 1.2 * run.flat])
    found = bl.retrieve(1e4 * flats, 1e4 * run.sample, None, scene, flats_every=2, engine=engine)
    plain = bl.retrieve(1e4 * run.flat, 1e4 * run.sample, None, scene, engine=engine)
    assert found.record["flats_every"] == 2 and found.record["gain_assumed"]
    ratio = np.nanmedian(plain.transmission / found.transmission, axis=(1, 2))
    # Views are taken half a view behind their number: flats before views 0, 2 and behind 3.
    assert np.allclose(ratio, [1.025, 1.075, 1.125, 1.175], atol=2e-3), ratio
    with pytest.raises(bl.ArgumentError) as raised:
        run.retrieve(gain=2.0)
    assert raised.value.key == "gain"
