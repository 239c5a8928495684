//! Names of grades, glasses and other materials that are formulas of unlike elements, such as `SS304` and `ITO`.

use super::designation::{Element, elements, is_metal, joined};

/// Molecules and clusters of one element.
const MOLECULES: [&str; 27] = [
    "H2", "D2", "T2", "N2", "O2", "O3", "F2", "Cl2", "Br2", "I2", "At2", "P2", "P4", "As2", "As4",
    "Sb4", "S2", "S6", "S8", "Se6", "Se8", "C2", "C60", "C70", "C76", "C78", "C84",
];
/// Density up to which molecules of gases are liquid or solid, g/cm3: D2 is a tool steel, too, and F2 a glass.
const DENSEST: f64 = 2.0;
/// Molecules of gases.
const GASES: [&str; 7] = ["H2", "D2", "T2", "N2", "O2", "O3", "F2"];
/// Beginnings of names of optical glasses that end with F and a number, and the numbers of true fluorides.
const FLINTS: [(&str, &[&str]); 7] = [
    ("S", &["2", "4", "6"]),
    ("Ba", &["2"]),
    ("La", &["3"]),
    ("Ti", &["2", "3", "4"]),
    ("K", &[]),
    ("BaS", &[]),
    ("LaS", &[]),
];
/// Compounds of two metals, an atom of each.
const PAIRS: [&str; 60] = [
    "AgCd", "AgMg", "AgZn", "AlCo", "AlFe", "AlLi", "AlMn", "AlNi", "AlSb", "AlTi", "AuCd", "AuCu",
    "AuMg", "AuSn", "AuZn", "BiMn", "CoAl", "CoFe", "CoPt", "CoSb", "CoSi", "CoTi", "CrSi", "CuAu",
    "CuPd", "CuPt", "CuTi", "CuZn", "CuZr", "FeAl", "FeCo", "FePd", "FePt", "FeRh", "FeSi", "FeTi",
    "GaSb", "HfSi", "InBi", "InSb", "IrMn", "LiAl", "MnAl", "MnBi", "MnNi", "MnSi", "NiAl", "NiMn",
    "NiSb", "NiSi", "NiTi", "NiZr", "PdIn", "PtMn", "PtSi", "SiGe", "TiAl", "TiNi", "VSi", "ZrSi",
];
/// Names in use that have the symbols of elements alone, and what they mean.
const NAMES: [(&str, &str); 43] = [
    ("SS", "stainless steel"),
    ("FeC", "steel"),
    ("HSS", "high-speed steel"),
    ("OFHC", "copper, Cu"),
    ("HBN", "hexagonal boron nitride, BN"),
    ("hBN", "hexagonal boron nitride, BN"),
    ("CBN", "cubic boron nitride, BN"),
    ("PBN", "pyrolytic boron nitride, BN"),
    ("CNT", "carbon nanotubes, C"),
    ("CVD", "diamond, C"),
    ("CFC", "carbon fibre in carbon, C"),
    ("CFK", "carbon fibre in epoxy, \"CFRP\""),
    ("ITO", "indium tin oxide"),
    ("FTO", "fluorine-doped tin oxide, SnO2"),
    ("YBCO", "YBa2Cu3O7"),
    ("BSCCO", "Bi2Sr2CaCu2O8"),
    ("BSO", "Bi12SiO20"),
    ("PWO", "PbWO4"),
    ("CWO", "CdWO4"),
    ("COC", "cyclic olefin copolymer"),
    ("COP", "cyclic olefin polymer"),
    ("PI", "polyimide, \"kapton\""),
    ("PU", "polyurethane"),
    ("PCB", "circuit board"),
    ("PBS", "saline"),
    ("PVDF", "C2H2F2"),
    ("PVF", "C2H3F"),
    ("PVB", "C8H14O2"),
    ("PVP", "C6H9NO"),
    ("PVOH", "C2H4O"),
    ("PPS", "C6H4S"),
    ("PPO", "C8H8O"),
    ("PSU", "C27H22O4S"),
    ("PPSU", "C24H16O4S"),
    ("PBI", "C20H12N4"),
    ("PBT", "C12H12O4"),
    ("PHB", "C4H6O2"),
    ("HIPS", "C8H8"),
    ("SIS", "styrene isoprene styrene"),
    ("SBS", "styrene butadiene styrene"),
    ("TNT", "C7H5N3O6"),
    ("POF", "optical fibre of \"PMMA\""),
    ("CN", "cellulose nitrate"),
];

