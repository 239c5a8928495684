"""Retrieved images, and volumes made from them."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._engine import Engine, Progress, default_engine
from ._errors import ArgumentError, Error
from ._scene import Path, Scene

Method = Literal[
    "gaussian",
    "three-step",
    "two-step",
    "moments",
    "triangle",
    "trapezoid",
    "exact-curve",
    "beamlet",
]
Weights = Literal["none", "poisson"]
Quantity = Literal["mu", "delta", "dark_field"]
Window = Literal["ram-lak", "shepp-logan", "hann"]
Reconstruction = Literal["fbp", "cgls", "sirt", "bb"]
Image = NDArray[np.float32]


def _wrong(name: str, found: str, allowed: str) -> ArgumentError:
    return ArgumentError(
        f"{name}: found {found}; allowed: {allowed}", key=name, found=found, allowed=allowed
    )


@dataclass(frozen=True)
class Volume:
    """A reconstructed volume.

    Attributes:
        values: float32 ``[z][y][x]``, all ascending.
        voxel: Sides of a voxel along x, y and z, m.
        origin: Centre of the first voxel, x, y and z, m; the axis of rotation is at x = y = 0.
        quantity: Name of the quantity.
        unit: Their unit.
        residuals: Of iterative methods: root mean square of the weighted residuals of the start, then
            after each iteration.
        best: Iteration of the values, which has the least residual.
        pixels: Pixels of the images: how many had no result, no light or were misfits and were filled;
            ``None`` for sinograms.
    """

    values: NDArray[np.float32]
    voxel: tuple[float, float, float]
    origin: tuple[float, float, float]
    quantity: str
    unit: str
    residuals: tuple[float, ...] = ()
    best: int = 0
    pixels: Mapping[str, int] | None = None

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


class Images(Mapping[str, Image]):
    """Retrieved images by name, float32 ``[view][row][column]``; those of the flat have one view.

    A pixel without a result is NaN and has a bit in ``flags``; `flag_meanings` explains the bits.

    Attributes:
        record: Method, units, flags and their counts: ``retrieved.json``.
        geometry: Angles, distances and places of columns: ``geometry.json``; ``None`` where the angles
            of the views are not known.
        scene: The scene, where it is known.
    """

    def __init__(
        self,
        images: Mapping[str, Image],
        record: Mapping[str, Any],
        geometry: Mapping[str, Any] | None,
        scene: Scene | None,
        engine: Engine | None,
    ) -> None:
        self.record = dict(record)
        self.geometry = None if geometry is None else dict(geometry)
        self.scene = scene
        self._images = dict(images)
        self._engine = engine

    @classmethod
    def _of(
        cls, found: tuple[dict[str, Image], str, str | None], scene: Scene | None,
        engine: Engine | None,
    ) -> Images:
        images, record, geometry = found
        views = None if geometry is None else json.loads(geometry)
        return cls(images, json.loads(record), views, scene, engine)

    @classmethod
    def open(cls, path: Path, engine: Engine | None = None) -> Images:
        """Reads the images of a run directory, or of a folder of retrieved images.

        Raises:
            FileError: There are no retrieved images.
        """
        self = cls._of(_beamlet.read_images(path), None, engine)
        try:
            self.scene = Scene.from_toml(self.record["geometry"] or "")
        except Error:
            # Its files are gone; the images do without them.
            self.scene = None
        return self

    @property
    def title(self) -> str | None:
        """Title of the scene."""
        title: str | None = self.record.get("title")
        return title

    @property
    def energy(self) -> float | None:
        """Photon energy, keV; ``None`` for a spectrum."""
        return None if self.scene is None else self.scene._scene.energy

    def __getitem__(self, name: str) -> Image:
        try:
            return self._images[name]
        except KeyError:
            raise KeyError(f"no image is named {name}; allowed: {', '.join(self._images)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._images)

    def __len__(self) -> int:
        return len(self._images)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each image."""
        return {str(name): str(unit) for name, unit in self.record["units"].items()}

    @property
    def flag_meanings(self) -> dict[int, str]:
        """Meaning of each bit of ``flags``."""
        return {int(bit): str(meaning) for bit, meaning in self.record["flags"].items()}

    @property
    def transmission(self) -> Image:
        """Fraction of the light that the sample transmits."""
        return self["transmission"]

    @property
    def refraction(self) -> Image:
        """Refraction angle, rad; above 0 towards +x."""
        return self["refraction"]

    @property
    def dark_field(self) -> Image:
        """Variance of the refraction angle, rad²; a KeyError for methods without it."""
        return self["dark_field"]

    @property
    def flags(self) -> Image:
        """Bits of :attr:`flag_meanings`, as float32; 0: no flag."""
        return self["flags"]

    def sinograms(self, quantity: Quantity = "mu") -> tuple[Image, dict[str, int]]:
        """Sinograms ready for reconstruction: -ln of the transmission, refraction angles, variances.

        Pixels without a result, transmissions of 0 or less, and for ``mu`` misfits are filled linearly
        along their row (docs/reconstruction.md).

        Returns:
            Values ``[view][row][column]``, and the numbers of pixels by kind.

        Raises:
            ArgumentError: Views without angles or that move the sample, a view without any value.
        """
        if self.geometry is None:
            raise _wrong("geometry", "views without angles", "a scene with an angle for each view")
        image = self[{"mu": "transmission", "delta": "refraction"}.get(quantity, quantity)]
        flags = self._images.get("flags")
        values, counts = _beamlet.prepare(circle(self.geometry), quantity, image, flags)
        names = ("pixels", "without_answer", "dark", "misfits")
        return values, dict(zip(names, counts, strict=True))

    def weights(self, quantity: Quantity = "mu") -> Image:
        """Weights of the sinograms by the uncertainties of the retrieval: one over their squares, 0 where
        a pixel has no result. Uncertainties below a tenth of their median are raised to it.

        Raises:
            ArgumentError: The images were not retrieved from counts: they have no uncertainties.
        """
        name = {"mu": "transmission", "delta": "refraction"}.get(quantity, quantity)
        if f"{name}_sigma" not in self:
            raise _wrong("weights", f"images without {name}_sigma", "images of counts")
        sigma = self[f"{name}_sigma"].copy()
        if quantity == "mu":
            with np.errstate(divide="ignore", invalid="ignore"):
                sigma = np.where(self[name] > 0, sigma / self[name], np.nan).astype(np.float32)
        sigma[~np.isfinite(sigma)] = np.nan
        return _beamlet.weights(sigma)

    def reconstruct(
        self,
        quantity: Quantity = "mu",
        voxel: str | float | None = None,
        size: Sequence[int] | None = None,
        filter: Window = "ram-lak",
        cut_off: float = 1.0,
        progress: Progress | None = None,
        *,
        method: Reconstruction = "fbp",
        weights: Literal["sigma"] | ArrayLike | None = None,
        **options: Any,
    ) -> Volume:
        """Reconstructs a scan on a circle. Pixels without a value are filled: :meth:`sinograms`.

        Args:
            quantity: ``mu`` (1/m, from the transmission), ``delta`` (from the refraction) or
                ``dark_field`` (rad²/m).
            voxel: Side of the voxels, as ``"50 um"`` or in m; default: the size of a pixel at the axis.
            size: Voxels along x, y and z; default: the field of view.
            filter: Window of the filter, for ``fbp``.
            cut_off: Highest frequency, as a fraction of the Nyquist frequency, for ``fbp``.
            progress: Callback.
            method: Filtered back-projection, or an iterative method: :func:`beamlet.reconstruct`.
            weights: ``"sigma"``: iterative methods weigh values by :meth:`weights`.
            options: Others of :func:`beamlet.reconstruct`.

        Raises:
            ArgumentError: As of :func:`beamlet.reconstruct`, :meth:`sinograms` and :meth:`weights`.
        """
        sinograms, counts = self.sinograms(quantity)
        assert self.geometry is not None
        if isinstance(weights, str):
            if weights != "sigma":
                raise _wrong("weights", repr(weights), '"sigma" or an array')
            weights = self.weights(quantity)
        options.setdefault("engine", self._engine)
        volume = reconstruct(
            sinograms,
            self.geometry,
            quantity,
            voxel=voxel,
            size=size,
            filter=filter,
            cut_off=cut_off,
            progress=progress,
            method=method,
            weights=weights,
            **options,
        )
        return replace(volume, pixels=counts)

    def __repr__(self) -> str:
        return f"<Images {', '.join(self._images)}>"


