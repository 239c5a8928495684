"""Volumes from sinograms, and the geometry and voxels that they take."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._arguments import array, floats, number, shown, whole, whole_number, word
from ._engine import Engine, Progress, serving
from ._errors import wrong
from ._scene import Scene

Quantity = Literal["mu", "delta", "dark_field"]
Window = Literal["ram-lak", "shepp-logan", "hann"]
Reconstruction = Literal["fbp", "cgls", "sirt", "bb"]


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


def lengths(name: str, values: Sequence[str | float] | NDArray[np.floating[Any]]) -> list[float]:
    """Lengths in m from numbers in m or text with units."""
    allowed = 'numbers in m, or text with a unit as "20 um"'
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise wrong(name, shown(values), f"a list: {allowed}")
    found = []
    for value in values:
        if isinstance(value, str):
            found += _beamlet.lengths(name, [value])
        else:
            found.append(number(name, value, allowed))
    return found


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
    if axis is None and views.get("axis_column") is None:
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


def grid(
    voxel: str | float | None,
    size: Sequence[int] | None,
    origin: Sequence[str | float] | None,
) -> dict[str, Any]:
    """Voxels, as the extension takes them."""
    sides = "three whole numbers of 1 or more, along x, y and z"
    side = None if voxel is None else lengths("voxel", [voxel])[0]
    if side is not None and not 0 < side < np.inf:
        raise wrong("voxel", f"{side} m", "a length above 0")
    corner = None if origin is None else lengths("origin", origin)
    if corner is not None and len(corner) != 3:
        raise wrong("origin", f"{len(corner)} lengths", "three, along x, y and z")
    return {
        "voxel": side,
        "size": None if size is None else whole("size", size, 3, sides, least=1),
        "origin": corner,
    }


def cube(name: str, values: ArrayLike, sides: str) -> NDArray[np.float32]:
    """Values as contiguous float32 of three sides."""
    found = array(name, values, sides)
    if found.ndim != 3 or found.dtype.kind not in "fiu":
        raise wrong(name, f"shape {found.shape}, dtype {found.dtype}", sides)
    return np.ascontiguousarray(found, dtype=np.float32)


def reconstruct(
    sinograms: ArrayLike,
    geometry: Scene | Mapping[str, Any],
    quantity: Quantity = "mu",
    voxel: str | float | None = None,
    size: Sequence[int] | None = None,
    axis: float | None = None,
    filter: Window = "ram-lak",
    cut_off: float = 1.0,
    engine: Engine | None = None,
    progress: Progress | None = None,
    *,
    method: Reconstruction = "fbp",
    origin: Sequence[str | float] | None = None,
    arm_passes: int | None = None,
    extrapolate: bool = False,
    iterations: int = 20,
    discrepancy: float | None = None,
    non_negative: bool = False,
    phase: bool = False,
    weights: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    start: ArrayLike | None = None,
    keep_views: bool = False,
    attenuation: ArrayLike | None = None,
) -> Volume:
    """Reconstructs sinograms: docs/reconstruction.md has methods and options.

    Args:
        sinograms: ``[view][row][column]``: -ln T, refraction angles (rad), or variances (rad²).
        geometry: Scene, or a dict with the keys of ``geometry.json`` (docs/reading.md).
        quantity: What is reconstructed: ``mu``, ``delta`` or ``dark_field``.
        voxel: Side of the voxels, as ``"50 um"`` or in m; default: a pixel at the axis.
        size: Voxels along x, y and z; default: the field of view.
        axis: x of the axis of rotation from the optical axis, m; default: the geometry's.
        filter: Window of the filter, for ``fbp``.
        cut_off: Frequency from which on nothing counts, as a share of Nyquist's, for ``fbp``.
        engine: Engine; default: the shared one.
        progress: Callback.
        method: ``fbp``, filtered back-projection; or weighted least squares by ``cgls`` (conjugate
            gradients), ``sirt`` or ``bb`` (gradient descent with Barzilai-Borwein steps).
        origin: Centre of the first voxel, x, y and z; default: the volume lies about the axis.
        arm_passes: Corrections of ``fbp`` for lever arms; default: one for scans of less than a turn.
        extrapolate: ``fbp`` of ``mu`` and ``dark_field`` continues rows of bodies wider than the detector.
        iterations: Most iterations.
        discrepancy: Root mean square of the weighted residuals at which iterations end.
        non_negative: Voxels stay at or above zero (``sirt``, ``bb``).
        phase: ``delta`` from refraction angles integrated along the rows, which begin and end in air.
        weights: Weight of each value in iterative methods, 0 or more, ``[view][row][column]``.
        mask: True where voxels may differ from zero, ``[z][y][x]``.
        start: Volume to begin with, ``[z][y][x]``.
        keep_views: Views that lost their refraction keep their weight in ``delta``.
        attenuation: For ``delta``: -ln T of the same pixels, ``[view][row][column]``. Rows in which a body reaches
            an end are not searched for lost refraction.

    Raises:
        ArgumentError: Shapes, values, options or a geometry that cannot be.
    """
    values = cube("sinograms", sinograms, "(view, row, column)")
    options = {
        "method": word("method", method, Reconstruction),
        "filter": word("filter", filter, Window),
        "cut_off": number("cut_off", cut_off),
        "arm_passes": None if arm_passes is None else whole_number("arm_passes", arm_passes, 0),
        "extrapolate": bool(extrapolate),
        "iterations": whole_number("iterations", iterations, 1),
        "discrepancy": None if discrepancy is None else number("discrepancy", discrepancy),
        "non_negative": bool(non_negative),
        "phase": bool(phase),
        "keep_views": bool(keep_views),
    }
    if method == "fbp":
        given = {"weights": weights, "mask": mask, "start": start}
        for name, value in given.items():
            if value is not None:
                raise wrong(name, "an array for fbp", "cgls, sirt or bb")
        if phase:
            raise wrong("phase", "True for fbp", "cgls, sirt or bb")
    may = None
    if mask is not None:
        may = array("mask", mask, "bool, (z, y, x)")
        if may.ndim != 3 or may.dtype != np.bool_:
            raise wrong("mask", f"shape {may.shape}, dtype {may.dtype}", "bool, (z, y, x)")
        may = np.ascontiguousarray(may)
    volume, sides, corner, unit, residuals, best, lost = _beamlet.reconstruct(
        serving(engine)._engine,
        circle(geometry, axis),
        values,
        word("quantity", quantity, Quantity),
        grid(voxel, size, origin),
        options,
        None if weights is None else cube("weights", weights, "(view, row, column)"),
        may,
        None if start is None else cube("start", start, "(z, y, x)"),
        None if attenuation is None else cube("attenuation", attenuation, "(view, row, column)"),
        progress,
    )
    return Volume(
        volume,
        (sides[0], sides[1], sides[2]),
        (corner[0], corner[1], corner[2]),
        quantity,
        unit,
        tuple(residuals),
        best,
        lost_views=tuple(lost),
    )
