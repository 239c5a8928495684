"""Draws waves.svg: light behind a fibre by rays and waves, and dark field of cylinders by waves over rays.

Dots are measured ratios of waves_ratios.csv.
"""

import cmath
import csv
import math
from pathlib import Path

# Reference set-up in the plane of the sample mask, m: 30 keV, 1.2 + 0.6 m, spot of 30 um FWHM.
WAVELENGTH = 1.239841984e-9 / 30
DISTANCE = 0.4
APERTURE, WINDOW, PIXEL = 20e-6, 20e-6, 100e-6
BLUR = 30e-6 / 2.354820045 / 3
DELTA = 4.61e-7
WAVENUMBER = 2 * math.pi / WAVELENGTH


def chord(x, radius):
    return 2 * math.sqrt(max(radius * radius - x * x, 0.0))


def seen(x):
    """Share of light at x that a window about 0 sees."""
    below = lambda end: 0.5 * (1 + math.erf((end - x) / BLUR / math.sqrt(2)))
    return below(0.5 * WINDOW) - below(-0.5 * WINDOW)


def by_rays(centre, radius, offset, count=20000):
    """Light of the window: rays through an aperture at `offset`."""
    total, step = 0.0, APERTURE / count
    for i in range(count):
        x = offset - 0.5 * APERTURE + (i + 0.5) * step
        half = 0.5 * chord(x - centre, radius)
        angle = 2 * DELTA * (x - centre) / half if half > 1e-12 else 0.0
        total += seen(x + DISTANCE * angle) * step
    return total / PIXEL


def by_waves(centre, radius, offset, spacing=55e-9):
    """The same by pairs of rays (docs/waves.md)."""
    step = spacing / (WAVELENGTH * DISTANCE)
    count = int(APERTURE / spacing)
    places = [offset - 0.5 * APERTURE + (i + 0.5) * spacing for i in range(count)]
    field = [cmath.exp(-1j * WAVENUMBER * DELTA * chord(x - centre, radius)) for x in places]
    total = 0.0
    for j in range(count):
        f = j * step
        if f * BLUR > 0.95:
            break
        pairs = zip(field, field[j:], places)
        turn = -2j * math.pi * f
        light = sum(a * b.conjugate() * cmath.exp(turn * (x + 0.5 * j * spacing)) for a, b, x in pairs)
        window = WINDOW if j == 0 else math.sin(math.pi * f * WINDOW) / (math.pi * f)
        blur = math.exp(-2 * (math.pi * f * BLUR) ** 2)
        total += (1 if j == 0 else 2) * step * light.real * spacing * window * blur
    return total / PIXEL


def bessel_k1(x):
    step = 0.01
    return sum(math.exp(-x * math.cosh(t)) * math.cosh(t) for t in (step * (i + 0.5) for i in range(1500))) * step


def ratio(radius, shear=0.29e-6, count=40000):
    """Dark field of cylinders by waves over rays."""
    low, step = -radius - shear, 2 * (radius + shear) / count
    waves = 0.0
    for i in range(count):
        x = low + (i + 0.5) * step
        phase = WAVENUMBER * DELTA * (chord(x - shear / 2, radius) - chord(x + shear / 2, radius))
        waves += (1 - math.cos(phase)) * step
    a = 2 * WAVENUMBER * DELTA * shear
    return waves / (2 * radius * (1 - a * bessel_k1(a)))


WIDTH, HEIGHT, LEFT, TOP = 300, 200, 60, 20


