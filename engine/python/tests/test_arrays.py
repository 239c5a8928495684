"""Arrays: their memory, their values beside files of the same run, their axes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import beamlet as bl


def test_arrays_own_the_engines_memory(scene: bl.Scene, engine: bl.Engine) -> None:
    run = engine.simulate(scene)
    for array in (run.flat, run.sample):
        # Memory of the engine: numpy neither made nor copied it.
        assert not array.flags.owndata and type(array.base).__name__ == "PySliceContainer"
        assert array.dtype == np.float32 and array.flags.c_contiguous and array.flags.writeable
    first = run.flat.__array_interface__["data"][0]
    assert np.shares_memory(run.flat, run.flat[1:]) and first == run.flat.ctypes.data
    kept = run.sample.copy()
    sample = run.sample
    del run
    assert np.array_equal(sample, kept)


def test_the_work_of_the_device_is_counted(scene: bl.Scene, tmp_path: Path) -> None:
    engine = bl.Engine(profile=True)
    engine.simulate_to(scene, tmp_path / "run")
    work = engine.profile()
    assert work["bytes_to_device"] > 0 and work["kernels"]["illuminate"]["groups"] > 0
    assert json.loads((tmp_path / "run" / "run.json").read_text())["profile"]["submissions"] > 0


def test_arrays_equal_the_files_of_a_run_and_of_the_program(
    scene: bl.Scene, engine: bl.Engine, tmp_path: Path
) -> None:
    noisy = scene.replace("detector.photons", 5000)
    run = engine.simulate(noisy, seed=7)
    stored = engine.simulate_to(noisy, tmp_path / "run", seed=7)
    assert isinstance(stored.sample, np.memmap)
    program = tmp_path / "program"
    words = ["simulate", noisy.save(tmp_path / "scene"), "-o", str(program), "--format", "npy", "-q",
             "--set", "sampling.seed=7"]
    subprocess.run([sys.executable, "-m", "beamlet", *words], check=True)
    other = bl.Run.open(program)
    assert run.counts and stored.counts and other.counts
    for a, b in ((run, stored), (run, other)):
        assert a.flat.tobytes() == b.flat.tobytes()
        assert a.sample.tobytes() == b.sample.tobytes()
        assert a.counts and b.counts
        for name in ("flat", "sample", "dark"):
            values = getattr(a.counts, name).tobytes()
            assert values and values == getattr(b.counts, name).tobytes()
    assert {d.largest for d in bl.compare(tmp_path / "run", program)} == {0.0}
    assert run.record["seed"] == stored.record["seed"] == 7


@pytest.mark.parametrize("format", ["exr", "npy", "tiff"])
def test_flats_and_darks_between_views_are_stacks(
    scene: bl.Scene, engine: bl.Engine, tmp_path: Path, format: str
) -> None:
    # Flats before views 0, 2 and 4 and behind view 4, darks before views 0 and 3 and behind view 4.
    several = scene.replace("scan.angles", {"from": "0 deg", "to": "90 deg", "count": 5})
    for key, value in (("detector.photons", 5000), ("scan.flats_every", 2), ("scan.darks_every", 3)):
        several = several.replace(key, value)
    run = engine.simulate(several)
    stored = engine.simulate_to(several, tmp_path / "run", format=format)  # type: ignore[arg-type]
    for of in (run, stored):
        assert of.counts and of.flat.shape == of.counts.flat.shape == (4, 5, 4, 24)
        assert of.counts.dark is not None and of.counts.dark.shape == (3, 5, 4, 24)
    assert run.counts and stored.counts and np.array_equal(run.flat, stored.flat)
    assert np.array_equal(run.counts.flat, stored.counts.flat)
    assert run.counts.dark is not None and np.array_equal(run.counts.dark, stored.counts.dark)
    images = [of.retrieve(counts=True) for of in (run, stored)]
    assert images[0]["flat_amplitude"].shape[0] == 5
    assert np.array_equal(images[0].transmission, images[1].transmission, equal_nan=True)


@pytest.mark.parametrize("format", ["exr", "tiff"])
def test_other_formats_are_read(scene: bl.Scene, engine: bl.Engine, tmp_path: Path, format: str) -> None:
    run = engine.simulate_to(scene, tmp_path / "run", format=format)  # type: ignore[arg-type]
    assert np.array_equal(run.sample, engine.simulate(scene).sample)


def test_seeds_choose_the_noise(scene: bl.Scene, engine: bl.Engine) -> None:
    noisy = scene.replace("detector.photons", 100)
    a, b, c = (engine.simulate(noisy, seed=seed).counts for seed in (1, 1, 2))
    assert a and b and c
    assert np.array_equal(a.flat, b.flat) and not np.array_equal(a.flat, c.flat)
    many = list(engine.simulate_many([noisy, noisy], seeds=[1, 2]))
    assert np.array_equal(many[0].counts.flat, a.flat)  # type: ignore[union-attr]
    assert np.array_equal(many[1].counts.flat, c.flat)  # type: ignore[union-attr]


def test_axes_are_places_of_pixels(scene: bl.Scene, engine: bl.Engine) -> None:
    turned = scene.replace("scan.angles", ["0 deg", "90 deg"])
    run = engine.simulate(turned)
    view, step, row, column = run.axes
    assert tuple(len(axis.values) for axis in run.axes) == run.sample.shape == turned.shape
    assert np.allclose(view.values, [0, np.pi / 2]) and view.unit == "rad"
    assert np.allclose(step.values, np.linspace(-20e-6, 20e-6, 5)) and step.unit == "m"
    assert np.allclose(column.values, (np.arange(24) - 11.5) * 150e-6)
    assert np.allclose(row.values, (1.5 - np.arange(4)) * 150e-6)


def test_retrieval_in_memory_is_that_of_the_program(
    scene: bl.Scene, engine: bl.Engine, tmp_path: Path
) -> None:
    run = engine.simulate_to(scene.replace("detector.photons", 50_000), tmp_path / "run")
    words = ["retrieve", str(tmp_path / "run"), "--counts", "--weights", "poisson", "--format", "npy",
             "-q"]
    subprocess.run([sys.executable, "-m", "beamlet", *words], check=True)
    images = run.retrieve(counts=True, weights="poisson")
    files = sorted((tmp_path / "run/retrieved").glob("*.npy"))
    assert {file.stem for file in files} == set(images)
    for file in files:
        assert np.array_equal(np.load(file).reshape(images[file.stem].shape), images[file.stem],
                              equal_nan=True), file
    record = json.loads((tmp_path / "run/retrieved/retrieved.json").read_text())
    assert images.units == record["units"]
    assert images.units["refraction"] == "rad"
    assert set(images.flag_meanings) == {int(bit) for bit in record["flags"]}


def test_measured_arrays_are_retrieved(scene: bl.Scene, engine: bl.Engine) -> None:
    run = engine.simulate(scene.replace("detector.photons", 50_000))
    assert run.counts is not None
    offsets = ["-20 um", "-10 um", 0.0, 10e-6, "20 um"]
    counts = run.counts
    one = bl.retrieve(counts.flat, counts.sample, offsets, scene, dark=counts.dark, engine=engine)
    # Other types, strides, and a view alone.
    flat = np.asfortranarray(counts.flat.astype(np.float64))
    other = bl.retrieve(flat, counts.sample[0], offsets, scene, dark=counts.dark, engine=engine)
    for name in one:
        assert np.array_equal(one[name], other[name], equal_nan=True), name
    bad = np.zeros((4, 24))
    bad[1, 5] = 1
    marked = bl.retrieve(counts.flat, counts.sample, offsets, scene, bad_pixels=bad, engine=engine)
    assert np.isnan(marked.transmission[0, 1, 5]) and marked.flags[0, 1, 5] > 0


def test_a_scan_is_reconstructed(scene: bl.Scene, engine: bl.Engine) -> None:
    fine = scene.replace("scan.angles", {"from": "0 deg", "to": "360 deg", "count": 60})
    run = engine.simulate(fine)
    images = run.retrieve(method="exact-curve")
    volume = images.reconstruct("mu", voxel="80 um")
    assert volume.unit == "1/m" and volume.voxel == pytest.approx((80e-6,) * 3)
    x, y, z = volume.centres()
    inside = (np.hypot(x[None, :], y[:, None]) < 0.5e-3) & np.ones_like(volume.values, dtype=bool)
    expected = bl.material("resin", 30.0, scene=scene).mu[0]
    # Filtered back-projection of 60 views through 24 pixels.
    assert volume.values[inside].mean() == pytest.approx(expected, rel=0.05)
    delta = images.reconstruct("delta", voxel="80 um").values[inside].mean()
    assert delta == pytest.approx(bl.material("resin", 30.0, scene=scene).delta[0], rel=0.1)
    assert abs(z.mean()) < 1e-9
