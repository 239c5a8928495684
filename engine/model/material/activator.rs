//! Activators of scintillators in formulas: `CsI(Tl)`, `Gd2O2S:Tb`.

/// Elements that activate scintillators and phosphors, below 1 % of the atoms.
const ACTIVATORS: [&str; 27] = [
    "Ag", "Al", "Bi", "Ca", "Ce", "Co", "Cr", "Cu", "Dy", "Er", "Eu", "Ga", "Gd", "In", "Li", "Mg",
    "Mn", "Na", "Nd", "Pb", "Pr", "Sm", "Sn", "Tb", "Ti", "Tl", "Yb",
];

/// A formula without its activator: `CsI` of `CsI(Tl)` and `CsI:Tl`. Other formulas as they are.
pub(super) fn host(text: &str) -> &str {
    let text = text.trim();
    let parts = match text.strip_suffix([')', ']']) {
        Some(inside) => inside.rsplit_once(['(', '[']),
        None => text.split_once(':'),
    };
    let Some((host, activators)) = parts.filter(|_| !text.contains("wt%")) else { return text };
    let is_whole = host.trim_end().ends_with(|c: char| c.is_alphanumeric() || c == ')');
    let is_compound = is_whole && host.chars().filter(char::is_ascii_uppercase).count() > 1;
    let are_activators = activators.split([',', '+']).all(|it| ACTIVATORS.contains(&it.trim()));
    if is_compound && are_activators { host.trim_end() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn activators_do_not_count() {
        for (text, wanted) in [
            ("CsI(Tl)", "CsI"),
            ("CsI:Tl", "CsI"),
            ("CaF2 [Eu]", "CaF2"),
            ("ZnS:Cu,Al", "ZnS"),
            ("Gd3Al2Ga3O12(Ce+Mg)", "Gd3Al2Ga3O12"),
            ("Lu2O3(Eu)0.1", "Lu2O3(Eu)0.1"),
            ("Fe(Cu)", "Fe(Cu)"),
            ("(CuSn6)", "(CuSn6)"),
            ("KAl(SO4)", "KAl(SO4)"),
            ("C2H4(O)", "C2H4(O)"),
            ("Fe2O3 50wt%(Al)", "Fe2O3 50wt%(Al)"),
            ("CaO.(Al)", "CaO.(Al)"),
        ] {
            assert_eq!(host(text), wanted, "{text}");
        }
    }
}
