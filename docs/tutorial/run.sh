#!/bin/bash
# Makes the pictures of docs/tutorial.md by the commands of that page.
# Usage: docs/tutorial/run.sh [BEAMLET]   (default: target/release/beamlet)
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
program=$(realpath "${1:-$root/target/release/beamlet}")
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cd "$place"
beamlet() { "$program" "$@" </dev/null; }
awk '$0 == "```sh" { inside = 1; next } /^```$/ { inside = 0 } inside' "$root/docs/tutorial.md" >lines.sh
# shellcheck source=/dev/null
. ./lines.sh
while read -r from to; do cp "pictures/$from.png" "$root/docs/tutorial/$to.png"; done <<'PICTURES'
set_up set_up
sample_view_0000_step_005 frame
curve_view_0000_column_0019_row_0032 curve
transmission_view_0000 transmission
refraction_view_0000 refraction
dark_field_view_0000 dark_field
mu_z_0001 mu
delta_z_0001 delta
PICTURES
