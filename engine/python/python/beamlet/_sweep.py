"""Designs of a set-up: a scene with values of its keys varied, and scores of each."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _beamlet
from ._arguments import path as place
from ._arguments import shown, text
from ._engine import Engine, Progress, serving
from ._errors import wrong
from ._scene import Meshes, Path, Scene, inner, toml

#: Values of keys, by key: a range or list as text, or a list; or the path of a CSV table.
Varied = Mapping[str, Any] | Path
_ALLOWED = "a dict of keys and values, the path of a CSV table, or a list of these"


@dataclass(frozen=True, eq=False)
class Sweep:
    """Designs of a scene with their scores, counted from 0.

    Attributes:
        shape: Number of values of each varied key or table; ``scores[name].reshape(shape)`` has an axis for each.
        values: Values of the varied keys by key, ``[design]``: float64 in ``units[key]``, or text.
        scores: Values by score, ``[design]``, float64 in ``units[score]``; NaN where a design has none.
        units: Units by key, as they were given, and by score, in SI.
        photons: Photons of an open pixel in a frame, ``[design]``; NaN without photons.
        exposure: Exposure of a frame, s, ``[design]``; NaN without ``detector.exposure``.
        refused: Why the scene of a design is refused, or a score is not determined, ``[design]``; ``None``: nothing is.
        front: True for designs on the Pareto front of the first two scores, ``[design]``; empty with one score.
        best: The best design by the first score; ``None`` where no design has it.
    """

    shape: tuple[int, ...]
    values: dict[str, NDArray[Any]]
    scores: dict[str, NDArray[np.float64]]
    units: dict[str, str]
    photons: NDArray[np.float64]
    exposure: NDArray[np.float64]
    refused: list[str | None]
    front: NDArray[np.bool_]
    best: int | None
    _scene: Scene = field(repr=False)
    _sets: list[list[str]] = field(repr=False)

    def __len__(self) -> int:
        return len(self._sets)

    def scene(self, design: int | None = None) -> Scene:
        """The scene of a design, with the photons or the exposure of the fixed quantity.

        Args:
            design: Its number; default: the best one.

        Raises:
            ArgumentError: No such design, or none is the best.
            SceneError: The scene refuses the design.
        """
        chosen = self.best if design is None else design
        if chosen is None or not 0 <= chosen < len(self):
            found = "no design with a score" if chosen is None else shown(design)
            raise wrong("design", found, f"0 to {len(self) - 1}")
        return self._scene._with(self._sets[chosen], self._scene._meshes)

    @classmethod
    def _of(cls, scene: Scene, found: dict[str, Any]) -> Sweep:
        designs = found["designs"]

        def numbers(values: Iterable[float | None]) -> NDArray[np.float64]:
            return np.array([np.nan if value is None else value for value in values])

        units: dict[str, str] = {}
        values: dict[str, NDArray[Any]] = {}
        for index, key in enumerate(found["keys"]):
            written = [design["values"][index] for design in designs]
            units[key["path"]] = key["unit"]
            try:
                values[key["path"]] = np.array([float(value) for value in written])
            except ValueError:
                values[key["path"]] = np.array(written)
        units.update(found["units"])
        scores = {
            name: numbers(design["scores"][name] for design in designs) for name in found["units"]
        }
        front = [design["pareto"] for design in designs if design["pareto"] is not None]
        return cls(
            shape=tuple(found["shape"]),
            values=values,
            scores=scores,
            units=units,
            photons=numbers(design["photons"] for design in designs),
            exposure=numbers(design["exposure"] for design in designs),
            refused=[design["refused"] for design in designs],
            front=np.array(front, dtype=np.bool_),
            best=None if found["best"] is None else found["best"] - 1,
            _scene=scene,
            _sets=[design["set"] for design in designs],
        )


def _item(key: str, value: object, meshes: Meshes) -> str:
    """A value of a list as the engine reads it: text without separators as it is."""
    if isinstance(value, str) and not re.search(r'[,"\[\]{}]', value):
        return value
    return toml(key, value, meshes)


def _texts(vary: object, meshes: Meshes) -> list[str]:
    """Texts of the option ``--vary``."""
    if isinstance(vary, str | os.PathLike):
        return [place("vary", vary)]
    if not isinstance(vary, Mapping):
        if not isinstance(vary, Iterable):
            raise wrong("vary", shown(vary), _ALLOWED)
        return [one for part in vary for one in _texts(part, meshes)]
    found = []
    for name, values in vary.items():
        key = text("vary", name, "keys of the scene")
        if isinstance(values, np.ndarray):
            values = values.tolist()
        if not isinstance(values, str):
            many = values if isinstance(values, list | tuple | range) else [values]
            values = ", ".join(_item(key, value, meshes) for value in many)
        found.append(f"{key}={values}")
    return found


def sweep(
    scene: Scene,
    vary: Varied | Sequence[Varied],
    score: str | Sequence[str],
    fix: str | None = None,
    *,
    path: Path | None = None,
    overwrite: bool = False,
    resume: bool = False,
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Scores the designs of a set-up, as ``beamlet sweep`` does (docs/how-to/design.md).

    Ctrl-C ends it within a second, with ``KeyboardInterrupt``; with ``path`` it keeps finished designs.

    Args:
        scene: The scene.
        vary: Values by key: text with a range ``"10:40:16 um"`` or a list ``"10, 20, 40 um"``, or a list of values as
            of :meth:`Scene.replace`; the path of a CSV table with keys in its header and a design a row; or a list of
            these. All combinations are designs, up to 100,000; the values of the last key change first.
        score: Names of scores, a list or separated by commas; the first decides which design is best.
        fix: What all designs have in common, ``"time"``, ``"dose"`` or ``"photons"`` of the scan, as the scene has it or
            with a value, ``"time=60 s"``: the exposure or the photons of each design follow from it.
        path: Directory for the record of finished designs, ``sweep.json``, as ``beamlet sweep`` writes it.
        overwrite: Replace a record that is there.
        resume: Go on with the record that is there, of the same scene, values, scores and fixed quantity.
        engine: Engine; default: the shared one.
        progress: Callback.

    Raises:
        ArgumentError: Values, scores or a quantity that cannot be; `key` names the argument.
        SceneError: A key that no scene has, at once. A design that the scene refuses is in ``refused``.
        FileError: A table that cannot be read, or has rows of unlike lengths; a record that is there without
            ``overwrite`` and ``resume``; with ``resume`` none, or one of another sweep.
        DeviceError, OutOfMemoryError

    Example:
        >>> found = sweep(scene, {"detector.pitch": "50, 100 um"}, "visibility")  # doctest: +SKIP
        >>> found.scores["visibility"], found.scene().shape  # doctest: +SKIP
    """
    inner(scene)
    names = [score] if isinstance(score, str) else score
    if not isinstance(names, Iterable):
        raise wrong("score", shown(score), "names of scores")
    wanted = [text("score", name, "names of scores") for name in names]
    quantity = None if fix is None else text("fix", fix, "time, dose or photons")
    directory = None if path is None else place("path", path)
    meshes = dict(scene._meshes)
    texts = _texts(vary, meshes)
    known = scene._with((), meshes)
    found = _beamlet.sweep(
        serving(engine)._engine, known._scene, texts, wanted, quantity, directory, overwrite, resume, progress
    )
    return Sweep._of(known, json.loads(found))
