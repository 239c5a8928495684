"""Materials, spectra, and differences of files."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._arguments import array, number, path, shown, text
from ._engine import Progress
from ._errors import wrong
from ._run import Run
from ._scene import Path, Scene, inner


@dataclass(frozen=True, eq=False)
class Material:
    """Constants of a material: attenuation `mu` (1/m) and decrement `delta` (1) at `energies` (keV), float64 of
    one shape."""

    name: str
    energies: NDArray[np.float64]
    mu: NDArray[np.float64]
    delta: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Beam:
    """Photons by energy: `energies` in keV, `weights` on any scale, both ``[energy]``."""

    energies: NDArray[np.float64]
    weights: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Beam of a scene.

    Attributes:
        before: Before the filters; ``None`` for a single energy.
        after: Behind them.
        nodes: Energies that represent it, with their shares of the signal.
        mean_energy: keV.
        half_value_layer: Of aluminium, m; ``None`` for a single energy.
    """

    before: Beam | None
    after: Beam | None
    nodes: Beam
    mean_energy: float
    half_value_layer: float | None


@dataclass(frozen=True)
class Difference:
    """How two series of images differ, b - a: see ``beamlet compare``.

    Attributes:
        name: Of the series: ``flat``, ``sample``, ``transmission``, ...
        images: Number of images.
        pixels: Number of pixels that are finite in both.
        unlike: Number of pixels that are finite in one alone, or infinite in unlike ways.
        mean_a, mean_b: Means of both.
        mean: Mean of the differences.
        rms: Their root mean square.
        relative: `rms` over the root mean square of a; ``None`` where this is 0.
        largest: Largest absolute difference.
        largest_at: View, step, row and column where it is.
    """

    name: str
    images: int
    pixels: int
    unlike: int
    mean_a: float
    mean_b: float
    mean: float
    rms: float
    relative: float | None
    largest: float
    largest_at: tuple[int, int, int, int]


def material(
    name: str,
    energy: ArrayLike,
    density: float | None = None,
    scene: Scene | None = None,
) -> Material:
    """Constants of a material.

    Args:
        name: Built-in material, material of `scene`, or with `density` a formula.
        energy: Photon energies, keV, of any shape; a number counts as one energy.
        density: g/cm³.
        scene: Scene whose materials are used.

    Raises:
        ArgumentError: Unknown name or formula, no numbers, or energies outside the tables.

    Example:
        >>> water = material("water", [20.0, 30.0])
        >>> bool(np.all(np.diff(water.mu) < 0)), f"{water.delta[1]:.3e}"
        (True, '2.560e-07')
    """
    numbers = array("energy", energy, "numbers, keV")
    if numbers.dtype.kind not in "fiu":
        raise wrong("energy", shown(energy), "numbers, keV")
    energies = np.atleast_1d(numbers.astype(np.float64))
    of_scene = None if scene is None else inner(scene)
    name = text("name", name, "the name of a material")
    weight = None if density is None else number("density", density, "g/cm³")
    mu, delta = _beamlet.material(name, energies.ravel().tolist(), weight, of_scene)
    shape = energies.shape
    return Material(name, energies, np.reshape(mu, shape), np.reshape(delta, shape))


def spectrum(scene: Scene) -> Spectrum:
    """The beam of a scene before and after its filters.

    Raises:
        SceneError, FileError: Spectrum files or filters that are not possible.
    """
    found = json.loads(_beamlet.spectrum(inner(scene)))

    def beam(part: dict[str, list[float]] | None) -> Beam | None:
        if part is None:
            return None
        return Beam(np.array(part["energies_kev"]), np.array(part["weights"]))

    nodes = found["nodes"]
    return Spectrum(
        beam(found["before_filters"]),
        beam(found["after_filters"]),
        Beam(np.array(nodes["energies"]), np.array(nodes["weights"])),
        found["mean_energy_kev"],
        found["half_value_layer_m"],
    )


def compare(a: Run | Path, b: Run | Path, progress: Progress | None = None) -> list[Difference]:
    """Differences of two run directories, directories of retrieved images, or stacks in files.

    Raises:
        ArgumentError: A run in memory, or no path.
        FileError: One cannot be read, or their kinds or shapes differ.
    """
    found = json.loads(_beamlet.compare(_place("a", a), _place("b", b), progress))
    return [Difference(**{**one, "largest_at": tuple(one["largest_at"])}) for one in found]


def _place(name: str, what: Run | Path) -> str:
    """The path of a run directory, or of other files."""
    if not isinstance(what, Run):
        return path(name, what)
    if what.path is None:
        raise wrong(name, "a run in memory", "a run directory: Engine.simulate_to")
    return what.path
