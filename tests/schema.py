"""Scenes against the JSON Schema of scene files: schema.py ROOT SCHEMA [SCENES]; see schema.sh."""

import copy
import json
import sys
import tomllib
from pathlib import Path

import jsonschema

root, schema = Path(sys.argv[1]), json.loads(Path(sys.argv[2]).read_text())
jsonschema.Draft4Validator.check_schema(schema)
validator = jsonschema.Draft4Validator(schema)

shipped = [*root.glob("docs/experiments/**/scene.toml"), *root.glob("docs/gallery/*.toml")]
shipped += [root / "tests/inputs/scene_paper.toml", *root.glob("tests/fuzz/scene*/*.toml")]
assert len(shipped) > 8, shipped
tested = list(Path(sys.argv[3]).glob("*.toml")) if len(sys.argv) > 3 else []
assert len(sys.argv) < 4 or len(tested) > 200, f"{len(tested)} scenes of the tests"
for path in shipped + tested:
    text = path.read_text()
    try:
        scene = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        sys.exit(f"{path}: {error}\n{text}")
    errors = [f"{list(error.absolute_path)}: {error.message[:300]}" for error in validator.iter_errors(scene)]
    assert not errors, "\n".join([str(path), text, *errors])

paper = tomllib.loads((root / "tests/inputs/scene_paper.toml").read_text())
GONE = object()
WRONG = [
    (["source", "distance"], 1.21),
    (["source", "distance"], "-1 m"),
    (["source", "distance"], "1.21 keV"),
    (["source", "distance"], GONE),
    (["source", "energy"], GONE),
    (["source", "spectrum"], "tube.csv"),
    (["source", "enregy"], "30 keV"),
    (["detector", "pixels"], [128]),
    (["detector", "pixels"], [128, 0]),
    (["detector", "mode"], "counts"),
    (["detector", "gain"], 2),
    (["detector", "blur"], {"sigma": "1 um", "fwhm": "1 um"}),
    (["sample_mask", "transmission"], 0.5),
    (["sample_mask", "aperture"], "20 um"),
    (["sampling", "tolerance"], 0.5),
    (["scan", "mask_offsets"], []),
    (["scan", "mask_offsets"], [["1 um"]]),
    (["scan", "mask_offsets"], {"from": "0 um", "to": "1 um"}),
    (["materials", "carbon", "density"], "0 g/cm3"),
    (["object", 0, "unit"], "foot"),
    (["object", 0, "sha256"], "12"),
    (["object", 1, "shape"], {"sphere": {"radius": "1 mm"}, "box": {"size": ["1 mm", "1 mm", "1 mm"]}}),
    (["object", 1, "shape", "sphere", "sides"], 3),
    (["object", 1, "instances"], {"packing": "balls", "region": {"sphere": {"radius": "1 mm"}}, "fill": 0.1}),
    (["title"], ""),
]
assert validator.is_valid(paper)
for path, value in WRONG:
    scene = copy.deepcopy(paper)
    table = scene
    for key in path[:-1]:
        table = table.setdefault(key, {}) if isinstance(table, dict) else table[key]
    if value is GONE:
        del table[path[-1]]
    else:
        table[path[-1]] = value
    assert not validator.is_valid(scene), f"{path} = {value} is taken"
print(f"{len(shipped)} shipped scenes, {len(tested)} of the tests, {len(WRONG)} wrong ones")
