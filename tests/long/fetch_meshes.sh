#!/usr/bin/env bash
# Fetches other people's meshes into a folder, for meshes.py: the npm package stl-models, what the
# Debian packages of PrusaSlicer and OpenSCAD hold, and solids that trimesh and cadquery make.
# Packages are unpacked, not installed. What cannot be had is named on stderr and left out.
#   tests/long/fetch_meshes.sh FOLDER
set -euo pipefail
here=$(dirname "$(realpath "${BASH_SOURCE[0]}")")
mkdir -p "${1:?usage: fetch_meshes.sh FOLDER}"
cd "$1"

lacks() { echo "fetch_meshes.sh: without $1" >&2; }

[ -d npm ] || {
    mkdir npm.partial && (cd npm.partial && npm pack --silent stl-models >/dev/null && tar xzf ./*.tgz && rm ./*.tgz) &&
        mv npm.partial npm || lacks "the npm package stl-models"
}
for package in prusa-slicer openscad openscad-testing-data; do
    [ ! -d "$package" ] || continue
    mkdir "$package.partial" && (cd "$package.partial" &&
        apt-get -qq -o APT::Sandbox::User=root download "$package" && dpkg-deb -x ./*.deb . && rm ./*.deb) &&
        mv "$package.partial" "$package" || lacks "the Debian package $package"
done
[ -d made ] || {
    python3 -m venv venv && venv/bin/pip -q install trimesh cadquery scipy shapely mapbox_earcut manifold3d &&
        mkdir made.partial && venv/bin/python "$here/make_meshes.py" made.partial && mv made.partial made ||
        lacks "the solids of trimesh and cadquery"
}
rm -rf ./*.partial
find . -name venv -prune -o \( -iname '*.stl' -o -iname '*.obj' \) -print | wc -l
