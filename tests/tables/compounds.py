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
    "lung, deflated": "Lung (ICRP)",
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
# Compositions of xraylib with other densities.
AS = {"lung, inflated": ("Lung (ICRP)", 0.26)}
# Not among the compounds of xraylib: the constants alone are its own.
BY_WEIGHT = {
    "breast tissue": ("H10.6C33.2N3O52.7Na0.1P0.1S0.2Cl0.1", 1.02),
    "trabecular bone": ("H8.5C40.4N2.8O36.7Na0.1Mg0.1P3.4S0.2Cl0.2K0.1Ca7.4Fe0.1", 1.18),
    "glass fibre": ("B2.4843Na0.4452Mg2.8349Al8.0428Si25.3834Ca12.2927O48.5167", 2.58),
    "CFRP": ("H2.1908O5.7842C92.025", 1.56),
    "cemented carbide": ("Co10W84.4832C5.5168", 14.5),
    "stainless steel 316L": ("C0.02Si0.5Cr17.5Mn1Ni11.5Mo2.25Fe67.23", 8.0),
    "titanium alloy Ti-6Al-7Nb": ("Ti87Al6Nb7", 4.52),
    "carbon steel": ("C0.5Fe99.5", 7.82),
    "stainless steel 304": ("C0.04Si0.5P0.023S0.015Cr19Mn1Fe70.172Ni9.25", 8.0),
    "stainless steel 316": ("C0.041Si0.507P0.023S0.015Cr17Mn1.014Fe66.9Ni12Mo2.5", 8.0),
    "wood": ("H5.9642C49.7018N0.497O42.7435Mg0.1988S0.497K0.1988Ca0.1988", 0.64),
    "brass": ("Cu63Zn37", 8.44),
    "bronze": ("Cu94Sn6", 8.8),
    "titanium alloy": ("Ti90Al6V4", 4.43),
    "bearing steel": ("C1Cr1.5Mn0.35Si0.25Fe96.9", 7.83),
    "invar": ("Ni36Fe64", 8.1),
    "kovar": ("Ni29Co17Fe54", 8.36),
    "aluminium 2024": ("Cu4.35Mg1.5Mn0.6Al93.55", 2.78),
    "aluminium 5083": ("Mg4.45Mn0.7Cr0.15Al94.7", 2.66),
    "aluminium 5754": ("Mg3.1Mn0.25Al96.65", 2.67),
    "aluminium 6061": ("Mg1Si0.6Cu0.28Cr0.2Al97.92", 2.7),
    "aluminium 6082": ("Si1Mg0.9Mn0.7Al97.4", 2.7),
    "aluminium 7075": ("Zn5.6Mg2.5Cu1.6Cr0.23Al90.07", 2.81),
    "AlSi7Mg": ("Si7Mg0.35Al92.65", 2.68),
    "AlSi10Mg": ("Si10Mg0.325Al89.675", 2.67),
    "AlSi12": ("Si12Al88", 2.65),
    "magnesium AZ31": ("Al3Zn1Mn0.3Mg95.7", 1.77),
    "magnesium AZ91": ("Al9Zn0.7Mn0.2Mg90.1", 1.81),
    "brass CuZn30": ("Cu70Zn30", 8.53),
    "brass CuZn39Pb3": ("Cu58Pb3Zn39", 8.47),
    "bronze CuSn8": ("Sn8Cu92", 8.8),
    "bronze CuSn12": ("Sn12Cu88", 8.7),
    "beryllium copper": ("Be1.9Cu98.1", 8.25),
    "constantan": ("Ni44Mn1Cu55", 8.9),
    "nickel silver": ("Cu62Ni18Zn20", 8.7),
    "zamak 3": ("Al4Zn96", 6.6),
    "zamak 5": ("Al4Cu1Zn95", 6.7),
    "cobalt chrome": ("Cr28Mo6Co66", 8.3),
    "nickel alloy 625": ("Cr21.5Mo9Nb3.65Fe2.5Ni63.35", 8.44),
    "nickel alloy 718": ("Ni52.5Cr19Nb5.1Mo3.05Ti0.9Al0.5Fe18.95", 8.19),
    "solder Sn63Pb37": ("Sn63Pb37", 8.4),
    "solder SAC305": ("Ag3Cu0.5Sn96.5", 7.38),
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
for name, (source, density) in AS.items():
    data = xraylib.GetCompoundDataNISTByName(source)
    row(name, source, list(zip(data["Elements"], data["massFractions"])), density)
for name, (text, density) in BY_WEIGHT.items():
    row(name, "-", by_weight(text), density)
