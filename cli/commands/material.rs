//! `beamlet material`: constants of a material, and the built-in names.

use super::beam;
use crate::args::Material as Arguments;
use crate::failure::Failure;
use beamlet::check::CheckedMicrostructure;
use beamlet::cli_support::material::{builtin, builtins};
use beamlet::cli_support::printed::number;
use beamlet::cli_support::units::Dimension::{Density, Length};
use beamlet::material::{self, Constants};
use beamlet::scene::{Beam, MaterialSpec, Scene, SpectrumSpec};
use beamlet::spectrum::Spectrum;
use serde::Serialize;
use std::f64::consts::PI;
use std::io::Write;

/// Planck constant times speed of light, keV m (CODATA 2018).
const HC: f64 = 1.239_841_984e-9;

/// Where the constants come from.
const TABLES: &str = "mu: total cross sections of Elam, Ravel and Sieber (2002); \
                      delta: f1 of Chantler (2000)";

/// A built-in material.
#[derive(Debug, Serialize)]
struct BuiltIn {
    name: &'static str,
    formula: &'static str,
    density_g_cm3: f64,
    aliases: &'static [&'static str],
}

/// Constants at an energy, or their mean over the photons of a spectrum.
#[derive(Debug, Serialize)]
struct MaterialValues {
    /// Energy of the photon, or the mean of the photons.
    energy_kev: f64,
    mu_per_m: f64,
    delta: f64,
    beta: f64,
    critical_angle_rad: f64,
    /// Transmission of the requested thickness.
    transmission: Option<f64>,
}

#[derive(Debug, Serialize)]
struct MaterialReport {
    name: String,
    formula: Option<String>,
    density_g_cm3: Option<f64>,
    thickness_m: Option<f64>,
    /// True if the values are means over a spectrum.
    over_spectrum: bool,
    values: Vec<MaterialValues>,
    /// Bodies of a material of the scene, at the energy or at the mean of the photons.
    #[serde(skip_serializing_if = "Option::is_none")]
    microstructure: Option<CheckedMicrostructure>,
    tables: String,
    /// Least and greatest energy with constants; the greatest is left out where there is none.
    table_range_kev: [Option<f64>; 2],
}

pub(super) fn run(arguments: &Arguments, out: &mut impl Write) -> Result<(), Failure> {
    let Some(name) = &arguments.name else { return list(arguments.json, out) };
    let mut scene = match &arguments.spectrum {
        Some(path) => beam::of_file(path, &[])?,
        None => beam::bare(Beam::Energy(1.0))?,
    };
    define(&mut scene, name, arguments.density)?;
    if arguments.energies.is_empty() && arguments.spectrum.is_none() {
        let problem = "--energy, such as '30 keV', or --spectrum is required";
        return Err(Failure::Usage(problem.into()));
    }
    let (formula, density) = match (scene.materials.get(name), builtin(name)) {
        (Some(MaterialSpec::Formula { formula, density }), _) => {
            (Some(formula.clone()), Some(*density))
        }
        (Some(MaterialSpec::Mixture { parts, density }), _) => {
            let part = |(name, share): &(String, f64)| format!("{name} {share}");
            let parts: Vec<String> = parts.iter().map(part).collect();
            (Some(parts.join(", ") + " by weight"), Some(*density))
        }
        (None, Some(found)) => (Some(found.formula.into_owned()), Some(found.density)),
        _ => (None, None),
    };
    let range = material::range(&scene, name)?;
    let table = match scene.materials.get(name) {
        Some(MaterialSpec::Table { path }) => Some(beamlet::cli_support::printed::path(path)),
        _ => None,
    };
    let values = match (&arguments.spectrum, &scene.source.beam) {
        (Some(_), Beam::Spectrum(spec)) => {
            vec![over_spectrum(&scene, spec, name, arguments.thickness)?]
        }
        (Some(_), Beam::Energy(energy)) => {
            at_energies(&scene, name, &[*energy], arguments.thickness)?
        }
        (None, _) => at_energies(&scene, name, &arguments.energies, arguments.thickness)?,
    };
    let energy = values.first().map_or(0.0, |value| value.energy_kev);
    let report = MaterialReport {
        values,
        microstructure: CheckedMicrostructure::of(&scene, name, energy)?,
        name: name.clone(),
        formula,
        density_g_cm3: density,
        thickness_m: arguments.thickness,
        over_spectrum: matches!(scene.source.beam, Beam::Spectrum(_)),
        tables: table.unwrap_or_else(|| TABLES.to_owned()),
        table_range_kev: range.map(|energy| energy.is_finite().then_some(energy)),
    };
    match arguments.json {
        true => super::write_json(&report, out),
        false => Ok(write_text(&report, out)?),
    }
}

/// Makes `name` a material of the scene where it is a formula, or has another density.
fn define(scene: &mut Scene, name: &str, density: Option<f64>) -> Result<(), Failure> {
    if let (Some(MaterialSpec::Mixture { density, .. }), Some(wanted)) =
        (scene.materials.get_mut(name), density)
    {
        *density = wanted;
        return Ok(());
    }
    let builtin = builtin(name).filter(|_| !scene.materials.contains_key(name));
    let formula = match (scene.materials.get(name), builtin) {
        (Some(MaterialSpec::Formula { formula, .. }), _) => formula.clone(),
        (Some(_), _) if density.is_some() => {
            let problem = format!("--density is for formulas; {name:?} has none");
            return Err(Failure::Usage(problem));
        }
        (None, Some(found)) if found.formula.is_empty() && density.is_some() => {
            return Err(Failure::Usage(format!("--density: {name:?} has no density to change")));
        }
        (None, Some(found)) => found.formula.into_owned(),
        (Some(_), _) => return Ok(()),
        (None, None) => {
            let mut tried = scene.clone();
            let spec = |density| MaterialSpec::Formula { formula: name.to_owned(), density };
            tried.materials.insert(name.to_owned(), spec(1.0));
            if material::range(&tried, name).is_err() {
                // Neither a name nor a formula: the engine's error has the nearest name.
                material::range(scene, name)?;
            }
            let Some(density) = density else {
                let problem = format!("the formula {name:?} needs --density, such as '1.2 g/cm3'");
                return Err(Failure::Usage(problem));
            };
            scene.materials.insert(name.to_owned(), spec(density));
            return Ok(());
        }
    };
    if let Some(density) = density {
        scene.materials.insert(name.to_owned(), MaterialSpec::Formula { formula, density });
    }
    Ok(())
}

