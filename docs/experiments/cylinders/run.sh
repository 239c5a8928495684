#!/usr/bin/env bash
# The paper's fourth experiment: cylinders of water, polyethylene and carbon at 60 kV, beside
# theory.py, and with more energy nodes and all rays traced in order.
# usage: docs/experiments/cylinders/run.sh [DIR]    (runs go to DIR; some minutes on two cores)
# Needs `beamlet` in the path (or BEAMLET=target/release/beamlet), and Python with numpy, scipy,
# matplotlib and xraydb.
set -euo pipefail
runs=$(realpath -m "${1:-target/experiments/cylinders}")
beamlet=$(command -v "${BEAMLET:-beamlet}")
beamlet=$(realpath "$beamlet")
cd "$(dirname "${BASH_SOURCE[0]}")"
mkdir -p "$runs"

run() {
    local name=$1
    shift
    rm -rf "${runs:?}/$name"
    TIMEFORMAT="%R %U %S"
    { time "$beamlet" simulate scene.toml -o "$runs/$name" --format npy -q "$@" 2>&3; } \
        3>&2 2>"$runs/$name.time"
    "$beamlet" retrieve "$runs/$name" --format npy -q
}
run chosen
run 60 --set source.spectrum.nodes=60
run exact --set sampling.transport=exact
"$beamlet" spectrum scene.toml --json >"$runs/spectrum.json"
"${PYTHON:-python3}" picture.py "$runs" cylinders.png
