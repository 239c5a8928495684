#!/usr/bin/env bash
# A thousand simulations in one process against a thousand processes, files under both versions of h5py, ASTRA,
# and the notebooks of docs/tutorial in full, in Jupyter. After tests/run.sh, whose environment it takes.
# Usage: engine/python/tests/long.sh [TARGET]
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd)
target=$(realpath -m "${1:-$root/target}")
bin=$target/python/bin
[ -e "$bin/beamlet" ] || "$root/engine/python/tests/run.sh" "$target"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"

# HDF5 1.14 of h5py 3.15, and the newest.
for h5py in 'h5py==3.15.*' 'h5py'; do
    "$bin/pip" install --quiet --disable-pip-version-check --upgrade "$h5py"
    "$bin/python" -c 'import h5py; print("h5py", h5py.__version__, "HDF5", h5py.version.hdf5_version)'
    "$bin/python" -m pytest -q -p no:cacheprovider "$root/engine/python/tests/test_convert.py"
done
"$bin/pip" install --quiet --disable-pip-version-check astra-toolbox ipykernel nbclient nbformat
cp "$root"/docs/tutorial/*.ipynb .
"$bin/python" "$root/engine/python/tests/notebooks.py" --write ./*.ipynb
"$bin/python" "$root/engine/python/tests/many.py" "${SIMULATIONS:-1000}"
