//! Symbols of elements in capitals, such as PB, which are formulas of other elements.

/// Symbols that no usual formula in capitals begins with.
const SYMBOLS: [&str; 16] = [
    "BI", "CU", "DY", "IN", "NB", "NI", "OS", "PB", "PT", "PU", "SB", "SC", "SI", "SN", "TB", "TI",
];
/// Texts that mean an element or a compound of it, while other formulas begin with the same letters.
const WHOLE: [&str; 10] = ["CD", "CO", "CO3O4", "COO", "CS", "CSF", "CSI", "HF", "HFO2", "ND"];
/// Density below which a formula is a gas, g/cm3.
const GAS: f64 = 0.1;

/// A text in capitals with its first element as it is usually meant: `Pb` of `PB`. `None` for texts that mean the
/// elements that they name, as `CO` with the density of a gas.
pub(super) fn meant(text: &str, density: Option<f64>) -> Option<String> {
    let text = text.trim();
    let is_plain = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit();
    let symbol = text.get(..2).filter(|_| text.chars().all(is_plain))?;
    let is_gas = density.is_some_and(|density| density < GAS);
    let is_meant = SYMBOLS.contains(&symbol) || WHOLE.contains(&text) && !is_gas;
    is_meant.then(|| format!("{}{}{}", &text[..1], text[1..2].to_lowercase(), &text[2..]))
}
