"""Pictures, as the program draws them."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Literal

from ._arguments import path as place
from ._arguments import shown, whole_number, word
from ._errors import Error, FileError, wrong
from ._scene import Path, Scene

if TYPE_CHECKING:
    from ._run import Run

Format = Literal["png", "svg"]


@dataclass(frozen=True)
class Picture:
    """A picture, which Jupyter shows: name of its file, and its bytes as PNG or SVG."""

    name: str
    data: bytes

    def _repr_png_(self) -> bytes | None:
        return self.data if self.name.endswith(".png") else None

    def _repr_svg_(self) -> str | None:
        return self.data.decode() if self.name.endswith(".svg") else None

    def save(self, path: Path) -> None:
        """Writes the picture to a file.

        Raises:
            FileError: It cannot be written.
        """
        to = place("path", path)
        try:
            FilePath(to).write_bytes(self.data)
        except OSError as error:
            raise FileError(f"{to}: cannot be written: {error.strerror}", file=to) from error


def view(
    what: Scene | Run | Path,
    format: Format = "png",
    width: int | None = None,
    options: tuple[str, ...] = (),
) -> list[Picture]:
    """Draws a scene, or the run or images of a directory (docs/pictures.md).

    Args:
        what: A scene, a run in a directory, or the path of a scene, run or images.
        format: Format of the pictures.
        width: Width in pixels.
        options: Other options of ``beamlet view``.

    Raises:
        ArgumentError: A run in memory, a format or width that does not exist.
        FileError: The path leads nowhere.
        Error: With the message of ``beamlet view``.
    """
    word("format", format, Format)
    if width is not None:
        width = whole_number("width", width, 1)
    if isinstance(options, str) or not all(isinstance(option, str) for option in options):
        raise wrong("options", shown(options), "options of beamlet view, each a text of its own")
    with tempfile.TemporaryDirectory(prefix="beamlet-") as folder:
        if isinstance(what, Scene):
            subject = what.save(os.path.join(folder, "scene"))
        elif isinstance(what, str | os.PathLike):
            subject = os.fspath(what)
            if not os.path.exists(subject):
                raise FileError(f"{subject}: does not exist", file=subject)
        elif not hasattr(what, "path"):
            raise wrong("what", type(what).__name__, "a Scene, a Run in a directory, or a path")
        elif what.path is None:
            raise wrong("run", "a run in memory", "a run directory: Engine.simulate_to")
        else:
            subject = what.path
        out = os.path.join(folder, "pictures")
        words = [sys.executable, "-m", "beamlet", "view", subject, "-o", out, "--format", format, "-q"]
        if width is not None:
            words += ["--width", str(width)]
        done = subprocess.run([*words, *options], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise Error(done.stderr.strip().removeprefix("error: "))
        names = sorted(os.listdir(out))
        return [Picture(name, (FilePath(out) / name).read_bytes()) for name in names]
