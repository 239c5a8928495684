"""Mesa's Vulkan device on the CPU. `beamlet` takes it where the host shows no Vulkan driver."""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).parent


def driver_file() -> str:
    """Path of the driver's description, for VK_DRIVER_FILES."""
    return str(_FOLDER / "lavapipe.json")


def loader() -> str:
    """Path of the Vulkan loader."""
    return str(_FOLDER / "libvulkan.so.1")
