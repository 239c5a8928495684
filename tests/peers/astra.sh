#!/usr/bin/env bash
# Installs the astra-toolbox of PyPI in an environment of its own. Exports a scan of three rods to it and
# checks places and handedness; reconstructs the same fan with it and with beamlet, and compares errors and
# processor time; take the ratio of the times.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
beamlet=${1:-${CARGO_TARGET_DIR:-target}/release/beamlet}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" -q install astra-toolbox==2.5.0 numpy
"$beamlet" simulate -q tests/peers/astra_export.toml -o "$work/run" --format npy
"$beamlet" retrieve -q "$work/run" --method exact-curve
"$beamlet" convert -q "$work/run" --to astra -o "$work/astra"
"$work/venv/bin/python" tests/peers/astra_export.py "$work/astra"
BEAMLET_PEERS=$work cargo test --release --locked --test reconstruct -- --ignored files_for_astra
"$work/venv/bin/python" tests/peers/astra_cgls.py "$work"
