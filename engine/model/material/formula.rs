//! Constants from a chemical formula and a density.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::{Mutex, PoisonError};

use xraydb::{CrossSectionKind, XrayDb, XrayDbError};

use super::notation::{self, Composition};
use super::{Constants, builtin, capitals, designation, grade, letter_o, within};
use crate::scene::path;
use beamlet_core::error::{Error, Result};
use beamlet_core::reserve;
use beamlet_core::units::Dimension;

/// A formula at a density and energies, by their bits.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Known {
    formula: String,
    density: u64,
    energies: Vec<u64>,
}

/// Entries of the cache of constants, at most: about 1 MB with spectra of 100 energies.
const MOST_KNOWN: usize = 256;

/// Mu from the total cross section (Elam: photoabsorption, coherent and incoherent scattering, all of
/// which take light out of the beam), delta from f1 (Chantler). `density` in g/cm3, `energies` in keV;
/// `outside` makes the error of an energy without constants, from found and allowed values. The latest results are kept:
/// designs of a sweep have the same materials.
pub(super) fn constants(
    name: &str,
    formula: &str,
    density: f64,
    energies: &[f64],
    outside: impl Fn(String, String) -> Error,
) -> Result<Vec<Constants>> {
    static KNOWN: Mutex<BTreeMap<Known, Vec<Constants>>> = Mutex::new(BTreeMap::new());
    let key = Known {
        formula: formula.to_owned(),
        density: density.to_bits(),
        energies: energies.iter().map(|energy| energy.to_bits()).collect(),
    };
    let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = known().get(&key) {
        return Ok(found.clone());
    }
    let found = read_constants(name, formula, density, energies, outside)?;
    let mut known = known();
    if known.len() >= MOST_KNOWN {
        known.clear();
    }
    known.insert(key, found.clone());
    Ok(found)
}

/// [`constants`] from the tables.
fn read_constants(
    name: &str,
    formula: &str,
    density: f64,
    energies: &[f64],
    outside: impl Fn(String, String) -> Error,
) -> Result<Vec<Constants>> {
    let failed = |error| unreadable(name, formula, density, &error);
    let db = database()?.map_err(failed)?;
    let Composition { text, lightness } = read(&db, name, formula, density)?;
    let (formula, density) = (text.as_str(), density * lightness);
    let elements = db.mass_fractions(formula).map_err(failed)?;
    for (element, _) in &elements {
        // The tables clamp: an energy beyond their end would quietly get the end's value.
        let (low, high) = element_range(&db, element).map_err(failed)?;
        let is_outside = |energy: &&f64| within([low, high], **energy * 1e3).is_none();
        if let Some(energy) = energies.iter().find(is_outside) {
            return Err(outside(
                Dimension::Energy.rounded(*energy),
                format!(
                    "{} keV to {} keV, the range of the tables for {element} in \"{name}\"",
                    low / 1e3,
                    high / 1e3
                ),
            ));
        }
    }
    let energies_ev: Vec<f64> = energies.iter().map(|energy| energy * 1e3).collect();
    let mu_per_cm =
        db.material_mu(formula, density, &energies_ev, CrossSectionKind::Total).map_err(failed)?;
    let delta = |energy: &f64| {
        db.xray_delta_beta(formula, density, *energy).map(|found| found.delta).map_err(failed)
    };
    let deltas: Vec<f64> = energies_ev.iter().map(delta).collect::<Result<_>>()?;
    let constants =
        |(mu, delta): (f64, f64)| Constants { mu: mu * 100.0, delta, ..Constants::default() };
    Ok(mu_per_cm.into_iter().zip(deltas).map(constants).collect())
}

/// Checks that a text is a chemical formula; the inner error is the fault of it.
pub(super) fn check(text: &str) -> Result<std::result::Result<(), String>> {
    let db = database()?;
    Ok(db.map_err(|error| error.to_string()).and_then(|db| composition(&db, text).map(|_| ())))
}

/// The composition of a formula.
///
/// # Errors
/// A formula that cannot be read; an alloy's designation by weight.
fn read(db: &XrayDb, name: &str, formula: &str, density: f64) -> Result<Composition> {
    if let Some(allowed) = other_ways(formula, Some(density)) {
        let key = path::join("materials", name);
        return Err(Error::scene(key, format!("formula \"{formula}\""), allowed));
    }
    composition(db, formula).map_err(|error| unreadable(name, formula, density, &error))
}

fn composition(db: &XrayDb, formula: &str) -> std::result::Result<Composition, String> {
    notation::read(formula, |name| {
        // The tables know elements by their names and numbers, too.
        let symbol = db.symbol(name).ok().filter(|symbol| *symbol == name)?;
        db.molar_mass(symbol).ok()
    })
}

