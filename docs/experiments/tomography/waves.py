#!/usr/bin/env python3
"""Draws waves.png from the results of waves.sh, and prints tables of images and volumes.

usage: waves.py RUNS [FOLDER]    (FOLDER, for the picture; without it the tables alone)
"""

import json
import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

RUNS = pathlib.Path(sys.argv[1])
NAMES = {"waves": "waves, smooth", "rays": "rays, smooth", "rough": "rays, roughness 0.002"}
# Those of the scene, mm.
PITCH = 0.15 * 1.213 / 1.8
THICK = np.loadtxt("thick.csv", delimiter=",", skiprows=2)[:, :2] + [0, -5]
REGIONS = {
    "polyethylene": ([(5.0, -4.5)], 1.0),
    "carbon": ([(5.0, 0.0)], 0.35),
    "epoxy": ([(-5.0, 0.0)], 0.35),
    "nylon": ([(-6.0, -4.0)], 0.35),
    "fibres of 300 µm": (THICK, 0.075),
    "bundle": ([(0.0, 5.0)], 0.9),
}
QUANTITIES = {"mu": (1e-2, "µ, 1/cm"), "delta": (1e7, "δ, 10⁻⁷"), "dark-field": (1e8, "σ², 10⁻⁸ rad²/m")}

fields = {name: np.load(RUNS / f"{name}-images/dark_field.npy").squeeze().astype(float) for name in NAMES}
views, columns = fields["waves"].shape
x = (np.arange(columns) + 0.5 - columns / 2) * PITCH
turns = 2 * np.pi * np.arange(views) / views
# Columns behind the bundle; the sense of rotation is that in which it scatters.
behind = [np.abs(x - sense * 5.0 * np.sin(turns)[:, None]) < 1.1 for sense in (-1, 1)]
bundle = max(behind, key=lambda seen: fields["rays"][seen].mean())
print("| dark field behind the bundle, rad² | of smooth rays |")
print("|---|---|")
for name, words in NAMES.items():
    ratios = [fields[name][v][bundle[v]].mean() / fields["rays"][v][bundle[v]].mean() for v in range(views)]
    error = np.std(ratios) / np.sqrt(views)
    print(f"| {words}: {fields[name][bundle].mean():.3g} | {np.mean(ratios):.3f} ± {error:.3f} |")

record = json.loads((RUNS / "waves-volumes/volume.json").read_text())
axes = [1e3 * (o + v * np.arange(n)) for o, v, n in zip(record["origin_m"], record["voxel_m"], record["size"])]
slices = {name: {q: np.load(RUNS / f"{name}-volumes/{q}.npy")[0] for q in QUANTITIES} for name in NAMES}


def inside(centres, radius):
    """Voxels whose centres lie within `radius` of one of `centres`."""
    off = [np.hypot(axes[0][None] - a, axes[1][:, None] - b) for a, b in centres]
    return np.min(off, axis=0) < radius


print("\n| quantity | | " + " | ".join(REGIONS) + " |")
print("|" + "---|" * (len(REGIONS) + 2))
for q, (factor, unit) in QUANTITIES.items():
    for name, words in NAMES.items():
        values = [factor * slices[name][q][inside(*where)] for where in REGIONS.values()]
        print(f"| {unit} | {words} | " + " | ".join(f"{v.mean():.3g} ({v.std():.2g})" for v in values) + " |")

if len(sys.argv) > 2:
    plt.rcParams.update({"font.size": 10, "axes.linewidth": 0.7})
    figure, panels = plt.subplots(1, 3, figsize=(10.6, 3.9), layout="constrained", sharey=True)
    for panel, (name, words) in zip(panels, NAMES.items()):
        ends = [axes[0][0], axes[0][-1], axes[1][0], axes[1][-1]]
        image = panel.imshow(1e8 * slices[name]["dark-field"], origin="lower", extent=ends, cmap="gray", vmin=-1.5, vmax=7.5)
        panel.set(title=words, xlim=(-10.8, 10.8), ylim=(-10.8, 10.8), xlabel="x [mm]")
    panels[0].set_ylabel("y [mm]")
    figure.colorbar(image, ax=panels, shrink=0.8, label="σ² [10⁻⁸ rad²/m]")
    figure.savefig(pathlib.Path(sys.argv[2]) / "waves.png", dpi=65)
