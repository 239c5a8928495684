#!/usr/bin/env bash
# The fifth experiment by waves without roughness, beside rays without and with it: retrieves 60 views by
# Gaussian fits, reconstructs them by filtered back-projection, draws waves.png and prints tables.
# usage: docs/experiments/tomography/waves.sh [DIR]   (results go to DIR; three minutes on two cores)
# Needs `beamlet` in the path (or BEAMLET), and Python (or PYTHON) with numpy and matplotlib.
set -euo pipefail
runs=$(realpath -m "${1:-target/experiments/waves}")
beamlet=$(realpath "$(command -v "${BEAMLET:-beamlet}")")
cd "$(dirname "${BASH_SOURCE[0]}")"
mkdir -p "$runs"
smooth=()
for object in matrix fibres "thick fibres" "carbon rod" "epoxy rod" "nylon rod"; do
    smooth+=(--set "object.$object.roughness=0")
done

simulate() {
    local name=$1
    shift
    if [ ! -e "$runs/$name/run.json" ]; then
        TIMEFORMAT="$name: %R s by the clock, %U + %S of processor time"
        time "$beamlet" simulate scene.toml -o "$runs/$name" --format npy --set scan.angles.count=60 -q "$@"
    fi
    "$beamlet" retrieve "$runs/$name" --method gaussian -o "$runs/$name-images" --format npy --overwrite -q
    "$beamlet" reconstruct "$runs/$name-images" -o "$runs/$name-volumes" --format npy --overwrite --truth \
        --no-gradient-bias -q
}
simulate waves "${smooth[@]}" --set sampling.transport=wave
simulate rays "${smooth[@]}"
simulate rough
"${PYTHON:-python3}" waves.py "$runs" .
