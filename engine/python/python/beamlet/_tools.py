"""Materials, spectra, and differences of files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import _beamlet
from ._engine import Progress
from ._scene import Path, Scene


@dataclass(frozen=True)
class Material:
    """Constants of a material: attenuation `mu` (1/m) and decrement `delta` at `energies` (keV)."""

    name: str
    energies: NDArray[np.float64]
    mu: NDArray[np.float64]
    delta: NDArray[np.float64]


@dataclass(frozen=True)
class Beam:
    """Photons by energy: `energies` in keV, `weights` on any scale."""

    energies: NDArray[np.float64]
    weights: NDArray[np.float64]


@dataclass(frozen=True)
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
    """How two series of images differ, b - a: see ``beamlet compare``."""

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
    energy: float | Sequence[float] | NDArray[np.floating],
    density: float | None = None,
    scene: Scene | None = None,
) -> Material:
    """Constants of a material.

    Args:
        name: Built-in material, material of `scene`, or with `density` a formula.
        energy: Photon energies, keV.
        density: g/cm³.
        scene: Scene whose materials are used.

    Raises:
        SceneError: Unknown name, or energies outside the tables.

    Example:
        >>> water = material("water", [20.0, 30.0])
        >>> bool(np.all(np.diff(water.mu) < 0)), f"{water.delta[1]:.3e}"
        (True, '2.560e-07')
    """
    energies = np.atleast_1d(np.asarray(energy, dtype=np.float64))
    inner = None if scene is None else scene._scene
    mu, delta = _beamlet.material(name, energies.tolist(), density, inner)
    return Material(name, energies, np.array(mu), np.array(delta))


def spectrum(scene: Scene) -> Spectrum:
    """The beam of a scene before and after its filters.

    Raises:
        SceneError, FileError: Spectrum files or filters that are not possible.
    """
    found = json.loads(_beamlet.spectrum(scene._scene))

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


def compare(a: Path, b: Path, progress: Progress | None = None) -> list[Difference]:
    """Differences of two run directories, directories of retrieved images, or stacks in files.

    Raises:
        FileError: One cannot be read, or their kinds or shapes differ.
    """
    found = json.loads(_beamlet.compare(a, b, progress))
    return [Difference(**{**one, "largest_at": tuple(one["largest_at"])}) for one in found]
