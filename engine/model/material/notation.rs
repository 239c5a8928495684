//! Grammar of chemical formulas.
//!
//! ```text
//! formula  = weights | parts
//! weights  = { compound number "wt%" } [ compound ]       the last compound is the rest
//! parts    = part { separator part }                      a hydrate: CuSO4.5H2O
//! part     = [ number ] compound                          a number needs a second part
//! compound = { ( symbol | "(" compound ")" ) [ number ] } also [ ] and { }
//! separator = "·" | "*" | "." before anything but the digits of a decimal number
//! ```
//!
//! A last symbol in brackets without a number, or behind a colon, is an activator and does not count: `CsI(Tl)`,
//! `Gd2O2S:Tb`. Symbols are the elements, and D and T. Blanks do not count, except between digits. Numbers have no
//! exponent: the E of `Lu2O3Eu0.1` is europium.

use super::activator;
use std::fmt::Write as _;

/// Molar masses of deuterium and tritium, g/mol (AME 2020).
const ISOTOPES: [(&str, f64); 2] = [("D", 2.014_101_778), ("T", 3.016_049_281)];
/// Elements behind whose number a point may begin another part: oxides and salts end with them.
const ANIONS: [&str; 5] = ["O", "F", "Cl", "Br", "I"];
/// Water in a hydrate.
const WATER: [&str; 5] = ["H2O", "D2O", "T2O", "(H2O)", "(D2O)"];
/// Deepest nesting of groups.
const DEEPEST: usize = 16;

/// A formula that was read.
#[derive(Debug, PartialEq)]
pub(super) struct Composition {
    /// The same numbers of atoms in the notation of `xraydb`, D and T as H.
    pub(super) text: String,
    /// Mass with D and T as natural hydrogen, relative to the mass of the formula.
    pub(super) lightness: f64,
}

/// An atom of a formula and its number.
type Atom = (String, f64);

/// Reads a formula; `mass` has the molar mass of an element.
///
/// # Errors
/// The fault, with its place.
pub(super) fn read(text: &str, mass: impl Fn(&str) -> Option<f64>) -> Result<Composition, String> {
    let text = plain(activator::host(text))?;
    let mass = |symbol: &str| {
        let isotope = ISOTOPES.iter().find(|(name, _)| *name == symbol).map(|(_, mass)| *mass);
        isotope.or_else(|| mass(symbol))
    };
    if text.contains("wt%") {
        return weights(&text, mass);
    }
    let atoms = Reader::new(&text, &mass).formula()?;
    let lightness = lightness(&atoms, mass)?;
    Ok(Composition { text: written(&atoms), lightness })
}

/// The text without blanks, with one sign for separators and digits of one kind.
fn plain(text: &str) -> Result<String, String> {
    let mut plain = String::with_capacity(text.len());
    let mut blank = false;
    for letter in text.trim().chars() {
        if letter.is_whitespace() {
            blank = true;
            continue;
        }
        let letter = match letter {
            '₀'..='₉' => char::from_digit(letter as u32 - '₀' as u32, 10).unwrap_or(letter),
            '⋅' | '∙' | '•' | '*' => '·',
            '[' | '{' => '(',
            ']' | '}' => ')',
            other => other,
        };
        let is_digit = |c: char| c.is_ascii_digit();
        if blank && is_digit(letter) && plain.ends_with(is_digit) {
            return Err("a blank between two digits; write * between the parts".into());
        }
        blank = false;
        plain.push(letter);
    }
    Ok(plain)
}

