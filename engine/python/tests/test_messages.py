"""Messages of the engine in Python's words."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENE

import beamlet as bl
from beamlet import convert
from beamlet._errors import in_python

ENGINE = Path(__file__).parents[2]


def test_options_in_messages_of_the_engine_are_arguments() -> None:
    """Each option that a message of the engine names is an argument of some function, under its name there."""
    functions: list[Any] = [convert.to_nxtomo, bl.Scene.replace, *(getattr(bl, name) for name in bl.__all__)]
    for kind in (bl.Engine, bl.Run, bl.Images, bl.Scene):
        functions += [member for _, member in inspect.getmembers(kind, inspect.isfunction)]
    callables = [function for function in functions if callable(function)]
    arguments = set().union(*(inspect.signature(function).parameters for function in callables))
    # Parts of a run, resumption against advice, lines of scene files and sweeps are no work of the package; arrays in
    # another order have axes to exchange.
    others = {"views", "set", "allow-mixed", "vary", "score", "fix", "resume", "overwrite", "frame-order"}
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


def test_runs_warn_of_a_sample_outside_the_field(scene: bl.Scene, engine: bl.Engine) -> None:
    assert engine.simulate(scene).warnings == []
    run = engine.simulate(scene.replace("object.rod.position", ["20 mm", "0 mm", "0 mm"]))
    assert any("outside the field of view" in warning for warning in run.warnings)
    assert "1 warning" in repr(run)
