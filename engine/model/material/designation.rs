//! Designations of alloys by weight, such as `AlSi10Mg` and `Ti6Al7Nb`, which are chemical formulas, too.

/// Metals that alloys are named after.
const BASES: [&str; 30] = [
    "Ag", "Al", "Au", "Be", "Bi", "Co", "Cr", "Cu", "Fe", "Ga", "Hf", "In", "Ir", "Mg", "Mo", "Nb",
    "Ni", "Pb", "Pd", "Pt", "Rh", "Ru", "Sn", "Ta", "Ti", "U", "V", "W", "Zn", "Zr",
];
/// Further elements that are alloyed with them.
const ALLOYED: [&str; 22] = [
    "Ca", "Cd", "Ce", "Dy", "Er", "Gd", "Ge", "Hg", "La", "Li", "Mn", "Nd", "Os", "Pr", "Re", "Sb",
    "Sc", "Si", "Sr", "Tl", "Y", "Yb",
];
/// Elements of small shares; with larger numbers they make compounds.
const TRACES: [&str; 4] = ["B", "C", "P", "Te"];
/// Compounds of two elements that are better known than the alloy of these shares: silicides, aluminides, Laves
/// phases and others.
const COMPOUNDS: [&str; 82] = [
    "AuAl2", "AuGa2", "AuIn2", "AuSb2", "AuSn2", "AuSn4", "CoAl3", "CoGa3", "CoSb2", "CoSb3",
    "CoSi2", "CoSn2", "CrSi2", "CuAl2", "FeAl2", "FeAl3", "FeGa3", "FeSb2", "FeSn2", "HfAl3",
    "HfCr2", "HfMo2", "HfSi2", "HfV2", "HfW2", "IrSi3", "IrSn4", "MgCd3", "MgCu2", "MgNi2",
    "MgZn2", "MoAl5", "MoBe12", "MoSi2", "NbAl3", "NbBe12", "NbCo2", "NbCr2", "NbFe2", "NbSi2",
    "NiAl3", "NiSb2", "NiSi2", "PdSn2", "PdSn3", "PdSn4", "PtAl2", "PtSn2", "PtSn4", "TaAl3",
    "TaCo2", "TaCr2", "TaSi2", "TiAl2", "TiAl3", "TiBe2", "TiBe12", "TiCo2", "TiCr2", "TiFe2",
    "TiMn2", "TiNi3", "TiSi2", "UAl2", "UAl3", "UBe13", "UFe2", "UGe2", "UPd3", "UPt3", "USi2",
    "USi3", "USn3", "VSi2", "WAl12", "WSi2", "ZrAl2", "ZrAl3", "ZrCo2", "ZrCr2", "ZrSi2", "ZrV2",
];
/// Least share in front of the only other metal of an alloy: below it numbers of atoms, as in `Ti3Al`, but of `SMALL`.
const LEAST: f64 = 5.0;
/// Alloys of a base and a smaller share of another metal, of which no compound has these numbers of atoms.
const SMALL: [&str; 30] = [
    "Al1Cu", "Al3Cu", "Al4Cu", "Al1Fe", "Al1Li", "Al2Li", "Al4Li", "Al1Mg", "Al2Mg", "Al3Mg",
    "Al4Mg", "Al1Mn", "Al2Mn", "Al1Si", "Al2Si", "Al3Si", "Al4Si", "Al1Zn", "Al2Zn", "Al4Zn",
    "Cu1Cr", "Cu2Be", "Mg1Mn", "Mg2Mn", "Sn1Cu", "Sn3Ag", "Sn4Ag", "Pb3Sb", "Pb4Sb", "Zn4Al",
];

/// Symbol of an element, and its number if it has one.
pub(super) type Element<'a> = (&'a str, Option<&'a str>);

/// The shares by weight of a text that looks like the designation of an alloy, in the notation of formulas.
/// Elements without a share but the base are not in it. A base metal without a number comes first: `TiAl6V4`,
/// `CuSn6`; or shares come before the elements: `Ti6Al7Nb`, `WC10Co`; or all numbers are percentages:
/// `Sn63Pb37`. Hyphens and blanks between the parts do not count.
pub(super) fn by_weight(text: &str) -> Option<String> {
    let text = joined(text);
    let elements = elements(&text)?;
    shares_before(&elements).or_else(|| shares_behind(&text, &elements))
}

/// True for texts of symbols and numbers alone, with hyphens and blanks between the parts.
pub(super) fn is_of_symbols(text: &str) -> bool {
    elements(&joined(text)).is_some()
}

pub(super) fn joined(text: &str) -> String {
    text.chars().filter(|c| !matches!(c, '-' | ' ')).collect()
}

pub(super) fn is_metal(symbol: &str) -> bool {
    BASES.contains(&symbol) || ALLOYED.contains(&symbol)
}

fn value(number: Option<&str>) -> Option<f64> {
    number.and_then(|number| number.parse().ok())
}

