"""Fits eq. 1 to the curves of an NPY file (step, curve) with scipy's curve_fit, pixel by pixel, as
retrieval scripts do. Prints fits per second, by time and by processor time (without start-up)."""

import sys
import time

import numpy as np
from scipy.optimize import curve_fit


def gaussian(x, amplitude, centre, width, background):
    return amplitude * np.exp(-0.5 * ((x - centre) / width) ** 2) + background


curves = np.load(sys.argv[1]).astype(float)
x = np.linspace(-25, 25, curves.shape[0])
wall, cpu = time.perf_counter(), time.process_time()
for y in curves.T:
    curve_fit(gaussian, x, y, p0=(y.max() - y.min(), x[y.argmax()], 9.0, y.min()))
count = curves.shape[1]
print(count / (time.perf_counter() - wall), count / (time.process_time() - cpu))
