"""Measures the dark field of carbon fibres by waves over rays, by diameter, and writes waves_ratios.csv.

usage: waves_ratios.py BEAMLET FOLDER [DIAMETER ...]    (um; runs of missing diameters go to FOLDER)

Stacks of parallel fibres in vacuum, a tenth of their box, in the reference set-up of waves.md without absorption.
Each column is a stack of its own. The curve of 19 mask steps is averaged over columns: its transform at
1/(2 pi sigma), sigma of the flat, has exp(-nD), and Gaussians are fitted to seven of its steps. Deviations are from
groups of columns. Needs numpy.
"""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np

import waves

COLUMNS, GROUPS = 128, 16
# Stacks of few thick fibres differ more: each seed adds as many columns.
SEEDS = {40: 3, 80: 3}
OFFSETS = 5e-6 * np.arange(-9, 10)
FITTED = slice(3, 16, 2)
SIGMA = 9.2e-6
# Most crossings of a ray, and deepest box, m.
CROSSINGS, DEPTH, FILL = 25, 8e-3, 0.1

SCENE = """
[source]
distance = "1.21 m"
spot = ["30 um", "0 um"]
energy = "30 keV"
[sample_mask]
distance = "1.2 m"
aperture = "20 um"
period = "100 um"
transmission = 0.0
[detector_mask]
distance = "1.8 m"
aperture = "30 um"
transmission = 0.0
[detector]
distance = "1.8 m"
pixels = [{columns}, 1]
pitch = "150 um"
[scan]
mask_offsets = {{ from = "-45 um", to = "45 um", count = 19 }}
[sampling]
tolerance = 3e-4
transport = "{transport}"
[materials.fibre]
mu = "0 /m"
delta = {delta}
[[object]]
name = "fibres"
material = "fibre"
shape = {{ cylinder = {{ radius = "{radius} m", height = "8 mm" }} }}
instances = {{ packing = "parallel-fibres", count = {count}, seed = {seed}, region = {{ box = {{ size = ["{width} m", "{depth} m", "8 mm"] }} }} }}
"""


def scene(diameter, transport, seed):
    """Text of a scene with fibres of a diameter, m."""
    width = 100e-6 * 1.21 / 1.2 * (COLUMNS + 4)
    crossings = min(CROSSINGS, DEPTH * FILL * 4 / (np.pi * diameter))
    count = round(crossings * width / diameter)
    depth = count * np.pi * diameter**2 / 4 / FILL / width
    return SCENE.format(
        columns=COLUMNS, transport=transport, seed=seed, delta=waves.DELTA, radius=diameter / 2, count=count, width=width, depth=depth
    )


def stacks(beamlet, folder, diameter, transport, seed):
    """Flat and sample of a run, [step][column]."""
    run = folder / f"{1e6 * diameter:g}-{transport}-{seed}"
    if not run.exists():
        text = run.with_suffix(".toml")
        text.write_text(scene(diameter, transport, seed))
        subprocess.run([beamlet, "simulate", text, "-o", run, "--format", "npy", "-q"], check=True)
    read = [np.load(run / f"{name}.npy").reshape(len(OFFSETS), COLUMNS).astype(float) for name in ("flat", "sample")]
    return [stack[:, 1:-1] for stack in read]


def all_stacks(beamlet, folder, diameter, transport):
    """The same over all seeds."""
    seeds = range(1, 1 + SEEDS.get(round(1e6 * diameter), 1))
    return [np.hstack(of) for of in zip(*(stacks(beamlet, folder, diameter, transport, seed) for seed in seeds))]


def variance(curve):
    """Variance of a Gaussian that is fitted to seven steps."""
    x, y = 1e6 * OFFSETS[FITTED], curve[FITTED]
    area, centre, square = y.max(), 0.0, 100.0
    for _ in range(50):
        shape = np.exp(-((x - centre) ** 2) / (2 * square))
        slopes = np.stack([shape, area * shape * (x - centre) / square, area * shape * (x - centre) ** 2 / (2 * square**2)])
        change = np.linalg.lstsq(slopes.T, y - area * shape, rcond=None)[0]
        area, centre, square = np.array([area, centre, square]) + change
    return 1e-12 * square


def scatter(flat, sample):
    """nD by the transform of the curve, and the variance that fits find more than in the flat (m²)."""
    at = np.exp(-1j * OFFSETS / SIGMA)
    return np.array([-np.log(np.abs(at @ sample) / np.abs(at @ flat)), variance(sample) - variance(flat)])


def ratios(by_waves, by_rays):
    """Ratios of waves to rays by transform and by fits, each with its deviation."""

    def of(keep):
        means = [[stack[:, keep].mean(axis=1) for stack in of_run] for of_run in (by_waves, by_rays)]
        return scatter(*means[0]) / scatter(*means[1])

    columns = by_waves[0].shape[1]
    group = np.arange(columns) * GROUPS // columns
    without = np.array([of(group != number) for number in range(GROUPS)])
    deviation = np.sqrt((GROUPS - 1) * without.var(axis=0))
    return of(group >= 0), deviation


def main():
    beamlet, folder = sys.argv[1], Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    diameters = [float(text) for text in sys.argv[3:]] or [5, 10, 20, 40, 80]
    rows = []
    for diameter in diameters:
        runs = [all_stacks(beamlet, folder, 1e-6 * diameter, transport) for transport in ("wave", "auto")]
        [transform, fits], [transform_off, fits_off] = ratios(*runs)
        expected = waves.ratio(0.5e-6 * diameter)
        rows.append([f"{diameter:g}", *(f"{x:.3f}" for x in (expected, transform, transform_off, fits, fits_off))])
        print(*rows[-1], flush=True)
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        names = ["diameter_um", "structure_functions", "transform", "transform_deviation", "fits", "fits_deviation"]
        csv.writer(file, lineterminator="\n").writerows([names, *rows])


if __name__ == "__main__":
    main()
