//! Designations of alloys by weight, such as `AlSi10Mg`, which are chemical formulas, too.

/// Metals that alloys are named after.
const BASES: [&str; 24] = [
    "Ag", "Al", "Au", "Bi", "Co", "Cr", "Cu", "Fe", "Mg", "Mo", "Nb", "Ni", "Pb", "Pd", "Pt", "Sn",
    "Ta", "Ti", "U", "V", "W", "Zn", "Zr", "Hf",
];
/// Further elements that are alloyed with them.
const ALLOYED: [&str; 13] =
    ["Be", "Si", "Sb", "Mn", "Cd", "Li", "Re", "Rh", "Ir", "Ru", "Y", "Ce", "Nd"];
/// Elements of small shares; with larger numbers they make compounds.
const TRACES: [&str; 3] = ["B", "C", "P"];

/// Symbol of an element, and its number if it has one.
type Element<'a> = (&'a str, Option<&'a str>);

/// Checks whether elements with their numbers look like the designation of an alloy. A base metal without a
/// number comes first: `TiAl6V4`, `CuSn6`; or all numbers are percentages: `Sn63Pb37`.
pub(super) fn is_by_weight(elements: &[Element<'_>]) -> bool {
    let [(base, share), added @ ..] = elements else { return false };
    let value = |number: &Option<&str>| number.and_then(|number| number.parse::<f64>().ok());
    let is_metal = |symbol: &str| BASES.contains(&symbol) || ALLOYED.contains(&symbol);
    let is_trace = |symbol: &str, number: &Option<&str>| {
        TRACES.contains(&symbol) && value(number).is_none_or(|number| number < 1.0)
    };
    let fits = |(symbol, number): &Element<'_>| is_metal(symbol) || is_trace(symbol, number);
    let is_share = |(symbol, number): &Element<'_>| is_metal(symbol) && number.is_some();
    if !BASES.contains(base) || !added.iter().all(fits) || !added.iter().any(is_share) {
        return false;
    }
    let sum: f64 = elements.iter().filter_map(|(_, number)| value(number)).sum();
    match (share, added) {
        (Some(_), _) => added.iter().all(|it| it.1.is_some()) && (sum - 100.0).abs() <= 0.5,
        // Intermetallic compounds have two elements and small whole numbers: TiAl3, CuAl2.
        (None, [(_, number)]) => !matches!(number, Some("2" | "3")) && sum < 100.0,
        (None, _) => sum < 100.0,
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

/// The shares by weight of a designation, in the notation of formulas. Elements without a number but
/// the base are not in it.
pub(super) fn by_weight(elements: &[Element<'_>]) -> String {
    let [(base, share), added @ ..] = elements else { return String::new() };
    let part = |(symbol, number): &Element<'_>| Some(format!("{symbol}{}wt%", (*number)?));
    match share {
        Some(_) => elements.iter().filter_map(part).collect(),
        None => added.iter().filter_map(part).collect::<String>() + base,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn designations_are_known_from_compounds() {
        let of = |text| elements(text).filter(|elements| is_by_weight(elements));
        for (text, weights) in [
            ("TiAl6V4", "Al6wt%V4wt%Ti"),
            ("AlSi10Mg", "Si10wt%Al"),
            ("CuSn6", "Sn6wt%Cu"),
            ("SnAg3.5", "Ag3.5wt%Sn"),
            ("AlMg4.5Mn0.7", "Mg4.5wt%Mn0.7wt%Al"),
            ("NiCr22Mo9Nb", "Cr22wt%Mo9wt%Ni"),
            ("CuCr1Zr", "Cr1wt%Cu"),
            ("CuSn8P", "Sn8wt%Cu"),
            ("Sn63Pb37", "Sn63wt%Pb37wt%"),
            ("CuNi44", "Ni44wt%Cu"),
            ("AlMg1", "Mg1wt%Al"),
        ] {
            assert_eq!(of(text).map(|it| by_weight(&it)).as_deref(), Some(weights), "{text}");
        }
        for text in [
            "H2O",
            "TiAl3",
            "CuAl2",
            "NiTi",
            "MgAl2O4",
            "Cu2ZnSnS4",
            "LaNi5",
            "Ti3Al",
            "ZnGeP2",
            "TiC0.7",
            "Pd40Ni10Cu30P20",
            "Ti1Al6V4",
            "(TiAl6V4)",
            "Al6wt%V4wt%Ti",
            "FeS2",
            "W",
            "",
            "CuInSe2",
            "Nd2Fe14B",
            "CoCrFeNi",
            "AlMgB14",
            "PbTiO3",
            "WC",
            "MgB2",
        ] {
            assert_eq!(of(text), None, "{text}");
        }
    }
}
