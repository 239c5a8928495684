#!/usr/bin/env bash
# Installs Embree (Debian's libembree-dev), traces the five scenes of tests/bench/trace.rs with it
# and with beamlet, the same rays from the same files, and prints both rates and their ratio.
# Rates are million rays per second of processor time, all threads together; take the ratios.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }
if [ ! -e /usr/include/embree3/rtcore.h ]; then
    as_root apt-get install -y --no-install-recommends libembree-dev g++
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${CXX:-g++}" -std=c++17 -O3 -march=native -Wall -Wextra tests/peers/embree.cpp \
    -o "$work/embree" -lembree3 -lpthread

cargo bench --bench trace -- --export "$work"
mapfile -t names < <(cut -f1 "$work/rates.tsv")
"$work/embree" "$work" "${names[@]}" >"$work/embree.tsv"

echo
paste "$work/rates.tsv" "$work/embree.tsv" | awk -F '\t' '
    BEGIN {
        printf "%-14s%12s%12s%8s%10s%10s%10s%10s%10s\n", "scene", "crossings", "Embree",
            "differ", "bvh", "query", "Embree", "bvh/E", "query/E"
    }
    {
        printf "%-14s%12d%12d%8d%10.3f%10.3f%10.3f%10.3f%10.3f\n", $1, $2, $6, $7, $3, $4, $8,
            $3 / $8, $4 / $8
    }'
