#!/usr/bin/env python3
"""Draws cylinders.png from the runs of run.sh and prints their differences from theory.py."""

import json
import pathlib
import sys

import matplotlib
import numpy as np
from scipy.optimize import curve_fit

import theory

matplotlib.use("Agg")
import matplotlib.pyplot as plt

RUNS = pathlib.Path(sys.argv[1])
ROW = theory.ROWS // 2
x = (np.arange(theory.COLUMNS) + 0.5 - theory.COLUMNS / 2) * theory.PITCH
sample_x = x * theory.SOURCE / theory.DETECTOR  # in the plane of the cylinders
aside = np.min([np.abs(sample_x - c) for c, _, _ in theory.CYLINDERS], axis=0)
inside = aside < 0.9 * theory.RADIUS
# Light of a silhouette falls into the pixel that it is seen in, and into those beside it.
silhouette = np.abs(aside - theory.RADIUS) < theory.PITCH
PLACES = {"inside": inside, "beside": aside > theory.RADIUS + theory.PITCH,
          "rim": (aside >= 0.9 * theory.RADIUS) & (aside < theory.RADIUS) & ~silhouette,
          "silhouettes": silhouette}


def gaussian(f, a, centre, width, background):
    return a * np.exp(-0.5 * ((f - centre) / width) ** 2) + background


def fits(curves):
    """A, centre, width, background of each curve, lengths in um."""
    f = 1e6 * theory.OFFSETS
    start = [0, 0, 9, 0]
    return np.array([
        curve_fit(gaussian, f, c, [np.ptp(c), *start[1:]], xtol=1e-13, ftol=1e-13)[0] for c in curves
    ]).T


beam = json.loads((RUNS / "spectrum.json").read_text())
flat, seen, plain_t, plain_alpha = theory.curves(beam["after"]["energies_kev"], beam["after"]["weights"])
of_flat, of_seen = fits(flat), fits(seen)
exact = {
    "transmission": of_seen[0] * of_seen[2] / (of_flat[0] * of_flat[2]),
    "refraction": -theory.MAGNIFICATION / theory.LEVER * 1e-6 * (of_seen[1] - of_flat[1]),
}
rms_alpha = np.sqrt(np.mean(exact["refraction"][inside] ** 2))
print(f"{len(beam['after']['weights'])} rows; {len(beam['nodes']['weights'])} nodes chosen, "
      f"estimated error {beam['nodes']['estimated_error']:.1e}; "
      f"rms of alpha inside {rms_alpha:.4g} rad")
print("| run | pixels | flat | sample | T | alpha [rad] | seconds: wall, user, system |")
print("|---|---|---|---|---|---|---|")
shown = {}
for run in ("chosen", "60", "exact"):
    stacks = np.load(RUNS / run / "flat.npy")[:, ROW].T, np.load(RUNS / run / "sample.npy")[0, :, ROW].T
    images = {n: np.load(RUNS / run / "retrieved" / f"{n}.npy")[0, ROW].astype(float) for n in exact}
    off = [np.abs(stacks[0] - flat), np.abs(stacks[1] - seen)]
    off += [np.abs(images[n] - exact[n]) for n in exact]
    shown[run] = images
    for place, pixels in PLACES.items():
        cells = " | ".join(f"{np.max(o[pixels]):.1e}, {np.sqrt(np.mean(o[pixels]**2)):.1e}" for o in off)
        seconds = (RUNS / f"{run}.time").read_text().strip() if place == "inside" else ""
        print(f"| {run} | {place} ({pixels.sum()}) | {cells} | {seconds} |")

plt.rcParams.update({"font.size": 9, "axes.linewidth": 0.7})
figure, axes = plt.subplots(3, 2, figsize=(10.4, 7.2), layout="constrained", sharex=True,
                            gridspec_kw={"height_ratios": [0.75, 2, 1]})
mm = 1e3 * x
extent = [-19.2, 19.2, -4.8, 4.8]
answers = shown["chosen"]
for side, (name, factor, words, plain, style, limit) in enumerate((
    ("transmission", 1, "transmission", plain_t, {"cmap": "gray", "vmin": 0.7, "vmax": 1.05}, 1e-3),
    ("refraction", 1e6, "refraction angle [µrad]", 1e6 * plain_alpha,
     {"cmap": "RdBu_r", "vmin": -2, "vmax": 2}, 1e-3),
)):
    image, profile, off = axes[:, side]
    view = factor * np.load(RUNS / "chosen" / "retrieved" / f"{name}.npy")[0]
    drawn = image.imshow(view, extent=extent, interpolation="nearest", aspect="auto", **style)
    image.set_title(words, fontsize=10)
    figure.colorbar(drawn, ax=image, location="right", pad=0.01, aspect=8)
    image.set_ylabel("z [mm]")
    profile.plot(mm, plain, color="0.72", lw=3.2, label="mean over the spectrum at the aperture")
    profile.plot(mm, factor * exact[name], "o", ms=2.6, mfc="none", mew=0.7, color="#d55e00",
                 label="fits of the analytic curves")
    profile.plot(mm, factor * answers[name], lw=0.9, color="#0072b2", label="beamlet")
    if side == 0:
        profile.set_ylim(0.68, 1.12)
    else:
        profile.set_ylim(-3.6, 3.6)
    for (centre, _, _), word in zip(theory.CYLINDERS, ("water", "polyethylene", "carbon")):
        place = 1e3 * centre * theory.DETECTOR / theory.SOURCE
        profile.text(place, profile.get_ylim()[1] - 0.07 * np.ptp(profile.get_ylim()), word, ha="center",
                     fontsize=8)
    scale = 1 if name == "transmission" else rms_alpha
    error = (answers[name] - exact[name]) / scale
    off.axhspan(-limit, limit, color="#009e73", alpha=0.12, lw=0)
    off.axhline(0, color="0.6", lw=0.5)
    off.plot(mm[inside], error[inside], ".", ms=3, color="#0072b2", label="inside")
    off.plot(mm[~inside], error[~inside], "x", ms=3, mew=0.6, color="0.5", label="rim, silhouettes, beside")
    off.set_ylim(-3e-3, 4e-3)
    off.set_ylabel("difference" + (" / rms of angle" if side else ""))
    off.set_xlabel("x on the detector [mm]")
    off.legend(loc="upper right", fontsize=7, ncols=2, frameon=False)
    off.set_xlim(extent[:2])
handles, words = axes[1, 0].get_legend_handles_labels()
figure.legend(handles, words, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
figure.savefig(sys.argv[2], dpi=110)
