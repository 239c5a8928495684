"""Volumes from sinograms, and the geometry and voxels that they take."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._arguments import array, floats, number, word
from ._engine import Engine, Progress, serving
from ._errors import wrong
from ._options import described
from ._scene import Scene, inner

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._keywords import ReconstructKeywords

Quantity = Literal["mu", "delta", "dark_field"]


#: Line of a table: text, or numbers where a column has them; ``None`` where a cell is empty.
Line = dict[str, str | float | None]


def _table(written: str) -> tuple[Line, ...]:
    """Lines of a table in CSV."""

    def cell(value: str) -> str | float | None:
        try:
            return float(value) if value else None
        except ValueError:
            return value

    lines = csv.DictReader(written.splitlines())
    return tuple({key: cell(value) for key, value in line.items()} for line in lines)


@dataclass(frozen=True, eq=False)
class Truth:
    """The scene on the voxels of a volume.

    Attributes:
        labels: uint16 ``[z][y][x]``: 0 in the surroundings, 1 and up the objects in the order of the scene.
        names: Object and material of each label.
        values: True values of the volume, float32 ``[z][y][x]``; ``None`` for the dark field.
        errors: Errors of the volume by object: a line with ``object``, ``truth``, ``mean``,
            ``error_percent``, ... for each object with inner voxels.
    """

    labels: NDArray[np.uint16]
    names: Mapping[int, str]
    values: NDArray[np.float32] | None
    errors: tuple[Line, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Volume:
    """A reconstructed volume.

    Attributes:
        values: float32 ``[z][y][x]``, all ascending.
        voxel: Sides of a voxel along x, y and z, m.
        origin: Centre of the first voxel, x, y and z, m; the axis of rotation is at x = y = 0.
        quantity: What the values are.
        unit: Their unit.
        residuals: Of iterative methods: root mean square of the weighted residuals of the start, then
            after each iteration.
        best: Number of the iterate that the values are, the one of the least residual.
        pixels: Pixels of the images: how many had no answer, no light or were misfits and were filled;
            ``None`` for sinograms.
        truth: The scene on the voxels; ``None`` without.
        axis: x of the axis of rotation from the optical axis, m.
        energy: Energy of ``mu`` after the correction of beam hardening, keV; ``None`` without.
        bias: Length k of δ + kμ after the correction for gradients of the attenuation, m; ``None``
            without.
        lost_views: Numbers of the views that lost their refraction, as at flat faces along the beam; without
            ``keep_views`` they have no weight in ``delta``.
    """

    values: NDArray[np.float32]
    voxel: tuple[float, float, float]
    origin: tuple[float, float, float]
    quantity: str
    unit: str
    residuals: tuple[float, ...] = ()
    best: int = 0
    pixels: Mapping[str, int] | None = None
    truth: Truth | None = None
    axis: float = 0.0
    energy: float | None = None
    bias: float | None = None
    lost_views: tuple[int, ...] = ()

    def centres(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Centres of the voxels along x, y and z, m."""
        deep, across, along = self.values.shape
        x, y, z = (
            start + side * np.arange(count)
            for start, side, count in zip(
                self.origin, self.voxel, (along, across, deep), strict=True
            )
        )
        return x, y, z

    def __repr__(self) -> str:
        deep, across, along = self.values.shape
        sides = " x ".join(f"{1e6 * side:.4g}" for side in self.voxel)
        return (
            f"<Volume {self.quantity} ({self.unit}) of {along} x {across} x {deep} voxels"
            f" of {sides} µm along x, y, z>"
        )


def circle(geometry: Scene | Mapping[str, Any], axis: float | None = None) -> dict[str, Any]:
    """Geometry of a scan on a circle, as the extension takes it.

    Args:
        geometry: Scene, or a dict with the keys of ``geometry.json``.
        axis: x of the axis of rotation from the optical axis, m; default: the geometry's.

    Raises:
        ArgumentError: A key that lacks, or views that are no circle.
    """
    views = geometry.geometry if isinstance(geometry, Scene) else geometry
    if not isinstance(views, Mapping):
        raise wrong("geometry", type(views).__name__, "a Scene, or a dict with the keys of geometry.json")
    for key in ("source_to_axis_m", "source_to_detector_m", "columns_m", "rows_m", "angles_rad"):
        if views.get(key) is None:
            raise wrong(f"geometry.{key}", "nothing", "the keys of geometry.json")
    if views.get("sample_motions") is not None or (axis is None and views.get("axis_column") is None):
        raise wrong("scan", "views that move the sample", "views on a circle")
    columns = floats("geometry.columns_m", views["columns_m"])
    near, far = (number(f"geometry.{key}", views[key]) for key in ("source_to_axis_m", "source_to_detector_m"))
    if axis is None:
        pitch = (columns[-1] - columns[0]) / max(len(columns) - 1, 1)
        at = columns[0] + pitch * number("geometry.axis_column", views["axis_column"])
        # Beside the optical axis; on it places of columns are rounded.
        axis = 0.0 if abs(at) < 1e-6 * pitch else at if np.isinf(near) else at * near / far
    analyser = views.get("source_to_analyser_m")
    return {
        "distances": [near, far],
        "columns": columns,
        "rows": floats("geometry.rows_m", views["rows_m"]),
        "angles": floats("geometry.angles_rad", views["angles_rad"]),
        "axis": number("axis", axis, "a length, m"),
        "lever": None if analyser is None else number("geometry.source_to_analyser_m", analyser) - near,
    }


