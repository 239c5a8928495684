#!/usr/bin/env python3
"""Draws slices.png and boxes.png from the results of run.sh and prints the table of regions.

usage: picture.py RUNS [FOLDER]    (FOLDER, for the pictures; without it the table alone)
"""

import json
import pathlib
import re
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

RUNS = pathlib.Path(sys.argv[1])
VOLUMES = {
    "paper": "Gaussian fit, Barzilai-Borwein",
    "gaussian_fbp": "Gaussian fit, filtered back-projection",
    "exact_fbp": "exact curve, filtered back-projection",
}
QUANTITIES = {  # file: factor, unit, limits of grey values
    "mu": (1e-2, "µ [1/cm]", (0.05, 0.7)),
    "delta": (1e7, "δ [10⁻⁷]", (1.7, 4.7)),
    "dark-field": (1e8, "σ² [10⁻⁸ rad²/m]", (-1.5, 7.5)),
}
# Centres and radius of regions, mm; those of the scene.
THICK = np.loadtxt("thick.csv", delimiter=",", skiprows=2)[:, :2] + [0, -5]
BUNDLE, BUNDLE_RADIUS = (0.0, 5.0), 1.25
REGIONS = {
    "polyethylene": ([(5.0, -4.5)], 1.0, "#0072b2"),
    "carbon rod": ([(5.0, 0.0)], 0.35, "#d55e00"),
    "epoxy rod": ([(-5.0, 0.0)], 0.35, "#009e73"),
    "nylon rod": ([(-6.0, -4.0)], 0.35, "#cc79a7"),
    "thick fibres": (THICK, 0.075, "#56b4e9"),
    "bundle": ([BUNDLE], 0.9, "#e69f00"),
}
RADIUS = 2.5e-6  # of a thin fibre, m
WIDENING = 3.95  # variance of the curve of a bundle over N (2 Δδ)², 7 steps over ±30 um


def region(record, centres, radius):
    """Voxels whose centres lie within `radius` of one of `centres`."""
    (x, y, _) = (
        1e3 * (o + v * np.arange(n)) for o, v, n in zip(record["origin_m"], record["voxel_m"], record["size"])
    )
    off = [np.hypot(x[None] - a, y[:, None] - b) for a, b in centres]
    return np.min(off, axis=0) < radius


def fibres(scene):
    """Number of thin fibres."""
    return int(re.search(r"parallel-fibres.*?count = (\d+)", scene.read_text(), re.DOTALL).group(1))


record = json.loads((RUNS / "exact_fbp/volume.json").read_text())
slices = {
    name: {q: np.load(RUNS / name / f"{q}.npy")[0].astype(float) for q in QUANTITIES} for name in VOLUMES
}
truth = {q: np.load(RUNS / "exact_fbp" / f"{q}_truth.npy")[0].astype(float) for q in ("mu", "delta")}
voxels = {name: region(record, centres, radius) for name, (centres, radius, _) in REGIONS.items()}
fill = fibres(RUNS / "run/scene.toml") * RADIUS**2 / (1e-3 * BUNDLE_RADIUS) ** 2
theory = {}
for name in REGIONS:
    if name != "bundle":
        theory[name] = {q: np.median(truth[q][voxels[name]]) for q in truth} | {"dark-field": 0.0}
carbon, matrix = theory["carbon rod"], theory["polyethylene"]
mean = {q: fill * carbon[q] + (1 - fill) * matrix[q] for q in truth}
crossings = 2 * fill / (np.pi * RADIUS)
theory["bundle"] = mean | {"dark-field": WIDENING * crossings * (2 * (carbon["delta"] - matrix["delta"])) ** 2}

print(f"fill of the bundle {fill:.3f}, {1e-3 * crossings * 2 * BUNDLE_RADIUS:.0f} fibres through its centre")
print("| quantity | way | " + " | ".join(REGIONS) + " |")
print("|" + "---|" * (len(REGIONS) + 2))
for q, (factor, unit, _) in QUANTITIES.items():
    print(f"| {unit} | theory | " + " | ".join(f"{factor * theory[n][q]:.4g}" for n in REGIONS) + " |")
    for name, words in VOLUMES.items():
        cells = []
        for place in REGIONS:
            values, true = slices[name][q][voxels[place]], theory[place][q]
            if true == 0.0:
                cells.append(f"{factor * values.mean():.2g} ({factor * values.std():.2g})")
            else:
                cells.append(f"{100 * (values.mean() / true - 1):+.1f} % ({100 * values.std() / true:.1f})")
        print(f"| | {words} | " + " | ".join(cells) + " |")

if len(sys.argv) < 3:
    sys.exit()
FOLDER = pathlib.Path(sys.argv[2])
plt.rcParams.update({"font.size": 9, "axes.linewidth": 0.7})
ends = [1e3 * (o + v * (np.array([0, n]) - 0.5)) for o, v, n in
        zip(record["origin_m"], record["voxel_m"], record["size"])]
shown = ("paper", "exact_fbp")
figure, axes = plt.subplots(2, 3, figsize=(10.6, 7.2), layout="constrained", sharex=True, sharey=True)
for row, name in zip(axes, shown):
    for axis, (q, (factor, unit, limits)) in zip(row, QUANTITIES.items()):
        image = axis.imshow(factor * slices[name][q], origin="lower", extent=[*ends[0], *ends[1]], cmap="gray",
                            vmin=limits[0], vmax=limits[1], interpolation="nearest")
        figure.colorbar(image, ax=axis, location="bottom", pad=0.02, shrink=0.8, label=unit)
        axis.set(xlim=(-10.8, 10.8), ylim=(-10.8, 10.8))
    row[0].set_ylabel(f"{VOLUMES[name]}\ny [mm]")
for centres, radius, colour in REGIONS.values():
    for centre in centres:
        axes[1, 1].add_patch(plt.Circle(centre, radius, fill=False, ec=colour, lw=0.9))
for axis in axes[1]:
    axis.set_xlabel("x [mm]")
figure.savefig(FOLDER / "slices.png", dpi=110)

figure, axes = plt.subplots(1, 3, figsize=(10.6, 4.0), layout="constrained")
for axis, (q, (factor, unit, _)) in zip(axes, QUANTITIES.items()):
    for place, (region_name, (_, _, colour)) in enumerate(REGIONS.items()):
        values = [factor * slices[name][q][voxels[region_name]] for name in VOLUMES]
        at = place + np.array([-0.26, 0.0, 0.26])
        drawn = axis.boxplot(values, positions=at, widths=0.2, patch_artist=True, whis=(5, 95), showfliers=False, manage_ticks=False,
                             medianprops={"color": "black", "lw": 0.9}, boxprops={"lw": 0.6},
                             whiskerprops={"lw": 0.6}, capprops={"lw": 0.6})
        for box, alpha in zip(drawn["boxes"], (0.25, 0.55, 1.0)):
            box.set_facecolor(matplotlib.colors.to_rgba(colour, alpha))
        level = factor * theory[region_name][q]
        axis.plot([place - 0.45, place + 0.45], [level, level], "--", color=colour, lw=1.3)
    axis.set_xticks(range(len(REGIONS)), list(REGIONS), rotation=35, ha="right")
    axis.set_ylabel(unit)
figure.suptitle("from the left: " + "; ".join(VOLUMES.values()) + "; dashed: theory", fontsize=9)
figure.savefig(FOLDER / "boxes.png", dpi=110)
