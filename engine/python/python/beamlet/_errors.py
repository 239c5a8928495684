"""Exceptions of beamlet. Each says what was found, where, and what is allowed or helps."""

from __future__ import annotations

import os
from collections.abc import Sequence


class Error(Exception):
    """Base of all exceptions of beamlet.

    Attributes are ``None`` where an error has nothing to say of them.

    Attributes:
        key: Key of the scene (``detector.pitch``), argument, object or device.
        found: What was found there.
        allowed: What is allowed there.
        place: File, line and column, or the place in a mesh.
        file: File, where there is one.
        line: Line in it, from 1.
        remedy: What to change.
        errors: Each of several errors of a scene; otherwise this one alone.
    """

    def __init__(
        self,
        message: str,
        *,
        key: str | None = None,
        found: str | None = None,
        allowed: str | None = None,
        place: str | None = None,
        file: str | os.PathLike[str] | None = None,
        line: int | None = None,
        remedy: str | None = None,
        errors: Sequence[Error] = (),
    ) -> None:
        super().__init__(message)
        self.key = key
        self.found = found
        self.allowed = allowed
        self.place = place
        self.file = None if file is None else os.fspath(file)
        self.line = line
        self.remedy = remedy if remedy is not None else allowed
        self.errors: tuple[Error, ...] = tuple(errors) or (self,)


class SceneError(Error, ValueError):
    """A value of the scene is not possible."""


class ArgumentError(Error, ValueError):
    """An argument has a value that is not possible."""


def wrong(name: str, found: str, allowed: str) -> ArgumentError:
    """The error of an argument by its name, with the found value and the allowed ones."""
    return ArgumentError(
        f"{name}: found {found}; allowed: {allowed}", key=name, found=found, allowed=allowed
    )


class MeshError(Error, ValueError):
    """A mesh or shape cannot be a sample."""


class DeviceError(Error, RuntimeError):
    """No Vulkan device is usable, the device failed, or the engine is closed or of another process."""


class OutOfMemoryError(Error, MemoryError):
    """Not enough memory on host or device, or below the memory limit."""


class FileError(Error, OSError):
    """A file or folder cannot be read or written."""


class TallyError(Error, ArithmeticError):
    """Too many rays failed a check; the result is unreliable."""


class InterruptedWork(Error):
    """The process is about to end and stopped this work."""
