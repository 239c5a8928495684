#!/usr/bin/env bash
# The paper's fifth experiment: simulates the CT, retrieves it by Gaussian fits (the paper's way) and
# by the exact curve, reconstructs three contrasts from each, and draws slices and box plots.
# usage: docs/experiments/tomography/run.sh [DIR]   (results go to DIR; ten minutes on two cores)
# From a clean clone: .ci/setup && cargo build --release && \
#   BEAMLET=target/release/beamlet docs/experiments/tomography/run.sh
# Needs `beamlet` in the path (or BEAMLET), and Python with numpy and matplotlib. A simulation that
# was interrupted goes on. SET='key=value key=value' changes the scene, as for a quick look:
#   SET='scan.angles.count=60 object.fibres.instances.count=8000'
set -euo pipefail
runs=$(realpath -m "${1:-target/experiments/tomography}")
beamlet=$(command -v "${BEAMLET:-beamlet}")
beamlet=$(realpath "$beamlet")
cd "$(dirname "${BASH_SOURCE[0]}")"
mkdir -p "$runs"
sets=()
for set in ${SET-}; do
    sets+=(--set "$set")
done

# timed NAME COMMAND...: runs a command; seconds by the clock, of user and system go to NAME.time.
timed() {
    local name=$1
    shift
    TIMEFORMAT="%R %U %S"
    { time "$@" 2>&3; } 3>&2 2>"$runs/$name.time"
    echo "$name: $(cat "$runs/$name.time") s (clock, user, system)"
}

if [ ! -e "$runs/run/run.json" ]; then
    timed simulate "$beamlet" simulate scene.toml -o "$runs/run" --format npy "${sets[@]}"
elif ! grep -q '"state": "done"' "$runs/run/run.json"; then
    timed resume "$beamlet" simulate scene.toml -o "$runs/run" --resume "${sets[@]}"
fi
for method in gaussian exact-curve; do
    timed "retrieve_$method" "$beamlet" retrieve "$runs/run" --method "$method" \
        -o "$runs/$method" --format npy --overwrite -q
done

reconstruct() {
    local name=$1 images=$2
    shift 2
    timed "reconstruct_$name" "$beamlet" reconstruct "$runs/$images" -o "$runs/$name" \
        --format npy --overwrite --truth -q "$@"
}
# The paper's way: gradient descent with the steps of Barzilai and Borwein, δ from integrated angles.
reconstruct paper gaussian --method bb --iterations 30 --phase --no-gradient-bias
reconstruct gaussian_fbp gaussian --no-gradient-bias
reconstruct exact_fbp exact-curve
"${PYTHON:-python3}" picture.py "$runs" .
