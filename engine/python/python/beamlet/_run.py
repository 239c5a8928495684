"""Stacks of a run, in memory or in a run directory."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _beamlet
from ._arguments import path as place
from ._engine import Engine, Progress, pixels, serving, still_open
from ._errors import FileError, counted, in_python, wrong
from ._options import described
from ._scene import Path, Scene

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._images import Images
    from ._keywords import Method, RunKeywords

Stack = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis of stacks: name, the places of its entries, and their unit."""

    name: str
    values: NDArray[np.float64]
    unit: str


@dataclass(frozen=True, eq=False)
class Counts:
    """Detector numbers, float32: flat and dark ``[step][row][column]``, sample ``[view][step][row][column]``.

    Flats and darks of ``scan.flats_every`` and ``scan.darks_every`` are ``[index][step][row][column]``.
    """

    flat: Stack
    sample: Stack
    dark: Stack | None


class Run:
    """Stacks of a simulation. A pickled run has its arrays.

    Attributes:
        scene: The scene.
        flat: Intensities without sample, float32 ``[step][row][column]``; 1 is the open beam. With
            ``scan.flats_every`` all flats, ``[index][step][row][column]``.
        sample: Intensities with sample, float32 ``[view][step][row][column]``.
        counts: Detector numbers, where the scene has ``detector.photons``.
        record: Device, driver, seed, counts of rays, and times.
        path: Directory of the run; ``None`` for a run in memory.
    """

    def __init__(
        self,
        scene: Scene,
        flat: Stack,
        sample: Stack,
        counts: Counts | None,
        record: Mapping[str, Any],
        path: str | None,
        engine: Engine | None,
    ) -> None:
        self.scene = scene
        self.flat = flat
        self.sample = sample
        self.counts = counts
        self.record = dict(record)
        self.path = path
        self._engine = engine

    @classmethod
    def _of_arrays(
        cls,
        engine: Engine,
        scene: Scene,
        found: tuple[Stack, Stack, tuple[Stack, Stack, Stack] | None, str],
    ) -> Run:
        flat, sample, numbers, record = found
        counts = None if numbers is None else Counts(*numbers)
        return cls(scene, flat, sample, counts, json.loads(record), None, engine)

    @classmethod
    def open(cls, path: Path, engine: Engine | None = None) -> Run:
        """Opens a run directory. NPY stacks are mapped into memory; others are read whole.

        Args:
            path: The directory.
            engine: Engine for what follows; default: the shared one.

        Raises:
            FileError: There is no run, or no view is committed.
        """
        path = place("path", path)
        of_flat, of_sample, of_counts, record = _beamlet.open_run(path)
        counts = None
        if of_counts is not None:
            dark = None if of_counts[2] is None else _one_or_all(_mapped(*of_counts[2]))
            counts = Counts(_one_or_all(_mapped(*of_counts[0])), _mapped(*of_counts[1]), dark)
        scene = Scene.load(os.path.join(path, "scene.toml"))
        flat, sample = _one_or_all(_mapped(*of_flat)), _mapped(*of_sample)
        return cls(scene, flat, sample, counts, json.loads(record), path, engine)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_engine": None}

    @property
    def engine(self) -> Engine:
        """The engine that made the run; the shared one where it is closed or not known."""
        return serving(still_open(self._engine))

    @property
    def axes(self) -> tuple[Axis, Axis, Axis, Axis]:
        """Axes of the sample: views (rad), steps (mask offsets, m), rows (z, m), columns (x, m).

        A flat has the last three. Rows begin at the top; x and z are those of the pixel centres on
        the detector.
        """
        x, z = pixels(self.scene)
        return (
            Axis("view", self.scene.angles[: len(self.sample)], "rad"),
            Axis("step", self.scene.mask_offsets, "m"),
            Axis("row", z, "m"),
            Axis("column", x, "m"),
        )

    def to_xarray(self) -> Any:
        """Flat and sample with their axes as an ``xarray.Dataset``; needs xarray."""
        import xarray  # type: ignore[import-not-found, unused-ignore]

        axes = self.axes
        names = [axis.name for axis in axes]
        coords = {axis.name: (axis.name, axis.values, {"units": axis.unit}) for axis in axes}
        of_values = {"units": "1", "long_name": "intensity, 1 is the open beam"}
        of_flat = names[1:] if self.flat.ndim == 3 else ["flat_index", *names[1:]]
        stacks = {"flat": (of_flat, self.flat, of_values), "sample": (names, self.sample, of_values)}
        return xarray.Dataset(stacks, coords=coords, attrs={"record": json.dumps(self.record)})

    @described("retrieve")
    def retrieve(
        self,
        method: Method | None = None,
        counts: bool = False,
        *,
        progress: Progress | None = None,
        **options: Unpack[RunKeywords],
    ) -> Images:
        """Retrieves transmission, refraction and dark field, as ``beamlet retrieve`` does (docs/retrieval.md).

        Args:
            counts: Retrieve from detector numbers, with uncertainties.
            progress: Callback.

        Raises:
            SceneError: The method does not suit the set-up or its mask offsets.
            ArgumentError: The run has no counts, or options do not go together.
        """
        from ._retrieve import Stacks, retrieved

        if not counts:
            stacks = Stacks("intensities", self.flat, self.sample)
        elif self.counts is None:
            raise wrong("counts", "a run without counts", "a scene with detector.photons")
        else:
            stacks = Stacks("counts", self.counts.flat, self.counts.sample, self.counts.dark)
        given = {"method": method, **options}
        return retrieved(self.engine, self.scene, stacks, given, progress)

    def view(self, width: int | None = None) -> list[Any]:
        """Pictures of the run, of its directory alone. See :func:`beamlet.view`."""
        from ._view import view

        return view(self, width=width)

    @property
    def warnings(self) -> list[str]:
        """What to look at: a sample outside the field of view, errors that may exceed a tolerance."""
        return [in_python(str(warning)) for warning in self.record.get("warnings", ())]

    def __repr__(self) -> str:
        views, steps, rows, columns = self.sample.shape
        place = f" in {self.path}" if self.path else ""
        doubts = counted(self.warnings)
        return f"<Run of {views} views x {steps} steps of {columns} x {rows} pixels{place}{doubts}>"


def _one_or_all(stack: Stack) -> Stack:
    """A flat or dark alone, or all of several."""
    return stack[0] if len(stack) == 1 else stack


def _mapped(file: str | os.PathLike[str], shape: tuple[int, int, int, int]) -> Stack:
    """A stack of a run directory, ``[view][step][row][column]``."""
    path = os.fspath(file)
    views, steps, rows, columns = shape
    if path.endswith(".npy"):
        try:
            stack: Stack = np.load(path, mmap_mode="r")
        except (OSError, ValueError) as error:
            raise FileError(f"{path}: cannot be mapped: {error}", file=path) from error
        # Views that are not committed have their place in the file.
        return stack.reshape(-1, steps, rows, columns)[:views]
    return _beamlet.read_stack(path, steps, views)
