#!/usr/bin/env bash
# The paper's second experiment: flat curves for focal spots of 0, 10, 20 and 30 um.
# usage: docs/experiments/spots/run.sh [DIR]    (runs go to DIR; seconds)
# Needs `beamlet` in the path (or BEAMLET=target/release/beamlet), and Python with numpy and
# matplotlib for the picture.
set -euo pipefail
runs=$(realpath -m "${1:-target/experiments/spots}")
beamlet=$(command -v "${BEAMLET:-beamlet}")
beamlet=$(realpath "$beamlet")
cd "$(dirname "${BASH_SOURCE[0]}")"
mkdir -p "$runs"
for spot in 0 10 20 30; do
    rm -rf "${runs:?}/$spot"
    "$beamlet" simulate scene.toml -o "$runs/$spot" --format npy -q \
        --set "source.spot=[\"$spot um\", \"26 um\"]"
    "$beamlet" retrieve "$runs/$spot" --format npy
done
"${PYTHON:-python3}" picture.py "$runs" spots.png
