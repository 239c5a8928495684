"""Retrieved images, of runs and of measured stacks."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._arguments import array, number, shown, whole, word
from ._arguments import path as place
from ._engine import Engine, Progress, serving
from ._errors import ArgumentError, Error, wrong
from ._scene import Path, Scene, inner
from ._volume import (
    Quantity,
    Reconstruction,
    Volume,
    Window,
    circle,
    lengths,
    reconstruct,
)

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
Image = NDArray[np.float32]

#: Image from which the sinograms of a quantity come.
SOURCES = {"mu": "transmission", "delta": "refraction", "dark_field": "dark_field"}


def _source(quantity: str) -> str:
    return SOURCES[word("quantity", quantity, Quantity)]


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
        self = cls._of(_beamlet.read_images(place("path", path)), None, engine)
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

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_engine": None}

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
    def warnings(self) -> list[str]:
        """What the retrieval doubts: faults of the stacks, and uncertainties that do not fit them."""
        return [str(warning) for warning in self.record.get("warnings", ())]

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

    def sinograms(self, quantity: Quantity = "mu") -> tuple[Image, dict[str, int]]:
        """Sinograms ready for reconstruction: -ln of the transmission, refraction angles, variances.

        Pixels without an answer, transmissions of 0 or less, and for ``mu`` misfits are filled linearly
        along their row (docs/reconstruction.md).

        Returns:
            Values ``[view][row][column]``, and the numbers of pixels by kind.

        Raises:
            ArgumentError: Views without angles or that move the sample, a view without any value.
        """
        if self.geometry is None:
            raise wrong("geometry", "views without angles", "a scene with an angle for each view")
        image = self[_source(quantity)]
        flags = self._images.get("flags")
        values, counts = _beamlet.prepare(circle(self.geometry), quantity, image, flags)
        names = ("pixels", "without_answer", "dark", "misfits")
        return values, dict(zip(names, counts, strict=True))

    def _attenuation(self) -> Image | None:
        """-ln of the transmission; ``None`` where a view has none."""
        try:
            return self.sinograms("mu")[0]
        except ArgumentError:
            return None

    def weights(self, quantity: Quantity = "mu") -> Image:
        """Weights of the sinograms by the uncertainties of the retrieval: one over their squares, 0 where
        a pixel has no answer. Below a tenth of their median uncertainties count as this.

        Raises:
            ArgumentError: The images were not retrieved from counts: they have no uncertainties.
        """
        name = _source(quantity)
        if f"{name}_sigma" not in self:
            raise wrong("weights", f"images without {name}_sigma", "images of counts")
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
            voxel: Side of the voxels, as ``"50 um"`` or in m; default: a pixel at the axis.
            size: Voxels along x, y and z; default: the field of view.
            filter: Window of the filter, for ``fbp``.
            cut_off: Frequency from which on nothing counts, as a share of Nyquist's, for ``fbp``.
            progress: Callback.
            method: Filtered back-projection, or an iterative method: :func:`beamlet.reconstruct`.
            weights: ``"sigma"``: iterative methods weigh values by :meth:`weights`.
            options: Others of :func:`beamlet.reconstruct`; ``attenuation`` comes from the transmission.

        Raises:
            ArgumentError: As of :func:`beamlet.reconstruct`, :meth:`sinograms` and :meth:`weights`.
        """
        sinograms, counts = self.sinograms(quantity)
        assert self.geometry is not None
        if isinstance(weights, str):
            if weights != "sigma":
                raise wrong("weights", shown(weights), '"sigma" or an array')
            weights = self.weights(quantity)
        engine = self._engine
        options.setdefault("engine", None if engine is None or engine.closed else engine)
        if quantity == "delta" and "transmission" in self and not options.get("keep_views"):
            options.setdefault("attenuation", self._attenuation())
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
        doubts = {0: "", 1: ", 1 warning"}.get(len(self.warnings), f", {len(self.warnings)} warnings")
        return f"<Images {', '.join(self._images)}{doubts}>"


