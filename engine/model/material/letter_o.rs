//! Zeros in formulas that mean the letter O, such as that of `Si02`.

/// Elements whose oxides have two of their atoms and one of oxygen: `H20` has the form of `H2O`.
const PAIRED: [&str; 12] = ["Ag", "Cl", "Cs", "Cu", "D", "H", "K", "Li", "N", "Na", "Rb", "Tl"];
/// Largest number of oxygen atoms behind a zero between digits: numbers such as 2024 are grades.
const MOST: u32 = 19;

/// A formula that has zeros for the letter O.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct LetterO {
    /// The formula with the letter.
    pub(super) meant: String,
    /// True if the zeros may belong to numbers, too: `Al203`.
    pub(super) has_numbers: bool,
}

/// A formula with the letter O where its zeros mean it. `None` without such zeros and for a text in brackets, whose
/// numbers are meant.
pub(super) fn meant(text: &str) -> Option<LetterO> {
    let text = text.trim();
    let letters: Vec<char> = text.chars().collect();
    let mut found = LetterO { meant: String::new(), has_numbers: true };
    let mut at = 0;
    let mut is_changed = false;
    while let Some(letter) = letters.get(at) {
        let is_number = letter.is_ascii_digit() || *letter == '.';
        let length = letters[at..].iter().take_while(|c| c.is_ascii_digit() || **c == '.').count();
        if !is_number {
            found.meant.push(*letter);
            at += 1;
            continue;
        }
        let number: String = letters[at..at + length].iter().collect();
        match zero(&number, &letters[..at], &letters[at + length..]) {
            Some(place) => {
                found.has_numbers &= place > 0;
                is_changed = true;
                found.meant.push_str(&number[..place]);
                found.meant.push('O');
                found.meant.push_str(&number[place + 1..]);
            }
            None => found.meant.push_str(&number),
        }
        at += length;
    }
    let is_bracketed = text.starts_with(['(', '[', '{']) && found.has_numbers;
    (is_changed && !is_bracketed).then_some(found)
}

/// Place of the zero of a number that means the letter, between the letters before and behind the number.
fn zero(number: &str, before: &[char], behind: &[char]) -> Option<usize> {
    let is_share = behind.starts_with(&['w', 't', '%']);
    let place = number.find('0').filter(|_| !number.contains('.') && !is_share)?;
    let (count, oxygen) = (&number[..place], &number[place + 1..]);
    if oxygen.contains('0') {
        return None;
    }
    let is_behind_atoms = before.last().is_some_and(|c| c.is_alphabetic() || *c == ')');
    if count.is_empty() {
        let is_hydroxide = behind.first() == Some(&'H') && oxygen.is_empty();
        return (is_behind_atoms || is_hydroxide).then_some(place);
    }
    // Nobody writes the number 1 of atoms.
    if !is_behind_atoms || count == "1" || count.len() > 2 {
        return None;
    }
    if !oxygen.is_empty() {
        return oxygen.parse().is_ok_and(|oxygen: u32| oxygen <= MOST).then_some(place);
    }
    let start = before.iter().rposition(char::is_ascii_uppercase)?;
    let symbol: String = before[start..].iter().collect();
    // Behind a separator a part may have a number: the 5 of `CuSO4*5H20`.
    let part = before[..start].iter().rev().find(|letter| !letter.is_ascii_digit());
    let is_alone = part.is_none_or(|last| !last.is_alphanumeric() && *last != ')')
        && behind.first().is_none_or(|next| !next.is_alphanumeric() && *next != '(');
    let is_oxide = is_alone && count == "2" && PAIRED.contains(&symbol.as_str());
    let is_alcohol = symbol == "H" && behind.first() == Some(&'H');
    (is_oxide || is_alcohol).then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_letters_where_numbers_are_not_written_so() {
        for pair in "Si02=SiO2 C02=CO2 CaC03=CaCO3 H2S04=H2SO4 Ca(0H)2=Ca(OH)2 Mg0=MgO Ca10(P04)6(0H)2=Ca10(PO4)6(OH)2 \
            Al203=Al2O3 Fe304=Fe3O4 U308=U3O8 H20=H2O Cu20=Cu2O CuSO4.5H20=CuSO4.5H2O Bi4Ge3012=Bi4Ge3O12 \
            Gd202S=Gd2O2S C5H802=C5H8O2 C2H50H=C2H5OH Y3Al5012=Y3Al5O12"
            .split_whitespace()
        {
            let (text, wanted) = pair.split_once('=').expect("a pair");
            let found = meant(text).map(|found| found.meant);
            assert_eq!(found.as_deref(), Some(wanted), "{text}");
        }
        for text in "C10H20O10 Si0.5Ge0.5 Ca10P6O26H2 O2 C60 C20H42 B10H14 C30H50 Sn60Pb40 Fe80B20 Al5083 Ti6242 \
            (H20) (Al203) Pd40Ni40P20 Al10wt%Cu Cr20wt%Ni Na0.4O La0.7Sr0.3MnO3"
            .split_whitespace()
        {
            assert_eq!(meant(text), None, "{text}");
        }
        assert_eq!(meant("(Si02)").map(|found| found.has_numbers), Some(false));
    }
}
