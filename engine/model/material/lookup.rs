//! Built-in materials by their names and formulas, and solutions of contrast agents in water by the mass of iodine
//! or gadolinium in a volume: "iodine 10 mg/ml".

use super::activator::host;
use super::builtin::{Builtin, builtins, fold, of_formula};
use beamlet_core::units::number;
use std::collections::HashMap;
use std::sync::OnceLock;

/// A contrast agent in water, whose density is linear in its concentration.
struct Agent {
    /// Names of its heavy element.
    names: [&'static str; 2],
    formula: &'static str,
    /// Mass of the heavy element, relative to the mass of the agent.
    share: f64,
    /// Increase of the density, relative to the mass of the heavy element in a volume.
    slope: f64,
    /// Largest concentration of the heavy element, mg/ml.
    most: f64,
}

/// Iohexol: 300 mg of iodine in 1.349 g, of 1 ml (20 °C). Gadoterate meglumine: 78.6 mg of gadolinium in 1.175 g.
/// Both by the makers of the injections.
const AGENTS: [Agent; 2] = [
    Agent {
        names: ["iodine", "i"],
        formula: "C19H26I3N3O9",
        share: 380.713 / 821.14,
        slope: 1.17,
        most: 400.0,
    },
    Agent {
        names: ["gadolinium", "gd"],
        formula: "C23H42GdN5O13",
        share: 157.25 / 753.87,
        slope: 2.252,
        most: 160.0,
    },
];
/// Density of water at 20 °C, g/cm3.
const WATER: f64 = 0.998;

/// The built-in material of this name or alias (case, blanks and hyphens do not matter), of this
/// formula where no other built-in one has it, with or without an activator, or the element of this symbol; or
/// a solution, such as "iodine 10 mg/ml". Carbon and silica have several densities: they go by their names only.
pub fn builtin(name: &str) -> Option<Builtin> {
    let named = by_spelling().get(&fold(name)).map(|place| &builtins()[*place]);
    // Formulas keep their case: "Co" is cobalt, "CO" would be a compound.
    let found = named.or_else(|| match &of_formula(host(name))[..] {
        [only] => Some(*only),
        _ => None,
    });
    found.cloned().or_else(|| solution(name))
}

/// Places of the built-in materials by their folded names and aliases.
fn by_spelling() -> &'static HashMap<String, usize> {
    static PLACES: OnceLock<HashMap<String, usize>> = OnceLock::new();
    PLACES.get_or_init(|| {
        let mut places = HashMap::new();
        for (place, entry) in builtins().iter().enumerate() {
            let aliases = entry.aliases.iter().copied();
            for known in std::iter::once(&*entry.name).chain(aliases) {
                places.entry(fold(known)).or_insert(place);
            }
        }
        places
    })
}

/// The solution of this name: an element, its concentration in mg/ml, and the word "solution" where it is written,
/// in any order. `None` for other names and for concentrations beyond the agent's.
fn solution(name: &str) -> Option<Builtin> {
    let name = name.to_lowercase();
    let (before, behind) = name.split_once("mg/ml")?;
    let before = before.trim_end();
    let digits = before.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.').len();
    let concentration = number(&before[digits..])?;
    let words = before[..digits].split_whitespace().chain(behind.split_whitespace());
    let mut words = words.filter(|word| !["solution", "of", "in", "water"].contains(word));
    let (element, None) = (words.next()?, words.next()) else { return None };
    let agent = AGENTS.iter().find(|agent| agent.names.contains(&element))?;
    if !(concentration > 0.0 && concentration <= agent.most) {
        return None;
    }
    let mass = concentration * 1e-3;
    let density = WATER + agent.slope * mass;
    let percent = 100.0 * mass / agent.share / density;
    Some(Builtin {
        name: format!("{} {concentration} mg/ml", agent.names[0]).into(),
        formula: format!("({}){percent:.6}wt%(H2O)", agent.formula).into(),
        density: (density * 1e4).round() / 1e4,
        aliases: &[],
    })
}
