"""Retrieval from arrays: measured stacks, and the stacks of a run."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._arguments import array, number, shown, text, whole, whole_number, word
from ._engine import Engine, Progress, serving
from ._errors import wrong
from ._images import Images
from ._scene import Scene, inner
from ._volume import lengths

Method = Literal[
    "gaussian",
    "three-step",
    "two-step",
    "moments",
    "triangle",
    "exact-curve",
    "beamlet",
]
Weights = Literal["none", "poisson"]
Correction = Literal["offset", "plane", "dose", "steps"]
Span = tuple[int, int]
#: Columns, or columns and rows, each from a first to an end that is excluded.
EmptyBeam = Span | tuple[Span, Span]


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


def _span(name: str, value: object, allowed: str) -> list[int]:
    """First and last index of a range, the last excluded."""
    found = whole(name, value, 2, allowed)
    if found[0] >= found[1]:
        raise wrong(name, shown(value), allowed)
    return found


def _empty_beam(value: object) -> tuple[list[int], list[int] | None]:
    """Columns, and rows where they are given."""
    name, allowed = "empty_beam", "(first, end) of columns, or a pair of these of columns and rows"
    if isinstance(value, tuple | list) and len(value) == 2 and isinstance(value[0], tuple | list):
        return _span(name, value[0], allowed), _span(name, value[1], allowed)
    return _span(name, value, allowed), None


def _columns(value: object) -> str:
    """Columns that are kept, as the engine reads them."""
    name, allowed = "columns", "a slice of columns, as slice(1, None, 2)"
    if not isinstance(value, slice):
        raise wrong(name, shown(value), allowed)
    start = 0 if value.start is None else whole_number(name, value.start, 0)
    end = "" if value.stop is None else str(whole_number(name, value.stop, 1))
    step = 1 if value.step is None else whole_number(name, value.step, 1)
    return f"{start}:{end}:{step}"


def _correct(value: object) -> str | None:
    """Names of corrections, as the engine reads them."""
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, Sequence):
        raise wrong("correct", shown(value), f"some of {', '.join(get_args(Correction))}")
    return ",".join(word("correct", name, Correction) for name in names) or None


def _omit_steps(value: object) -> list[int]:
    """Steps to leave out."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise wrong("omit_steps", shown(value), "a list of mask steps, from 0")
    return [whole_number("omit_steps", step, 0) for step in value]


def _bad_pixels(value: ArrayLike, frame: tuple[int, ...]) -> NDArray[np.float32]:
    bad = array("bad_pixels", value, "bool or numbers, (row, column)")
    if bad.ndim != 2 or bad.dtype.kind not in "bfiu":
        given = f"shape {bad.shape}, dtype {bad.dtype}"
        raise wrong("bad_pixels", given, "bool or numbers, (row, column)")
    _check_frames("bad_pixels", bad, frame)
    if (bad != 0).all():
        raise wrong("bad_pixels", "every pixel", "False or 0 where a pixel is good")
    return bad.astype(np.float32)


def _background(value: Any) -> str:
    return value if isinstance(value, str) else str(number("background", value))


