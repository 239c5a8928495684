"""Keywords of verbs in the signatures and docstrings of functions, from the tables of options."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any, TypeVar

from . import _beamlet

Function = TypeVar("Function", bound=Callable[..., Any])


def described(verb: str) -> Callable[[Function], Function]:
    """Gives a function with ``**options`` the keywords of a verb, with their defaults and meanings."""

    def describe(function: Function) -> Function:
        own = inspect.signature(function)
        parameters = [it for it in own.parameters.values() if it.kind is not it.VAR_KEYWORD]
        entries = []
        for name, kind, default, doc, is_declared, is_measured in _beamlet.keywords(verb):
            if is_declared and name not in own.parameters or is_measured and "flat" not in own.parameters:
                continue
            if not is_declared:
                value = ast.literal_eval(default)
                parameters.append(
                    inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=value, annotation=kind)
                )
            entries.append(f"{name}: {doc}.")
        function.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        text = inspect.cleandoc(function.__doc__ or "")
        head, mark, rest = text.partition("\n\nR")
        args = "\n".join(textwrap.fill(entry, 100, subsequent_indent="    ") for entry in entries)
        function.__doc__ = head + "\n" + textwrap.indent(args, "    ") + mark + rest
        return function

    return describe