/// Compounds by weight.
fn weights(text: &str, mass: impl Fn(&str) -> Option<f64>) -> Result<Composition, String> {
    let mut rest = text;
    let mut parts: Vec<(Vec<Atom>, Option<f64>)> = Vec::new();
    while let Some((head, tail)) = rest.split_once("wt%") {
        let digits = head.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.').len();
        let (compound, percent) = head.split_at(digits);
        let percent = percent.parse::<f64>().ok().filter(|percent| percent.is_finite());
        let percent = percent.ok_or_else(|| format!("no number before wt% in \"{head}\""))?;
        parts.push((Reader::new(compound, &mass).formula()?, Some(percent)));
        rest = tail;
    }
    if !rest.is_empty() {
        parts.push((Reader::new(rest, &mass).formula()?, None));
    }
    let named: f64 = parts.iter().filter_map(|part| part.1).sum();
    if named > 100.0 + 1e-9 {
        return Err(format!("the shares by weight sum to {named} %, more than 100 %"));
    }
    let light = |atoms: &[Atom]| lightness(atoms, &mass);
    let factors = parts.iter().map(|(atoms, _)| light(atoms)).collect::<Result<Vec<_>, _>>()?;
    let is_natural = factors.iter().all(|factor| *factor >= 1.0);
    let total = if rest.is_empty() { named } else { 100.0 };
    let of = |percent: Option<f64>| percent.unwrap_or(100.0 - named);
    let sum: f64 = parts.iter().zip(&factors).map(|(part, factor)| of(part.1) * factor).sum();
    let mut written_parts = String::new();
    for ((atoms, percent), factor) in parts.iter().zip(&factors) {
        let _ = write!(written_parts, "({})", written(atoms));
        match percent {
            Some(percent) if is_natural => {
                let _ = write!(written_parts, "{percent}wt%");
            }
            // The last part stays the rest.
            Some(percent) => {
                let _ = write!(written_parts, "{}wt%", percent * factor * total / sum);
            }
            None => {}
        }
    }
    let lightness = if is_natural { 1.0 } else { sum / total };
    Ok(Composition { text: written_parts, lightness })
}

/// Numbers of atoms as a formula that has no ambiguous places.
fn written(atoms: &[Atom]) -> String {
    let name = |symbol: &str| match ISOTOPES.iter().any(|(isotope, _)| *isotope == symbol) {
        true => "H".to_owned(),
        false => symbol.to_owned(),
    };
    atoms.iter().map(|(symbol, count)| format!("({}){count}", name(symbol))).collect()
}

/// Mass of the atoms with D and T as H, relative to their mass.
fn lightness(atoms: &[Atom], mass: impl Fn(&str) -> Option<f64>) -> Result<f64, String> {
    let total = |is_natural: bool| -> f64 {
        let of = |symbol: &str| {
            let isotope = ISOTOPES.iter().any(|(isotope, _)| *isotope == symbol);
            mass(if isotope && is_natural { "H" } else { symbol }).unwrap_or_default()
        };
        atoms.iter().map(|(symbol, count)| count * of(symbol)).sum()
    };
    let [natural, real] = [total(true), total(false)];
    if !(real > 0.0 && real.is_finite()) {
        return Err("numbers of atoms beyond all limits".into());
    }
    Ok(natural / real)
}

struct Reader<'a, M> {
    letters: Vec<char>,
    at: usize,
    depth: usize,
    mass: &'a M,
}

impl<'a, M: Fn(&str) -> Option<f64>> Reader<'a, M> {
    fn new(text: &str, mass: &'a M) -> Self {
        Self { letters: text.chars().collect(), at: 0, depth: 0, mass }
    }

