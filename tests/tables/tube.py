"""Makes the tables of the built-in X-ray tube, and the numbers its test compares with.

    pip install spekpy==2.5.4
    python tests/tables/tube.py tables     # engine/model/spectrum/{tungsten,molybdenum}.bin
    python tests/tables/tube.py scale      # photons per electron of a value of 1, in engine/model/spectrum/tube.rs
    python tests/tables/tube.py reference  # tests/tables/{tube.csv,spekpy_100kv.txt}

Model: "casim" of SpekPy 2.5 (MIT licence, G. Poludniowski and others): Omar, Andreo and
Poludniowski, Med. Phys. 47 (2020) 4763 and 4005 (bremsstrahlung), NIM B 437 (2018) 36 (lines).

What is tabulated stands before the self-absorption in the target, which is strong and jumps at
the absorption edges: bremsstrahlung against depth, in units that vary slowly (photon energy over
tube voltage, depth over the range of the electrons), and the lines of each shell. The engine
applies the self-absorption of the continuum at the energy asked for, by the attenuation that
SpekPy uses for it; lines have it included.

Layout of a table, little-endian: u32 counts of voltages V, angles A, ratios U, depths D, rows of
attenuation M, shells;
f64 voltages [V] kV, angles [A] deg, ratios [U] (photon energy / voltage), depths [D] (of the
range), ranges [V] cm, energies [M] keV, attenuation of the target [M] 1/cm; f64 low and step; u16 codes [V][A][U][D]: value = exp(low + step * code),
65535 is 0; the value is energy * range * photons per keV, cm and sr, scaled as a whole. Then for
each shell: f64 edge keV; u32 counts of excesses X and lines L; f64 excesses [X] (voltage - edge),
energies [L] keV, values [X][A][L]: photons per sr on the same scale, over excess^1.6.
"""

import pathlib
import struct
import sys
import warnings

import numpy as np
import spekpy
from spekpy.SpekAniso import SpekAniso

warnings.filterwarnings("ignore")
ROOT = pathlib.Path(__file__).resolve().parents[2]
ANGLES = np.array([6.0, 9.0, 13.0, 20.0, 30.0, 45.0])
RATIOS = (np.arange(48) + 0.5) / 48
VOLTAGES = {
    "W": [20, 25, 30, 35, 40, 50, 60, 70, 80, 100, 120, 140, 160],
    "Mo": [20, 23, 26, 30, 35, 40, 45, 50],
}
NUMBERS = {"W": 74, "Mo": 42}
NAMES = {"W": "tungsten", "Mo": "molybdenum"}
SHELLS = ("K", "L1", "L2", "L3")
GROWTH = 1.6


def emission(target, kvp, angle, energies):
    return SpekAniso(target=target, shape="casim", diffuse=False, brsrc="nist", x=0.0, y=0.0,
                     z=100.0, k=energies, th=angle, kvp=float(kvp), thick=None, trans=False)


def lines_of(target, kvp, angle):
    """Per shell: line energies and photons per sr behind the target, by SpekPy's own functions."""
    tube = emission(target, kvp, angle, kvp * RATIOS)
    (edge_k, line_k, part_k, edge_1, edge_2, edge_3, line_1, line_2, line_3, part_1, part_2,
     part_3) = tube._SpekAniso__get_char_data()
    shells = [(edge_k, line_k, part_k), (edge_1, line_1, part_1), (edge_2, line_2, part_2),
              (edge_3, line_3, part_3)]
    log_mac, density = tube._SpekAniso__get_logmac_fn(Rayleigh=False)
    depth = np.arange(0, 20.0 + 1e-9, 1 / 200)
    dists = tube._SpekAniso__gen_char_dists(depth)
    path = depth * float(tube.rcsda) * density / np.sin(np.radians(angle))
    out = []
    for (edge, lines, parts), dist in zip(shells, dists):
        keep = (lines > 1.0) & (parts > 1e-4)
        lines, parts = lines[keep], parts[keep]
        escape = np.exp(-np.exp(log_mac(np.log(lines)))[:, None] * path)
        photons = np.trapezoid(dist * escape, depth, axis=1) * parts / (4 * np.pi)
        out.append((float(edge), lines, photons if kvp > edge else 0 * photons))
    return out


def attenuation_of(target):
    """Energies, keV, and attenuation, 1/cm, that SpekPy gives the continuum in the target."""
    folder = pathlib.Path(spekpy.__file__).parent / "data" / "tables" / "advanced"
    data = np.load(folder / f"MassAttCoeff_Z{NUMBERS[target]}.npz")
    energies = np.exp(data["logk"].astype(float))
    keep = energies < 200
    return energies[keep], np.exp(data["logmac"].astype(float))[keep] * float(np.squeeze(data["rho"]))