/// The ways to write a formula that has another reading: the name of a material, the designation of an alloy by weight,
/// a zero for the letter O, or an element in capitals; `None` for others. `density`: g/cm3, where it is known.
pub(super) fn other_ways(formula: &str, density: Option<f64>) -> Option<String> {
    let counts = format!("\"({formula})\" counts atoms");
    let is_of_symbols = designation::is_of_symbols(formula);
    let named = builtin(formula).filter(|it| is_of_symbols && it.formula != formula.trim());
    if let Some(known) = named {
        let kind = if known.formula.contains("wt%") { "an alloy by weight" } else { "a name" };
        return Some(format!(
            "{kind}: the built-in material \"{}\", {}; {counts}",
            known.name, known.formula
        ));
    }
    if let Some(letter) = letter_o::meant(formula) {
        let numbers = if letter.has_numbers { format!("; {counts}") } else { String::new() };
        return Some(format!("\"{}\" with the letter O{numbers}", letter.meant));
    }
    let reads = || matches!(check(&designation::joined(formula)), Ok(Ok(())));
    if let Some(meaning) = grade::meant(formula, density).filter(|_| reads()) {
        return Some(format!(
            "a name ({meaning}): its formula, or shares by weight such as \"Al6wt%V4wt%Ti\"; {counts}"
        ));
    }
    if let Some(meant) = capitals::meant(formula, density) {
        return Some(format!(
            "\"{meant}\" for the element, or \"({formula})\" for an atom of each letter"
        ));
    }
    let by_weight = designation::by_weight(formula).filter(|_| is_of_symbols)?;
    Some(format!("an alloy by weight: \"{by_weight}\", with its shares in percent; {counts}"))
}

/// The formula of a mixture, by the weight of each element, and the mass of it with D and T as
/// natural hydrogen relative to its mass. `parts`: key, formula and share by weight of each; shares are
/// relative.
pub(super) fn mixed(parts: &[(String, String, f64)]) -> Result<(String, f64)> {
    let unreadable = |key: &str, formula: &str, error: &dyn Display| {
        let allowed = format!("a built-in material or a chemical formula ({error})");
        Error::scene(key, format!("{formula:?}"), allowed)
    };
    let [first, ..] = parts else { return Ok((String::new(), 1.0)) };
    let db = database()?.map_err(|error| unreadable(&first.0, &first.1, &error))?;
    let total: f64 = parts.iter().map(|part| part.2).sum();
    let mut elements = BTreeMap::<String, f64>::new();
    let mut lightness = 0.0;
    for (key, formula, weight) in parts {
        if let Some(allowed) = other_ways(formula, None) {
            return Err(Error::scene(key, format!("{formula:?}"), allowed));
        }
        let found = composition(&db, formula).map_err(|e| unreadable(key, formula, &e))?;
        lightness += found.lightness * weight / total;
        let shares = db.mass_fractions(&found.text).map_err(|e| unreadable(key, formula, &e))?;
        for (element, share) in shares {
            *elements.entry(element).or_default() += share * found.lightness * weight / total;
        }
    }
    // Natural parts sum to 1 but for rounding.
    let is_natural = (lightness - 1.0_f64).abs() < 1e-12;
    if !is_natural {
        elements.values_mut().for_each(|share| *share /= lightness);
    }
    // The last one is the rest: shares that sum to 100 but for rounding would be refused.
    let rest = elements.pop_last().map(|(element, _)| element).unwrap_or_default();
    let shares = elements.iter().map(|(element, share)| format!("{element}{}wt%", 100.0 * share));
    Ok((shares.collect::<String>() + &rest, if is_natural { 1.0 } else { lightness }))
}

/// Energies of the absorption edges of the elements of a formula, keV.
pub(super) fn edges(name: &str, formula: &str, density: f64) -> Result<Vec<f64>> {
    let failed = |error| unreadable(name, formula, density, &error);
    let db = database()?.map_err(failed)?;
    let mut edges = Vec::new();
    let formula = &read(&db, name, formula, density)?.text;
    for (element, _) in db.mass_fractions(formula).map_err(failed)? {
        let levels = db.xray_edges(&element).map_err(failed)?;
        edges.extend(levels.values().map(|edge| edge.energy / 1e3));
    }
    edges.sort_by(f64::total_cmp);
    Ok(edges)
}

/// Least and greatest energy, keV, that the tables cover for all elements of a formula.
pub(super) fn range(name: &str, formula: &str, density: f64) -> Result<[f64; 2]> {
    let failed = |error| unreadable(name, formula, density, &error);
    let db = database()?.map_err(failed)?;
    let mut common = [0.0, f64::INFINITY];
    let formula = &read(&db, name, formula, density)?.text;
    for (element, _) in db.mass_fractions(formula).map_err(failed)? {
        let (low, high) = element_range(&db, &element).map_err(failed)?;
        common = [common[0].max(low / 1e3), common[1].min(high / 1e3)];
    }
    Ok(common)
}

/// The tables of the elements; room for them is reserved, since reading them panics without.
fn database() -> Result<std::result::Result<XrayDb, XrayDbError>> {
    /// Bytes while they are read, as measured.
    const READ: u64 = 24 << 20;
    /// Written by `build.rs`.
    const ELEMENTS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/elements.bin"));
    reserve::ask(READ, "the tables of the elements", "raise the memory limit of this process")?;
    Ok(XrayDb::load_uncompressed(ELEMENTS))
}

fn unreadable(name: &str, formula: &str, density: f64, error: &dyn Display) -> Error {
    Error::scene(
        path::join("materials", name),
        format!("formula \"{formula}\", density {density} g/cm3"),
        format!("a chemical formula such as \"H2O\" and a density above 0 ({error})"),
    )
}

/// Energies in eV that both tables cover for an element.
fn element_range(db: &XrayDb, element: &str) -> std::result::Result<(f64, f64), XrayDbError> {
    let (elam_low, elam_high) = XrayDb::elam_energy_range();
    let (chantler_low, chantler_high) = db.chantler_energy_range(element)?;
    Ok((elam_low.max(chantler_low), elam_high.min(chantler_high)))
}
