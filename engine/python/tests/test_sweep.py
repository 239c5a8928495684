"""Designs of a set-up: the same as from the program, errors, progress and Ctrl-C."""

import csv
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import beamlet as bl

APERTURE = "sample_mask.projected_aperture"


MASK = 'material = "gold"\nthickness = "225 um"\nprojected_aperture = "30 um"\n'
TEXT = f"""
[source]
distance = "1.21 m"
spot = "30 um"
energy = "30 keV"
[sample_mask]
distance = "1.2 m"
{MASK}
[detector_mask]
{MASK}
[detector]
distance = "1.8 m"
pixels = [8, 4]
pitch = "150 um"
photons = 10000
[scan]
mask_offsets = {{ from = "-25 um", to = "25 um", count = 11 }}
"""


@pytest.fixture
def scene() -> bl.Scene:
    """A set-up without a sample."""
    return bl.Scene.from_toml(TEXT)


def test_designs_are_those_of_the_program(scene: bl.Scene, tmp_path: Path) -> None:
    scores = ["sigma_alpha", "visibility", "dose"]
    vary = {APERTURE: "20:200:4 um", "scan.mask_offsets.count": [5, 11]}
    found = bl.sweep(scene, vary, scores, fix="photons=1e6")
    (tmp_path / "scene.toml").write_text(TEXT)
    words = [sys.executable, "-m", "beamlet", "sweep", "scene.toml", "-q", "-o", "out", "--fix", "photons=1e6"]
    words += ["--vary", f"{APERTURE}=20:200:4 um", "--vary", "scan.mask_offsets.count=5,11"]
    subprocess.run([*words, "--score", ",".join(scores)], check=True, cwd=tmp_path)
    with open(tmp_path / "out" / "sweep.csv", encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    assert found.shape == (4, 2) and len(found) == len(rows) == 8
    assert found.values[APERTURE].tolist() == [20, 20, 80, 80, 140, 140, 200, 200]
    assert found.values["scan.mask_offsets.count"].tolist() == [5, 11] * 4
    units = {APERTURE: "um", "scan.mask_offsets.count": "", "sigma_alpha": "rad", "visibility": "1", "dose": "Gy"}
    assert found.units == units
    columns = {"sigma_alpha": ("sigma_alpha [nrad]", 1e-9), "visibility": ("visibility [%]", 1e-2), "dose": ("dose [mGy]", 1e-3)}
    for name, (column, unit) in columns.items():
        of_program = [float(row[column] or "nan") * unit for row in rows]
        np.testing.assert_allclose(found.scores[name], of_program, rtol=1e-12)
    assert [reason or "" for reason in found.refused] == [row["refused"] for row in rows]
    assert found.refused[6] is not None and np.isnan(found.scores["dose"][6])
    assert found.front.tolist() == [row["pareto"] == "1" for row in rows]
    np.testing.assert_allclose(found.photons[:2], [1e6 / 5, 1e6 / 11])
    assert np.isnan(found.exposure).all()


def test_the_best_design_is_a_scene_with_its_score(scene: bl.Scene) -> None:
    found = bl.sweep(scene, {APERTURE: ["20 um", "30 um", "60 um"]}, "sigma_alpha", fix="photons=1e6")
    assert found.best == int(np.nanargmin(found.scores["sigma_alpha"]))
    expected = bl.check(found.scene()).values["illumination"]["expected"]["refraction"]
    assert abs(found.scores["sigma_alpha"][found.best] / expected - 1) < 1e-3
    assert bl.check(found.scene(0)).values["setup"]["sample_mask"][1] == pytest.approx(20e-6 / 1.5, rel=1e-6)
    for design in (3, -1):
        with pytest.raises(bl.ArgumentError, match="design"):
            found.scene(design)


def test_tables_lists_and_meshes_vary(scene: bl.Scene, tmp_path: Path) -> None:
    table = tmp_path / "designs.csv"
    table.write_text(f"{APERTURE} [um],detector.photons\n20,100\n30,200\n")
    found = bl.sweep(scene, [table, {"source.spot": [["30 um", "20 um"], "40 um"]}], "photons")
    assert found.shape == (2, 2) and found.scores["photons"].tolist() == [100, 100, 200, 200]
    assert found.values["source.spot"][1] == "40 um" and found.units[APERTURE] == "um"
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    body = bl.Object(name="body", mesh=(corners, faces), unit="mm", material="nylon 6")
    text = scene.save(tmp_path)
    other = bl.Scene.load(text).replace("object", [body])
    found = bl.sweep(other, {"object.body.mesh": [(corners, faces), (2 * corners, faces)]}, "photons")
    assert len(found) == 2 and found.refused == [None, None]
    extents = [found.scene(design).ideal(tolerance=0.1).transmission.min() for design in (0, 1)]
    assert extents[1] < extents[0] < 1


ROD = bl.Object(name="rod", material="nylon 6", shape={"cylinder": {"radius": "0.3 mm", "height": "90 mm"}})


def test_scores_at_a_sample(scene: bl.Scene) -> None:
    with_rod = scene.replace("object", [ROD]).replace("detector.pixels", [16, 2])
    scores = ["cnr:rod", "bias_alpha:rod", "error_alpha:rod", "sigma_alpha"]
    found = bl.sweep(with_rod, {APERTURE: "20:40:3 um", "detector.photons": [10000, 40000]}, scores)
    assert found.refused == [None] * 6 and found.units["cnr:rod"] == "1" and found.units["bias_alpha:rod"] == "rad"
    contrast, bias, error = (found.scores[name].reshape(3, 2) for name in scores[:3])
    np.testing.assert_allclose(contrast[:, 1] / contrast[:, 0], 2, rtol=1e-2)
    noise = np.sqrt(error**2 - bias**2)
    np.testing.assert_allclose(noise[:, 0] / noise[:, 1], 2, rtol=3e-2)
    assert found.best == int(np.argmax(found.scores["cnr:rod"]))
    # By hand, from 400 noisy rows of the best design, whose rod covers six columns.
    images = bl.Engine().simulate(found.scene().replace("detector.pixels", [16, 400])).retrieve(
        counts=True, weights="poisson"
    )
    rod, beside = images.transmission[0][:, 5:11], images.transmission[0][:, :4]
    contrasts = rod.mean(axis=0) - beside.mean()
    noise_by_hand = (rod.var(axis=0).mean() + beside.var(axis=0).mean()) / 2
    by_hand = np.sqrt((contrasts**2).mean() / noise_by_hand)
    assert abs(found.scores["cnr:rod"][found.best] / by_hand - 1) < 0.05
    with pytest.raises(bl.ArgumentError, match="no object .*objects of the scene: rod"):
        bl.sweep(with_rod, {APERTURE: ["20 um"]}, "cnr:rot")
    with pytest.raises(bl.ArgumentError, match="of a scene without objects"):
        bl.sweep(scene, {APERTURE: ["20 um"]}, "cnr:rod")


@pytest.mark.parametrize(
    ("arguments", "key", "words"),
    [
        ({"vary": {APERTURE: "1:2:0 um"}}, "vary", "empty range"),
        ({"vary": {APERTURE: "1:2:1000000000 um"}}, "vary", "1000000000 values"),
        ({"vary": {APERTURE: []}}, "vary", "an empty value"),
        ({"vary": {APERTURE: [None]}}, APERTURE, "None"),
        ({"vary": {}}, "vary", "nothing to vary"),
        ({"vary": 7}, "vary", "a dict"),
        ({"vary": {3: "1, 2"}}, "vary", "keys of the scene"),
        ({"score": "beauty"}, "score", "visibility"),
        ({"score": 3}, "score", "names of scores"),
        ({"score": []}, "score", "no score"),
        ({"fix": "time"}, "fix", "without exposure"),
        ({"fix": 3}, "fix", "time, dose or photons"),
        ({"vary": {"detector.photons": [1, 2]}, "fix": "photons"}, "vary", "it follows from fix"),
        ({"scene": "scene.toml"}, "scene", "a Scene"),
        ({"engine": "engine"}, "engine", "an Engine"),
    ],
)
def test_wrong_arguments_are_named(
    scene: bl.Scene, arguments: dict[str, object], key: str, words: str
) -> None:
    given = {"scene": scene, "vary": {APERTURE: ["20 um", "30 um"]}, "score": "visibility", **arguments}
    with pytest.raises(bl.ArgumentError, match=words) as raised:
        bl.sweep(**given)  # type: ignore[arg-type]
    assert raised.value.key == key


def test_keys_and_tables_that_are_not_there(scene: bl.Scene, tmp_path: Path) -> None:
    with pytest.raises(bl.SceneError, match="did you mean `photons`") as raised:
        bl.sweep(scene, {"detector.photon": [1, 2]}, "dose")
    assert raised.value.key == "detector.photon"
    with pytest.raises(bl.FileError, match="nothing.csv"):
        bl.sweep(scene, tmp_path / "nothing.csv", "dose")


def test_a_record_is_resumed(scene: bl.Scene, tmp_path: Path) -> None:
    place, vary = tmp_path / "out", {APERTURE: "20:40:60 um"}

    def stop(step: str, share: float | None) -> None:
        if share and share > 0.2:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        bl.sweep(scene, vary, "visibility,dose", path=place, progress=stop)
    record = json.loads((place / "sweep.json").read_text())
    assert 10 < len(record["designs"]) < 60
    record["designs"][0]["photons"] = 7.0
    (place / "sweep.json").write_text(json.dumps(record))
    found = bl.sweep(scene, vary, "visibility,dose", path=place, resume=True)
    assert len(found) == 60 and found.photons[0] == 7.0, "kept, not made again"
    whole = bl.sweep(scene, vary, "visibility,dose")
    np.testing.assert_array_equal(found.scores["dose"], whole.scores["dose"])
    with pytest.raises(bl.FileError, match="overwrite=True"):
        bl.sweep(scene, vary, "visibility,dose", path=place)
    with pytest.raises(bl.FileError, match="another score"):
        bl.sweep(scene, vary, "dose", path=place, resume=True)
    with pytest.raises(bl.FileError, match="no sweep to resume"):
        bl.sweep(scene, vary, "dose", path=tmp_path / "nothing", resume=True)
    assert bl.sweep(scene, vary, "dose", path=place, overwrite=True).scores["dose"].size == 60


def test_progress_and_interruption(scene: bl.Scene) -> None:
    blurred = scene.replace("detector.blur", {"fwhm": "120 um"}).replace("detector_mask.period", "140 um")
    reported: list[tuple[str, float | None]] = []
    began: list[float] = []

    def progress(step: str, share: float | None) -> None:
        reported.append((step, share))
        if share and not began:
            began.append(time.monotonic())
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        bl.sweep(blurred, {APERTURE: "20:40:1000 um"}, "visibility", progress=progress)
    assert time.monotonic() - began[0] < 1.5
    began.clear()
    large = scene.replace("object", [ROD]).replace("detector.pixels", [96, 400])

    def soon(step: str, share: float | None) -> None:
        if not began:
            began.append(time.monotonic())
            threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()

    with pytest.raises(KeyboardInterrupt):
        bl.sweep(large, {APERTURE: "20:40:1000 um"}, "bias_alpha", progress=soon)
    assert time.monotonic() - began[0] < 2.5
    found = bl.sweep(scene, {APERTURE: "20:40:40 um"}, "visibility", progress=lambda *at: reported.append(at))
    assert len(found) == 40 and reported[-1] == ("designs", 1.0)
