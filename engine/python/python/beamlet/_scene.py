"""Scenes: from files, from dicts, and with meshes from arrays."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _beamlet
from ._arguments import array
from ._arguments import text as text_of
from ._arguments import path as place
from ._errors import FileError, wrong

if TYPE_CHECKING:
    from ._images import Images

Path = str | os.PathLike[str]
#: Vertices and triangles by the name of the file that stands for them.
Meshes = dict[str, tuple[NDArray[np.float64], NDArray[np.uint32]]]


def _text(value: str) -> str:
    """A text for JSON and TOML."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _toml(value: object) -> str:
    """A plain value of an override as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        items = (f"{_text(str(key))} = {_toml(item)}" for key, item in value.items())
        return "{ " + ", ".join(items) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return repr(value)


def _triangles(mesh: Any, name: str) -> Any:
    """Triangles of a mesh: ``faces``, or those of pyvista."""
    regular = getattr(mesh, "regular_faces", None)
    if regular is not None:
        return regular
    faces = getattr(mesh, "faces", None)
    if faces is None:
        raise wrong(f"{name}.mesh", type(mesh).__name__, "an object with vertices and faces")
    return faces


def arrays_of(
    mesh: Any, name: str = "object"
) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Vertices and triangles of a mesh, checked.

    Args:
        mesh: A pair (vertices, faces) of arrays, or an object with ``vertices`` and ``faces``
            (trimesh) or ``points`` and ``faces`` (pyvista).
        name: Its name in errors.

    Returns:
        Vertices ``(n, 3)`` as float64 and triangles ``(m, 3)`` as uint32.

    Raises:
        ArgumentError: For other shapes or types, indices out of range, or values that are not finite.
    """
    if isinstance(mesh, tuple | list):
        if len(mesh) != 2:
            raise wrong(f"{name}.mesh", f"{len(mesh)} items", "vertices and faces")
        points, faces = mesh
    else:
        points = getattr(mesh, "vertices", None)
        if points is None:
            points = getattr(mesh, "points", None)
        if points is None:
            raise wrong(f"{name}.mesh", type(mesh).__name__, "an object with vertices and faces")
        faces = _triangles(mesh, name)
    vertices = array(f"{name}.vertices", points, "shape (n, 3)")
    triangles = array(f"{name}.faces", faces, "shape (n, 3)")
    for found, what in ((vertices, "vertices"), (triangles, "faces")):
        if found.ndim != 2 or found.shape[1] != 3 or not len(found):
            raise wrong(f"{name}.{what}", f"shape {found.shape}", "shape (n, 3), n above 0")
    if vertices.dtype.kind not in "fiu":
        raise wrong(f"{name}.vertices", f"dtype {vertices.dtype}", "real numbers")
    if triangles.dtype.kind not in "iu":
        raise wrong(f"{name}.faces", f"dtype {triangles.dtype}", "whole numbers")
    if not np.isfinite(vertices).all():
        raise wrong(f"{name}.vertices", "values that are not finite", "finite numbers")
    if triangles.size and not (0 <= triangles.min() and triangles.max() < len(vertices)):
        range_of = f"{triangles.min()} to {triangles.max()}"
        raise wrong(f"{name}.faces", range_of, f"indices from 0 to {len(vertices) - 1}")
    return (
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(triangles, dtype=np.uint32),
    )


def _mesh(mesh: object, label: str, meshes: Meshes) -> str:
    """The file of a mesh; of arrays a name that stands for them in `meshes`."""
    if isinstance(mesh, str | os.PathLike):
        return place(f"{label}.mesh", mesh)
    arrays = arrays_of(mesh, label)
    digest = hashlib.sha256(arrays[0].tobytes() + arrays[1].tobytes()).hexdigest()
    name = f"mesh-{digest[:20]}.ply"
    meshes[name] = arrays
    return name


def _plain(value: object, key: str, meshes: Meshes) -> object:
    """A value for JSON and TOML: text, finite numbers, lists and dicts. Names of files stand for meshes of arrays,
    which are put into `meshes`.

    Args:
        value: The value.
        key: Its key in the scene.
        meshes: Meshes that were found.

    Raises:
        ArgumentError: With the key, for other values.
    """
    if isinstance(value, Mapping):
        inside = f"{key}." if key else ""
        table = {str(name): _plain(item, f"{inside}{name}", meshes)
                 for name, item in value.items() if name != "mesh"}
        if "mesh" in value:
            mesh = value["mesh"]
            label = f"object.{value['name']}" if "name" in value else key
            table["mesh"] = _mesh(mesh, label, meshes)
            if table["mesh"] in meshes:
                unit = table.get("unit") or getattr(mesh, "units", None)
                if unit is None:
                    raise wrong(f"{label}.unit", "nothing", 'the length of 1.0, as unit = "mm"')
                table["unit"] = unit
        return table
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item, f"{key}[{index}]", meshes) for index, item in enumerate(value)]
    if isinstance(value, os.PathLike):
        value = place(key, value)
    if isinstance(value, str):
        if any("\ud800" <= letter <= "\udfff" for letter in value):
            raise wrong(key, ascii(value), "text of Unicode")
        return value
    if isinstance(value, float) and not math.isfinite(value):
        raise wrong(key, repr(value), "a finite number")
    if value is None or isinstance(value, bool | int | float):
        return value
    raise wrong(key, type(value).__name__, "numbers, text, lists and dicts")


