#!/usr/bin/env python3
"""Draws rays.png from the runs of run.sh and prints its figures. Needs numpy and matplotlib."""

import json
import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

RUNS = pathlib.Path(sys.argv[1])
COUNTS = ["1", "5", "10", "50", "100", "500", "1000", "5000"]
SHOWN = ["1", "10", "100", "1000", "5000", "cells"]
PITCH, MAGNIFICATION, RADIUS = 0.150, 1.8 / 1.21, 4.0  # mm

x = (np.arange(128) + 0.5 - 64) * PITCH
# Away from the silhouette, where a Gaussian fits badly whatever the sampling.
interior = np.abs(x) < 0.9 * RADIUS * MAGNIFICATION


def image(run, name):
    return np.load(RUNS / run / "retrieved" / f"{name}.npy")[0].astype(float)


def rms(values):
    return np.sqrt(np.nanmean(values**2))


exact = {name: image("cells", name) for name in ("transmission", "refraction")}
print(f"rms of alpha inside the cylinder: {rms(exact['refraction'][:, interior]):.3g} rad")
print("| rays per pixel | rms error of T | rms error of alpha [rad] | pixels without a result | traces |")
print("|---|---|---|---|---|")
errors = {}
for run in COUNTS + ["cells"]:
    record = json.loads((RUNS / run / "run.json").read_text())
    errors[run] = [
        rms((image(run, name) - exact[name])[:, interior]) for name in ("transmission", "refraction")
    ]
    lost = 100 * np.mean(np.isnan(image(run, "refraction")))
    cost = f"{lost:.1f} % | {record['tally']['rays']:,}"
    if run == "cells":
        print(f"| cells | (reference) | (reference) | {cost} |")
    else:
        print(f"| {run} | {errors[run][0]:.2g} | {errors[run][1]:.2g} | {cost} |")

plt.rcParams.update({"font.size": 9, "axes.linewidth": 0.7})
figure, axes = plt.subplots(len(SHOWN), 3, figsize=(10.4, 7.4), layout="constrained", sharex=True,
                            gridspec_kw={"width_ratios": [1, 1, 0.9]})
extent = [x[0] - PITCH / 2, x[-1] + PITCH / 2, -12 * PITCH, 12 * PITCH]
limit = 2.0  # urad
# Pixels without a result are violet, as in beamlet's own pictures.
gray, signed = (matplotlib.colormaps[name].with_extremes(bad="#be46d2") for name in ("gray", "RdBu_r"))
for (left, middle, right), run in zip(axes, SHOWN):
    for panel, name, factor, style in (
        (left, "transmission", 1, {"cmap": gray, "vmin": 0.6, "vmax": 1.05}),
        (middle, "refraction", 1e6, {"cmap": signed, "vmin": -limit, "vmax": limit}),
    ):
        shown = panel.imshow(factor * image(run, name), extent=extent, interpolation="nearest", **style)
        panel.set_yticks([-1, 0, 1])
        panel.tick_params(length=2)
        if run == SHOWN[0]:
            words = {"transmission": "transmission", "refraction": "refraction angle [µrad]"}[name]
            panel.set_title(words, fontsize=10)
            bars = [axes[row][0 if name == "transmission" else 1] for row in range(len(SHOWN))]
            figure.colorbar(shown, ax=bars, location="bottom", shrink=0.8, aspect=40, pad=0.02)
    label = "cells" if run == "cells" else f"{run} ray{'s' if run != '1' else ''}"
    left.set_ylabel(label + "\nper pixel" * (run != "cells"), fontsize=10)
    row = 12
    right.plot(x, 1e6 * exact["refraction"][row], color="0.65", lw=2.2, label="cells")
    if run != "cells":
        right.plot(x, 1e6 * image(run, "refraction")[row], color="#0072b2", lw=0.9)
        right.text(0.03, 0.82, f"rms error {1e6 * errors[run][1]:.3f} µrad", transform=right.transAxes)
    else:
        right.text(0.03, 0.82, "(grey line in every panel)", transform=right.transAxes)
    right.set_ylim(-3.6, 3.6)
    right.set_xlim(extent[:2])
    right.tick_params(length=2)
    if run == SHOWN[0]:
        right.set_title("refraction angle along a row [µrad]", fontsize=10)
for panel in axes[-1]:
    panel.set_xlabel("x on the detector [mm]")
figure.savefig(sys.argv[2], dpi=110)
