"""Volumes from sinograms, and the geometry and voxels that they take."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from inspect import signature
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._arguments import array, floats, number, shown, text, whole, whole_number, word
from ._engine import Engine, Progress, serving
from ._errors import wrong
from ._scene import Scene, inner

Quantity = Literal["mu", "delta", "dark_field"]
Window = Literal["ram-lak", "shepp-logan", "hann"]
Reconstruction = Literal["fbp", "cgls", "sirt", "bb"]


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


def _hardening(value: str | None) -> tuple[str, float | None] | None:
    """Material and energy (keV) of a correction of beam hardening."""
    if value is None:
        return None
    material, at, energy = text("beam_hardening", value, '"MATERIAL" or "MATERIAL@ENERGY"').partition("@")
    if not material.strip():
        raise wrong("beam_hardening", shown(value), 'a material, or one with an energy as "water@40keV"')
    return material.strip(), _beamlet.energy("beam_hardening", energy) if at else None


def _centred(
    geometry: Scene | Mapping[str, Any], centre: float | str | None
) -> Scene | Mapping[str, Any]:
    """The geometry with the axis of rotation on a column."""
    if centre is None or centre == "auto":
        return geometry
    column = number("centre", centre, 'a column, counted from 0 with a fraction, or "auto"')
    views = geometry.geometry if isinstance(geometry, Scene) else geometry
    if not isinstance(views, Mapping) or views.get("axis_column") is None:
        return geometry
    return {**views, "axis_column": column}


def _options(method: Reconstruction, given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a method, checked, as the extension takes them."""
    options = {
        "method": word("method", method, Reconstruction),
        "filter": word("filter", given["filter"], Window),
        "cut_off": number("cut_off", given["cut_off"]),
        "iterations": whole_number("iterations", given["iterations"], 1),
        "beam_hardening": _hardening(given["beam_hardening"]),
        "find_centre": given["centre"] == "auto",
    }
    passes, discrepancy = given["arm_passes"], given["discrepancy"]
    options["arm_passes"] = None if passes is None else whole_number("arm_passes", passes, 0)
    options["discrepancy"] = None if discrepancy is None else number("discrepancy", discrepancy)
    for name in ("extrapolate", "non_negative", "phase", "rings", "truth", "keep_views"):
        options[name] = bool(given[name])
    return options


def _refuse_for_fbp(given: Mapping[str, Any]) -> None:
    """Refuses options of iterative methods."""
    for name in ("weights", "mask", "start"):
        if given[name] is not None:
            raise wrong(name, "an array for fbp", "cgls, sirt or bb")
    if given["phase"]:
        raise wrong("phase", "True for fbp", "cgls, sirt or bb")


def _mask(mask: ArrayLike | str | None) -> tuple[NDArray[np.bool_] | None, str | None]:
    """A mask of voxels as an array, or as a shape."""
    if mask is None or isinstance(mask, str):
        return None, mask
    may = array("mask", mask, "bool, (z, y, x), or a shape")
    if may.ndim != 3 or may.dtype != np.bool_:
        raise wrong("mask", f"shape {may.shape}, dtype {may.dtype}", "bool, (z, y, x), or a shape")
    return np.ascontiguousarray(may), None


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
    mask: ArrayLike | str | None = None,
    start: ArrayLike | None = None,
    centre: float | Literal["auto"] | None = None,
    rings: bool = False,
    beam_hardening: str | None = None,
    truth: bool = False,
    scene: Scene | None = None,
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
        mask: True where voxels may differ from zero, ``[z][y][x]``, a shape as
            ``"cylinder:0 mm,0 mm,8 mm"``, ``sphere:X,Y,Z,RADIUS`` or ``box:X,Y,Z,WIDTH,DEPTH,HEIGHT``, or the path of a file as for the command line.
        start: Volume to begin with, ``[z][y][x]``.
        centre: Column of the axis of rotation, counted from 0 at the centre of the first, with a
            fraction; ``"auto"`` finds it in the sinograms; default: `axis`.
        rings: Stripes of single columns are removed.
        beam_hardening: Material of the sample, as ``"water"`` or with the energy of ``mu`` as
            ``"water@40keV"``: -ln T under the spectrum of the scene is corrected for beam hardening.
        truth: The scene on the same voxels and the errors by object: ``Volume.truth``.
        scene: Scene for `beam_hardening` and `truth`; default: `geometry`, where it is one.
        keep_views: Views that lost their refraction keep their weight in ``delta``.
        attenuation: For ``delta``: -ln T of the same pixels, ``[view][row][column]``. Rows in which a body reaches
            an end are not searched for lost refraction.

    Raises:
        ArgumentError: Shapes, values, options or a geometry that cannot be.
    """
    return volume_of(dict(locals()), {})


#: Values of options that are not given.
DEFAULTS = {name: option.default for name, option in signature(reconstruct).parameters.items()}


def volume_of(given: Mapping[str, Any], beside: Mapping[str, Any]) -> Volume:
    """The volume of :func:`reconstruct`.

    Args:
        given: All its arguments.
        beside: What retrieved images know beside them: to correct ``delta`` for gradients of the attenuation the volume ``mu`` and
            ``flat_width`` (m).
    """
    weights, start, geometry = (given[name] for name in ("weights", "start", "geometry"))
    attenuation = given["attenuation"]
    if given["method"] == "fbp":
        _refuse_for_fbp(given)
    if given["axis"] is not None and given["centre"] is not None:
        raise wrong("centre", "centre and axis", "one of them")
    sides = "(view, row, column)"
    values = cube("sinograms", given["sinograms"], sides)
    may, shape = _mask(given["mask"])
    arrays = {
        "weights": None if weights is None else cube("weights", weights, sides),
        "mask": may,
        "start": None if start is None else cube("start", start, "(z, y, x)"),
        "attenuation": None if attenuation is None else cube("attenuation", attenuation, sides),
        "mu": beside.get("mu"),
    }
    options = _options(given["method"], given)
    scene = given["scene"]
    if scene is None and isinstance(geometry, Scene):
        scene = geometry
    found = _beamlet.reconstruct(
        serving(given["engine"])._engine,
        circle(_centred(geometry, given["centre"]), given["axis"]),
        values,
        word("quantity", given["quantity"], Quantity),
        grid(given["voxel"], given["size"], given["origin"]),
        options | {"mask_shape": shape, "flat_width": beside.get("flat_width")},
        arrays,
        None if scene is None else inner(scene),
        given["progress"],
    )
    return _volume(given["quantity"], found)


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
