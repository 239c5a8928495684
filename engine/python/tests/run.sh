#!/usr/bin/env bash
# Builds the wheel, installs it into a fresh environment, and tests it: pytest, doctests, the code of
# docs/python.md, the notebooks of docs/tutorial (small), types and stubs.
# Usage: engine/python/tests/run.sh [TARGET]   (default: target; its builds of crates are shared)
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd)
target=$(realpath -m "${1:-$root/target}")
package=$root/engine/python
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

python3 -m venv --clear "$target/python"
bin=$target/python/bin
"$bin/pip" install --quiet --disable-pip-version-check maturin pytest mypy h5py matplotlib nxtomo scipy \
    silx tifffile trimesh
cargo fmt --check --manifest-path "$package/Cargo.toml" --package beamlet-python
python3 "$package/licences.py" --check
rm -rf "$target/wheels"
CARGO_TARGET_DIR=$target "$bin/maturin" build --release --locked --quiet \
    --manifest-path "$package/Cargo.toml" --interpreter "$bin/python" --out "$target/wheels"
wheel=$(ls "$target"/wheels/*.whl)
bytes=$(stat -c %s "$wheel")
echo "${wheel##*/}: $bytes bytes"
[ "$bytes" -le 16000000 ] || { echo "the wheel exceeds 16 MB" >&2; exit 1; }
"$bin/pip" install --quiet --disable-pip-version-check "$wheel"

# The package of the environment, and not that of the sources.
cd "$scratch"
"$bin/python" -m pytest -q -p no:cacheprovider --doctest-modules --pyargs beamlet
"$bin/python" -m pytest -q -p no:cacheprovider --durations=5 "$package/tests"
"$bin/beamlet" example cylinder -o cylinder >/dev/null
awk '/^```python$/ { inside = 1; next } /^```$/ { inside = 0 } inside' "$root/docs/python.md" >guide.py
"$bin/python" guide.py
BEAMLET_QUICK=1 "$bin/python" "$package/tests/notebooks.py" "$root"/docs/tutorial/*.ipynb
"$bin/python" -m mypy --strict --config-file "$package/pyproject.toml" guide.py "$package/python/beamlet"
"$bin/python" -m mypy.stubtest --mypy-config-file "$package/pyproject.toml" beamlet._beamlet