fn at_energies(
    scene: &Scene,
    name: &str,
    energies: &[f64],
    thickness: Option<f64>,
) -> Result<Vec<MaterialValues>, Failure> {
    let constants = material::constants_over(scene, name, energies)?;
    let values = |(energy, Constants { mu, delta, .. }): (&f64, Constants)| MaterialValues {
        energy_kev: *energy,
        mu_per_m: mu,
        delta,
        beta: beta(mu, *energy),
        critical_angle_rad: critical_angle(delta),
        transmission: thickness.map(|thickness| (-mu * thickness).exp()),
    };
    Ok(energies.iter().zip(constants).map(values).collect())
}

/// Means over the photons of the scene's spectrum behind its filters.
fn over_spectrum(
    scene: &Scene,
    spec: &SpectrumSpec,
    name: &str,
    thickness: Option<f64>,
) -> Result<MaterialValues, Failure> {
    let spectrum = Spectrum::after_filters(scene, spec)?.significant();
    let constants = material::constants_over(scene, name, &spectrum.energies_kev)?;
    let mean = |value: &dyn Fn(f64, Constants) -> f64| {
        let rows = spectrum.energies_kev.iter().zip(&constants).zip(&spectrum.weights);
        rows.map(|((energy, constants), weight)| weight * value(*energy, *constants)).sum::<f64>()
            / spectrum.total()
    };
    let delta = mean(&|_, constants| constants.delta);
    Ok(MaterialValues {
        energy_kev: spectrum.mean_energy(),
        mu_per_m: mean(&|_, constants| constants.mu),
        delta,
        beta: mean(&|energy, constants| beta(constants.mu, energy)),
        critical_angle_rad: critical_angle(delta),
        transmission: thickness.map(|t| mean(&|_, constants| (-constants.mu * t).exp())),
    })
}

/// beta = mu lambda / 4 pi; mu in 1/m, energy in keV.
fn beta(mu: f64, energy: f64) -> f64 {
    mu * HC / energy / (4.0 * PI)
}

/// Critical angle of total reflection from vacuum, rad.
fn critical_angle(delta: f64) -> f64 {
    (2.0 * delta.max(0.0)).sqrt()
}

fn write_text(report: &MaterialReport, out: &mut impl Write) -> std::io::Result<()> {
    write!(out, "{}", report.name)?;
    if let (Some(formula), Some(density)) = (&report.formula, report.density_g_cm3) {
        write!(out, "  {formula}, {}", Density.rounded(density))?;
    }
    writeln!(out)?;
    for value in &report.values {
        let mut line = |name: &str, value: String| writeln!(out, "  {name:<16}{value}");
        let energy = format!("{} keV", number(value.energy_kev));
        if report.over_spectrum {
            line("mean energy", format!("{energy}; the values below are means over the photons"))?;
        } else {
            line("energy", energy)?;
        }
        line("mu", format!("{} /m", number(value.mu_per_m)))?;
        line("delta", number(value.delta))?;
        line("beta", number(value.beta))?;
        line("critical angle", format!("{} mrad", number(1e3 * value.critical_angle_rad)))?;
        if let (Some(transmission), Some(thickness)) = (value.transmission, report.thickness_m) {
            let text = format!("{} of {}", number(transmission), Length.rounded(thickness));
            line("transmission", text)?;
        }
    }
    if let Some(structure) = &report.microstructure {
        write!(out, "{structure}")?;
        for warning in structure.warnings() {
            writeln!(out, "  {:<18}{warning}", "warning")?;
        }
    }
    let [low, high] = report.table_range_kev;
    let range = match (low, high) {
        (Some(low), Some(high)) => format!("; {} keV to {} keV", number(low), number(high)),
        _ => "; any energy".to_owned(),
    };
    writeln!(out, "  {:<16}{}{range}", "tables", report.tables)
}

fn list(json: bool, out: &mut impl Write) -> Result<(), Failure> {
    let known = builtins().iter().map(|entry| BuiltIn {
        name: &entry.name,
        formula: &entry.formula,
        density_g_cm3: entry.density,
        aliases: entry.aliases,
    });
    if json {
        return super::write_json(&known.collect::<Vec<_>>(), out);
    }
    for BuiltIn { name, formula, density_g_cm3, aliases } in known {
        let density = Density.rounded(density_g_cm3);
        writeln!(out, "{name:<20}{density:<18}{formula:<38} {}", aliases.join(", "))?;
    }
    writeln!(out, "\n{TABLES}; 0.1 keV to 800 keV at most.")?;
    Ok(writeln!(
        out,
        "A formula also selects an element or compound of this list, if no other entry has the formula.\n\
         Solutions of contrast agents in water are named by their concentration: \"iodine 10 mg/ml\" (iohexol, \
         up to 400),\n\"gadolinium 5 mg/ml\" (gadoterate, up to 160)."
    )?)
}