/// Shares before the elements, of which the last has no number.
fn shares_before(elements: &[Element<'_>]) -> Option<String> {
    let (base, first, added) = match elements {
        [("W", None), ("C", Some(first)), added @ ..] => ("WC", *first, added),
        [(base, Some(first)), added @ ..] if BASES.contains(base) => (*base, *first, added),
        _ => return None,
    };
    let (last, between) = added.split_last()?;
    let shares: Option<Vec<&str>> = between.iter().map(|(_, number)| *number).collect();
    let shares: Vec<&str> = std::iter::once(first).chain(shares?).collect();
    let values: Option<Vec<f64>> = shares.iter().map(|share| value(Some(share))).collect();
    let values = values?;
    let are_metals = added.iter().all(|(symbol, _)| is_metal(symbol)) && last.1.is_none();
    let is_alloy = match (base, added.len()) {
        ("WC", _) => true,
        (_, 1) => {
            let is_small = SMALL.contains(&format!("{base}{first}{}", last.0).as_str());
            values[0] >= LEAST || is_small || first.contains('.') && values[0] >= 1.0
        }
        _ => values[0] >= 1.0,
    };
    if !are_metals || !is_alloy || values.iter().sum::<f64>() >= 100.0 {
        return None;
    }
    let parts = added.iter().zip(&shares).map(|((symbol, _), share)| format!("{symbol}{share}wt%"));
    Some(parts.collect::<String>() + base)
}

/// Shares behind the elements.
fn shares_behind(text: &str, elements: &[Element<'_>]) -> Option<String> {
    let [(base, share), added @ ..] = elements else { return None };
    let is_small = |number: Option<&str>| value(number).is_none_or(|number| number < 1.0);
    let fits = |(symbol, number): &Element<'_>| {
        is_metal(symbol) || TRACES.contains(symbol) && is_small(*number)
    };
    // Tellurium has no compounds of such numbers with the bases but as CuTe0.5.
    let is_share =
        |(symbol, number): &Element<'_>| (is_metal(symbol) || *symbol == "Te") && number.is_some();
    if !BASES.contains(base) || !added.iter().all(fits) || !added.iter().any(is_share) {
        return None;
    }
    let sum: f64 = elements.iter().filter_map(|(_, number)| value(*number)).sum();
    let part = |(symbol, number): &Element<'_>| Some(format!("{symbol}{}wt%", (*number)?));
    match share {
        Some(_) => {
            let is_whole = added.iter().all(|it| it.1.is_some()) && (sum - 100.0).abs() <= 0.5;
            is_whole.then(|| elements.iter().filter_map(part).collect())
        }
        None => {
            let is_alloy = sum < 100.0 && !COMPOUNDS.contains(&text);
            is_alloy.then(|| added.iter().filter_map(part).collect::<String>() + base)
        }
    }
}

/// Symbols with their numbers, where a text is nothing else.
pub(super) fn elements(text: &str) -> Option<Vec<Element<'_>>> {
    let mut found = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let tail = rest.strip_prefix(|c: char| c.is_ascii_uppercase())?;
        let tail = tail.trim_start_matches(|c: char| c.is_ascii_lowercase());
        let (symbol, tail) = rest.split_at(rest.len() - tail.len());
        let behind = tail.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
        let (number, behind) = tail.split_at(tail.len() - behind.len());
        found.push((symbol, Some(number).filter(|number| !number.is_empty())));
        rest = behind;
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Designations with their shares by weight.
    const ALLOYS: &str = "TiAl6V4=Al6wt%V4wt%Ti AlSi10Mg=Si10wt%Al CuSn6=Sn6wt%Cu SnAg3.5=Ag3.5wt%Sn \
        AlMg4.5Mn0.7=Mg4.5wt%Mn0.7wt%Al NiCr22Mo9Nb=Cr22wt%Mo9wt%Ni CuCr1Zr=Cr1wt%Cu CuSn8P=Sn8wt%Cu \
        Sn63Pb37=Sn63wt%Pb37wt% CuNi44=Ni44wt%Cu AlMg1=Mg1wt%Al MgMn2=Mn2wt%Mg FeSi3=Si3wt%Fe PbSb3=Sb3wt%Pb \
        PbCa0.1=Ca0.1wt%Pb AuGe12=Ge12wt%Au InSn48=Sn48wt%In GaIn21.5Sn10=In21.5wt%Sn10wt%Ga CuTe0.5=Te0.5wt%Cu \
        Ti6Al7Nb=Al6wt%Nb7wt%Ti Ti-6Al-7Nb=Al6wt%Nb7wt%Ti Ti13Nb13Zr=Nb13wt%Zr13wt%Ti Ti5Al2.5Sn=Al5wt%Sn2.5wt%Ti \
        Ti15Mo=Mo15wt%Ti Al4Cu=Cu4wt%Al Al-3Mg=Mg3wt%Al Sn3Ag=Ag3wt%Sn WC10Co=Co10wt%WC W5Re=Re5wt%W";
    const COMPOUNDS: &str = "H2O TiAl3 CuAl2 NiTi MgAl2O4 Cu2ZnSnS4 LaNi5 Ti3Al Al2Cu Al3Zr Al3Sc Al3Ni Ni3Al Mg2Si Cu3Sn ZnGeP2 TiC0.7 Pd40Ni10Cu30P20 \
        Ti1Al6V4 (TiAl6V4) Al6wt%V4wt%Ti FeS2 W CuInSe2 Nd2Fe14B CoCrFeNi AlMgB14 PbTiO3 WC MgB2 MoSi2 MgZn2 CoSb3 \
        Fe3Al Mg17Al12 Ga0.5In0.5Sb Bi2Te3 PbTe Cu2MnAl";

    #[test]
    fn designations_are_known_from_compounds() {
        for pair in ALLOYS.split_whitespace() {
            let (text, weights) = pair.split_once('=').expect("a pair");
            assert_eq!(by_weight(text).as_deref(), Some(weights), "{text}");
        }
        for text in COMPOUNDS.split_whitespace().chain([""]) {
            assert_eq!(by_weight(text), None, "{text}");
        }
    }
}
