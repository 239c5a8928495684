"""Types of the keywords of verbs, from the tables of options: BEAMLET_WRITE_DOCS=1 cargo test --test inputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

Lengths = Sequence[str | float] | NDArray[np.floating[Any]]
Span = tuple[int, int]
#: Columns, or columns and rows, each from a first to an end that is excluded.
EmptyBeam = Span | tuple[Span, Span]
Correction = Literal["offset", "plane", "dose", "steps"]
Method = Literal["gaussian", "three-step", "two-step", "moments", "triangle", "exact-curve", "beamlet"]
Weights = Literal["none", "poisson"]
Reconstruction = Literal["fbp", "cgls", "sirt", "bb"]
Window = Literal["ram-lak", "shepp-logan", "hann"]


class RunKeywords(TypedDict, total=False):
    bad_pixels: ArrayLike | None
    columns: slice | None
    bin: tuple[int, int] | None
    empty_beam: EmptyBeam | None
    correct: Correction | Sequence[Correction] | None
    lattice: str | None
    aperture: str | None
    detector_aperture: str | None
    omit_steps: Sequence[int] | None
    background: str | float | None
    weights: Weights
    gain: float | None
    read_noise: float | None
    saturation: float | None
    phase: bool


class MeasuredKeywords(RunKeywords, total=False):
    flats_every: int | None
    offsets_z: Lengths | None


class ReconstructKeywords(TypedDict, total=False):
    method: Reconstruction
    filter: Window
    cut_off: float
    arm_passes: int | None
    extrapolate: bool
    iterations: int
    discrepancy: float | None
    non_negative: bool
    phase: bool
    mask: ArrayLike | str | None
    start: ArrayLike | None
    rings: bool
    keep_views: bool
    beam_hardening: str | None
    voxel: str | float | None
    size: Sequence[int] | None
    origin: Lengths | None
    centre: float | Literal["auto"] | None
    truth: bool


class IdealKeywords(TypedDict, total=False):
    reach: str | float | None
    tolerance: float
    angle_tolerance: float
    most_rays: int
