"""Arguments of other kinds: each error is beamlet's own and names the argument; what can be taken is taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENE
from test_errors import changed, tetrahedron, with_mesh

import beamlet as bl
from beamlet import convert

TURNS = {"from": "0 deg", "to": "360 deg", "count": 6}


@pytest.fixture(scope="module")
def scan(engine: bl.Engine) -> bl.Run:
    return engine.simulate(bl.Scene.from_dict(SCENE).replace("scan.angles", TURNS))


@pytest.fixture(scope="module")
def images(scan: bl.Run) -> bl.Images:
    return scan.retrieve(method="moments")


def names(key: str, *calls: Callable[[], Any]) -> None:
    """Each call raises an ArgumentError with this key."""
    for number, call in enumerate(calls):
        with pytest.raises(bl.ArgumentError) as raised:
            call()
        error = raised.value
        assert error.key == key and error.found and error.allowed, (number, error)
        assert len(str(error)) < 400, error


def test_options_of_reconstructions_name_themselves(images: bl.Images) -> None:
    def with_option(**options: Any) -> Callable[[], Any]:
        return lambda: images.reconstruct(**{"method": "cgls", **options})

    for key, values in {
        "iterations": (0, -3, 1.7, "9", None, True, 1 << 70),
        "discrepancy": ("1", float("nan"), [1.0, 2.0], 1j),
        "method": (None, 3, "fast"),
        "size": (5, [1.5, 2, 3], [0, 1, 1], [1, 1, 1 << 70], "abc"),
        "voxel": ([1, 2, 3], float("nan"), 0, -1.0, "9"),
        "origin": ("1 mm", 3, ["1 mm"]),
        "weights": (3, "poisson", np.ones((6, 4, 24)) > 0),
        "gradient_bias": (3, "mu"),
        "beam_hardening": ("", "@40keV", "water@40", "water@x", 3, "resin"),
        "centre": ("middle", float("nan"), [3.0]),
        "mask": (np.ones((4, 24, 24)), 3, "sphere:9 m,0 m,0 m,1 mm"),
        "engine": ("gpu", 0, object()),
    }.items():
        names(key, *(with_option(**{key: value}) for value in values))
    for key, values in {
        "cut_off": ("x", float("nan"), 5),
        "arm_passes": (-1, 0.5),
        "filter": (None, "hamming"),
        "phase": (True,),
    }.items():
        names(key, *(with_option(**{"method": "fbp", key: value}) for value in values))
    names("quantity", with_option(quantity=None), with_option(quantity=["mu"]))
    ragged: Any = [[[1.0, 2.0], [3.0]]]
    names("sinograms", lambda: bl.reconstruct(ragged, images.geometry or {}))
    assert images.reconstruct(method="cgls", iterations=np.int64(2)).values.any()  # type: ignore[arg-type]


def test_geometries_name_their_keys(scan: bl.Run) -> None:
    geometry, sinograms = scan.scene.geometry, np.zeros((6, 4, 24))
    for key, values in {
        "columns_m": ("abc", [], [[1.0]], 3),
        "rows_m": ([], "x"),
        "angles_rad": ([], ["a"]),
        "source_to_axis_m": ("1 m", [1.0, 2.0]),
        "axis_column": ("middle",),
    }.items():
        for value in values:
            other = {**geometry, key: value}
            names(f"geometry.{key}", lambda other=other: bl.reconstruct(sinograms, other))
    axis: Any = "1 mm"
    names("axis", lambda: bl.reconstruct(sinograms, geometry, axis=axis))
    # A place of the axis makes no circle of views that move the sample.
    moved = scan.scene.replace("scan.travel", ["0 mm", "0 mm", "1 mm"]).geometry
    names("scan", lambda: bl.reconstruct(sinograms, moved), lambda: bl.reconstruct(sinograms, moved, axis=0.0))


def test_options_of_retrievals_name_themselves(scan: bl.Run, scene: bl.Scene) -> None:
    flat, sample, offsets = scan.flat, scan.sample, scene.mask_offsets

    def with_option(**options: Any) -> Callable[[], Any]:
        given = {"flat": flat, "sample": sample, "offsets": offsets, "geometry": scene, **options}
        return lambda: bl.retrieve(**given)

    masked = np.ma.masked_array(flat, mask=flat > np.median(flat))
    for key, values in {
        "flat": (None, 1.0, flat[:, :0], masked, [[[1.0], [1.0, 2.0]]], flat.astype(str)),
        "sample": (sample[:0], sample[None], sample[..., :0]),
        "offsets": (5, "20 um", [None] * 5, [np.nan] * 5, ["1"] * 5),
        "method": (3, "fast"),
        "lattice": (3, "40", "40 um", "40 um, 0 um; 80 um, 0 um"),
        "aperture": (3, "40"),
        "detector_aperture": (3, "40"),
        "offsets_z": (5, "20 um", [None] * 5, [np.nan] * 5),
        "weights": (None, "all"),
        "gain": ("x", float("nan"), [1, 2]),
        "read_noise": (-1, "x", float("nan")),
        "saturation": ("x", float("nan")),
        "bad_pixels": (np.ones((4, 24)), [[1], [1, 2]]),
        "flats_every": (0, 1.5, "2"),
        "columns": ("1::2", 3, slice(-1, None), slice(0, 4, 0), slice(0, 99)),
        "bin": (2, (0, 1), (2, 1, 1), (25, 1)),
        "empty_beam": (3, "0:2", (2, 2), (0, 99), ((0, 2), 3), ((0, 2), (0, 9))),
        "correct": ("drift", ["offset", "drift"], 3),
        "engine": (scene,),
    }.items():
        names(key, *(with_option(**{key: value}) for value in values))


def test_other_calls_name_their_arguments(
    scan: bl.Run, images: bl.Images, engine: bl.Engine, scene: bl.Scene, tmp_path: Path
) -> None:
    simulated: Any = engine
    for key, calls in {
        "most_rays": [lambda value=value: simulated.ideal(scene, most_rays=value) for value in (-1, 10.5, "x")],
        "tolerance": [lambda value=value: simulated.ideal(scene, tolerance=value) for value in (0, "x", None)],
        "reach": [lambda value=value: simulated.ideal(scene, reach=value) for value in ("3 m", [1], np.nan)],
        "path": [lambda: simulated.simulate_to(scene, None), lambda: bl.Run.open(3), lambda: bl.Images.open(b"x"),
                 lambda: bl.Scene.load(None), lambda: convert.to_cil(images, None)],
        "format": [lambda: simulated.simulate_to(scene, tmp_path / "a", format="gif")],
        "scenes": [lambda: simulated.simulate_many(scene), lambda: bl.simulate_many(3)],
        "seeds": [lambda: simulated.simulate_many([scene], 3)],
        "backend": [lambda: bl.Engine(backend=3)],
        "memory_limit": [lambda: bl.Engine(memory_limit="-3 GiB"), lambda: bl.Engine(memory_limit=True)],
        "images": [lambda: convert.to_cil(scan, tmp_path / "a"), lambda: convert.to_dxchange(None, tmp_path / "a"),
                   lambda: convert.to_astra({})],
        "contrast": [lambda: convert.to_cil(images, tmp_path / "a", None)],
        "width": [lambda: bl.view(scene, width="x"), lambda: bl.view(scene, width=0.5)],
        "options": [lambda: bl.view(scene, options="--foo"), lambda: bl.view(scene, options=(3,))],
        "a": [lambda: bl.compare(scan, "b"), lambda: bl.compare(3, "b")],
        "name": [lambda: bl.material(None, 30.0)],
        "energy": [lambda: bl.material("water", None), lambda: bl.material("water", [[1.0], [1.0, 2.0]])],
        "density": [lambda: bl.material("C", 30.0, density="2 g/cm3"), lambda: bl.material("C", 30.0, density=-1)],
        "data": [lambda: bl.Projector(scan.scene, None)],
        "text": [lambda: bl.Scene.from_toml(b"")],
        "scene": [lambda: bl.Scene.from_dict(None), lambda: bl.Scene.from_dict([1])],
        "key": [lambda: scene.replace(3, 3)],
    }.items():  # type: ignore[arg-type]
        names(key, *calls)
    assert not list(tmp_path.iterdir())


def test_values_of_scenes_that_are_no_text_or_number_name_their_key() -> None:
    for value in (np.nan, np.inf, {1}, b"30 um", 1 + 2j, "\ud800"):
        names("source.spot", lambda value=value: bl.Scene.from_dict(changed("source", "spot", value)))
        scene = bl.Scene.from_dict(SCENE)
        names("source.spot", lambda value=value, scene=scene: scene.replace("source.spot", value))
    names("detector.pixels[1]", lambda: bl.Scene.from_dict(changed("detector", "pixels", [4, np.nan])))
    names("object[0].colour.red", lambda: bl.Scene.from_dict(changed("object", "colour", {"red": 1j})))
    assert bl.Scene.from_dict(SCENE).replace("title", "a😀é").title == "a😀é"


def test_meshes_that_are_empty_ragged_or_masked_are_refused() -> None:
    vertices, faces = tetrahedron()
    masked = np.ma.masked_array(vertices, mask=vertices > 0)
    for mesh in ((vertices[:0], faces[:0]), (masked, faces), ([[0, 0, 0], [1, 0]], faces), ([], [])):
        names("object.body.vertices", lambda mesh=mesh: bl.Scene.from_dict(with_mesh(mesh)))
    names("object.body.faces", lambda: bl.Scene.from_dict(with_mesh((vertices, faces[:0]))))
    # Without a value under the mask it is an array like others.
    whole = np.ma.masked_array(vertices, mask=False)
    assert bl.Scene.from_dict(with_mesh((whole, faces))).shape == (1, 5, 4, 24)


def test_a_mesh_of_arrays_takes_the_place_of_another(engine: bl.Engine) -> None:
    vertices, faces = tetrahedron()
    small = bl.Scene.from_dict(with_mesh((vertices, faces)))
    large = small.replace("object.body.mesh", (2 * vertices, faces))
    expected = bl.Scene.from_dict(with_mesh((2 * vertices, faces)))
    simulated = engine.simulate(large).sample
    assert np.array_equal(simulated, engine.simulate(expected).sample)
    assert not np.array_equal(simulated, engine.simulate(small).sample)
    body = bl.Object(name="body", mesh=(2 * vertices, faces), unit="mm", material="resin")
    assert np.array_equal(engine.simulate(small.replace("object", [body])).sample, simulated)
    names("object.body.faces", lambda: small.replace("object.body.mesh", (vertices, faces + 9)))


def test_errors_of_meshes_of_arrays_name_no_temporary_file(engine: bl.Engine) -> None:
    vertices, faces = tetrahedron()
    hole = bl.Scene.from_dict(with_mesh((vertices, faces[:3])))
    with bl.Engine() as plain:
        for each in (engine, plain):
            with pytest.raises(bl.MeshError) as raised:
                each.simulate(hole)
            assert raised.value.key == '"body"' and ".ply" not in str(raised.value)


def test_a_failing_scene_ends_many_and_the_engine_serves_on(engine: bl.Engine, scene: bl.Scene) -> None:
    vertices, faces = tetrahedron()
    hole = bl.Scene.from_dict(with_mesh((vertices, faces[:3])))
    found = []
    with pytest.raises(bl.MeshError):
        for run in engine.simulate_many([scene, hole, scene]):
            found.append(run)
    assert len(found) == 1
    assert np.array_equal(next(engine.simulate_many([scene])).sample, found[0].sample)

    def broken() -> Iterator[bl.Scene]:
        yield scene
        raise LookupError("no more")

    runs = engine.simulate_many(broken())
    assert next(runs).sample.size
    with pytest.raises(LookupError, match="no more"):
        next(runs)
    # Too few seeds do not end the scenes without a word; endless ones serve.
    few = engine.simulate_many([scene] * 3, seeds=[1])
    next(few)
    names("seeds", lambda: next(few))
    assert len(list(engine.simulate_many([scene] * 2, seeds=iter(range(99))))) == 2


def test_runs_outlive_their_engine_and_their_folder(scene: bl.Scene, tmp_path: Path) -> None:
    with bl.Engine() as short:
        run = short.simulate(scene)
        stored = short.simulate_to(scene, tmp_path / "run")
    assert short.closed and run.engine is bl.default_engine()
    images = run.retrieve(method="moments")
    for path in sorted((tmp_path / "run").rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    # Mapped values are there; what needs the folder says that it is gone.
    assert np.array_equal(stored.retrieve(method="moments").transmission, images.transmission, equal_nan=True)
    with pytest.raises(bl.FileError, match="run"):
        bl.Run.open(tmp_path / "run")
    scans = scene.replace("scan.angles", TURNS)
    with bl.Engine() as other:
        taken = other.simulate(scans).retrieve(method="moments")
    assert taken.reconstruct().values.any()


def test_places_that_cannot_be_written_are_file_errors(scene: bl.Scene, tmp_path: Path) -> None:
    taken = tmp_path / "file"
    taken.write_text("")
    for call in (
        lambda: scene.save(taken),
        lambda: scene.save(taken / "below"),
        lambda: bl.Picture("a.png", b"").save(tmp_path / "none" / "a.png"),
    ):
        with pytest.raises(bl.FileError) as raised:
            call()  # type: ignore[no-untyped-call]
        assert str(tmp_path) in str(raised.value)


def test_doubts_of_a_retrieval_are_shown(engine: bl.Engine, scene: bl.Scene) -> None:
    run = engine.simulate(scene)
    narrow = bl.retrieve(run.flat[:, :, :20], run.sample[..., :20], scene.mask_offsets, scene, engine=engine)
    assert any("24 x 4 pixels" in warning for warning in narrow.warnings), narrow.warnings
    assert "warning" in repr(narrow) and "warning" not in repr(run.retrieve(method="exact-curve"))
