"""The driver of beamlet-lavapipe: taken where the host has none, and never otherwise."""

from __future__ import annotations

import os
import subprocess
import sys
import types
from pathlib import Path

import pytest

from beamlet import _vulkan


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """A package in the place of beamlet-lavapipe, and a machine that nobody looked at."""
    module = types.ModuleType("beamlet_lavapipe")
    driver = str(tmp_path / "lavapipe.json")
    module.driver_file = lambda: driver  # type: ignore[attr-defined]
    module.loader = lambda: str(tmp_path / "none.so")  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "beamlet_lavapipe", module)
    monkeypatch.setattr(_vulkan, "_looked", False)
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.delenv(name, raising=False)
    # Set and removed, so that the test leaves no trace.
    monkeypatch.setenv("VK_DRIVER_FILES", "")
    return driver


def test_it_serves_hosts_without_drivers(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_vulkan, "_host_has_drivers", lambda: False)
    monkeypatch.setattr(_vulkan, "_host_has_loader", lambda: True)
    _vulkan.find_driver()
    assert os.environ["VK_DRIVER_FILES"] == package


def test_drivers_of_the_host_come_first(
    package: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "XDG_CONFIG_DIRS"):
        monkeypatch.setenv(name, str(tmp_path))
    (tmp_path / "share/vulkan/icd.d").mkdir(parents=True)
    (tmp_path / "share/vulkan/icd.d/gpu.json").write_text("{}")
    monkeypatch.setenv("XDG_DATA_DIRS", str(tmp_path / "share"))
    assert _vulkan._host_has_drivers()
    _vulkan.find_driver()
    assert os.environ["VK_DRIVER_FILES"] == ""


def test_errors_without_a_device_name_three_remedies(tmp_path: Path) -> None:
    script = """
import beamlet as bl
for work in (bl.Engine, bl.devices):
    try:
        work()
    except bl.DeviceError as error:
        print(error.remedy)
"""
    nowhere = {"VK_DRIVER_FILES": str(tmp_path / "none.json"), "VK_ICD_FILENAMES": str(tmp_path / "none.json")}
    done = subprocess.run(
        [sys.executable, "-c", script], env=os.environ | nowhere, capture_output=True, text=True, check=True
    )
    remedies = done.stdout.splitlines()
    assert len(remedies) == 2, done
    for remedy in remedies:
        # The driver of a GPU, Mesa's device of the system, and the wheel.
        assert "driver" in remedy and "mesa-vulkan-drivers" in remedy and "beamlet[cpu]" in remedy


def test_a_choice_of_the_user_stays(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_vulkan, "_host_has_drivers", lambda: False)
    monkeypatch.setenv("VK_DRIVER_FILES", "/other.json")
    _vulkan.find_driver()
    assert os.environ["VK_DRIVER_FILES"] == "/other.json"
