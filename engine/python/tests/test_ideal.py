"""Ideal images: closed forms, reconstruction, reach."""

from __future__ import annotations

import numpy as np
import pytest

import beamlet as bl


def test_ideal_images_of_a_rod_are_the_closed_form(scene: bl.Scene, engine: bl.Engine) -> None:
    ideal = engine.ideal(scene, tolerance=1e-4, angle_tolerance=5e-9)
    assert ideal.transmission.shape == (1, 4, 24) == engine.simulate(scene).retrieve().flags.shape
    resin = bl.material("resin", 30.0, scene=scene)
    radius = 0.8e-3
    # Openings of 30 um on the detector, as the axis sees them.
    near = 1.21 / 1.8
    for column in (9, 12, 14, 17):
        centre = (column - 11.5) * 150e-6
        x = near * (centre + 30e-6 * ((np.arange(1000) + 0.5) / 1000 - 0.5))
        half = np.sqrt(radius**2 - x**2)
        light = np.exp(-2 * resin.mu[0] * half)
        angle = 2 * resin.delta[0] * x / half
        mean = (light * angle).sum() / light.sum()
        variance = (light * angle**2).sum() / light.sum() - mean**2
        assert ideal.transmission[0, 1, column] == pytest.approx(light.mean(), rel=2e-4)
        assert ideal.refraction[0, 1, column] == pytest.approx(mean, rel=5e-3)
        assert np.sqrt(ideal.dark_field[0, 1, column]) == pytest.approx(np.sqrt(variance), abs=5e-9)
    assert (ideal["transmission_error"] < 1e-3).all()
    assert ideal.units["dark_field_error"] == "rad²" and ideal.record["rays"] >= 64 * 4 * 24


def test_ideal_images_are_reconstructed(scene: bl.Scene, engine: bl.Engine) -> None:
    turned = scene.replace("scan.angles", {"from": "0 deg", "to": "360 deg", "count": 60})
    ideal = engine.ideal(turned.replace("detector.pixels", [24, 1]))
    volume = ideal.reconstruct("delta")
    x, y, _ = volume.centres()
    inside = (np.hypot(x[None, :], y[:, None]) < 0.5e-3)[None]
    true = bl.material("resin", 30.0, scene=scene).delta[0]
    found = volume.values[inside].mean() / true
    # The openings show a fifth of each pixel. Sums over so few columns with steep edges are 7 % short;
    # openings as wide as the pixels would leave 1.02, and twice as many columns 0.98.
    assert openings_alone(24) == pytest.approx(0.928, abs=1e-3)
    assert found == pytest.approx(openings_alone(24), abs=0.015)


def openings_alone(columns: int) -> float:
    """Mean decrement within 0.5 mm of the axis over its true value, by filtered back-projection of the
    closed form of the rod behind the openings, in parallel light."""
    near = 1.21 / 1.8
    pitch, radius = 24 * 150e-6 / columns, 0.8e-3
    within = 30e-6 * ((np.arange(2001) + 0.5) / 2001 - 0.5)
    place = (np.arange(columns) - (columns - 1) / 2) * pitch
    x = near * (place[:, None] + within)
    half = np.sqrt(np.maximum(radius**2 - x**2, 0.0))
    angle = np.divide(2 * x, half, out=np.zeros_like(x), where=half > 0).mean(axis=1)
    apart = np.subtract.outer(np.arange(columns), np.arange(columns))
    with np.errstate(divide="ignore", invalid="ignore"):
        kernel = np.where(apart == 0, 0.0, (1 - np.cos(np.pi * apart)) / (np.pi * apart))
    filtered = -(kernel @ angle)
    u = near * place
    across, along = np.meshgrid(u, u)
    turns = np.radians(np.arange(360))
    sums = sum(np.interp(across * np.cos(t) + along * np.sin(t), u, filtered) for t in turns)
    inside = np.hypot(across, along) < 0.5e-3
    return float((sums[inside] / (2 * len(turns))).mean())


def test_the_reach_bounds_angles(scene: bl.Scene, engine: bl.Engine) -> None:
    wide = engine.ideal(scene)
    # Half a period of 100 um, over M = 1.5 and z = 0.59 m.
    assert wide.record["reach_rad"] == pytest.approx(0.5 * 100e-6 * 1.5 / 0.59, rel=2e-3)
    narrow = engine.ideal(scene, reach="1 urad")
    assert narrow.record["reach_rad"] == pytest.approx(1e-6)
    assert np.nanmax(np.abs(narrow.refraction)) <= 1e-6 < np.nanmax(np.abs(wide.refraction))
    assert np.array_equal(narrow.transmission[0, 0, :4], wide.transmission[0, 0, :4])
    for options, key in (
        ({"reach": -1.0}, "reach"),
        ({"reach": "1 um"}, "reach"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"most_rays": 1}, "most_rays"),
    ):
        with pytest.raises(bl.ArgumentError) as raised:
            engine.ideal(scene, **options)  # type: ignore[arg-type]
        assert raised.value.key == key
    # The shared engine serves scenes.
    assert np.array_equal(scene.ideal(most_rays=64).refraction, engine.ideal(scene, most_rays=64).refraction)
