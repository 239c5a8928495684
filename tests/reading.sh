#!/bin/bash
# Runs the lines of README.md and the lines and the Python of docs/reading.md on runs of few pixels,
# in every format, and the lines of docs/how-to and of docs/tutorial.md, so that these pages stay true.
# Usage: tests/reading.sh [BEAMLET]   (default: target/release/beamlet)
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
program=${1:-$root/target/release/beamlet}
case $program in /*) ;; *) program=$PWD/$program ;; esac
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cd "$place"

# The program as the pages name it. What reads a scene gets $few; where a page names no format, runs
# and retrieved images get $format, if there is one.
few=()
format=
beamlet() {
    local more=()
    case $1 in simulate | check) more=("${few[@]}") ;; esac
    case " $* " in
        *" --format "*) ;;
        " simulate "* | " retrieve "*) [ -z "$format" ] || more+=(--format "$format") ;;
    esac
    local code=0
    "$program" "$@" "${more[@]}" </dev/null 2>>"$place/log" || code=$?
    # 1: what was compared differs.
    [ $code = 0 ] || [ "$1 $code" = "compare 1" ] || {
        echo "failed: beamlet $* ${more[*]}" >&2
        tail -5 "$place/log" >&2
        return 1
    }
}

# lines LANGUAGE FILE: the lines of a language's blocks.
lines() {
    awk -v begin="\`\`\`$1" '$0 == begin { inside = 1; next } /^```$/ { inside = 0 } inside' "$2"
}

few=(--set 'detector.pixels=[48, 4]')
lines sh "$root/README.md" | grep '^beamlet ' >readme.sh
for format in exr npy tiff; do
    mkdir "readme_$format"
    # shellcheck source=/dev/null
    (cd "readme_$format" && set -e && . ../readme.sh) >>log
done
format=
few+=(--set 'scan.angles={ from = "0 deg", to = "360 deg", count = 3 }')
few[1]='detector.pixels=[16, 4]'
beamlet example cylinder -o . >>log
lines sh "$root/docs/reading.md" >reading_lines.sh
# shellcheck source=/dev/null
. ./reading_lines.sh >>log

lines python "$root/docs/reading.md" >reading.py
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check numpy OpenEXR tifffile h5py
cp "$root/docs/beamlet_run.py" .
venv/bin/python reading.py

# Retrieved images and another set-up, from the lines of README.md.
venv/bin/python - <<'PYTHON'
import numpy as np

import beamlet_run

for run in ["run", "narrow"]:
    runs = [beamlet_run.Run(f"readme_{format}/{run}") for format in ["exr", "npy", "tiff"]]
    assert all(one.done and one.check() == [] for one in runs)
    assert all(np.array_equal(one.sample, runs[0].sample) for one in runs)
# They have other masks.
assert not np.array_equal(runs[0].flat, beamlet_run.Run("readme_exr/run").flat)
images = [beamlet_run.Retrieved(f"readme_{format}/run/retrieved") for format in ["exr", "npy", "tiff"]]
for name in images[0].units:
    assert images[0][name].shape == (1, 4, 48), name
    assert all(np.array_equal(one[name], images[0][name], equal_nan=True) for one in images), name
PYTHON
# Parts of a run, of the scene of the how-to on CT; Slurm has a test of its own.
few=()
mkdir cluster
lines sh "$root/docs/how-to/ct.md" | sed -n '/^cat > scan.toml/,/^TOML/p' >scan.sh
lines sh "$root/docs/how-to/cluster.md" >cluster.sh
# shellcheck source=/dev/null
(cd cluster && set -e && . ../scan.sh && . ../cluster.sh) >cluster.log
"$program" check cluster/run >>log
few=(--set 'detector.pixels=[16, 6]')
mkdir how-to scan
cp "$root"/docs/how-to/{tube,design}.toml how-to
# Pages of one folder share their files; the page on CT has a run of its own.
for page in design=how-to faster=how-to ct=scan; do
    folder=${page#*=} page=${page%=*}
    lines sh "$root/docs/how-to/$page.md" >"$page.sh"
    # shellcheck source=/dev/null
    (cd "$folder" && set -e && . "../$page.sh") >"$page.log"
done
# 26 apertures, and the offsets of a page that says that check warns of them.
[ "$(wc -l <how-to/aperture/sweep.csv)" = 27 ]
grep -q 'warning: scan.mask_offsets cover' design.log
grep -q '"bore" crosses "tube", which has facets: it becomes a mesh' faster.log
few=(--set 'detector.pixels=[24, 3]' --set 'scan.angles={ from = "0 deg", to = "360 deg", count = 8 }')
lines sh "$root/docs/tutorial.md" >tutorial.sh
mkdir tutorial
# shellcheck source=/dev/null
(cd tutorial && set -e && . ../tutorial.sh) >tutorial.log
grep -q '^bracket,nylon 66,delta,' tutorial/volume/errors.csv
echo "README.md: $(grep -c . readme.sh) lines in each of 3 formats"
