#!/usr/bin/env bash
# The paper's third experiment: a smooth octagon, a rough one, and the smooth one with a roughness.
# usage: docs/experiments/octagon/run.sh [DIR]    (runs go to DIR; some twenty minutes on two cores)
# Needs `beamlet` in the path (or BEAMLET=target/release/beamlet), and Python with numpy and
# matplotlib for the meshes and the pictures.
set -euo pipefail
runs=$(realpath -m "${1:-target/experiments/octagon}")
beamlet=$(command -v "${BEAMLET:-beamlet}")
beamlet=$(realpath "$beamlet")
cd "$(dirname "${BASH_SOURCE[0]}")"
mkdir -p "$runs"
"${PYTHON:-python3}" make.py "$runs"
cp scene.toml "$runs"

# run NAME MESH ROUGHNESS [SETTING...]
run() {
    local name=$1 mesh=$2 roughness=$3
    shift 3
    local settings=()
    for setting in "object[0].mesh=\"$mesh\"" "object[0].roughness=$roughness" "$@"; do
        settings+=(--set "$setting")
    done
    rm -rf "${runs:?}/$name"
    "$beamlet" simulate "$runs/scene.toml" -o "$runs/$name" --format npy -q "${settings[@]}"
}
cells=sampling.scheme=cells
few=sampling.max_rays=20000
fine='scan.angles={ from = "22 deg", to = "23 deg", count = 100 }'
coarse='scan.angles={ from = "22 deg", to = "23 deg", count = 20 }'
for body in smooth:octagon.stl:0 rough:rough.stl:0 roughness:octagon.stl:0.001; do
    IFS=: read -r name mesh roughness <<<"$body"
    run "cells_$name" "$mesh" "$roughness" "$cells" "$few"
    run "fine_$name" "$mesh" "$roughness" "$cells" "$few" "$fine"
    run "random_$name" "$mesh" "$roughness"
done
for roughness in 0.0003 0.0005 0.0007 0.001 0.0014 0.002 0.003; do
    run "scan_$roughness" octagon.stl "$roughness" "$cells" "$few" "$coarse"
done
run scan_mesh rough.stl 0 "$cells" "$coarse"
run scan_0 octagon.stl 0 "$cells" "$coarse"
"${PYTHON:-python3}" picture.py "$runs" .
