"""What the tests share: a small scene and one engine."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from typing import Any

import pytest

import beamlet as bl

#: An edge-illumination set-up of 24 x 4 pixels at 5 mask offsets, with a rod that is exact.
SCENE: dict[str, Any] = {
    "source": {"distance": "1.21 m", "spot": ["30 um", "26 um"], "energy": "30 keV"},
    "detector": {"distance": "1.8 m", "pixels": [24, 4], "pitch": "150 um"},
    "sample_mask": {
        "distance": "1.2 m",
        "material": "gold",
        "thickness": "225 um",
        "projected_aperture": "30 um",
    },
    "detector_mask": {"material": "gold", "thickness": "225 um", "projected_aperture": "30 um"},
    "scan": {"mask_offsets": {"from": "-20 um", "to": "20 um", "count": 5}},
    "materials": {"resin": {"formula": "C2H4O", "density": "1.2 g/cm3"}},
    "object": [
        {
            "name": "rod",
            "shape": {"cylinder": {"radius": "0.8 mm", "height": "4 mm"}},
            "material": "resin",
        }
    ],
}


# Shells start processes in the background with SIGINT ignored, and Python leaves that so.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def scene() -> bl.Scene:
    """The scene of all tests."""
    return bl.Scene.from_dict(SCENE)


@pytest.fixture(scope="session")
def engine() -> Iterator[bl.Engine]:
    """The engine of all tests."""
    with bl.Engine() as engine:
        yield engine


@pytest.fixture
def large(scene: bl.Scene) -> bl.Scene:
    """A scene of many seconds."""
    many = scene.replace("detector.pixels", [512, 512]).replace("sampling.tolerance", 1e-6)
    return many.replace("scan.angles", {"from": "0 deg", "to": "360 deg", "count": 200})
