//! Constants from a chemical formula and a density.

use xraydb::{CrossSectionKind, XrayDb, XrayDbError};

use super::Constants;
use crate::error::{Error, Result};
use crate::scene::path;

/// Mu from the total cross section (Elam: photoabsorption, coherent and incoherent
/// scattering, all of which take light out of the beam), delta from f1 (Chantler).
/// `density` in g/cm3, `energy` in keV.
pub(super) fn constants(name: &str, formula: &str, density: f64, energy: f64) -> Result<Constants> {
    let failed = |error: XrayDbError| {
        Error::scene(
            path::join("materials", name),
            format!("formula \"{formula}\", density {density} g/cm3"),
            format!("a chemical formula such as \"H2O\" and a density above 0 ({error})"),
        )
    };
    let db = XrayDb::try_new().map_err(failed)?;
    let elements = db.mass_fractions(formula).map_err(failed)?;
    let energy_ev = energy * 1e3;
    for (element, _) in &elements {
        // The tables clamp: an energy beyond their end would quietly get the end's value.
        let (low, high) = range(&db, element).map_err(failed)?;
        if !(low..=high).contains(&energy_ev) {
            return Err(Error::scene(
                "source.energy",
                format!("{energy} keV"),
                format!(
                    "{} keV to {} keV, the range of the tables for {element} in \"{name}\"",
                    low / 1e3,
                    high / 1e3
                ),
            ));
        }
    }
    let mu_per_cm =
        db.material_mu_at(formula, density, energy_ev, CrossSectionKind::Total).map_err(failed)?;
    let delta = db.xray_delta_beta(formula, density, energy_ev).map_err(failed)?.delta;
    Ok(Constants { mu: mu_per_cm * 100.0, delta })
}

/// Energies in eV that both tables cover for an element.
fn range(db: &XrayDb, element: &str) -> std::result::Result<(f64, f64), XrayDbError> {
    let (elam_low, elam_high) = XrayDb::elam_energy_range();
    let (chantler_low, chantler_high) = db.chantler_energy_range(element)?;
    Ok((elam_low.max(chantler_low), elam_high.min(chantler_high)))
}
