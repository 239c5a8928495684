"""Exceptions of beamlet. Each says what was found, where, and what is allowed or helps."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import Any

#: An option of the command line in a message of the engine, with its value where one follows.
_OPTION = re.compile(r"(?<![\w/.-])--(?P<name>[a-z]+(?:-[a-z]+)*)(?: (?P<value>[A-Z][A-Z0-9]*(?::[A-Z0-9]+)*)\b)?")
#: A method in such a message, also behind its command.
_METHOD = re.compile(r"(?:retrieve )?(?<![\w/.-])--(method|weights) ([a-z]+(?:-[a-z]+)*)")

#: A command of the program.
_COMMAND = re.compile(r"(`beamlet [^`]*`)")


def counted(warnings: list[str]) -> str:
    """The end of a description: how many warnings there are, and nothing without any."""
    return {0: "", 1: ", 1 warning"}.get(len(warnings), f", {len(warnings)} warnings")


def in_python(message: str) -> str:
    """A message of the engine with the arguments of Python in place of options of the command line; commands
    of the program in backticks stay.

    Example:
        >>> in_python("has one flat; --flats-every must be 1 or more; or --method three-step")
        'has one flat; flats_every must be 1 or more; or method="three-step"'
    """
    def argument(found: re.Match[str]) -> str:
        name, value = found["name"].replace("-", "_"), found["value"]
        name = "replace" if name == "set" else name
        return name if value is None else f"{name}={value}"

    parts = _COMMAND.split(message)
    parts[::2] = [_OPTION.sub(argument, _METHOD.sub(r'\1="\2"', part)) for part in parts[::2]]
    return "".join(parts)


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


def of_engine(name: str, message: str, **facts: Any) -> Error:
    """The exception of an error of the engine, by the name of its class."""
    for fact in ("found", "allowed", "remedy"):
        if isinstance(facts.get(fact), str):
            facts[fact] = in_python(facts[fact])
    kind: type[Error] = globals()[name]
    return kind(in_python(message), **facts)


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