def _stack(name: str, values: ArrayLike, sides: int) -> NDArray[np.float32]:
    """Values as contiguous float32 of four sides; a copy only where they are not."""
    all_sides = {2: "(row, column) or (frame, row, column)", 3: "(step, row, column)"}
    allowed = all_sides.get(sides, "(view, step, row, column)")
    found = array(name, values, allowed)
    if found.dtype.kind not in "fiu":
        raise wrong(name, f"dtype {found.dtype}", "real numbers")
    if not sides <= found.ndim <= 4 or found.size == 0:
        raise wrong(name, f"shape {found.shape}", allowed)
    while found.ndim < 4:
        found = found[np.newaxis]
    return np.ascontiguousarray(found, dtype=np.float32)


def _check_frames(name: str, found: NDArray[Any], frame: tuple[int, ...]) -> None:
    if found.shape[-2:] != frame:
        allowed = f"rows and columns of flat, {frame}"
        raise wrong(name, f"rows and columns {found.shape[-2:]}", allowed)


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
    of_scene = inner(scene, "geometry" if kind == "measured" else "scene")
    of_flat, of_sample = _stack("flat", flat, 3), _stack("sample", sample, 4)
    of_dark = None if dark is None else _stack("dark", dark, 2)
    frame = of_flat.shape[-2:]
    _check_frames("sample", of_sample, frame)
    if of_dark is not None:
        _check_frames("dark", of_dark, frame)
    if mask_offsets is not None and len(mask_offsets) != of_flat.shape[1]:
        raise wrong("flat", f"{of_flat.shape[1]} steps", f"{len(mask_offsets)}, as offsets")
    known = ("method", "weights", "gain", "read_noise", "saturation", "steps", "sample_offsets")
    chosen = {name: options.get(name) for name in known} | {"bad_pixels": None}
    word("method", chosen["method"], Method)
    word("weights", chosen["weights"], Weights)
    for name in ("gain", "read_noise", "saturation"):
        if chosen[name] is not None:
            chosen[name] = number(name, chosen[name])
    if chosen["steps"] is not None:
        chosen["steps"] = whole("steps", chosen["steps"], 2, "two numbers of steps, from 0")
    with tempfile.TemporaryDirectory(prefix="beamlet-") as folder:
        if bad_pixels is not None:
            bad = array("bad_pixels", bad_pixels, "bool or numbers, (row, column)")
            if bad.ndim != 2 or bad.dtype.kind not in "bfiu":
                given = f"shape {bad.shape}, dtype {bad.dtype}"
                raise wrong("bad_pixels", given, "bool or numbers, (row, column)")
            _check_frames("bad_pixels", bad, frame)
            if (bad != 0).all():
                raise wrong("bad_pixels", "every pixel", "False or 0 where a pixel is good")
            path = f"{folder}/bad_pixels.npy"
            np.save(path, bad.astype(np.float32))
            chosen["bad_pixels"] = path
        found = _beamlet.retrieve(
            engine._engine,
            of_scene,
            kind,
            of_flat,
            of_sample,
            of_dark,
            mask_offsets,
            chosen,
            progress,
        )
    return Images._of(found, scene, engine)


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
        dark: Counts without beam, ``[frame][row][column]`` or ``[row][column]``; their mean is subtracted.
        method: The estimator (docs/retrieval.md).
        weights: ``poisson`` weights counts by their noise.
        gain: Counts of a photon; default 1.
        read_noise: Standard deviation of counts without beam, in counts.
        saturation: Counts of this value and above are left out.
        bad_pixels: True or not zero where a pixel is bad, ``[row][column]``.
        steps: Indices of the two steps of the sample for ``two-step``, from 0.
        sample_offsets: Mask offset of each step of the sample for ``two-step``, m, or text with a unit,
            where they differ from `offsets`.
        engine: Engine; default: the shared one.
        progress: Callback.

    Returns:
        Images ``[view][row][column]``; a stack ``[step][row][column]`` has one view.

    Raises:
        ArgumentError: An array of another shape or type, or an option that cannot be; `key` names it.
        FileError: A number of steps of the sample that the method does not take.
        SceneError: Offsets or a set-up that the method does not take.
    """
    of_sample = array("sample", sample, "(view, step, row, column) or (step, row, column)")
    return _retrieve(
        serving(engine),
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