def toml(key: str, value: object, meshes: Meshes) -> str:
    """The value of an override as TOML; meshes of arrays are put into `meshes`.

    Raises:
        ArgumentError: With the key, for a value that no scene has.
    """
    if value is None:
        raise wrong(key, "None", "text with a unit, a number, a list or a dict")
    if key.rpartition(".")[2] == "mesh":
        return _toml(_mesh(value, key.rpartition(".")[0], meshes))
    return _toml(_plain(value, key, meshes))


class Scene:
    """What is simulated: source, masks, detector, materials, objects and scan.

    Keys and units are those of scene files (docs/scene.md). Quantities are text with a unit, as
    ``"20 um"``; numbers are used where scene files have numbers. Scenes can be pickled and copied; a
    scene of a file is read again from it.

    Args:
        sections: Sections of a scene by name: ``source={...}, detector={...}, object=[{...}]``
            (``objects`` is the same as ``object``). An object's ``mesh`` is a file, a pair
            (vertices, faces) of arrays, or an object with these attributes (trimesh, pyvista); its
            ``unit`` is the length of 1.0 in it.

    Raises:
        SceneError: With key, what was found and what is allowed.

    Example:
        >>> scene = Scene(
        ...     source={"distance": "1.2 m", "spot": "30 um", "energy": "30 keV"},
        ...     detector={"distance": "1.8 m", "pixels": [8, 2], "pitch": "150 um"},
        ...     object=[{"name": "rod", "material": "nylon 6",
        ...              "shape": {"cylinder": {"radius": "0.2 mm", "height": "9 mm"}}}],
        ... )
        >>> scene.shape
        (1, 1, 2, 8)
        >>> scene.replace("detector.pixels", [16, 2]).shape
        (1, 1, 2, 16)
    """

    def __init__(self, **sections: Any) -> None:
        if "objects" in sections:
            sections["object"] = sections.pop("objects")
        meshes: Meshes = {}
        table = _plain(sections, "", meshes)
        written = json.dumps(table, indent=1, ensure_ascii=False)
        self._text: tuple[str, bool, str] | None = (written, True, os.getcwd())
        self._path: str | None = None
        self._meshes = meshes
        self._read(())

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_scene"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._read(self._sets)

    def _read(self, sets: tuple[str, ...]) -> None:
        self._sets = sets
        if self._text is None:
            assert self._path is not None
            self._scene = _beamlet.Scene.load(self._path, list(sets), self._meshes)
        else:
            written, is_json, directory = self._text
            self._scene = _beamlet.Scene.parse(
                written, is_json, directory, list(sets), self._meshes
            )

    @classmethod
    def load(cls, path: Path, **changes: Any) -> Scene:
        """Loads a scene file, TOML or JSON.

        Args:
            path: The file.
            changes: As of :meth:`replace`, with ``__`` for dots: ``detector__photons=20000``.

        Raises:
            FileError: The file cannot be read.
            SceneError: With file, line, key, what was found and what is allowed.
        """
        self = cls.__new__(cls)
        self._text, self._path, self._meshes = None, os.path.abspath(place("path", path)), {}
        named = ((key.replace("__", "."), value) for key, value in changes.items())
        self._read(tuple(f"{key}={toml(key, value, self._meshes)}" for key, value in named))
        return self

    def _with(self, sets: Iterable[str], meshes: Meshes) -> Scene:
        """The same scene with more overrides ``key=value``, and with these meshes of arrays."""
        other = Scene.__new__(Scene)
        other._text, other._path, other._meshes = self._text, self._path, meshes
        other._read((*self._sets, *sets))
        return other

    @classmethod
    def from_dict(cls, scene: Mapping[str, Any]) -> Scene:
        """The scene of a dict with the sections of a scene file.

        Raises:
            SceneError: As of the constructor; unknown keys are errors.
        """
        if not isinstance(scene, Mapping):
            raise wrong("scene", type(scene).__name__, "a dict with the sections of a scene file")
        return cls(**{str(key): value for key, value in scene.items()})

    @classmethod
    def from_toml(cls, text: str, directory: Path = ".") -> Scene:
        """The scene of TOML text; relative paths in it start from `directory`.

        Raises:
            SceneError: With line, key, what was found and what is allowed.
        """
        self = cls.__new__(cls)
        place_of_files = os.path.abspath(place("directory", directory))
        self._text = (text_of("text", text, "TOML"), False, place_of_files)
        self._path, self._meshes = None, {}
        self._read(())
        return self

    def replace(self, key: str, value: Any) -> Scene:
        """The same scene with another value of a key.

        Args:
            key: Path of the key: ``detector_mask.projected_aperture``, ``object.rod.material``,
                ``object[0].material``.
            value: Text with a unit, number, list or dict, as the scene file has it; for ``object.NAME.mesh``
                also arrays, in the unit of the object.

        Raises:
            SceneError: There is no such key, or the value is not possible.
        """
        name, meshes = text_of("key", key, "the path of a key"), dict(self._meshes)
        return self._with([f"{name}={toml(name, value, meshes)}"], meshes)

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Views, mask steps, rows and columns of its stacks."""
        columns, rows = self._scene.pixels
        return (len(self._scene.angles), len(self._scene.mask_offsets), rows, columns)

    @property
    def title(self) -> str | None:
        """Title of the scene."""
        return self._scene.title

    @property
    def mask_offsets(self) -> NDArray[np.float64]:
        """Mask offsets of the steps, m."""
        return np.array(self._scene.mask_offsets)

    @property
    def mask_offsets_z(self) -> NDArray[np.float64]:
        """Mask offsets of the steps along z, m; empty where the mask does not move along z."""
        return np.array(self._scene.mask_offsets_z)

    @property
    def angles(self) -> NDArray[np.float64]:
        """Angles of the views, rad."""
        return np.array(self._scene.angles)

    @property
    def geometry(self) -> dict[str, Any]:
        """Angles, distances, and places of columns and rows: the keys of ``geometry.json``
        (docs/reading.md)."""
        geometry: dict[str, Any] = json.loads(self._scene.geometry)
        return geometry

    def save(self, directory: Path) -> str:
        """Writes the resolved scene, with every default, as ``scene.toml``, and its meshes of arrays.

        Returns:
            The path of the file.

        Raises:
            FileError: It cannot be written.
        """
        directory = place("directory", directory)
        path = os.path.join(directory, "scene.toml")
        try:
            os.makedirs(directory, exist_ok=True)
            written = self._scene.to_toml(os.path.abspath(directory))
            with open(path, "w", encoding="utf-8") as file:
                file.write(written)
        except OSError as error:
            if isinstance(error, FileError):
                raise
            raise FileError(f"{path}: cannot be written: {error.strerror}", file=path) from error
        return path

    def ideal(self, **options: Any) -> Images:
        """Ideal images, by the shared engine. See :meth:`beamlet.Engine.ideal`."""
        from ._engine import default_engine

        return default_engine().ideal(self, **options)

    def view(self, width: int | None = None) -> list[Any]:
        """Pictures of set-up and sample, which Jupyter shows. See :func:`beamlet.view`."""
        from ._view import view

        return view(self, width=width)

    def _repr_png_(self) -> bytes | None:
        pictures = self.view()
        return pictures[0]._repr_png_() if pictures else None

    def __repr__(self) -> str:
        views, steps, rows, columns = self.shape
        title = f"{self.title!r}, " if self.title else ""
        return f"<Scene {title}{views} views x {steps} steps of {columns} x {rows} pixels>"


def inner(scene: Scene, name: str = "scene") -> _beamlet.Scene:
    """The scene as the extension takes it.

    Raises:
        ArgumentError: Something else than a scene.
    """
    if not isinstance(scene, Scene):
        raise wrong(name, type(scene).__name__, "a Scene, as of Scene.load or Scene.from_dict")
    return scene._scene


def Object(*, mesh: Any = None, material: str, **keys: Any) -> dict[str, Any]:
    """An object of a scene, as a dict of its keys (docs/scene.md, ``[[object]]``).

    Args:
        mesh: File, (vertices, faces), or an object of trimesh or pyvista; ``shape=...`` in its place.
        material: Name of its material.
        keys: Other keys: ``name``, ``unit``, ``position``, ``rotate``, ...
    """
    table = {"material": material, **keys}
    if mesh is not None:
        table["mesh"] = mesh
    table.setdefault("name", "object")
    return table