def _stack(name: str, values: ArrayLike, sides: int) -> NDArray[np.float32]:
    """Values as contiguous float32 of four sides; a copy only where they are not."""
    array = np.asarray(values)
    if array.dtype.kind not in "fiu":
        raise _wrong(name, f"dtype {array.dtype}", "real numbers")
    if array.ndim not in (sides, 4):
        raise _wrong(name, f"shape {array.shape}", "(step, row, column)" if sides == 3 else
                     "(view, step, row, column)")
    if array.ndim < 4:
        array = array[np.newaxis]
    return np.ascontiguousarray(array, dtype=np.float32)


def _retrieve(
    engine: Engine,
    scene: Scene,
    kind: str,
    flat: ArrayLike,
    sample: ArrayLike,
    dark: ArrayLike | None = None,
    mask_offsets: list[float] | None = None,
    bad_pixels: ArrayLike | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Images:
    of_flat, of_sample = _stack("flat", flat, 3), _stack("sample", sample, 4)
    of_dark = None if dark is None else _stack("dark", dark, 3)
    known = ("method", "weights", "gain", "read_noise", "saturation", "steps", "sample_offsets")
    chosen = {name: options.get(name) for name in known} | {"bad_pixels": None}
    with tempfile.TemporaryDirectory(prefix="beamlet-") as folder:
        if bad_pixels is not None:
            path = f"{folder}/bad_pixels.npy"
            np.save(path, np.asarray(bad_pixels).astype(np.float32))
            chosen["bad_pixels"] = path
        found = _beamlet.retrieve(
            engine._engine,
            scene._scene,
            kind,
            of_flat,
            of_sample,
            of_dark,
            mask_offsets,
            chosen,
            progress,
        )
    return Images._of(found, scene, engine)


def lengths(name: str, values: Sequence[str | float] | NDArray[np.floating[Any]]) -> list[float]:
    """Lengths in m from numbers in m or text with units."""
    return [
        _beamlet.lengths(name, [value])[0] if isinstance(value, str) else float(value)
        for value in values
    ]


def retrieve(
    flat: ArrayLike,
    sample: ArrayLike,
    offsets: Sequence[str | float] | NDArray[np.floating[Any]],
    geometry: Scene,
    dark: ArrayLike | None = None,
    method: Method = "gaussian",
    weights: Weights = "none",
    gain: float | None = None,
    read_noise: float | None = None,
    saturation: float | None = None,
    bad_pixels: ArrayLike | None = None,
    steps: tuple[int, int] | None = None,
    sample_offsets: Sequence[str | float] | None = None,
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> Images:
    """Retrieves measured stacks.

    Args:
        flat: Counts without sample, ``[step][row][column]``.
        sample: Counts with sample, ``[view][step][row][column]`` or ``[step][row][column]``.
        offsets: Mask offset of each step, m, or text with a unit.
        geometry: Scene with the set-up.
        dark: Counts without beam, ``[frame][row][column]``; their mean is subtracted.
        method: The estimator (docs/retrieval.md).
        weights: ``poisson`` weights counts by their noise.
        gain: Counts of a photon; default 1.
        read_noise: Standard deviation of counts without beam.
        saturation: Counts at or above it are excluded.
        bad_pixels: Not zero where a pixel is bad, ``[row][column]``.
        steps: Steps of the sample for ``two-step``.
        sample_offsets: Offsets of the sample for ``two-step``, if they differ from the flat's.
        engine: Engine; default: the shared one.
        progress: Callback.

    Raises:
        ArgumentError, FileError, SceneError: For shapes, values, offsets or options that are not possible;
            errors name ``flat``, ``sample`` or ``dark`` in place of a file.
    """
    of_sample = np.asarray(sample)
    return _retrieve(
        engine or default_engine(),
        geometry,
        "measured",
        flat,
        of_sample[np.newaxis] if of_sample.ndim == 3 else of_sample,
        dark=dark,
        mask_offsets=lengths("offsets", offsets),
        bad_pixels=bad_pixels,
        progress=progress,
        method=method,
        weights=weights,
        gain=gain,
        read_noise=read_noise,
        saturation=saturation,
        steps=steps,
        sample_offsets=None if sample_offsets is None else lengths("sample_offsets", sample_offsets),
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
    for key in ("source_to_axis_m", "source_to_detector_m", "columns_m", "rows_m", "angles_rad"):
        if views.get(key) is None:
            raise _wrong(f"geometry.{key}", "nothing", "the keys of geometry.json")
    if axis is None and views.get("axis_column") is None:
        raise _wrong("scan", "views that move the sample", "views on a circle")
    columns = [float(place) for place in views["columns_m"]]
    near, far = float(views["source_to_axis_m"]), float(views["source_to_detector_m"])
    if axis is None:
        pitch = (columns[-1] - columns[0]) / max(len(columns) - 1, 1)
        at = columns[0] + pitch * float(views["axis_column"])
        # Beside the optical axis; on it places of columns are rounded.
        axis = 0.0 if abs(at) < 1e-6 * pitch else at if np.isinf(near) else at * near / far
    analyser = views.get("source_to_analyser_m")
    return {
        "distances": [near, far],
        "columns": columns,
        "rows": [float(place) for place in views["rows_m"]],
        "angles": [float(angle) for angle in views["angles_rad"]],
        "axis": float(axis),
        "lever": None if analyser is None else float(analyser) - near,
    }


def grid(
    voxel: str | float | None,
    size: Sequence[int] | None,
    origin: Sequence[str | float] | None,
) -> dict[str, Any]:
    """Voxels, as the extension takes them."""
    if origin is not None and len(origin) != 3:
        raise _wrong("origin", f"{len(origin)} lengths", "three, along x, y and z")
    return {
        "voxel": None if voxel is None else lengths("voxel", [voxel])[0],
        "size": None if size is None else _sides("size", size),
        "origin": None if origin is None else lengths("origin", origin),
    }


def _sides(name: str, values: Sequence[int]) -> list[int]:
    sides = [int(value) for value in values]
    if len(sides) != 3 or min(sides) < 1:
        raise _wrong(name, str(sides), "three numbers of 1 or more, along x, y and z")
    return sides


def _cube(name: str, values: ArrayLike, sides: str) -> NDArray[np.float32]:
    """Values as contiguous float32 of three sides."""
    array = np.asarray(values)
    if array.ndim != 3 or array.dtype.kind not in "fiu":
        raise _wrong(name, f"shape {array.shape}, dtype {array.dtype}", sides)
    return np.ascontiguousarray(array, dtype=np.float32)


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
) -> Volume:
    """Reconstructs sinograms: docs/reconstruction.md has methods and options.

    Args:
        sinograms: ``[view][row][column]``: -ln T, refraction angles (rad), or variances (rad²).
        geometry: Scene, or a dict with the keys of ``geometry.json`` (docs/reading.md).
        quantity: What is reconstructed: ``mu``, ``delta`` or ``dark_field``.
        voxel: Side of the voxels, as ``"50 um"`` or in m; default: the size of a pixel at the axis.
        size: Voxels along x, y and z; default: the field of view.
        axis: x of the axis of rotation from the optical axis, m; default: the geometry's.
        filter: Window of the filter, for ``fbp``.
        cut_off: Highest frequency, as a fraction of the Nyquist frequency, for ``fbp``.
        engine: Engine; default: the shared one.
        progress: Callback.
        method: ``fbp``, filtered back-projection; or weighted least squares by ``cgls`` (conjugate
            gradients), ``sirt`` or ``bb`` (gradient descent with Barzilai-Borwein steps).
        origin: Centre of the first voxel, x, y and z; default: the volume is centred on the axis.
        arm_passes: Number of corrections of ``fbp`` for lever arms; default: 1 for scans of less than a
            turn, else 0.
        extrapolate: ``fbp`` of ``mu`` and ``dark_field`` continues rows of bodies wider than the detector.
        iterations: Most iterations.
        discrepancy: Root mean square of the weighted residuals at which iterations end.
        non_negative: Voxels stay at or above zero (``sirt``, ``bb``).
        phase: ``delta`` from refraction angles integrated along the rows, which begin and end in air.
        weights: Weight of each value in iterative methods, 0 or more, ``[view][row][column]``.
        mask: True where voxels may differ from zero, ``[z][y][x]``.
        start: Volume to begin with, ``[z][y][x]``.

    Raises:
        ArgumentError: Shapes, values, options or a geometry that are not possible.
    """
    array = _cube("sinograms", sinograms, "(view, row, column)")
    options = {
        "method": method,
        "filter": filter,
        "cut_off": float(cut_off),
        "arm_passes": arm_passes,
        "extrapolate": bool(extrapolate),
        "iterations": int(iterations),
        "discrepancy": None if discrepancy is None else float(discrepancy),
        "non_negative": bool(non_negative),
        "phase": bool(phase),
    }
    if method == "fbp":
        given = {"weights": weights, "mask": mask, "start": start}
        wrong = [name for name, value in given.items() if value is not None]
        if wrong:
            raise _wrong(wrong[0], "an array for fbp", "cgls, sirt or bb")
    may = None
    if mask is not None:
        may = np.asarray(mask)
        if may.ndim != 3 or may.dtype != np.bool_:
            raise _wrong("mask", f"shape {may.shape}, dtype {may.dtype}", "bool, (z, y, x)")
        may = np.ascontiguousarray(may)
    values, sides, corner, unit, residuals, best = _beamlet.reconstruct(
        (engine or default_engine())._engine,
        circle(geometry, axis),
        array,
        quantity,
        grid(voxel, size, origin),
        options,
        None if weights is None else _cube("weights", weights, "(view, row, column)"),
        may,
        None if start is None else _cube("start", start, "(z, y, x)"),
        progress,
    )
    return Volume(
        values,
        (sides[0], sides[1], sides[2]),
        (corner[0], corner[1], corner[2]),
        quantity,
        unit,
        tuple(residuals),
        best,
    )
