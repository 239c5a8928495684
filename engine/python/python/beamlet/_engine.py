"""The device, and simulations on it."""

from __future__ import annotations

import atexit
import json
import os
import threading
import weakref
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from . import _beamlet, _vulkan
from ._arguments import shown, whole_number, word
from ._arguments import path as place
from ._errors import ArgumentError, DeviceError, in_python, wrong
from ._options import described
from ._scene import Path, Scene, inner

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._images import Images
    from ._keywords import IdealKeywords
    from ._run import Run

#: Called with the step in work and the share of it that is done, from 0 to 1, or ``None`` where it is
#: not known; about 20 times a second, in the thread of the call. An exception ends the work.
Progress = Callable[[str, float | None], object]
Backend = Literal["auto", "bvh", "ray-query"]
Format = Literal["exr", "npy", "tiff"]

_open: weakref.WeakSet[Engine] = weakref.WeakSet()
_lock = threading.Lock()
_default: Engine | None = None


@dataclass(frozen=True)
class Device:
    """A Vulkan device. `problem` says why it cannot serve, where it cannot."""

    index: int
    name: str
    kind: str
    driver: str
    api_version: str
    problem: str | None
    ray_query: bool
    memory_bytes: int

    @classmethod
    def _of(cls, found: dict[str, Any]) -> Device:
        return cls(**{name: found[name] for name in cls.__dataclass_fields__})


@dataclass(frozen=True)
class CheckReport:
    """What a scene amounts to: ``print`` it; `values` holds the numbers in SI units."""

    text: str
    values: dict[str, Any]

    @property
    def warnings(self) -> list[str]:
        """What looks odd but does not stop a run."""
        return [in_python(warning) for warning in self.values["warnings"]]

    @property
    def refusals(self) -> list[str]:
        """Why a run refuses objects, where it does."""
        return [in_python(refusal) for refusal in self.values["refusals"]]

    def __str__(self) -> str:
        return self.text + "".join(f"\nrefused: {refusal}\n" for refusal in self.refusals)


def devices() -> list[Device]:
    """Every device that Vulkan shows, usable or not.

    Raises:
        DeviceError: Without Vulkan loader, driver or device.
    """
    _vulkan.find_driver()
    with _vulkan.naming_the_package():
        return [Device._of(found) for found in json.loads(_beamlet.devices())]


def _bytes(limit: int | str | None) -> int | None:
    """Bytes of a memory limit, also as text: ``"2 GiB"``."""
    limit = limit if limit is not None else os.environ.get("BEAMLET_MEMORY_LIMIT") or None
    if limit is None or isinstance(limit, str):
        return None if limit is None else _beamlet.memory_size(limit)
    try:
        return whole_number("memory_limit", limit, 1)
    except ArgumentError:
        allowed = 'a whole number of bytes above 0, or text as "2 GiB"'
        raise wrong("memory_limit", shown(limit), allowed) from None


def _seeded(scene: Scene, seed: int | None) -> Scene:
    """The scene with this seed in place of its own, where there is one."""
    inner(scene)
    return scene if seed is None else scene.replace("sampling.seed", seed)


