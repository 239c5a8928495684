#!/usr/bin/env python3
"""Draws sinograms.png and grazing.png from the runs of run.sh and prints its figures. usage:
picture.py RUNS DIR. Needs numpy and matplotlib."""

import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

RUNS, OUT = map(pathlib.Path, sys.argv[1:3])
BODIES = {"smooth": "smooth mesh", "rough": "rough mesh", "roughness": "smooth mesh, roughness 0.001"}
COLOURS = {"smooth": "#0072b2", "rough": "#d55e00", "roughness": "#009e73"}
SCAN = ["0.0003", "0.0005", "0.0007", "0.001", "0.0014", "0.002", "0.003"]
EDGE = slice(104, 118)  # pixels about the face that is grazed and lit


def relative(run):
    """Intensity over that of the flat, [view][column]."""
    sample, flat = (np.load(RUNS / run / f"{name}.npy").astype(float) for name in ("sample", "flat"))
    return sample.reshape(-1, 128) / flat.reshape(128)


def rms(values):
    return np.sqrt(np.mean(values**2))


x = (np.arange(128) - 63.5) * 0.15
plt.rcParams.update({"font.size": 9, "axes.linewidth": 0.7})

figure, axes = plt.subplots(3, 3, figsize=(10.4, 8.2), layout="constrained")
for column, (body, title) in enumerate(BODIES.items()):
    for row, scheme in enumerate(("random", "cells")):
        panel = axes[row][column]
        shown = panel.imshow(relative(f"{scheme}_{body}"), cmap="gray", vmin=0, vmax=1.2, aspect="auto",
                             extent=[x[0], x[-1], 44.5, -0.5], interpolation="nearest")
        panel.set_title(f"{title}, {'5000 random rays' if scheme == 'random' else 'cells'}", fontsize=9)
        panel.set_ylabel("view [degrees]")
        panel.axhline(22, color="#cc79a7", lw=0.6, ls="--")
figure.colorbar(shown, ax=axes[:2], label="intensity over the flat's", shrink=0.7)
for panel, (view, scheme) in zip(axes[2], ((22, "random"), (22, "cells"), (23, "cells"))):
    for body, title in BODIES.items():
        values = relative(f"{scheme}_{body}")[view]
        panel.plot(x[EDGE], values[EDGE], color=COLOURS[body], lw=1.1, marker=".", ms=3, label=title)
    panel.set_title(f"view {view}°, {'random rays' if scheme == 'random' else 'cells'}", fontsize=9)
    panel.set_xlabel("x on the detector [mm]")
    panel.set_ylim(-0.05, 1.6)
axes[2][0].legend(fontsize=7)
figure.savefig(OUT / "sinograms.png", dpi=110)

angles = 22 + np.arange(100) / 100
figure, axes = plt.subplots(1, 3, figsize=(10.4, 3.2), layout="constrained")
for body, title in BODIES.items():
    values = relative(f"fine_{body}")[:, EDGE]
    axes[0].plot(angles, values.max(axis=1), color=COLOURS[body], lw=1.1, label=title)
    axes[1].plot(angles, values.min(axis=1), color=COLOURS[body], lw=1.1)
axes[0].set_title("brightest pixel at the edge", fontsize=9)
axes[1].set_title("darkest pixel at the edge", fontsize=9)
for panel in axes[:2]:
    panel.set_xlabel("view [degrees]")
    panel.set_ylabel("intensity over the flat's")
axes[0].legend(fontsize=7)
mesh, smooth = relative("scan_mesh")[:, EDGE], relative("scan_0")[:, EDGE]
off = [rms(relative(f"scan_{roughness}")[:, EDGE] - mesh) for roughness in SCAN]
axes[2].semilogx([float(s) for s in SCAN], off, color=COLOURS["roughness"], marker=".")
axes[2].axhline(rms(smooth - mesh), color=COLOURS["smooth"], lw=0.8, label="smooth")
axes[2].set_title("rms difference from the rough mesh", fontsize=9)
axes[2].set_xlabel("roughness")
axes[2].set_xticks([0.0003, 0.001, 0.003], ["0.0003", "0.001", "0.003"])
axes[2].minorticks_off()
axes[2].legend(fontsize=7)
figure.savefig(OUT / "grazing.png", dpi=110)

print("rms of random rays less cells, all views and pixels:")
for body in BODIES:
    print(f"  {body}: {rms(relative(f'random_{body}') - relative(f'cells_{body}')):.4f}")
print("| body | brightest, views of 0.01 degrees | brightest in 22.6 to 22.8 | contrast at 22 degrees | at 23 degrees |")
print("|---|---|---|---|---|")
for body, title in BODIES.items():
    fine = relative(f"fine_{body}")[:, EDGE]
    contrast = [np.ptp(relative(f"cells_{body}")[view, EDGE]) for view in (22, 23)]
    print(f"| {title} | {fine.max():.3f} at {angles[fine.max(axis=1).argmax()]:.2f}° | "
          f"{fine[60:81].max(axis=1).mean():.3f} | {contrast[0]:.3f} | {contrast[1]:.3f} |")
print("| roughness | rms difference from the rough mesh | contrast, mean of the views |")
print("|---|---|---|")
contrast = lambda values: np.ptp(values, axis=1).mean()
print(f"| 0 | {rms(smooth - mesh):.4f} | {contrast(smooth):.3f} |")
for roughness, value in zip(SCAN, off):
    print(f"| {roughness} | {value:.4f} | {contrast(relative(f'scan_{roughness}')[:, EDGE]):.3f} |")
print(f"| rough mesh | 0 | {contrast(mesh):.3f} |")
