#!/usr/bin/env bash
# Installs gVirtualXRay (PyPI gvxr, with the libraries that its wheel needs on Debian), makes a plain
# radiograph of the bumpy ball with it and with beamlet, one after the other on the same CPU, and prints
# the processor time of both and how their images differ. gVirtualXRay draws by OpenGL: here by Mesa's
# CPU device through EGL.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }
libraries=(libegl1 libgl1 libgl1-mesa-dri libxcb-res0 libxcb-composite0 libxcb-ewmh2 libxcb-icccm4
    libxcb-keysyms1 libxcb-xinerama0 python3-venv)
if ! dpkg -s "${libraries[@]}" >/dev/null 2>&1; then
    as_root apt-get install -y --no-install-recommends "${libraries[@]}"
fi

cargo build --release
target=${CARGO_TARGET_DIR:-target}
python=$target/gvxr/bin/python
if [ ! -x "$python" ]; then
    python3 -m venv "$target/gvxr"
    "$python" -m pip install -q gvxr numpy
fi
EGL_PLATFORM=surfaceless LIBGL_ALWAYS_SOFTWARE=1 "$python" tests/peers/gvxr.py "$target/release/beamlet"
