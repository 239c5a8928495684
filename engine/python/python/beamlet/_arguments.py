"""Arguments, checked: each function returns the value, or raises an ArgumentError that names it."""

from __future__ import annotations

import operator
import os
from typing import Any, SupportsFloat, SupportsIndex, cast, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import wrong

#: Most characters of a value in an error.
LONGEST = 100


def shown(value: object) -> str:
    """A value in an error."""
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"


def number(name: str, value: object, allowed: str = "a number") -> float:
    """A real number; NaN is none."""
    if not isinstance(value, str | bytes | bool):
        try:
            found = float(cast(SupportsFloat, value))
        except (TypeError, ValueError, OverflowError):
            pass
        else:
            if not np.isnan(found):
                return found
    raise wrong(name, shown(value), allowed)


def whole_number(name: str, value: object, least: int) -> int:
    """A whole number, `least` or more."""
    if not isinstance(value, bool):
        try:
            found = operator.index(cast(SupportsIndex, value))
        except TypeError:
            pass
        else:
            # The engine takes 64 bits.
            if least <= found < 1 << 63:
                return found
    raise wrong(name, shown(value), f"a whole number, {least} or more")


def word(name: str, value: object, kind: object) -> str:
    """One of the words of a `Literal`."""
    words = get_args(kind)
    if not isinstance(value, str) or value not in words:
        raise wrong(name, shown(value), ", ".join(words))
    return value


def text(name: str, value: object, allowed: str = "text") -> str:
    """A text."""
    if not isinstance(value, str):
        raise wrong(name, shown(value), allowed)
    return value


def path(name: str, value: object) -> str:
    """A path as text."""
    found = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(found, str):
        raise wrong(name, shown(value), "a path")
    return found


def floats(name: str, values: object, allowed: str = "a list of numbers") -> list[float]:
    """A list of numbers, one or more."""
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.ndim != 1 or found.size == 0:
        raise wrong(name, shown(values), allowed)
    return cast("list[float]", found.tolist())


def array(name: str, values: ArrayLike, allowed: str) -> NDArray[Any]:
    """Values as an array. A mask that covers values would be lost, and is refused."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise wrong(name, "an array with masked values", f"{allowed}, without a mask")
    try:
        return np.asarray(values)
    except ValueError:
        raise wrong(name, "lists of unlike lengths", allowed) from None