    /// All parts: atoms by symbol.
    fn formula(mut self) -> Result<Vec<Atom>, String> {
        let leads = self.letters.first().is_some_and(char::is_ascii_digit);
        let mut atoms = self.part()?;
        let mut parts = 1;
        while let Some(letter) = self.letter(self.at) {
            match letter {
                '·' | '.' => self.at += 1,
                ')' => return Err("a closing bracket without an opening one".into()),
                _ => return Err(format!("\"{}\" is not part of a formula", self.rest(self.at))),
            }
            atoms.extend(self.part()?);
            parts += 1;
        }
        if leads && parts == 1 {
            return Err(
                "a number before the formula: isotopes other than D and T are not read".into()
            );
        }
        atoms.sort_by(|a, b| a.0.cmp(&b.0));
        atoms.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            if is_same {
                kept.1 += next.1;
            }
            is_same
        });
        Ok(atoms)
    }

    /// A part behind a separator, or the first.
    fn part(&mut self) -> Result<Vec<Atom>, String> {
        let factor = self.number(false)?.unwrap_or(1.0);
        let mut atoms = self.compound()?;
        atoms.iter_mut().for_each(|atom| atom.1 *= factor);
        Ok(atoms)
    }

    fn compound(&mut self) -> Result<Vec<Atom>, String> {
        let start = self.at;
        let mut atoms = Vec::new();
        loop {
            let mut items = match self.letter(self.at) {
                Some('(') => self.group()?,
                Some(letter) if letter.is_ascii_uppercase() => vec![(self.symbol()?, 1.0)],
                _ if atoms.is_empty() => {
                    let place = self.rest(start);
                    return Err(format!("an element is missing before \"{place}\""));
                }
                _ => return Ok(atoms),
            };
            if let Some(number) = self.number(true)? {
                items.iter_mut().for_each(|atom| atom.1 *= number);
            }
            atoms.append(&mut items);
        }
    }

    fn group(&mut self) -> Result<Vec<Atom>, String> {
        self.at += 1;
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("brackets nested more than {DEEPEST} deep"));
        }
        let atoms = self.compound()?;
        self.depth -= 1;
        match self.letter(self.at) {
            Some(')') => self.at += 1,
            _ => return Err("a closing bracket is missing".into()),
        }
        Ok(atoms)
    }

    fn symbol(&mut self) -> Result<String, String> {
        let small = self.letters[self.at + 1..].iter().take_while(|c| c.is_ascii_lowercase());
        let end = self.at + 1 + small.count();
        let symbol: String = self.letters[self.at..end].iter().collect();
        if (self.mass)(&symbol).is_none() {
            return Err(format!("\"{symbol}\" is no element"));
        }
        self.at = end;
        Ok(symbol)
    }

    /// The number here, if there is one; `counts`: it counts an element or a group before it.
    fn number(&mut self, counts: bool) -> Result<Option<f64>, String> {
        let start = self.at;
        let mut end = self.digits_end(start);
        if self.letter(end) == Some('.') && !self.separates(end, counts)? {
            end = self.digits_end(end + 1);
        }
        if end == start {
            return Ok(None);
        }
        self.at = end;
        let text: String = self.letters[start..end].iter().collect();
        let begins_with_zero =
            text.starts_with('0') && text[1..].starts_with(|c: char| c.is_ascii_digit());
        if begins_with_zero {
            return Err(format!("the number \"{text}\" begins with 0, in place of the letter O?"));
        }
        match text.parse::<f64>() {
            Ok(number) if number > 0.0 && number.is_finite() => Ok(Some(number)),
            _ => Err(format!("the number \"{text}\"; allowed: a number above 0")),
        }
    }

    /// Checks whether the point at `dot` separates parts: it is no decimal point.
    fn separates(&self, dot: usize, counts: bool) -> Result<bool, String> {
        let before = self.letters[..dot].iter().rev().take_while(|c| c.is_ascii_digit()).count();
        let (digits, end) = (&self.letters[dot - before..dot], self.digits_end(dot + 1));
        let decimals = end - dot - 1;
        if decimals == 0 || self.letter(end) == Some('.') && self.digits_end(end + 1) > end + 1 {
            return Ok(true);
        }
        if !counts || digits.first() == Some(&'0') {
            return Ok(false);
        }
        let rest = self.rest(end);
        let is_water = |water: &&str| {
            let behind = rest.strip_prefix(*water).map(|rest| rest.chars().next());
            behind.is_some_and(|next| matches!(next, None | Some('·' | '.' | ')')))
        };
        if WATER.iter().any(is_water) {
            return Ok(true);
        }
        let of = &self.letters[..dot - before];
        let is_salt = of.last() == Some(&')')
            || ANIONS.iter().any(|anion| {
                let symbol: Vec<char> = anion.chars().collect();
                of.ends_with(&symbol)
            });
        let goes_on = self.letter(end).is_some_and(|next| next == '(' || next.is_ascii_uppercase());
        if is_salt && goes_on && decimals == 1 {
            let number: String = self.letters[dot - before..end].iter().collect();
            return Err(format!(
                "\"{number}\" is a number or ends a part; write {number}0 for the number, or * in \
                 place of the point"
            ));
        }
        Ok(false)
    }

    fn digits_end(&self, start: usize) -> usize {
        let digits = self.letters.get(start..).unwrap_or_default();
        start + digits.iter().take_while(|letter| letter.is_ascii_digit()).count()
    }

    fn letter(&self, at: usize) -> Option<char> {
        self.letters.get(at).copied()
    }

    fn rest(&self, at: usize) -> String {
        self.letters.get(at..).unwrap_or_default().iter().collect()
    }
}
