#!/usr/bin/env python3
"""Draws spots.png from the runs of run.sh and prints its figures. Needs numpy and matplotlib."""

import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

RUNS = pathlib.Path(sys.argv[1])
SPOTS = [0, 10, 20, 30]  # um
STEPS = np.linspace(-40, 40, 21)  # um
ROW, COLUMN = 1, 64

plt.rcParams.update({"font.size": 9, "axes.linewidth": 0.7})
figure, axes = plt.subplots(2, 4, figsize=(11, 4.2), layout="constrained", sharex=True,
                            sharey="row", gridspec_kw={"height_ratios": [3, 1]})
print("| spot FWHM | peak | fitted A | sigma [um] | b | rms of curve less fit, of the peak |")
print("|---|---|---|---|---|---|")
for spot, (panel, below) in zip(SPOTS, axes.T):
    curve = np.load(RUNS / f"{spot}" / "flat.npy")[:, ROW, COLUMN].astype(float)
    a, mu, sigma, b = (
        float(np.load(RUNS / f"{spot}" / "retrieved" / f"flat_{name}.npy")[0, ROW, COLUMN])
        for name in ("amplitude", "centre", "width", "background")
    )
    mu, sigma = 1e6 * mu, 1e6 * sigma
    fit = lambda f: a * np.exp(-((f - mu) ** 2) / (2 * sigma**2)) + b
    left = curve - fit(STEPS)
    rms = np.sqrt(np.mean(left**2)) / curve.max()
    print(f"| {spot} um | {curve.max():.5f} | {a:.5f} | {sigma:.3f} | {b:.5f} | {100 * rms:.2f} % |")
    fine = np.linspace(-44, 44, 500)
    panel.plot(fine, fit(fine), color="#0072b2", lw=1.6, label="Gaussian fit")
    panel.plot(STEPS, curve, "o", color="#d55e00", ms=4, label="mask steps")
    panel.set_title("point source" if spot == 0 else f"spot {spot} µm FWHM", fontsize=10)
    panel.grid(lw=0.4)
    below.axhline(0, color="0.6", lw=0.6)
    below.plot(STEPS, 100 * left / curve.max(), "o-", color="#d55e00", ms=3, lw=0.8)
    panel.text(0.97, 0.9, f"rms less fit\n{100 * rms:.2f} % of peak", transform=panel.transAxes,
               ha="right", va="top", fontsize=8)
    below.set_xlabel("mask offset [µm]")
    below.grid(lw=0.4)
axes[0, 0].set_ylabel("intensity (1 = open pixel)")
axes[1, 0].set_ylabel("less fit\n[% of peak]")
axes[0, 0].legend(loc="upper left", fontsize=8, frameon=False)
figure.savefig(sys.argv[2], dpi=110)
