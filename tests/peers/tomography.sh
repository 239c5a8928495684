#!/usr/bin/env bash
# Means of regions of mu by beamlet's filtered back-projection beside itk-rtk's FDK and ASTRA's CGLS, of
# one CT of a laboratory set-up. Installs both from PyPI into a folder of its own; needs the network, and
# some minutes for the simulation.
#   tests/peers/tomography.sh BEAMLET [FOLDER]     FOLDER keeps the run (default: a temporary one)
set -euo pipefail
beamlet=$(realpath "${1:?usage: tomography.sh BEAMLET [FOLDER]}")
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
folder=${2:-}
if [ -z "$folder" ]; then
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
fi
mkdir -p "$folder"
[ -d "$folder/venv" ] || python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy itk-rtk astra-toolbox
"$folder/venv/bin/python" "$here/tomography.py" "$beamlet" "$here/tomography.toml" "$folder"