def panel(x0, curves, x_ends, y_ends, ticks, labels):
    """Curves `(points, colour, name)` in a frame with ticks."""
    at_x = lambda x: x0 + LEFT + WIDTH * (x - x_ends[0]) / (x_ends[1] - x_ends[0])
    at_y = lambda y: TOP + HEIGHT * (1 - (y - y_ends[0]) / (y_ends[1] - y_ends[0]))
    out = [f'<rect x="{x0 + LEFT}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#888"/>']
    for value, text in ticks[0]:
        out.append(f'<text x="{at_x(value):.1f}" y="{TOP + HEIGHT + 16}" text-anchor="middle">{text}</text>')
    for value, text in ticks[1]:
        out.append(f'<text x="{x0 + LEFT - 6}" y="{at_y(value) + 4:.1f}" text-anchor="end">{text}</text>')
    for number, (points, colour, name) in enumerate(curves):
        path = " ".join(f"{at_x(x):.1f},{at_y(y):.1f}" for x, y in points)
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.6"/>')
        y = TOP + 16 + 16 * number
        out.append(f'<text x="{x0 + LEFT + WIDTH / 2}" y="{y}" text-anchor="middle" fill="{colour}">{name}</text>')
    out.append(f'<text x="{x0 + LEFT + WIDTH / 2}" y="{TOP + HEIGHT + 34}" text-anchor="middle">{labels[0]}</text>')
    out.append(f'<text x="{x0 + 12}" y="{TOP + HEIGHT / 2}" text-anchor="middle" transform="rotate(-90 {x0 + 12} {TOP + HEIGHT / 2})">{labels[1]}</text>')
    return out


def dots(x0, points, x_ends, y_ends):
    """Points `(x, y, deviation)` in the frame of a panel."""
    at_x = lambda x: x0 + LEFT + WIDTH * (x - x_ends[0]) / (x_ends[1] - x_ends[0])
    at_y = lambda y: TOP + HEIGHT * (1 - (y - y_ends[0]) / (y_ends[1] - y_ends[0]))
    for x, y, off in points:
        ends = f'y1="{at_y(y - off):.1f}" y2="{at_y(y + off):.1f}"'
        yield f'<line x1="{at_x(x):.1f}" x2="{at_x(x):.1f}" {ends} stroke="#333"/>'
        yield f'<circle cx="{at_x(x):.1f}" cy="{at_y(y):.1f}" r="3" fill="#333"/>'


def main():
    offset, radius = 0.0, 2.5e-6
    flats = [by_rays(1, radius, offset), by_waves(1, radius, offset)]
    places = [-16 + 0.5 * i for i in range(65)]
    change = lambda of, flat: [(x, 1e4 * (of(x * 1e-6, radius, offset) - flat)) for x in places]
    rays, waves = change(by_rays, flats[0]), change(by_waves, flats[1])
    values = [y for _, y in rays + waves]
    reach = math.ceil(max(map(abs, values)))
    ticks = ([(x, str(x)) for x in (-15, -10, -5, 0, 5, 10, 15)], [(y, str(y)) for y in (-reach, 0, reach)])
    left = panel(0, [(rays, "#c33", "rays"), (waves, "#06c", "waves")], (-16, 16), (-reach, reach), ticks,
                 ("place of the fibre, µm", "change of light, 1e-4"))
    diameters = [0.5 * 1.25**i for i in range(30)]
    curve = [(math.log10(d), ratio(0.5e-6 * d)) for d in diameters]
    ticks = ([(math.log10(d), str(d)) for d in (0.5, 1, 5, 20, 100, 300)], [(y, str(y)) for y in (0, 0.5, 1)])
    right = panel(380, [(curve, "#06c", "carbon cylinders, 30 keV")], (math.log10(0.5), math.log10(350)), (0, 1.1),
                  ticks, ("diameter, µm", "dark field, waves / rays"))
    with Path(__file__).with_name("waves_ratios.csv").open() as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    points = [(math.log10(row["diameter_um"]), row["transform"], row["transform_deviation"]) for row in rows]
    right += dots(380, points, (math.log10(0.5), math.log10(350)), (0, 1.1))
    body = "\n".join(left + right)
    style = 'font-family="DejaVu Sans, sans-serif" font-size="12"'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" width="750" height="265" {style}>\n<rect width="750" height="265" fill="#fff"/>\n{body}\n</svg>\n'
    Path(__file__).with_suffix(".svg").write_text(svg)
    return curve


if __name__ == "__main__":
    for size, value in main():
        print(f"{10**size:8.2f} {value:.3f}")
