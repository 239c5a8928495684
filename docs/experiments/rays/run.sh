#!/usr/bin/env bash
# The paper's first experiment: 1 to 5000 random rays per pixel, beside cells.
# usage: docs/experiments/rays/run.sh [DIR]    (runs go to DIR; some minutes on two cores)
# Needs `beamlet` in the path (or BEAMLET=target/release/beamlet), and Python with numpy and
# matplotlib for the picture.
set -euo pipefail
runs=$(realpath -m "${1:-target/experiments/rays}")
beamlet=$(command -v "${BEAMLET:-beamlet}")
beamlet=$(realpath "$beamlet")
cd "$(dirname "${BASH_SOURCE[0]}")"
mkdir -p "$runs"

# Two dozen rows show what 128 would: nothing changes along the cylinder.
run() {
    local name=$1
    shift
    rm -rf "${runs:?}/$name"
    "$beamlet" simulate ../cylinder/scene.toml -o "$runs/$name" --format npy -q \
        --set 'detector.pixels=[128, 24]' "$@"
    "$beamlet" retrieve "$runs/$name" --format npy
}
for rays in 1 5 10 50 100 500 1000 5000; do
    run "$rays" --set sampling.scheme=random --set "sampling.rays=[$rays, 1]"
done
run cells
"${PYTHON:-python3}" picture.py "$runs" rays.png