class Engine:
    """A Vulkan device that serves many scenes, from any thread, one after another or at once.

    Args:
        device: Index or part of the name; default: ``BEAMLET_DEVICE``, then the best device.
        backend: How rays find surfaces; default: ``BEAMLET_BACKEND``, then by device and scene.
        memory_limit: Bytes on host and device together, or text such as ``"2 GiB"``; default:
            ``BEAMLET_MEMORY_LIMIT``, then what the geometry needs and up to 1 GiB for a band.
        validation: Request the Khronos validation layer.
        profile: Measure the time of each kernel on the device, for :meth:`profile` and run.json.

    Raises:
        DeviceError: No device can serve; also in a fork of a process that used beamlet.
        ArgumentError: A backend or memory limit that does not exist.
    """

    def __init__(
        self,
        device: str | int | None = None,
        backend: Backend | None = None,
        memory_limit: int | str | None = None,
        validation: bool = False,
        profile: bool = False,
    ) -> None:
        _vulkan.find_driver()
        name = None if device is None else str(device)
        way = None if backend is None else word("backend", backend, Backend)
        way = way or os.environ.get("BEAMLET_BACKEND") or None
        limit = _bytes(memory_limit)
        with _vulkan.naming_the_package():
            self._engine = _beamlet.Engine(name, way, limit, validation, profile)
        _open.add(self)

    @property
    def device(self) -> Device:
        """The device in use."""
        return Device._of(json.loads(self._engine.description()))

    def profile(self) -> dict[str, Any]:
        """Work of the device since it was opened: submissions, waits, bytes each way, buffers, and for each
        kernel dispatches, workgroups and, with ``profile=True``, seconds. A dictionary as ``profile`` in
        run.json."""
        return cast(dict[str, Any], json.loads(self._engine.profile()))

    def simulate(
        self,
        scene: Scene,
        seed: int | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Simulates a scene into arrays.

        Ctrl-C ends it within a second, with ``KeyboardInterrupt``; the engine goes on to serve.

        Args:
            scene: The scene.
            seed: Seed in place of the scene's ``sampling.seed``.
            progress: Callback.

        Raises:
            SceneError, MeshError, DeviceError, OutOfMemoryError, TallyError
        """
        from ._run import Run

        scene = _seeded(scene, seed)
        return Run._of_arrays(self, scene, self._engine.simulate(scene._scene, progress))

    def simulate_to(
        self,
        scene: Scene,
        path: Path,
        seed: int | None = None,
        format: Format = "npy",
        overwrite: bool = False,
        resume: bool = False,
        progress: Progress | None = None,
    ) -> Run:
        """Simulates a scene into a run directory, view by view: for stacks that exceed the memory.

        What is interrupted is resumed with ``resume=True``. Meshes given as arrays are written to
        the folder ``PATH.meshes``, to which the scene of the run refers.

        Args:
            scene: The scene.
            path: Directory of the run.
            seed: Seed in place of the scene's.
            format: Format of the stacks; ``npy`` can be mapped into memory.
            overwrite: Replace a run that is there.
            resume: Go on with a run that is there.
            progress: Callback.

        Returns:
            The run, opened as by :meth:`Run.open`.

        Raises:
            FileError: The place is taken or cannot be written.
            SceneError, MeshError, DeviceError, OutOfMemoryError, TallyError
        """
        from ._run import Run

        scene = _seeded(scene, seed)
        path = os.path.abspath(place("path", path))
        word("format", format, Format)
        meshes = f"{path}.meshes"
        if scene._meshes:
            os.makedirs(meshes, exist_ok=True)
        self._engine.simulate_to(
            scene._scene, path, meshes, format, overwrite, resume, progress
        )
        return Run.open(path, engine=self)

    def check(self, scene: Scene, progress: Progress | None = None) -> CheckReport:
        """Checks a scene: set-up, illumination curve, materials, meshes, doubts, rays, time and memory.

        Raises:
            SceneError, MeshError: For what would stop a run before its first ray.
        """
        text, values = self._engine.check(inner(scene), progress)
        return CheckReport(in_python(text), json.loads(values))

    @described("ideal")
    def ideal(
        self, scene: Scene, *, progress: Progress | None = None, **options: Unpack[IdealKeywords]
    ) -> Images:
        """Ideal images of a scene, as truth for training: the contrasts of a retrieval without noise,
        focal spot, blur, leaks and the bias of its method (docs/retrieval.md, "Ideal images").

        All light that passes the aligned masks straight before a pixel has a distribution of refraction
        angles: ``transmission`` is its sum over that without sample, ``refraction`` its mean (rad),
        ``dark_field`` its variance (rad²), whether structure, roughness or a gradient across the opening
        spreads the angles. Shapes are as in :meth:`Run.retrieve`.

        Args:
            scene: The scene.
            progress: Callback.

        Returns:
            The contrasts, and ``transmission_error``, ``refraction_error`` and ``dark_field_error``: standard
            errors of the sums over rays. NaN behind bars. `record` has ``reach_rad``, ``rays`` and
            ``beyond_tolerance``, the pixels whose errors exceed the tolerances.

        Raises:
            SceneError, MeshError, ArgumentError, DeviceError, OutOfMemoryError, TallyError
        """
        from ._images import Images

        images, geometry, reached, rays, beyond = _beamlet.ideal(
            self._engine, inner(scene), dict(options), progress
        )
        units = {"transmission": "1", "refraction": "rad", "dark_field": "rad²"}
        record = {
            "title": scene.title,
            "method": "ideal",
            "units": {name: units[name.removesuffix("_error")] for name in images},
            "flags": {},
            "reach_rad": reached,
            "rays": rays,
            "beyond_tolerance": beyond,
        }
        return Images(images, record, json.loads(geometry), scene, self)

    def simulate_many(
        self,
        scenes: Iterable[Scene],
        seeds: Iterable[int] | None = None,
    ) -> Iterator[Run]:
        """Simulates scenes one after another, as they are asked for; kernels are made once.

        Args:
            scenes: Scenes, also without end.
            seeds: Seed of each, also without end; default: those of the scenes.

        Returns:
            The run of each scene, in order. A scene that fails ends it with its exception.

        Raises:
            ArgumentError: No scenes or seeds, at once; fewer seeds than scenes, at the first scene
                without one.
        """
        for name, values in (("scenes", scenes), ("seeds", () if seeds is None else seeds)):
            if not isinstance(values, Iterable):
                raise wrong(name, shown(values), f"{name}, one after another")
        return self._many(iter(scenes), None if seeds is None else iter(seeds))

    def _many(self, scenes: Iterator[Scene], seeds: Iterator[int] | None) -> Iterator[Run]:
        for count, scene in enumerate(scenes):
            seed = None if seeds is None else next(seeds, None)
            if seeds is not None and seed is None:
                raise wrong("seeds", f"{count} seeds", "a seed for each scene")
            yield self.simulate(scene, seed=seed)

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self not in _open

    def close(self) -> bool:
        """Closes the device; the end of the process does so too. Runs of this engine use the shared one then.

        Returns:
            Whether it is destroyed; ``False`` while work in another thread uses it.
        """
        _open.discard(self)
        return self._engine.close()

    def __enter__(self) -> Engine:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        try:
            return f"<Engine {self.device.name}>"
        except DeviceError:
            return "<Engine, closed>"


def still_open(engine: Engine | None) -> Engine | None:
    """An engine that is not closed."""
    return None if engine is None or engine.closed else engine


def serving(engine: Engine | None) -> Engine:
    """An engine that was given, or the shared one."""
    if engine is None:
        return default_engine()
    if not isinstance(engine, Engine):
        raise wrong("engine", shown(engine), "an Engine")
    return engine


def default_engine() -> Engine:
    """The engine that functions without one share; opened by the first of them."""
    global _default
    with _lock:
        if _default is None:
            _default = Engine()
        return _default


def simulate_many(scenes: Iterable[Scene], seeds: Iterable[int] | None = None) -> Iterator[Run]:
    """As :meth:`Engine.simulate_many`, on the shared engine."""
    return default_engine().simulate_many(scenes, seeds)


def check(scene: Scene, progress: Progress | None = None) -> CheckReport:
    """As :meth:`Engine.check`, on the shared engine."""
    return default_engine().check(scene, progress)


def _end() -> None:
    """Ends work and closes devices: some drivers crash where one is left at the end of a process."""
    global _default
    if _beamlet.stop():
        for engine in list(_open):
            engine.close()
    _default = None


atexit.register(_end)


def pixels(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres of the columns (x, ascending) and rows (z, from the top) on the detector, m."""
    columns, rows = scene._scene.pixels
    across, down = scene._scene.pitch
    x = (np.arange(columns, dtype=np.float64) + (0.5 - columns / 2)) * across
    z = (np.arange(rows, dtype=np.float64) + (0.5 - rows / 2)) * -down
    return np.asarray(x), np.asarray(z)
