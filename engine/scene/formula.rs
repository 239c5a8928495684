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
    let text = formula.as_bytes();
    let mut at = 0;
    while at < text.len() {
        let begin = at;
        let is_number = |at: usize| match text.get(at) {
            Some(b'0'..=b'9' | b'.') => true,
            // An exponent; elsewhere E begins the name of an element.
            Some(b'e' | b'E') => {
                at > begin
                    && match text.get(at + 1) {
                        Some(b'+' | b'-') => text.get(at + 2).is_some_and(u8::is_ascii_digit),
                        next => next.is_some_and(u8::is_ascii_digit),
                    }
            }
            Some(b'+' | b'-') => at > begin && matches!(text[at - 1], b'e' | b'E'),
            _ => false,
        };
        while is_number(at) {
            at += 1;
        }
        let number = (at > begin).then(|| formula.get(begin..at)?.parse::<f64>().ok()).flatten();
        if number.is_some_and(|number| !(ATOMS[0]..=ATOMS[1]).contains(&number)) {
            let [least, most] = ATOMS;
            return Err(format!(
                "a chemical formula with {least:e} to {most:e} atoms of an element"
            ));
        }
        at = at.max(begin + 1);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::check_formula;

    #[test]
    fn numbers_of_atoms_beyond_any_use_are_refused_and_real_ones_are_not() {
        for good in ["H2O", "Ca10(PO4)6(OH)2", "H0.102C0.143", "Er2O3", "Eu", "C1e3H2", "C1000000"]
        {
            assert!(check_formula(good).is_ok(), "{good}");
        }
        for bad in ["H999999999999", "H1e300O", "H1E9", "C(H2)1e-7", "H0"] {
            assert!(check_formula(bad).unwrap_err().contains("1e6"), "{bad}");
        }
        assert!(check_formula(&"C".repeat(201)).unwrap_err().contains("200"));
    }
}
