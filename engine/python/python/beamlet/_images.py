"""Retrieved images."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._arguments import shown, word
from ._arguments import path as place
from ._engine import Engine, Progress, still_open
from ._errors import ArgumentError, Error, counted, in_python, wrong
from ._options import described
from ._scene import Path, Scene
from ._volume import Quantity, Sinograms, Volume, circle, volume_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._keywords import ReconstructKeywords

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
        return [in_python(str(warning)) for warning in self.record.get("warnings", ())]

    @property
    def flag_meanings(self) -> dict[int, str]:
        """Meaning of each bit of ``flags``."""
        return {int(bit): in_python(str(meaning)) for bit, meaning in self.record["flags"].items()}

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
        """Variance of the refraction angle, rad²."""
        return self["dark_field"]

    @property
    def flags(self) -> NDArray[np.uint32]:
        """Bits of :attr:`flag_meanings`; 0: none."""
        return self["flags"].astype(np.uint32)

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
        return _beamlet.weights(self._sigmas(quantity))

    @described("reconstruct")
    def reconstruct(
        self,
        quantity: Quantity = "mu",
        *,
        gradient_bias: Volume | None = None,
        axis: float | None = None,
        engine: Engine | None = None,
        progress: Progress | None = None,
        weights: ArrayLike | None = None,
        attenuation: ArrayLike | None = None,
        scene: Scene | None = None,
        **options: Unpack[ReconstructKeywords],
    ) -> Volume:
        """Reconstructs a scan on a circle. Pixels without a value are filled: :meth:`sinograms`.

        Args:
            quantity: ``mu`` (1/m, from the transmission), ``delta`` (from the refraction) or
                ``dark_field`` (rad²/m).
            gradient_bias: Volume of ``mu`` on the same voxels: ``delta`` is corrected for gradients of
                the attenuation (δ + kμ).
            axis: As of :func:`beamlet.reconstruct`, like `engine`, `progress`, `weights` and `scene`; default: the
                images'.
            attenuation: As there; default: of the transmission.

        Raises:
            ArgumentError: As of :func:`beamlet.reconstruct`, :meth:`sinograms` and :meth:`weights`.
        """
        sinograms, counts = self.sinograms(quantity)
        if attenuation is None and quantity == "delta" and "transmission" in self:
            attenuation = self._attenuation()
        scene = self.scene if scene is None else scene
        bias = self._bias(quantity, gradient_bias)
        of = Sinograms(sinograms, quantity, self.geometry or {}, axis, scene, weights, attenuation, **bias)
        engine = still_open(self._engine) if engine is None else engine
        volume = volume_of(of, options, engine, progress)
        if gradient_bias is not None:
            if (volume.voxel, volume.origin) != (gradient_bias.voxel, gradient_bias.origin):
                raise wrong("gradient_bias", "a Volume on other voxels", "one on the voxels of delta")
        return replace(volume, pixels=counts)

    def _bias(self, quantity: Quantity, mu: Volume | None) -> dict[str, Any]:
        """Volume and width by which ``delta`` is corrected for gradients of the attenuation."""
        if mu is None:
            return {}
        if not isinstance(mu, Volume) or mu.quantity != "mu" or quantity != "delta":
            raise wrong("gradient_bias", shown(mu), "a Volume of mu, for delta")
        if self.scene is None or self.record.get("flat_width") is None:
            raise wrong("gradient_bias", "images without scene or flat_width", "images with their scene")
        return {"mu": np.ascontiguousarray(mu.values), "flat_width": self.record["flat_width"]}

    def _sigmas(self, quantity: Quantity) -> Image:
        """Uncertainties of the sinograms, NaN where a pixel has no answer."""
        name = _source(quantity)
        if f"{name}_sigma" not in self:
            raise wrong("sigma", f"images without {name}_sigma", "images of counts")
        sigma = self[f"{name}_sigma"].copy()
        if quantity == "mu":
            with np.errstate(divide="ignore", invalid="ignore"):
                sigma = np.where(self[name] > 0, sigma / self[name], np.nan).astype(np.float32)
        sigma[~np.isfinite(sigma)] = np.nan
        return sigma

    def __repr__(self) -> str:
        return f"<Images {', '.join(self._images)}{counted(self.warnings)}>"
