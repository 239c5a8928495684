"""Errors: each names key, what was found, and a remedy."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENE

import beamlet as bl


def changed(section: str, key: str, value: Any) -> dict[str, Any]:
    scene = copy.deepcopy(SCENE)
    part = scene[section]
    (part[0] if isinstance(part, list) else part)[key] = value
    return scene


def tetrahedron() -> tuple[np.ndarray, np.ndarray]:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    return vertices, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def with_mesh(mesh: Any, **keys: Any) -> dict[str, Any]:
    scene = copy.deepcopy(SCENE)
    scene["object"] = [{"name": "body", "mesh": mesh, "material": "resin", "unit": "mm", **keys}]
    return scene


def test_unknown_keys_of_dicts_are_named_with_their_place() -> None:
    with pytest.raises(bl.SceneError) as raised:
        bl.Scene.from_dict(changed("detector", "pixelz", 3))
    error = raised.value
    assert error.key == "detector.pixelz" and error.found and "pixels" in str(error)
    assert error.line and "pixelz" in str(error)
    assert isinstance(error, ValueError) and error.errors == (error,)
    for scene, key in (
        ({**SCENE, "detektor": {}}, "detektor"),
        (changed("object", "colour", "red"), "object[0].colour"),
        (changed("scan", "mask_offsets", {"from": "0 um", "until": "1 um"}), "scan.mask_offsets.until"),
    ):
        with pytest.raises(bl.SceneError) as nested:
            bl.Scene.from_dict(scene)
        assert key in {error.key for error in nested.value.errors}
    with pytest.raises(bl.SceneError, match=r"detector\.pixelz"):
        bl.Scene.from_dict(SCENE).replace("detector.pixelz", 3)


def test_several_errors_come_at_once() -> None:
    scene = changed("detector", "pixels", [0, 4])
    scene["source"]["energy"] = "30"
    with pytest.raises(bl.SceneError) as raised:
        bl.Scene.from_dict(scene)
    assert {error.key for error in raised.value.errors} == {"source.energy", "detector.pixels[0]"}


def test_files_name_file_and_line(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text('[source]\ndistance = "1 m"\nspot = "30 parsec"\nenergy = "30 keV"\n')
    with pytest.raises(bl.SceneError) as raised:
        bl.Scene.load(path)
    first = raised.value.errors[-1]
    assert (first.file, first.line, first.key) == (str(path), 3, "source.spot")
    with pytest.raises(bl.FileError) as missing:
        bl.Scene.load(tmp_path / "none.toml")
    assert isinstance(missing.value, OSError) and missing.value.file == str(tmp_path / "none.toml")


def test_values_of_dicts_may_be_of_numpy_and_nothing_else_is_guessed() -> None:
    scene = changed("detector", "pixels", np.array([24, 4]))
    assert bl.Scene.from_dict(scene).shape == (1, 5, 4, 24)
    with pytest.raises(bl.ArgumentError, match="set"):
        bl.Scene.from_dict(changed("detector", "pixels", {1, 2}))


@pytest.mark.parametrize(
    ("vertices", "faces", "key"),
    [
        (np.zeros((4, 2)), np.zeros((4, 3), int), "object.body.vertices"),
        (np.zeros((4, 3)), np.zeros((4, 4), int), "object.body.faces"),
        (np.zeros((4, 3)), np.zeros((4, 3)), "object.body.faces"),
        (np.zeros((4, 3), complex), np.zeros((4, 3), int), "object.body.vertices"),
        (np.full((4, 3), np.nan), np.zeros((4, 3), int), "object.body.vertices"),
        (np.zeros((4, 3)), np.array([[0, 1, 4]]), "object.body.faces"),
        (np.zeros((4, 3)), np.array([[0, 1, -1]]), "object.body.faces"),
        (np.array(["a"]), np.zeros((4, 3), int), "object.body.vertices"),
    ],
)
def test_arrays_that_are_no_mesh(vertices: Any, faces: Any, key: str) -> None:
    with pytest.raises(bl.ArgumentError) as raised:
        bl.Scene.from_dict(with_mesh((vertices, faces)))
    assert raised.value.key == key and raised.value.found and raised.value.allowed


def test_meshes_need_a_unit_and_faces() -> None:
    scene = with_mesh(tetrahedron())
    del scene["object"][0]["unit"]
    with pytest.raises(bl.ArgumentError, match="unit"):
        bl.Scene.from_dict(scene)
    with pytest.raises(bl.ArgumentError, match="vertices and faces"):
        bl.Scene.from_dict(with_mesh(3.5))


def test_turned_meshes_are_taken(engine: bl.Engine) -> None:
    vertices, faces = tetrahedron()
    outside = engine.simulate(bl.Scene.from_dict(with_mesh((vertices, faces))))
    inside = engine.simulate(bl.Scene.from_dict(with_mesh((vertices, faces[:, ::-1]))))
    assert np.allclose(outside.sample, inside.sample, atol=1e-6)
    assert outside.sample.min() < outside.flat.max()


def test_meshes_may_have_any_strides_and_kinds_of_numbers(engine: bl.Engine) -> None:
    vertices, faces = tetrahedron()
    expected = engine.simulate(bl.Scene.from_dict(with_mesh((vertices, faces)))).sample
    twice = np.repeat(vertices, 2, axis=0)[::2]
    for mesh in (
        (np.asfortranarray(vertices), np.asfortranarray(faces)),
        (twice, faces.astype(np.uint8)),
        (vertices.astype(np.float32), faces.astype(np.int64)),
        (vertices.astype(int), faces.astype(">i4")),
        (vertices.tolist(), faces.tolist()),
    ):
        assert np.array_equal(engine.simulate(bl.Scene.from_dict(with_mesh(mesh))).sample, expected)


def test_meshes_of_arrays_and_of_files_are_alike(
    engine: bl.Engine, scene: bl.Scene, tmp_path: Path
) -> None:
    class Mesh:
        """As trimesh has it."""

        units = "mm"

        def __init__(self) -> None:
            self.vertices, self.faces = tetrahedron()

    of_object = with_mesh(Mesh())
    del of_object["object"][0]["unit"]
    a = bl.Scene.from_dict(of_object)
    run = engine.simulate(a, seed=1)
    b = bl.Scene.load(a.save(tmp_path / "saved"))
    assert np.array_equal(run.sample, engine.simulate(b, seed=1).sample)
    stored = engine.simulate_to(a, tmp_path / "run", seed=1)
    assert np.array_equal(run.sample, stored.sample)
    assert engine.check(a).refusals == []
    # Meshes are no part of what `replace` reads again.
    assert a.replace("object.body.material", "gold").shape == a.shape


def test_scenes_of_files_take_meshes_of_arrays(
    engine: bl.Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    vertices, faces = tetrahedron()
    expected = engine.simulate(bl.Scene.from_dict(with_mesh((2 * vertices, faces))), seed=1).sample
    bl.Scene.from_dict(with_mesh((vertices, faces))).save(tmp_path)
    monkeypatch.chdir(tmp_path)
    text = Path("scene.toml").read_text()
    scaled = (2e-3 * vertices, faces)
    for scene in (bl.Scene.load("scene.toml"), bl.Scene.from_toml(text)):
        # Every change reads the file again, from any working directory.
        monkeypatch.chdir("/")
        unit = scene.replace("object.body.unit", "m")
        large = unit.replace("object.body.mesh", scaled)
        large = large.replace("detector.photons", 1000).replace("detector.photons", 2000)
        for each in (large, pickle.loads(pickle.dumps(large)), copy.deepcopy(large)):
            found = engine.simulate(each, seed=1)
            # Corners that are rounded otherwise may change which lines are chosen: a third of the tolerance.
            assert np.allclose(found.sample, expected, atol=3e-4)
    assert engine.check(large).refusals == []
    assert large.ideal(most_rays=64).transmission.shape == (1, 4, 24)
    assert bl.Scene.load(large.save(tmp_path / "saved")).shape == large.shape
    stored = engine.simulate_to(large, tmp_path / "run", seed=1)
    assert np.allclose(stored.sample, expected, atol=3e-4)


def test_a_mesh_of_arrays_in_two_units_is_two_sizes(engine: bl.Engine, tmp_path: Path) -> None:
    scene = with_mesh(tetrahedron())
    scene["object"].append({**scene["object"][0], "name": "small", "unit": "0.5 mm",
                            "position": ["-1 mm", "0 mm", "0 mm"]})
    both = bl.Scene.from_dict(scene)
    alike = both.replace("object.small.unit", "mm")
    # Meshes stay in memory; run directories have files of them.
    expected = engine.simulate(both, seed=1).sample
    stored = engine.simulate_to(both, tmp_path / "run", seed=1).sample
    assert np.allclose(stored, expected, atol=3e-4)
    assert np.abs(engine.simulate(alike, seed=1).sample - expected).max() > 3e-3


def test_stacks_of_other_shapes_and_types(engine: bl.Engine, scene: bl.Scene) -> None:
    offsets = scene.mask_offsets
    flat, sample = np.ones((5, 4, 24)), np.ones((5, 4, 24))
    for wrong, key in (
        (lambda: bl.retrieve(flat[0], sample, offsets, scene, engine=engine), "flat"),
        (lambda: bl.retrieve(flat > 0, sample, offsets, scene, engine=engine), "flat"),
        (lambda: bl.retrieve(flat, sample[0, 0], offsets, scene, engine=engine), "sample"),
        (lambda: bl.retrieve(flat, sample, ["1"], scene, engine=engine), "offsets"),
        (lambda: bl.retrieve(flat, sample, [[0, 1]], scene, engine=engine), "offsets"),  # type: ignore[list-item]
        (lambda: bl.retrieve(flat[:3], sample, offsets, scene, engine=engine), "flat"),
        (lambda: bl.retrieve(flat + 1j, sample, offsets, scene, engine=engine), "flat"),
        (lambda: bl.retrieve(flat.astype(object), sample, offsets, scene, engine=engine), "flat"),
        (lambda: bl.retrieve(flat, sample[:, :, :20], offsets, scene, engine=engine), "sample"),
        (lambda: bl.retrieve(flat, sample, offsets, scene, dark=flat[:, 1:], engine=engine), "dark"),
        (lambda: bl.retrieve(flat, sample, offsets, scene, bad_pixels=flat[0, 1:], engine=engine),
         "bad_pixels"),
        (lambda: bl.retrieve(flat, sample, offsets, scene, bad_pixels="x.npy", engine=engine), "bad_pixels"),
        (lambda: bl.retrieve(flat, sample / 2, offsets, scene, gain=-1.0, engine=engine), "gain"),
        (lambda: bl.retrieve(flat, sample, offsets, SCENE, engine=engine), "geometry"),  # type: ignore[arg-type]
        (lambda: bl.reconstruct(sample, "scene.toml", engine=engine), "geometry"),  # type: ignore[arg-type]
        (lambda: bl.reconstruct(sample[0], scene, engine=engine), "sinograms"),
        (lambda: bl.reconstruct(sample, scene, engine=engine), "angles"),
        (lambda: bl.reconstruct(sample, scene, "my", engine=engine), "quantity"),  # type: ignore[arg-type]
    ):
        with pytest.raises(bl.ArgumentError) as raised:
            wrong()  # type: ignore[no-untyped-call]
        assert raised.value.key == key, raised.value
    with pytest.raises(bl.FileError, match="sample"):
        bl.retrieve(flat, sample[:3], offsets, scene, engine=engine)


def test_stacks_may_have_any_strides_and_kinds_of_numbers(engine: bl.Engine, scene: bl.Scene) -> None:
    run = engine.simulate(scene)
    # Whole numbers, which every type holds.
    flat, sample = np.rint(1000 * run.flat), np.rint(1000 * run.sample)
    dark, bad = np.ones((4, 24)), np.zeros((4, 24), bool)
    bad[1, 5] = True

    def retrieve(flat: Any, sample: Any, dark: Any, bad: Any) -> bl.Images:
        offsets = scene.mask_offsets
        return bl.retrieve(
            flat, sample, offsets, scene, dark, "moments", bad_pixels=bad, engine=engine
        )

    expected = retrieve(flat, sample, dark, bad)
    assert np.isnan(expected.transmission[0, 1, 5])
    for other in (
        (flat.astype(">u2"), sample.astype(np.uint16), dark.astype(np.uint8), bad.astype(float)),
        (np.asfortranarray(flat), np.asfortranarray(sample), dark[np.newaxis], bad.astype(np.int8)),
        (np.repeat(flat, 2, axis=2)[:, :, ::2], sample[:, ::-1][:, ::-1], dark.T.copy().T, bad),
        (flat.tolist(), sample[0].tolist(), dark.tolist(), bad.tolist()),
    ):
        found = retrieve(*other)
        for name in expected:
            assert np.array_equal(found[name], expected[name], equal_nan=True), name


def test_other_things_than_scenes_and_quantities_are_named(scene: bl.Scene, engine: bl.Engine) -> None:
    run = engine.simulate(scene)
    images = run.retrieve(method="moments")
    for wrong, key in (
        (lambda: engine.simulate(SCENE), "scene"),  # type: ignore[arg-type]
        (lambda: engine.simulate(SCENE, seed=1), "scene"),  # type: ignore[arg-type]
        (lambda: engine.check("scene.toml"), "scene"),  # type: ignore[arg-type]
        (lambda: engine.ideal(run), "scene"),  # type: ignore[arg-type]
        (lambda: bl.spectrum(SCENE), "scene"),  # type: ignore[arg-type]
        (lambda: bl.view(3), "what"),  # type: ignore[arg-type]
        (lambda: bl.view(scene, format="gif"), "format"),  # type: ignore[arg-type]
        (lambda: bl.view(scene, width=0), "width"),
        (lambda: images.sinograms("phase"), "quantity"),  # type: ignore[arg-type]
        (lambda: images.weights("phase"), "quantity"),  # type: ignore[arg-type]
        (lambda: bl.material("water", "30 keV"), "energy"),
        (lambda: bl.material("water", -3.0), "energy"),
        (lambda: bl.material("unobtainium", 30.0), "material"),
    ):
        with pytest.raises(bl.ArgumentError) as raised:
            wrong()  # type: ignore[no-untyped-call]
        assert raised.value.key == key, raised.value
    with pytest.raises(bl.FileError, match="none.toml"):
        bl.view("none.toml")


def test_scenes_and_results_are_pickled_and_copied(
    engine: bl.Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = bl.Scene.from_dict(with_mesh(tetrahedron())).replace("detector.pixels", [8, 2])
    run = engine.simulate(scene, seed=3)
    images = run.retrieve(method="moments")
    for way in (lambda it: pickle.loads(pickle.dumps(it)), copy.deepcopy):
        assert np.array_equal(engine.simulate(way(scene), seed=3).sample, run.sample)
        other = way(run)
        assert np.array_equal(other.sample, run.sample) and other.axes[1].unit == "m"
        assert np.array_equal(way(images).transmission, images.transmission, equal_nan=True)
    scene.save(tmp_path)
    monkeypatch.chdir(tmp_path)
    packed = pickle.dumps(bl.Scene.load("scene.toml"))
    monkeypatch.chdir("/")
    assert pickle.loads(packed).shape == scene.shape
    error = pickle.loads(pickle.dumps(bl.FileError("gone", file="x.npy", remedy="look")))
    assert (str(error), error.file, error.remedy) == ("gone", "x.npy", "look")


def test_options_and_closed_engines(scene: bl.Scene) -> None:
    with pytest.raises(bl.ArgumentError, match="ray-query"):
        bl.Engine(backend="fast")  # type: ignore[arg-type]
    for limit in ("two", -1, 0, 1e9):
        with pytest.raises(bl.ArgumentError, match="GiB"):
            bl.Engine(memory_limit=limit)  # type: ignore[arg-type]
    with pytest.raises(bl.DeviceError) as raised:
        bl.Engine(device="no such device")
    assert raised.value.remedy
    engine = bl.Engine()
    assert engine.device.name and engine.close() and engine.close() and "closed" in repr(engine)
    with pytest.raises(bl.DeviceError, match="closed"):
        engine.simulate(scene)
    with pytest.raises(bl.OutOfMemoryError) as short, bl.Engine(memory_limit="1 MiB") as small:
        small.simulate(scene)
    assert isinstance(short.value, MemoryError) and short.value.remedy


def test_runs_say_what_they_lack(scene: bl.Scene, engine: bl.Engine, tmp_path: Path) -> None:
    run = engine.simulate(scene)
    with pytest.raises(bl.ArgumentError, match="photons"):
        run.retrieve(counts=True)
    with pytest.raises(bl.ArgumentError, match="counts"):
        run.retrieve(weights="poisson")
    with pytest.raises(bl.ArgumentError, match="simulate_to"):
        run.view()
    with pytest.raises(bl.FileError, match=r"run\.json"):
        bl.Run.open(tmp_path)
    with pytest.raises(KeyError, match="transmission"):
        run.retrieve()["phase"]
    engine.simulate_to(scene, tmp_path / "run")
    with pytest.raises(bl.FileError, match="overwrite"):
        engine.simulate_to(scene, tmp_path / "run")
