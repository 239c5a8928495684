#!/bin/sh
# Runs the Python of docs/reading.md against fresh runs, so that the page stays true.
# Usage: tests/reading.sh [BEAMLET]   (default: target/release/beamlet)
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
beamlet=${1:-$root/target/release/beamlet}
case $beamlet in /*) ;; *) beamlet=$PWD/$beamlet ;; esac
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cd "$place"

"$beamlet" example cylinder -o scene
for format in exr npy tiff; do
    "$beamlet" simulate scene/scene.toml -o "run_$format" --format "$format" -q \
        --set 'detector.pixels=[16, 4]' \
        --set 'scan.angles={ from = "0 deg", to = "360 deg", count = 3 }'
    "$beamlet" simulate scene/scene.toml -o "noisy_$format" --format "$format" -q \
        --set 'detector.pixels=[16, 4]' \
        --set 'scan.angles={ from = "0 deg", to = "360 deg", count = 3 }' \
        --set detector.photons=20000 --set detector.offset=100 --set detector.electronic_noise=3
done
for format in exr npy tiff; do
    "$beamlet" retrieve "run_$format" --format "$format" -q
done

awk '/^```python$/ { inside = 1; next } /^```$/ { inside = 0 } inside' \
    "$root/docs/reading.md" > reading.py
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check numpy OpenEXR tifffile h5py
cp "$root/docs/beamlet_run.py" .
venv/bin/python reading.py