def _options(given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a retrieval, checked, as the extension takes them."""
    chosen: dict[str, Any] = dict.fromkeys((
        "gain", "read_noise", "saturation", "flats_every", "columns", "bin",
        "empty_beam", "correct", "omit_steps", "method", "lattice", "aperture", "detector_aperture",
        "offsets_z", "background",
    ))
    chosen |= {name: value for name, value in given.items() if value is not None}
    if given["method"] is not None:
        word("method", given["method"], Method)
    word("weights", given["weights"], Weights)
    checks: dict[str, Callable[[Any], Any]] = {
        "gain": lambda value: number("gain", value),
        "read_noise": lambda value: number("read_noise", value),
        "saturation": lambda value: number("saturation", value),
        "flats_every": lambda value: whole_number("flats_every", value, 1),
        "omit_steps": _omit_steps,
        "columns": _columns,
        "bin": lambda value: whole("bin", value, 2, "numbers of columns and rows, 1 or more", least=1),
        "empty_beam": _empty_beam,
        "correct": _correct,
        "phase": bool,
        "background": _background,
        "lattice": lambda value: text("lattice", value, 'text as "40 um, 40 um, 3 deg"'),
        "aperture": lambda value: text("aperture", value, 'text as "30 um, 20 um" or "round 30 um"'),
        "detector_aperture": lambda value: text("detector_aperture", value, 'text as "30 um, 20 um"'),
        "offsets_z": lambda value: lengths("offsets_z", value),
    }
    for name, check in checks.items():
        if chosen.get(name) is not None:
            chosen[name] = check(chosen[name])
    return chosen


def retrieved(
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
    chosen = _options(options) | {"bad_pixels": None}
    with tempfile.TemporaryDirectory(prefix="beamlet-") as folder:
        if bad_pixels is not None:
            path = f"{folder}/bad_pixels.npy"
            np.save(path, _bad_pixels(bad_pixels, frame))
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
    offsets: Sequence[str | float] | NDArray[np.floating[Any]] | None,
    geometry: Scene,
    dark: ArrayLike | None = None,
    method: Method | None = None,
    weights: Weights = "none",
    gain: float | None = None,
    read_noise: float | None = None,
    saturation: float | None = None,
    bad_pixels: ArrayLike | None = None,
    engine: Engine | None = None,
    progress: Progress | None = None,
    *,
    flats_every: int | None = None,
    omit_steps: Sequence[int] = (),
    columns: slice | None = None,
    bin: tuple[int, int] | None = None,
    empty_beam: EmptyBeam | None = None,
    correct: Correction | Sequence[Correction] = (),
    phase: bool = False,
    background: str | float | None = None,
    offsets_z: Sequence[str | float] | NDArray[np.floating[Any]] | None = None,
    lattice: str | None = None,
    aperture: str | None = None,
    detector_aperture: str | None = None,
) -> Images:
    """Retrieves measured stacks, as ``beamlet retrieve`` does (docs/retrieval.md).

    Args:
        flat: Counts without sample, ``[step][row][column]``; several flats ``[flat][step][row][column]``:
            one for each view, or with `flats_every`.
        sample: Counts with sample, ``[view][step][row][column]`` or ``[step][row][column]``.
        offsets: Mask offset of each step, m, or text with a unit; ``None``: those of the geometry's scan.
        geometry: Scene with the set-up.
        dark: Counts without beam, ``[frame][row][column]`` or ``[row][column]``; their mean is subtracted.
        method: The estimator; default: ``exact-curve`` where the scene knows the curve of its masks, ``beamlet`` for a
            sample mask alone (on a lattice with `aperture`), else ``gaussian``.
        weights: ``poisson`` weights counts by their noise.
        gain: Counts of a photon; default 1.
        read_noise: Standard deviation of counts without beam, in counts.
        saturation: Counts of this value and above are left out.
        bad_pixels: True or not zero where a pixel is bad, ``[row][column]``.
        engine: Engine; default: the shared one.
        progress: Callback.
        flats_every: Views between one flat and the next: the flat of a view is interpolated between the
            two nearest.
        omit_steps: Mask steps to leave out of flat and sample with their offsets, counted from 0, as a
            frame without beam.
        columns: Columns to keep, as ``slice(1, None, 2)`` for a mask of two pixels per period.
        bin: Columns and rows to combine into one pixel, after `columns`: sums of counts.
        empty_beam: Pixels (after `columns` and `bin`) with nothing in the beam: ``(first, end)`` of
            columns, or ``((first, end), (first, end))`` of columns and rows, the ends excluded.
            ``record["empty_beam"]`` has transmission, dose and drift there.
        correct: Corrections from these pixels or, without them, from both sides of each view where they
            are empty: ``"offset"``, ``"plane"``, ``"dose"``, ``"steps"``. ``record["corrections"]`` has
            their values.
        phase: Images of the phase, too: refraction integrated along the rows, m of delta times length.
        background: Background of the curves, for ``gaussian`` and ``exact-curve``: ``"free"``, the light that the masks
            ``"leak"``, or a number of counts; default: ``"leak"`` where the masks are known and nothing scatters.
        offsets_z: Mask offset along z of each step, as `offsets`: refraction and dark field along x and z.
        lattice: Lattice of the beamlets of a sample mask alone, as it is on the detector: ``"40 um, 40 um"``, with
            an angle ``"40 um, 40 um, 3 deg"``, or two vectors ``"40 um, 0 um; 20 um, 34.6 um"``. Refraction and
            dark field along x and z.
        aperture: Aperture of the sample mask as it is projected on the detector, or with `offsets_z` on the detector
            mask: ``"30 um, 20 um"`` or ``"round 30 um"``.
        detector_aperture: Aperture of the detector mask, for `offsets_z` and ``exact-curve``: ``"30 um, 20 um"``.

    Returns:
        Images ``[view][row][column]``; a stack ``[step][row][column]`` has one view.

    Raises:
        ArgumentError: An array of another shape or type, or an option that cannot be; `key` names it.
        FileError: A number of steps of the sample that the method does not take, or of flats.
        SceneError: Offsets or a set-up that the method does not take.
    """
    of_sample = array("sample", sample, "(view, step, row, column) or (step, row, column)")
    return retrieved(
        serving(engine),
        geometry,
        "measured",
        flat,
        of_sample[np.newaxis] if of_sample.ndim == 3 else of_sample,
        dark=dark,
        mask_offsets=None if offsets is None else lengths("offsets", offsets),
        bad_pixels=bad_pixels,
        progress=progress,
        method=method,
        weights=weights,
        gain=gain,
        read_noise=read_noise,
        saturation=saturation,
        flats_every=flats_every,
        omit_steps=omit_steps,
        columns=columns,
        bin=bin,
        empty_beam=empty_beam,
        correct=correct,
        phase=phase,
        background=background,
        offsets_z=offsets_z,
        lattice=lattice,
        aperture=aperture,
        detector_aperture=detector_aperture,
    )
