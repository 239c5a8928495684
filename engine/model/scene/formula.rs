//! Chemical formulas that scenes may name.

/// Most characters of a formula.
const LENGTH: usize = 200;
/// Least and greatest number of atoms in a formula.
const ATOMS: [f64; 2] = [1e-6, 1e6];

/// Refuses formulas that no substance has, before they are parsed: too long ones, and numbers of
/// atoms beyond any use.
///
/// # Errors
/// The allowed form.
pub fn check_formula(formula: &str) -> Result<(), String> {
    if formula.chars().count() > LENGTH {
        return Err(format!("a chemical formula of at most {LENGTH} characters"));
    }
    let [least, most] = ATOMS;
    let numbers = formula.split(|letter: char| !(letter.is_ascii_digit() || letter == '.'));
    let mut numbers = numbers.filter_map(|text| text.parse::<f64>().ok());
    if numbers.any(|number| !(least..=most).contains(&number)) {
        return Err(format!("a chemical formula with {least:e} to {most:e} atoms of an element"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::check_formula;

    #[test]
    fn numbers_of_atoms_beyond_any_use_are_refused_and_real_ones_are_not() {
        for good in ["H2O", "Ca10(PO4)6(OH)2", "H0.102C0.143", "Er2O3", "O3Er2", "C1000000"] {
            assert!(check_formula(good).is_ok(), "{good}");
        }
        for bad in ["H999999999999", "C(H2)0.0000001", "H0"] {
            assert!(check_formula(bad).unwrap_err().contains("1e6"), "{bad}");
        }
        assert!(check_formula(&"C".repeat(201)).unwrap_err().contains("200"));
    }
}