def cube(name: str, values: ArrayLike, sides: str) -> NDArray[np.float32]:
    """Values as contiguous float32 of three sides."""
    found = array(name, values, sides)
    if found.ndim != 3 or found.dtype.kind not in "fiu":
        raise wrong(name, f"shape {found.shape}, dtype {found.dtype}", sides)
    return np.ascontiguousarray(found, dtype=np.float32)


@described("reconstruct")
def reconstruct(
    sinograms: ArrayLike,
    geometry: Scene | Mapping[str, Any],
    quantity: Quantity = "mu",
    *,
    axis: float | None = None,
    engine: Engine | None = None,
    progress: Progress | None = None,
    weights: ArrayLike | None = None,
    attenuation: ArrayLike | None = None,
    scene: Scene | None = None,
    **options: Unpack[ReconstructKeywords],
) -> Volume:
    """Reconstructs sinograms: docs/reconstruction.md has methods and options.

    Args:
        sinograms: ``[view][row][column]``: -ln T, refraction angles (rad), or variances (rad²).
        geometry: Scene, or a dict with the keys of ``geometry.json`` (docs/reading.md).
        quantity: What is reconstructed: ``mu``, ``delta`` or ``dark_field``.
        axis: x of the axis of rotation from the optical axis, m; default: the geometry's.
        engine: Engine; default: the shared one.
        progress: Callback.
        weights: Weight of each value in iterative methods, 0 or more, ``[view][row][column]``.
        attenuation: For ``delta``: -ln T of the same pixels, ``[view][row][column]``. Rows in which a body reaches
            an end are not searched for lost refraction.
        scene: Scene for `beam_hardening` and `truth`; default: `geometry`, where it is one.

    Raises:
        ArgumentError: Shapes, values, options or a geometry that cannot be.
    """
    of = Sinograms(sinograms, quantity, geometry, axis, scene, weights, attenuation)
    return volume_of(of, options, engine, progress)


@dataclass(frozen=True, eq=False)
class Sinograms:
    """Sinograms as :func:`reconstruct` has them, and to correct ``delta`` for gradients of the attenuation the volume
    ``mu`` and ``flat_width`` (m)."""

    values: ArrayLike
    quantity: Quantity
    geometry: Scene | Mapping[str, Any]
    axis: float | None
    scene: Scene | None
    weights: ArrayLike | None
    attenuation: ArrayLike | None
    mu: NDArray[np.float32] | None = None
    flat_width: float | None = None


def volume_of(
    of: Sinograms, options: Mapping[str, Any], engine: Engine | None, progress: Progress | None
) -> Volume:
    """The volume of :func:`reconstruct`."""
    chosen = dict(options)
    if of.axis is not None and chosen.get("centre") is not None:
        raise wrong("centre", "centre and axis", "one of them")
    sides = "(view, row, column)"
    values = cube("sinograms", of.values, sides)
    given: dict[str, Any] = {"mask": None, "start": None, "mu": of.mu, "flat_width": of.flat_width}
    for name, array_of in (("weights", of.weights), ("attenuation", of.attenuation)):
        given[name] = None if array_of is None else cube(name, array_of, sides)
    if chosen.get("start") is not None:
        chosen["start"] = given["start"] = cube("start", chosen["start"], "(z, y, x)")
    if not isinstance(chosen.get("mask"), str | None):
        chosen["mask"] = given["mask"] = _mask(chosen["mask"])
    scene = of.geometry if of.scene is None and isinstance(of.geometry, Scene) else of.scene
    found = _beamlet.reconstruct(
        serving(engine)._engine,
        circle(of.geometry, of.axis),
        values,
        word("quantity", of.quantity, Quantity),
        chosen,
        given,
        None if scene is None else inner(scene),
        progress,
    )
    return _volume(of.quantity, found)


def _mask(mask: ArrayLike) -> NDArray[np.bool_]:
    """A mask of voxels."""
    may = array("mask", mask, "bool, (z, y, x), or a shape")
    if may.ndim != 3 or may.dtype != np.bool_:
        raise wrong("mask", f"shape {may.shape}, dtype {may.dtype}", "bool, (z, y, x), or a shape")
    return np.ascontiguousarray(may)


def _volume(quantity: str, found: Mapping[str, Any]) -> Volume:
    """A volume as the extension gives it."""
    truth = found["truth"]
    if truth is not None:
        labels, names, values, errors = truth
        truth = Truth(labels, names, values, _table(errors))
    return Volume(
        found["values"],
        tuple(found["voxel"]),
        tuple(found["origin"]),
        quantity,
        found["unit"],
        tuple(found["residuals"]),
        found["best"],
        truth=truth,
        axis=found["axis"],
        energy=found["energy"],
        bias=found["bias"],
        lost_views=tuple(found["lost_views"]),
    )