/// What a text that has the form of a formula means as a name. `density`: g/cm3, where it is known.
pub(super) fn meant(text: &str, density: Option<f64>) -> Option<String> {
    let text = joined(text);
    if let Some((_, meaning)) = NAMES.iter().find(|name| name.0 == text) {
        return Some((*meaning).to_owned());
    }
    let elements = elements(&text)?;
    let (first, _) = *elements.first()?;
    if elements.iter().all(|(symbol, _)| *symbol == first) {
        return of_one_element(&text, &elements, density);
    }
    let is_steel = text.strip_prefix("SUS").is_some_and(|rest| rest.parse::<u32>().is_ok());
    let is_copper =
        matches!(&elements[..], [("C", None), ("W" | "C", Some(number)), ..] if number.len() == 3);
    let is_pair = matches!(&elements[..], [(a, None), (b, None)] if is_metal(a) && is_metal(b));
    match () {
        () if is_pair && !PAIRS.contains(&text.as_str()) => Some("an alloy".to_owned()),
        () if is_steel => Some("a grade of stainless steel".to_owned()),
        () if is_copper => Some("a grade of copper".to_owned()),
        () if is_glass(&text, &elements) => Some("an optical glass".to_owned()),
        () => None,
    }
}

fn of_one_element(text: &str, elements: &[Element<'_>], density: Option<f64>) -> Option<String> {
    let is_dense = density.is_some_and(|density| density > DENSEST) && GASES.contains(&text);
    match elements {
        [(_, None)] => None,
        _ if MOLECULES.contains(&text) && !is_dense => None,
        [(symbol, _), ..] => Some(format!("a grade, or \"{symbol}\" for the element")),
        [] => None,
    }
}

/// True for names of optical glasses: `BK7`, `SF11`.
fn is_glass(text: &str, elements: &[Element<'_>]) -> bool {
    let Some(((last, Some(number)), before)) = elements.split_last() else { return false };
    let is_crown = *last == "K" && before.iter().all(|(_, number)| number.is_none());
    let stem = text.strip_suffix(number).and_then(|stem| stem.strip_suffix('F'));
    let stem = stem.map(|stem| stem.strip_prefix('N').unwrap_or(stem));
    let is_flint =
        |(begin, fluorides): &(&str, &[&str])| stem == Some(*begin) && !fluorides.contains(number);
    is_crown || FLINTS.iter().any(is_flint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_known_from_formulas() {
        for text in "SS304 SS Al7075 Al-1050 In718 Ti6242 C45 S235 S30400 H13 O1 W1 P20 Co60 C17200 SUS304 CW614N CC483K \
            BK7 N-BK7 SK16 FK51 BaK4 LaK8 SF11 N-SF57 NiCr CuSn AlSi FeNi PbSn WCu FeC BaF10 LaF2 KF9 LaSF9 ITO PVDF PI COC YBCO"
            .split_whitespace()
        {
            assert!(meant(text, None).is_some(), "{text}");
        }
        for text in "O3 S8 P4 C60 N2 D2 Fe KF SF6 BaF2 LaF3 LaSF KCl NiTi TiAl CuZn InSb FeCo SiGe MgK2O K2O NaCl HF H2O CO CuSn6 Al2O3 BN SiC KOH PCl5"
            .split_whitespace()
        {
            assert_eq!(meant(text, None), None, "{text}");
        }
        for (text, density, is_name) in [("D2", 7.7, true), ("D2", 0.2, false), ("F2", 3.6, true)] {
            assert_eq!(meant(text, Some(density)).is_some(), is_name, "{text}");
        }
    }
}
