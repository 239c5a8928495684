#!/usr/bin/env bash
# Installs the astra-toolbox of PyPI in an environment of its own, reconstructs the same fan with it and
# with beamlet, and compares errors and processor time; take the ratio of the times.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" -q install astra-toolbox==2.5.0 numpy
BEAMLET_PEERS=$work cargo test --release --locked --test reconstruct -- --ignored files_for_astra
"$work/venv/bin/python" tests/peers/astra_cgls.py "$work"
