"""The projector of reconstruction and its transpose, as operators on arrays of numpy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._arguments import array, word
from ._engine import Engine, Progress, serving
from ._errors import wrong
from ._scene import Scene
from ._volume import circle, cube

Data = Literal["attenuation", "refraction", "phase", "dark_field"]
Values = NDArray[np.float32]


class Projector:
    """Joseph's projector of a scan: ``A(volume)`` are sinograms, ``A.T(sinograms)`` a volume.

    ``A.T`` is the transpose of the matrix of ``A``: ``<A(x), y> = <x, A.T(y)>`` to 1e-6 of the product of the
    norms, since both sum in float32. Voxels count by their lever arm where the geometry has one, in dark fields by its
    square (docs/physics.md).

    The operator has what ``scipy.sparse.linalg`` asks of one (`shape`, `dtype`, `matvec`, `rmatvec`):
    ``scipy.sparse.linalg.lsqr(A, sinograms.ravel())`` works, and so does ``aslinearoperator(A)``.

    Args:
        geometry: Scene, or a dict with the keys of ``geometry.json`` (docs/reading.md).
        data: What sinograms are: ``attenuation`` (-ln T) of a volume of mu (1/m); ``refraction`` (rad, the
            difference over a column) or ``phase`` (m, the integral along the ray) of delta;
            ``dark_field`` (rad²) of rad²/m.
        voxel: Side of the voxels, as ``"50 um"`` or in m; default: the size of a pixel at the axis.
        size: Voxels along x, y and z; default: the field of view.
        origin: Centre of the first voxel, x, y and z; default: the volume is centred on the axis.
        axis: x of the axis of rotation from the optical axis, m; default: the geometry's.
        engine: Engine; default: the shared one.

    Attributes:
        volume_shape: Shape of volumes, ``(z, y, x)``, all ascending.
        sinograms_shape: Shape of sinograms, ``(view, row, column)``.
        voxel: Sides of a voxel along x, y and z, m.
        origin: Centre of the first voxel, x, y and z, m.
        unit: Unit of sinograms.
        volume_unit: Unit of volumes.

    Raises:
        ArgumentError: A geometry or grid that cannot be, a scan that is no circle.

    Example:
        >>> scene = Scene(
        ...     source={"distance": "1.2 m", "spot": "0 um", "energy": "30 keV"},
        ...     detector={"distance": "1.8 m", "pixels": [16, 2], "pitch": "150 um"},
        ...     scan={"angles": {"from": "0 deg", "to": "360 deg", "count": 12}},
        ... )
        >>> A = Projector(scene)
        >>> A.volume_shape, A.sinograms_shape, A.unit
        ((2, 16, 16), (12, 2, 16), '1')
        >>> A(np.ones(A.volume_shape)).shape, A.T(np.ones(A.sinograms_shape)).shape
        ((12, 2, 16), (2, 16, 16))
    """

    def __init__(
        self,
        geometry: Scene | Mapping[str, Any],
        data: Data = "attenuation",
        voxel: str | float | None = None,
        size: Sequence[int] | None = None,
        origin: Sequence[str | float] | None = None,
        axis: float | None = None,
        engine: Engine | None = None,
    ) -> None:
        self.data = data
        self._projector = _beamlet.Projector(
            serving(engine)._engine,
            circle(geometry, axis),
            word("data", data, Data),
            {"voxel": voxel, "size": size, "origin": origin},
        )
        x, y, z = self._projector.size
        views, rows, columns = self._projector.sinograms
        self.volume_shape = (z, y, x)
        self.sinograms_shape = (views, rows, columns)
        self.voxel = tuple(self._projector.voxel)
        self.origin = tuple(self._projector.origin)
        self.unit, self.volume_unit = self._projector.units

    def __call__(self, volume: ArrayLike, progress: Progress | None = None) -> Values:
        """Sinograms of a volume, float32 `sinograms_shape`.

        Raises:
            ArgumentError: A volume of another shape or of no real numbers.
        """
        return self._projector.project(cube("volume", volume, "(z, y, x)"), progress)

    @property
    def T(self) -> Transpose:
        """The transpose."""
        return Transpose(self)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the matrix: values of sinograms, voxels."""
        return (int(np.prod(self.sinograms_shape)), int(np.prod(self.volume_shape)))

    @property
    def dtype(self) -> np.dtype[np.float32]:
        """Type of the results."""
        return np.dtype(np.float32)

    def matvec(self, volume: ArrayLike) -> Values:
        """``A`` of a flattened volume, flattened."""
        return self(_shaped("volume", volume, self.volume_shape)).ravel()

    def rmatvec(self, sinograms: ArrayLike) -> Values:
        """``A.T`` of flattened sinograms, flattened."""
        return self.T(_shaped("sinograms", sinograms, self.sinograms_shape)).ravel()

    def __repr__(self) -> str:
        return f"<Projector of {self.data}: {self.volume_shape} to {self.sinograms_shape}>"


class Transpose:
    """The transpose of a projector: a volume of sinograms."""

    def __init__(self, projector: Projector) -> None:
        #: The projector.
        self.T = projector

    def __call__(self, sinograms: ArrayLike, progress: Progress | None = None) -> Values:
        """Volume of sinograms, float32 `volume_shape` of the projector.

        Raises:
            ArgumentError: Sinograms of another shape or of no real numbers.
        """
        values = cube("sinograms", sinograms, "(view, row, column)")
        return self.T._projector.transpose(values, progress)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the matrix: voxels, values of sinograms."""
        return self.T.shape[::-1]

    @property
    def dtype(self) -> np.dtype[np.float32]:
        """Type of the results."""
        return self.T.dtype

    def matvec(self, sinograms: ArrayLike) -> Values:
        """``A.T`` of flattened sinograms, flattened."""
        return self.T.rmatvec(sinograms)

    def rmatvec(self, volume: ArrayLike) -> Values:
        """``A`` of a flattened volume, flattened."""
        return self.T.matvec(volume)

    def __repr__(self) -> str:
        return f"<Transpose of {self.T!r}>"


def _shaped(name: str, values: ArrayLike, shape: tuple[int, int, int]) -> NDArray[Any]:
    found = array(name, values, f"{np.prod(shape)} numbers")
    if found.size != np.prod(shape):
        raise wrong(name, f"{found.size} values", f"{np.prod(shape)}")
    return found.reshape(shape)
