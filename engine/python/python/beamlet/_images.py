"""Retrieved images, and volumes made from them."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
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
        quantity: What the values are.
        unit: Their unit.
    """

    values: NDArray[np.float32]
    voxel: tuple[float, float, float]
    origin: tuple[float, float, float]
    quantity: str
    unit: str

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

    A pixel without an answer is NaN and has a bit in ``flags``; `flag_meanings` explains the bits.

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
            FileError: No images are there.
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
            raise KeyError(f"{name}; there are {', '.join(self._images)}") from None

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
        """Share of the light that passes, 0 to 1."""
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
        """Bits of :attr:`flag_meanings`, as float32; 0: nothing to say."""
        return self["flags"]

    def reconstruct(
        self,
        quantity: Quantity = "mu",
        voxel: str | float | None = None,
        size: Sequence[int] | None = None,
        filter: Window = "ram-lak",
        cut_off: float = 1.0,
        progress: Progress | None = None,
    ) -> Volume:
        """Filtered back-projection of a scan on a circle.

        Args:
            quantity: ``mu`` (1/m, from the transmission), ``delta`` (from the refraction) or
                ``dark_field`` (rad²/m).
            voxel: Side of the voxels, as ``"50 um"`` or in m; default: a pixel at the axis.
            size: Voxels along x, y and z; default: the field of view.
            filter: Window of the filter.
            cut_off: Frequency from which on nothing counts, as a share of Nyquist's.
            progress: Callback.

        Raises:
            ArgumentError: Pixels without an answer, a transmission of 0 or less, or a scan that is
                no circle.
        """
        name = {"mu": "transmission", "delta": "refraction"}.get(quantity, quantity)
        sinograms = self[name]
        if quantity == "mu":
            with np.errstate(divide="ignore", invalid="ignore"):
                sinograms = -np.log(sinograms)
        if self.geometry is None:
            raise _wrong("geometry", "views without angles", "a scene with an angle for each view")
        if not np.isfinite(sinograms).all():
            bad = int((~np.isfinite(sinograms)).sum())
            found = f"{bad} pixels without a finite value"
            raise _wrong(name, found, "a value in each pixel: fill them before")
        return reconstruct(
            sinograms,
            self.geometry,
            quantity,
            voxel=voxel,
            size=size,
            filter=filter,
            cut_off=cut_off,
            engine=self._engine,
            progress=progress,
        )

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
        saturation: Counts from here on are left out.
        bad_pixels: Not zero where a pixel is bad, ``[row][column]``.
        steps: Steps of the sample for ``two-step``.
        sample_offsets: Offsets of the sample for ``two-step``, where they are others.
        engine: Engine; default: the shared one.
        progress: Callback.

    Raises:
        ArgumentError, FileError, SceneError: For shapes, values, offsets or options that cannot be;
            ``flat``, ``sample`` and ``dark`` stand for the files.
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


def reconstruct(
    sinograms: ArrayLike,
    geometry: Scene | Mapping[str, Any],
    quantity: Quantity = "mu",
    voxel: str | float | None = None,
    size: Sequence[int] | None = None,
    axis: float = 0.0,
    filter: Window = "ram-lak",
    cut_off: float = 1.0,
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> Volume:
    """Filtered back-projection of sinograms.

    Args:
        sinograms: ``[view][row][column]``: -ln T, refraction angles (rad), or variances (rad²).
        geometry: Scene, or a dict with the keys of ``geometry.json`` (docs/reading.md).
        quantity: What the sinograms are: ``mu``, ``delta`` or ``dark_field``.
        voxel: Side of the voxels, as ``"50 um"`` or in m; default: a pixel at the axis.
        size: Voxels along x, y and z; default: the field of view.
        axis: x of the axis of rotation from the optical axis, m.
        filter: Window of the filter.
        cut_off: Frequency from which on nothing counts, as a share of Nyquist's.
        engine: Engine; default: the shared one.
        progress: Callback.

    Raises:
        ArgumentError: Shapes, values or a geometry that cannot be.
    """
    array = np.asarray(sinograms)
    if array.ndim != 3 or array.dtype.kind not in "fiu":
        raise _wrong("sinograms", f"shape {array.shape}, dtype {array.dtype}", "(view, row, column)")
    views = geometry.geometry if isinstance(geometry, Scene) else geometry
    if views["axis_column"] is None:
        raise _wrong("scan", "views that move the sample", "views on a circle")
    circle = {
        "distances": [views["source_to_axis_m"], views["source_to_detector_m"]],
        "columns": views["columns_m"],
        "rows": views["rows_m"],
        "angles": views["angles_rad"],
        "axis": float(axis),
    }
    side = None if voxel is None else lengths("voxel", [voxel])[0]
    grid = {"voxel": side, "size": None if size is None else list(size), "origin": None}
    values, sides, origin, unit = _beamlet.fbp(
        (engine or default_engine())._engine,
        circle,
        np.ascontiguousarray(array, dtype=np.float32),
        quantity,
        grid,
        filter,
        cut_off,
        progress,
    )
    return Volume(
        values, (sides[0], sides[1], sides[2]), (origin[0], origin[1], origin[2]), quantity, unit
    )