def largest(target):
    """Largest value of a table before it is scaled: photons per electron, sr and keV, times keV."""
    tubes = (emission(target, kvp, angle, kvp * RATIOS) for kvp in VOLTAGES[target]
             for angle in ANGLES)
    return max((tube.brem_kt * (tube.kvp * RATIOS)[:, None] * float(tube.rcsda)).max()
               for tube in tubes)


def table(target):
    voltages = np.array(VOLTAGES[target], float)
    values, ranges = [], []
    for kvp in voltages:
        rows = []
        for angle in ANGLES:
            tube = emission(target, kvp, angle, kvp * RATIOS)
            rows.append(tube.brem_kt * (kvp * RATIOS)[:, None] * float(tube.rcsda))
        depths = tube.t / float(tube.rcsda)
        ranges.append(float(tube.rcsda))
        values.append(rows)
        print(NAMES[target], kvp, flush=True)
    values = np.array(values)
    scale = 1 / values.max()
    values = values * scale
    codes = np.full(values.shape, 65535, "<u2")
    there = values > 1e-9
    low, high = np.log(values[there].min()), np.log(values.max())
    step = (high - low) / 65534
    codes[there] = np.round((np.log(values[there]) - low) / step)
    energies, attenuation = attenuation_of(target)
    out = struct.pack("<6I", len(voltages), len(ANGLES), len(RATIOS), len(depths), len(energies),
                      len(SHELLS))
    for array in (voltages, ANGLES, RATIOS, depths, np.array(ranges), energies, attenuation,
                  np.array([low, step])):
        out += np.asarray(array, "<f8").tobytes()
    out += codes.tobytes()
    for shell in range(len(SHELLS)):
        edge = lines_of(target, voltages[-1], 12.0)[shell][0]
        least = max(voltages[0] - edge, 0.01 * edge)
        excesses = np.geomspace(least, voltages[-1] - edge, 16)
        rows = [[lines_of(target, edge + excess, angle)[shell] for angle in ANGLES]
                for excess in excesses]
        lines = rows[0][0][1]
        photons = np.array([[entry[2] for entry in row] for row in rows])
        photons *= scale / excesses[:, None, None] ** GROWTH
        out += struct.pack("<d2I", edge, len(excesses), len(lines))
        for array in (excesses, lines, photons):
            out += np.asarray(array, "<f8").tobytes()
        print(NAMES[target], SHELLS[shell], len(lines), "lines", flush=True)
    path = ROOT / "engine" / "spectrum" / f"{NAMES[target]}.bin"
    path.write_bytes(out)
    print(path.name, len(out), "bytes")


# Off the grid of the tables, and filtered from hardly to strongly.
CASES = [
    ("W", kvp, angle, filters)
    for kvp, angle in [(30, 12), (33, 8), (47, 17), (60, 12), (72, 25), (85, 40), (100, 12),
                       (113, 7), (137, 12), (150, 22), (160, 11)]
    for filters in ([], [("Al", 1.0)], [("Be", 0.8), ("Al", 2.5)], [("Al", 1.0), ("Cu", 0.2)])
] + [
    ("Mo", kvp, angle, filters)
    for kvp, angle in [(20, 12), (24, 17), (28, 12), (33, 8), (43, 25), (50, 40)]
    for filters in ([], [("Al", 0.5)], [("Be", 0.8), ("Mo", 0.03)])
]


def reference():
    rows = ["# SpekPy %s, casim, coefficients of NIST; HVL of air kerma" % spekpy.__version__,
            "anode,kvp,angle_deg,filters_mm,mean_keV,hvl_mm_al"]
    for target, kvp, angle, filters in CASES:
        # Filters and aluminium by NIST's coefficients, as beamlet's are; the tube is the same.
        # SpekPy puts lines into the middle of their bin: narrow ones for the soft lines of Mo.
        width = 0.25 if target == "W" else 0.05
        spek = spekpy.Spek(kvp=kvp, th=angle, targ=target, dk=width, mu_data_source="nist")
        spek.multi_filter(filters)
        text = "+".join(f"{name}:{thickness}" for name, thickness in filters)
        rows.append(f"{NAMES[target]},{kvp},{angle},{text},{spek.get_emean():.4f},"
                    f"{spek.get_hvl1():.5f}")
        print(rows[-1], flush=True)
    (ROOT / "tests" / "tables" / "tube.csv").write_text("\n".join(rows) + "\n")
    # SpekPy's own text export, as a user would hand it over: 198 bins.
    spek = spekpy.Spek(kvp=100, th=12, targ="W", dk=0.5).filter("Al", 1.0)
    spek.export_spectrum(str(ROOT / "tests" / "tables" / "spekpy_100kv.txt"), comment="1 mm Al")


if __name__ == "__main__":
    if "tables" in sys.argv:
        for element in NAMES:
            table(element)
    if "scale" in sys.argv:
        for element in NAMES:
            print(NAMES[element], repr(float(largest(element))))
    if "reference" in sys.argv:
        reference()
