"""The engine of beamlet; `beamlet` wraps it. Checked against the module by mypy's stubtest."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

_Path = str | os.PathLike[str]
_Progress = Callable[[str, float | None], object] | None
_Floats = NDArray[np.float32]
_Counts = tuple[_Floats, _Floats, _Floats]
_Run = tuple[_Floats, _Floats, _Counts | None, str]
_Images = tuple[dict[str, _Floats], str, str | None]
_Shape = tuple[int, int, int, int]
_Place = tuple[Path, _Shape]
_Meshes = Mapping[str, tuple[NDArray[np.float64], NDArray[np.uint32]]]

__all__ = [
    "Engine",
    "Projector",
    "Scene",
    "__version__",
    "compare",
    "devices",
    "fill",
    "ideal",
    "keywords",
    "material",
    "memory_size",
    "open_run",
    "prepare",
    "program",
    "read_images",
    "read_stack",
    "reconstruct",
    "retrieve",
    "spectrum",
    "stop",
    "sweep",
    "weights",
]
__version__: str

@final
class Scene:
    @staticmethod
    def load(path: _Path, sets: Sequence[str], meshes: _Meshes) -> Scene: ...
    @staticmethod
    def parse(
        text: str,
        json: bool,
        directory: _Path,
        sets: Sequence[str],
        meshes: _Meshes,
    ) -> Scene: ...
    def to_toml(self, directory: _Path) -> str: ...
    @property
    def angles(self) -> list[float]: ...
    @property
    def energy(self) -> float | None: ...
    @property
    def geometry(self) -> str: ...
    @property
    def mask_offsets(self) -> list[float]: ...
    @property
    def mask_offsets_z(self) -> list[float]: ...
    @property
    def pitch(self) -> list[float]: ...
    @property
    def pixels(self) -> list[int]: ...
    @property
    def title(self) -> str | None: ...

@final
class Engine:
    def __new__(
        cls,
        device: str | None,
        backend: str | None,
        memory_limit: int | None,
        validation: bool,
        profile: bool,
    ) -> Engine: ...
    def check(self, scene: Scene, progress: _Progress) -> tuple[str, str]: ...
    def close(self) -> bool: ...
    def description(self) -> str: ...
    def profile(self) -> str: ...
    def simulate(self, scene: Scene, progress: _Progress) -> _Run: ...
    def simulate_to(
        self,
        scene: Scene,
        path: _Path,
        meshes: _Path,
        format: str,
        overwrite: bool,
        resume: bool,
        progress: _Progress,
    ) -> str: ...

@final
class Projector:
    def __new__(
        cls, engine: Engine, circle: Mapping[str, object], data: str, options: dict[str, Any]
    ) -> Projector: ...
    def project(self, volume: _Floats, progress: _Progress) -> _Floats: ...
    def transpose(self, sinograms: _Floats, progress: _Progress) -> _Floats: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def sinograms(self) -> list[int]: ...
    @property
    def size(self) -> list[int]: ...
    @property
    def units(self) -> tuple[str, str]: ...
    @property
    def voxel(self) -> list[float]: ...

def compare(a: _Path, b: _Path, progress: _Progress) -> str: ...
def devices() -> str: ...
def fill(
    places: Sequence[Sequence[float]], of: str, image: _Floats, flags: _Floats | None
) -> tuple[_Floats, int]: ...
def ideal(
    engine: Engine,
    scene: Scene,
    options: dict[str, Any],
    progress: _Progress,
) -> tuple[dict[str, _Floats], str, float, int, int]: ...
def keywords(verb: str) -> list[tuple[str, str, str, str, bool, bool]]: ...
def material(
    name: str, energies: Sequence[float], density: float | None, scene: Scene | None
) -> tuple[list[float], list[float]]: ...
def memory_size(text: str) -> int: ...
def open_run(
    path: _Path,
) -> tuple[_Place, _Place, tuple[_Place, _Place, _Place | None] | None, str]: ...
def prepare(
    circle: Mapping[str, object], of: str, image: _Floats, flags: _Floats | None
) -> tuple[_Floats, tuple[int, int, int, int]]: ...
def program(words: Sequence[str]) -> int: ...
def read_images(path: _Path) -> _Images: ...
def read_stack(path: _Path, steps: int, views: int) -> _Floats: ...
def reconstruct(
    engine: Engine,
    circle: Mapping[str, object],
    sinograms: _Floats,
    of: str,
    options: dict[str, Any],
    given: Mapping[str, object],
    scene: Scene | None,
    progress: _Progress,
) -> dict[str, Any]: ...
def retrieve(
    engine: Engine,
    scene: Scene,
    kind: str,
    flat: _Floats,
    sample: _Floats,
    dark: _Floats | None,
    options: dict[str, Any],
    progress: _Progress,
) -> _Images: ...
def spectrum(scene: Scene) -> str: ...
def stop() -> bool: ...
def sweep(
    engine: Engine,
    scene: Scene,
    vary: Sequence[str],
    score: Sequence[str],
    fix: str | None,
    path: _Path | None,
    overwrite: bool,
    resume: bool,
    progress: _Progress,
) -> str: ...
def weights(sigmas: _Floats) -> _Floats: ...
