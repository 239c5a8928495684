//! `beamlet spectrum`: emission of a source, before and after its filters.

use super::beam;
use super::pictures::{refuse_read, save_plot};
use crate::args::Spectrum as Arguments;
use crate::failure::Failure;
use crate::picture::spectrum::draw;
use beamlet::cli_support::printed::number;
use beamlet::cli_support::units::Dimension::{Angle, Length};
use beamlet::scene::{Beam, Scene, SpectrumOrigin, SpectrumSpec};
use beamlet::spectrum::{Nodes, Spectrum, nodes};
use serde::Serialize;
use std::io::Write;

/// Anode angle of a tube that is given none, rad.
const ANODE_ANGLE: f64 = 12.0_f64.to_radians();

/// A spectrum in numbers.
#[derive(Debug, Serialize)]
struct BeamSummary {
    /// Sum of the weights.
    photons: f64,
    mean_energy_kev: f64,
    half_value_layer_m: f64,
    #[serde(flatten)]
    spectrum: Spectrum,
}

impl BeamSummary {
    fn of(spectrum: Spectrum) -> Result<Self, Failure> {
        Ok(Self {
            photons: spectrum.total(),
            mean_energy_kev: spectrum.mean_energy(),
            half_value_layer_m: spectrum.half_value_layer()?,
            spectrum,
        })
    }
}

#[derive(Debug, Serialize)]
struct SpectrumReport {
    source: String,
    /// Filters of the tube itself and behind it, as "1 mm Al".
    inherent_filters: Vec<String>,
    filters: Vec<String>,
    before: BeamSummary,
    after: BeamSummary,
    /// Nodes of a scene; without one there is nothing to be accurate for.
    nodes: Option<Nodes>,
}

pub(super) fn run(arguments: &Arguments, out: &mut impl Write) -> Result<(), Failure> {
    let (scene, spec) = resolve(arguments)?;
    let locate = |error| match &arguments.input {
        Some(path) if beam::is_scene(path) => Scene::locate(path, &arguments.sets, error),
        _ => error,
    };
    let of_scene = arguments.input.as_deref().is_some_and(beam::is_scene);
    let report = SpectrumReport {
        source: source(&spec),
        inherent_filters: match &spec.origin {
            SpectrumOrigin::Tube { inherent_filters, .. } => listed(inherent_filters),
            _ => Vec::new(),
        },
        filters: listed(&spec.filters),
        before: BeamSummary::of(Spectrum::before_filters(&scene, &spec).map_err(locate)?)?,
        after: BeamSummary::of(Spectrum::after_filters(&scene, &spec).map_err(locate)?)?,
        nodes: of_scene.then(|| nodes(&scene).map_err(locate)).transpose()?,
    };
    if let Some(path) = &arguments.plot {
        let drawing = draw(&report.source, &report.before.spectrum, &report.after.spectrum);
        let mut read = scene.input_files();
        read.extend(arguments.input.clone());
        refuse_read(std::slice::from_ref(path), &read)?;
        save_plot(&drawing, path, arguments.overwrite)?;
    }
    match arguments.json {
        true => super::write_json(&report, out),
        false => Ok(write_text(&report, out)?),
    }
}

/// A scene with the spectrum of the arguments, and that spectrum.
fn resolve(arguments: &Arguments) -> Result<(Scene, SpectrumSpec), Failure> {
    let mut scene = match (&arguments.input, arguments.anode, arguments.kvp) {
        (Some(path), _, _) => beam::of_file(path, &arguments.sets)?,
        (None, Some(anode), Some(kvp)) => {
            let anode_angle = arguments.anode_angle.unwrap_or(ANODE_ANGLE);
            let inherent_filters = arguments.inherent.clone();
            let origin = SpectrumOrigin::Tube { anode, kvp, anode_angle, inherent_filters };
            beam::bare(Beam::Spectrum(SpectrumSpec::new(origin)))?
        }
        _ => {
            return Err(Failure::Usage(
                "give a scene, a spectrum file, or --anode and --kvp".into(),
            ));
        }
    };
    if let Beam::Spectrum(spec) = &mut scene.source.beam {
        spec.filters.extend(arguments.filters.iter().cloned());
    }
    scene.validate()?;
    match scene.source.beam.clone() {
        Beam::Spectrum(spec) => Ok((scene, spec)),
        Beam::Energy(energy) => Err(Failure::Usage(format!(
            "the scene has one energy, {energy} keV, and no spectrum; see `beamlet material` for \
             constants at an energy"
        ))),
    }
}

fn source(spec: &SpectrumSpec) -> String {
    match &spec.origin {
        SpectrumOrigin::File { path } => beamlet::cli_support::printed::path(path),
        SpectrumOrigin::Tube { anode, kvp, anode_angle, .. } => {
            format!("{} anode, {kvp} kV, {}", anode.name(), Angle.rounded(*anode_angle))
        }
        _ => "spectrum".to_owned(),
    }
}

fn listed(filters: &[beamlet::scene::Filter]) -> Vec<String> {
    let text = |filter: &beamlet::scene::Filter| {
        format!("{} {}", Length.rounded(filter.thickness), filter.material)
    };
    filters.iter().map(text).collect()
}

fn write_text(report: &SpectrumReport, out: &mut impl Write) -> std::io::Result<()> {
    writeln!(out, "{}", report.source)?;
    let none = || "none".to_owned();
    let list = |filters: &[String]| match filters {
        [] => none(),
        some => some.join(", "),
    };
    if report.source.contains(" anode, ") || !report.inherent_filters.is_empty() {
        writeln!(out, "  {:<20}{}", "inherent filters", list(&report.inherent_filters))?;
    }
    writeln!(out, "  {:<20}{}", "filters", list(&report.filters))?;
    let (before, after) = (&report.before, &report.after);
    writeln!(out, "\n  {:<20}{:>14}{:>14}", "", "before filters", "after")?;
    let mut line = |name: &str, unit: &str, value: &dyn Fn(&BeamSummary) -> f64| {
        let [before, after] = [before, after].map(|beam| number(value(beam)));
        writeln!(out, "  {:<20}{before:>14}{after:>14}  {unit}", name)
    };
    line("mean energy", "keV", &|beam| beam.mean_energy_kev)?;
    line("half-value layer", "mm Al", &|beam| 1e3 * beam.half_value_layer_m)?;
    line("photons", "of the unfiltered", &|beam| beam.photons / before.photons)?;
    line("highest energy", "keV", &|beam| {
        beam.spectrum.energies_kev.last().copied().unwrap_or(0.0)
    })?;
    if !before.spectrum.is_even() && !report.source.contains(" anode, ") {
        writeln!(out, "\nenergies are uneven: each weight counts as the photons of its row")?;
    }
    let Some(nodes) = &report.nodes else { return Ok(()) };
    let how = if nodes.chosen { "chosen" } else { "set by the scene" };
    writeln!(
        out,
        "\nenergy nodes: {}, {how}, estimated error {:.1e}",
        nodes.energies.len(),
        nodes.estimated_error
    )?;
    writeln!(out, "  {:>10}  {:>10}", "keV", "weight")?;
    for (energy, weight) in nodes.energies.iter().zip(&nodes.weights) {
        writeln!(out, "  {energy:>10.4}  {weight:>10.6}")?;
    }
    Ok(())
}
