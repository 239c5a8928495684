#!/bin/sh
# Holds scenes to the JSON Schema that `beamlet schema` prints: the shipped ones, those of the folder
# SCENES (which tests write where BEAMLET_SCENES_TO names it) and twenty wrong ones.
# Usage: tests/schema.sh [BEAMLET [SCENES]]   (default: target/release/beamlet)
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
beamlet=${1:-$root/target/release/beamlet}
case $beamlet in /*) ;; *) beamlet=$PWD/$beamlet ;; esac
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

"$beamlet" schema > "$place/schema.json"
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet --disable-pip-version-check jsonschema
"$place/venv/bin/python" "$root/tests/schema.py" "$root" "$place/schema.json" ${2:+"$2"}
