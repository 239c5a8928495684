"""The Vulkan driver of machines that have none: that of the package beamlet-lavapipe."""

from __future__ import annotations

import ctypes
import importlib
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from ._errors import DeviceError

#: What helps, in Python, where Vulkan shows no device.
PACKAGE = 'or pip install "beamlet[cpu]": a device on the CPU for Linux on x86-64 with glibc 2.36 or later'

_lock = threading.Lock()
_looked = False


def find_driver() -> None:
    """Takes the driver of beamlet-lavapipe where it is installed and the host shows no driver.

    Looks once, before the first call of Vulkan: environment variables of the host count, a driver of
    the host is never replaced.
    """
    global _looked
    with _lock:
        if _looked:
            return
        _looked = True
        if any(os.environ.get(name) for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES")):
            return
        try:
            package = importlib.import_module("beamlet_lavapipe")
        except ImportError:
            return
        if _host_has_drivers():
            return
        os.environ["VK_DRIVER_FILES"] = package.driver_file()
        if not _host_has_loader():
            ctypes.CDLL(package.loader(), mode=ctypes.RTLD_GLOBAL)


@contextmanager
def naming_the_package() -> Iterator[None]:
    """Adds the package of a driver to the remedies of errors without a loader or a device."""
    try:
        yield
    except DeviceError as error:
        if error.key not in ("the Vulkan loader", "a Vulkan device"):
            raise
        raise DeviceError(
            f"{error}, {PACKAGE}",
            key=error.key,
            found=error.found,
            remedy=f"{error.remedy}, {PACKAGE}",
        ) from None


def _host_has_drivers() -> bool:
    """Whether the loader of the host would find the description of a driver."""
    home = os.path.expanduser("~")
    data = os.environ.get("XDG_DATA_HOME") or os.path.join(home, ".local/share")
    config = os.environ.get("XDG_CONFIG_HOME") or os.path.join(home, ".config")
    roots = [config, data, "/etc", "/usr/local/etc"]
    roots += (os.environ.get("XDG_CONFIG_DIRS") or "/etc/xdg").split(":")
    roots += (os.environ.get("XDG_DATA_DIRS") or "/usr/local/share:/usr/share").split(":")
    for root in roots:
        try:
            names = os.listdir(os.path.join(root, "vulkan/icd.d"))
        except OSError:
            continue
        if any(name.endswith(".json") for name in names):
            return True
    return False


def _host_has_loader() -> bool:
    try:
        ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return False
    return True
