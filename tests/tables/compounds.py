"""Writes tests/tables/compounds.csv: the compositions that NIST has of ICRU and ICRP materials, and
their constants, by xraylib (BSD licence), for the test of the built-in materials.

    pip install xraylib==4.3.0
    python tests/tables/compounds.py > tests/tables/compounds.csv

Columns: name in beamlet; name in xraylib; density in g/cm3; shares by weight of the elements; energy
in keV, mu in 1/m and delta, repeated.
"""

import xraylib

COMPOUNDS = {
    "soft tissue": "Tissue, Soft (ICRP)",
    "soft tissue ICRU": "Tissue, Soft (ICRU four-component)",
    "adipose tissue": "Adipose Tissue (ICRP)",
    "muscle": "Muscle, Skeletal",
    "lung tissue": "Lung (ICRP)",
    "blood": "Blood (ICRP)",
    "brain": "Brain (ICRP)",
    "skin": "Skin (ICRP)",
    "cortical bone": "Bone, Cortical (ICRP)",
    "compact bone": "Bone, Compact (ICRU)",
    "borosilicate glass": "Glass, Pyrex",
    "soda-lime glass": "Glass, Plate",
    "lead glass": "Glass, Lead",
    "concrete": "Concrete, Portland",
}
# Not among the compounds of xraylib: the constants alone are its own.
BY_WEIGHT = {
    "breast tissue": ("H10.6C33.2N3O52.7Na0.1P0.1S0.2Cl0.1", 1.02),
    "carbon steel": ("C0.5Fe99.5", 7.82),
    "stainless steel 304": ("C0.04Si0.5P0.023S0.015Cr19Mn1Fe70.172Ni9.25", 8.0),
    "stainless steel 316": ("C0.041Si0.507P0.023S0.015Cr17Mn1.014Fe66.9Ni12Mo2.5", 8.0),
    "wood": ("H5.9642C49.7018N0.497O42.7435Mg0.1988S0.497K0.1988Ca0.1988", 0.64),
    "brass": ("Cu63Zn37", 8.44),
    "bronze": ("Cu94Sn6", 8.8),
    "titanium alloy": ("Ti90Al6V4", 4.43),
}
ENERGIES = [15.0, 30.0, 80.0]


def by_weight(text):
    """Elements and shares of "Cu63Zn37", read as weights; xraylib would read atoms."""
    import re

    pairs = re.findall(r"([A-Z][a-z]?)([0-9.]+)", text)
    total = sum(float(share) for _, share in pairs)
    return [(xraylib.SymbolToAtomicNumber(name), float(share) / total) for name, share in pairs]


def delta(elements, density, energy):
    """1 - n by f1 of each element; the constant is r_e (hc)^2 N_A / 2 pi, in keV^2 cm3 / g."""
    atoms = sum(
        share / xraylib.AtomicWeight(z) * (z + xraylib.Fi(z, energy)) for z, share in elements
    )
    return 4.15179082788e-4 * density / energy**2 * atoms


def row(name, source, elements, density):
    total = sum(share for _, share in elements)
    elements = [(z, share / total) for z, share in elements]
    shares = " ".join(f"{xraylib.AtomicNumberToSymbol(z)}:{share:.6f}" for z, share in elements)
    constants = []
    for energy in ENERGIES:
        mu = 100 * density * sum(share * xraylib.CS_Total(z, energy) for z, share in elements)
        constants += [f"{energy:g}", f"{mu:.6g}", f"{delta(elements, density, energy):.6g}"]
    print(";".join([name, source, f"{density:g}", shares, *constants]))


print("# name;xraylib;g/cm3;shares by weight;keV;mu 1/m;delta;keV;mu 1/m;delta;keV;mu 1/m;delta")
print(f"# tests/tables/compounds.py, xraylib {xraylib.__version__}")
for name, source in COMPOUNDS.items():
    data = xraylib.GetCompoundDataNISTByName(source)
    row(name, source, list(zip(data["Elements"], data["massFractions"])), data["density"])
for name, (text, density) in BY_WEIGHT.items():
    row(name, "-", by_weight(text), density)
