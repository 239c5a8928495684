"""Python has what the command line has: options of verbs against arguments, and messages in Python's words."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENE

import beamlet as bl
from beamlet import convert
from beamlet._errors import in_python

ENGINE = Path(__file__).parents[2]

#: Options of every verb that Python does not need, and why.
EVERYWHERE = {
    "help": "help() and docstrings",
    "version": "beamlet.__version__",
    "quiet": "nothing is printed",
    "verbose": "nothing is printed",
    "json": "results are objects",
    "output": "results are arrays",
    "format": "results are arrays",
    "overwrite": "results are arrays",
    "device": "Engine(device=...)",
    "profile": "Engine(profile=...)",
    "set": "Scene.replace",
}


def options(verb: str) -> set[str]:
    """Options of a verb of the program, in Python's spelling."""
    words = [sys.executable, "-m", "beamlet", verb, "--help"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    found = re.findall(r"^ +(?:-\w, )?(?:    )?--([a-z][a-z-]*)", done.stdout, re.MULTILINE)
    assert "output" in found, done.stdout
    return {name.replace("-", "_") for name in found}


def parameters(*functions: Callable[..., Any]) -> set[str]:
    names = {name for function in functions for name in inspect.signature(function).parameters}
    return names - {"self", "engine", "progress", "options"}


@pytest.mark.parametrize(
    ("verb", "functions", "otherwise", "own"),
    [
        (
            "reconstruct",
            (bl.Images.reconstruct, bl.reconstruct),
            # A limit of memory belongs to the engine; nothing is planned without being done; gradient_bias.
            {"memory_limit", "dry_run", "no_gradient_bias"},
            {"sinograms", "axis", "weights", "gradient_bias", "scene", "attenuation"},
        ),
    ],
)
def test_functions_have_the_options_of_the_command_line(
    verb: str, functions: tuple[Callable[..., Any], ...], otherwise: set[str], own: set[str]
) -> None:
    of_program = options(verb) - EVERYWHERE.keys()
    of_python = parameters(*functions)
    assert otherwise <= of_program, "an option that is gone"
    assert of_program - otherwise == of_python - own


def test_options_in_messages_of_the_engine_are_arguments() -> None:
    """Each option that a message of the engine names is an argument of some function, under its name there."""
    functions: list[Any] = [convert.to_nxtomo, bl.Scene.replace, *(getattr(bl, name) for name in bl.__all__)]
    for kind in (bl.Engine, bl.Run, bl.Images, bl.Scene):
        functions += [member for _, member in inspect.getmembers(kind, inspect.isfunction)]
    callables = [function for function in functions if callable(function)]
    arguments = set().union(*(inspect.signature(function).parameters for function in callables))
    # Parts of a run, resumption against advice, and lines of scene files are no work of the package.
    others = {"views", "set", "allow-mixed"}
    named: dict[str, str] = {}
    for path in sorted(ENGINE.rglob("*.rs")):
        if "python" in path.parts:
            continue
        text = re.sub(r"^\s*//.*$", "", path.read_text(), flags=re.MULTILINE)
        # Commands of the program keep its options.
        text = re.sub(r"`beamlet [^`]*`", "", text)
        for message in re.findall(r'"((?:[^"\\]|\\.)*)"', text, re.DOTALL):
            for option in re.findall(r"(?<![\w/.-])--([a-z]+(?:-[a-z]+)*)", message):
                named[option] = message
    assert len(named) > 10
    unknown = {option: message for option, message in named.items() if option.replace("-", "_") not in arguments}
    assert unknown.keys() <= others, unknown
    assert not [message for message in named.values() if "--" in in_python(message)]


def test_messages_name_arguments(engine: bl.Engine, scene: bl.Scene) -> None:
    run = engine.simulate(scene.replace("scan.angles", {"from": "0 deg", "to": "90 deg", "count": 3}))
    flats = np.stack([run.flat, run.flat])
    with pytest.raises(bl.FileError) as raised:
        bl.retrieve(flats, run.sample, scene.mask_offsets, scene, engine=engine)
    assert "flats_every=N" in str(raised.value) and "--" not in str(raised.value)
    assert raised.value.found and "flats_every" in raised.value.found
    meanings = run.retrieve(method="moments").flag_meanings.values()
    assert any("(bad_pixels)" in meaning for meaning in meanings)
    assert "--" not in str(engine.check(scene))
    assert in_python("/data/run--old/x: use --set 'a=b' or --weights poisson") == (
        "/data/run--old/x: use replace 'a=b' or weights=\"poisson\""
    )


def test_reports_of_refused_samples_print_why(engine: bl.Engine) -> None:
    cube = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6]]
    body = bl.Object(name="box", mesh=(cube, faces), unit="mm", material="resin")
    report = engine.check(bl.Scene.from_dict(SCENE | {"object": [body]}))
    assert len(report.refusals) == 1 and "open" in report.refusals[0]
    assert report.refusals[0] in str(report)
