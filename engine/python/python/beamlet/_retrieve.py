"""Retrieval from arrays: measured stacks, and the stacks of a run."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _beamlet
from ._arguments import array
from ._engine import Engine, Progress, serving
from ._errors import wrong
from ._images import Images
from ._options import described
from ._scene import Scene, inner

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._keywords import Lengths, MeasuredKeywords, Method


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


def _bad_pixels(value: ArrayLike, frame: tuple[int, ...]) -> NDArray[np.float32]:
    bad = array("bad_pixels", value, "bool or numbers, (row, column)")
    if bad.ndim != 2 or bad.dtype.kind not in "bfiu":
        given = f"shape {bad.shape}, dtype {bad.dtype}"
        raise wrong("bad_pixels", given, "bool or numbers, (row, column)")
    _check_frames("bad_pixels", bad, frame)
    if (bad != 0).all():
        raise wrong("bad_pixels", "every pixel", "False or 0 where a pixel is good")
    return bad.astype(np.float32)


@dataclass(frozen=True, eq=False)
class Stacks:
    """Stacks of a retrieval; `kind`: intensities or counts of a simulation, or measured."""

    kind: Literal["intensities", "counts", "measured"]
    flat: ArrayLike
    sample: ArrayLike
    dark: ArrayLike | None = None


def retrieved(
    engine: Engine, scene: Scene, stacks: Stacks, options: Mapping[str, Any], progress: Progress | None
) -> Images:
    """Images of stacks."""
    of_scene = inner(scene, "geometry" if stacks.kind == "measured" else "scene")
    of_flat, of_sample = _stack("flat", stacks.flat, 3), _stack("sample", stacks.sample, 4)
    of_dark = None if stacks.dark is None else _stack("dark", stacks.dark, 2)
    frame = of_flat.shape[-2:]
    _check_frames("sample", of_sample, frame)
    if of_dark is not None:
        _check_frames("dark", of_dark, frame)
    chosen = dict(options)
    with tempfile.TemporaryDirectory(prefix="beamlet-") as folder:
        if chosen.get("bad_pixels") is not None:
            path = f"{folder}/bad_pixels.npy"
            np.save(path, _bad_pixels(chosen["bad_pixels"], frame))
            chosen["bad_pixels"] = path
        found = _beamlet.retrieve(
            engine._engine, of_scene, stacks.kind, of_flat, of_sample, of_dark, chosen, progress
        )
    return Images._of(found, scene, engine)


@described("retrieve")
def retrieve(
    flat: ArrayLike,
    sample: ArrayLike,
    offsets: Lengths | None,
    geometry: Scene,
    dark: ArrayLike | None = None,
    method: Method | None = None,
    *,
    engine: Engine | None = None,
    progress: Progress | None = None,
    **options: Unpack[MeasuredKeywords],
) -> Images:
    """Retrieves measured stacks, as ``beamlet retrieve`` does (docs/retrieval.md).

    Args:
        flat: Counts without sample, ``[step][row][column]``; several flats ``[flat][step][row][column]``:
            one for each view, or with `flats_every`.
        sample: Counts with sample, ``[view][step][row][column]`` or ``[step][row][column]``.
        geometry: Scene with the set-up.
        dark: Counts without beam, ``[frame][row][column]`` or ``[row][column]``; their mean is subtracted.
        engine: Engine; default: the shared one.
        progress: Callback.

    Returns:
        Images ``[view][row][column]``; a stack ``[step][row][column]`` has one view.

    Raises:
        ArgumentError: An array of another shape or type, or an option that cannot be; `key` names it.
        FileError: A number of steps of the sample that the method does not take, or of flats.
        SceneError: Offsets or a set-up that the method does not take.
    """
    of_sample = array("sample", sample, "(view, step, row, column) or (step, row, column)")
    all_views = of_sample[np.newaxis] if of_sample.ndim == 3 else of_sample
    given = {"offsets": offsets, "method": method, **options}
    return retrieved(serving(engine), geometry, Stacks("measured", flat, all_views, dark), given, progress)
