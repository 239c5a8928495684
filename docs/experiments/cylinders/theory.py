"""Polychromatic illumination curves of cylinders between thick gold masks, energy by energy.

Independent of beamlet but for the rows of the spectrum: constants are those of xraydb, chords and
deflections closed forms of the circle, bars exact paths through boxes. Lengths in m, f64."""

import numpy as np
import xraydb

# The set-up of scene.toml.
SOURCE, SAMPLE_MASK, DETECTOR, DETECTOR_MASK = 1.21, 1.2, 1.8, 1.8 - 112.5e-6
PITCH, PERIOD, APERTURE, GOLD = 150e-6, 100e-6, 20e-6, 225e-6
COLUMNS, ROWS = 256, 64
SPOT = 30e-6 / np.sqrt(8 * np.log(2))
RADIUS = 3e-3
OFFSETS = np.linspace(-25e-6, 25e-6, 11)
MAGNIFICATION, LEVER = DETECTOR / SAMPLE_MASK, DETECTOR - SOURCE
CYLINDERS = [  # centre, formula, density
    (-8e-3, "H2O", 1.0),
    (0.0, "C2H4", 0.93),
    (8e-3, "C", 2.0),
]

STEP = 0.1e-6  # of the integral over the sample mask
HALF = 850  # of such steps on either side of an aperture's middle


def constants(energies):
    """mu (1/m) and delta, [material][energy], and mu of gold."""
    ev = 1e3 * np.asarray(energies)
    mu = [100 * xraydb.material_mu(f, ev, density=d, kind="total") for _, f, d in CYLINDERS]
    delta = [[xraydb.xray_delta_beta(f, d, e)[0] for e in ev] for _, f, d in CYLINDERS]
    gold = 100 * xraydb.material_mu("Au", ev, density=19.3, kind="total")
    return np.array(mu), np.array(delta), gold


def passed(x, period, aperture, theta, mu):
    """Integral from 0 to x of what a mask of straight boxes passes, [energy][x]."""
    mu = mu[:, None]
    width = GOLD * max(abs(theta), 1e-9)  # of the strip at an edge that is shadowed in part
    depth = mu * GOLD * np.sqrt(1 + theta**2)

    def within(x):
        """From 0, for one aperture in endless bars."""
        far = np.abs(x)
        open_part, strip_end = 0.5 * (aperture - width), 0.5 * (aperture + width)
        strip = width / depth * -np.expm1(-depth * np.clip((far - open_part) / width, 0, 1))
        bar = np.exp(-depth) * np.maximum(far - strip_end, 0)
        return np.sign(x) * (np.minimum(far, open_part) + strip + bar)

    nearest = np.round(x / period)
    whole = 2 * within(np.array([period / 2]))
    return nearest * whole + within(x - nearest * period)


def averages(centres, step, *mask):
    """Means over steps about their centres."""
    edges = np.append(centres - step / 2, centres[-1] + step / 2)
    return np.diff(passed(edges, *mask), axis=1) / step


def sample(x, mu, delta):
    """Optical depth and displacement at the detector mask of rays from the middle of the source
    through x in the sample mask, [energy][x], to first order in delta."""
    slope = x / SAMPLE_MASK
    cosine = 1 / np.sqrt(1 + slope**2)
    depth, displacement = np.zeros((mu.shape[1], x.size)), np.zeros((mu.shape[1], x.size))
    for (centre, _, _), mu_of, delta_of in zip(CYLINDERS, mu, delta):
        offset = (slope * SOURCE - centre) * cosine  # of the ray from the axis
        half = np.sqrt(np.maximum(RADIUS**2 - offset**2, 0))
        tangent = np.where(half > 0, offset / np.maximum(half, 1e-9), 0)
        # Where the ray comes closest to the axis: its two surfaces lie evenly about that.
        middle = SOURCE + (centre - slope * SOURCE) * slope * cosine**2
        arm = 2 * (DETECTOR_MASK - middle)
        depth += mu_of[:, None] * 2 * half
        displacement += delta_of[:, None] * tangent * arm * (1 + slope**2)
    return depth, displacement


def curves(energies, weights):
    """Flat and sample of a row in the middle, [column][step], in open pixels; and plain theory:
    transmission and refraction angle in the middle of each aperture."""
    mu, delta, gold = constants(energies)
    weights = np.asarray(weights) / np.sum(weights)
    flat, seen = np.empty((COLUMNS, OFFSETS.size)), np.empty((COLUMNS, OFFSETS.size))
    plain_t, plain_alpha = np.empty(COLUMNS), np.empty(COLUMNS)
    x = STEP * np.arange(-HALF, HALF + 1)
    shifts = np.rint(OFFSETS / STEP).astype(int)
    blur = SPOT * (DETECTOR_MASK / SAMPLE_MASK - 1)
    # Where light may pass the detector mask, on a grid that an FFT turns round in.
    count = 4096
    u = STEP * (np.arange(count) - count // 2)
    soft = np.exp(-0.5 * (blur * 2 * np.pi * np.fft.rfftfreq(count, STEP)) ** 2)
    shrink = DETECTOR_MASK / DETECTOR
    for column in range(COLUMNS):
        centre = (column + 0.5 - COLUMNS / 2) * PERIOD
        theta = centre / SAMPLE_MASK
        window = np.clip((PITCH * shrink / 2 - np.abs(u)) / STEP + 0.5, 0, 1)
        second = averages(u, STEP, PITCH * shrink, 30e-6 * shrink, theta, gold) * window
        second = np.fft.irfft(np.fft.rfft(second) * soft, count)
        wide = STEP * np.arange(-HALF - 250, HALF + 251)
        first = averages(wide, STEP, PERIOD, APERTURE, theta, gold)
        depth, displacement = sample(centre + x, mu, delta)
        light = np.exp(-depth)
        landing = DETECTOR_MASK / SAMPLE_MASK * x
        # A source point off the middle sees the sample a little aside: the mean of that.
        aside = SPOT * (SOURCE - SAMPLE_MASK) / SOURCE
        lean = -np.gradient(depth, STEP, axis=1) * aside * blur
        shade = weights[:, None] * np.exp(0.5 * (lean / blur) ** 2)
        where = (landing + displacement + lean - u[0]) / STEP
        where = np.clip(where, 0, count - 2.001)
        at = where.astype(int)
        part = where - at
        energy = np.arange(len(weights))[:, None]
        with_it = light * shade * ((1 - part) * second[energy, at] + part * second[energy, at + 1])
        where = (landing - u[0]) / STEP
        at = where.astype(int)
        part = where - at
        without = weights[:, None] * ((1 - part) * second[:, at] + part * second[:, at + 1])
        for step, shift in enumerate(shifts):
            some = first[:, 250 - shift : 250 - shift + x.size]
            seen[column, step] = np.sum(some * with_it) * STEP / PERIOD
            flat[column, step] = np.sum(some * without) * STEP / PERIOD
        middle = np.abs(x) <= APERTURE / 2
        amount = weights[:, None] * light[:, middle]
        plain_t[column] = amount.sum() / middle.sum()
        plain_alpha[column] = np.sum(amount * displacement[:, middle]) / amount.sum() / LEVER
    return flat, seen, plain_t, plain_alpha
