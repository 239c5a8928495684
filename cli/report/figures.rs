//! Parts of a page that need the scene: drawings of set-up, sample and spectrum, limits of ray optics. A note
//! names the missing ones.

use super::tables::TableRow;
use crate::failure::Failure;
use crate::picture::sample::{self, Camera};
use crate::picture::{set_up, spectrum};
use crate::progress::Reporter;
use crate::subject::Subject;
use beamlet::Control;
use beamlet::check::RayLimits;
use beamlet::geometry::Sample;
use beamlet::scene::{Beam, Scene};
use beamlet::spectrum::Spectrum;

/// Drawings as SVG, empty where there is nothing to draw, and limits of ray optics.
#[derive(Debug, Default)]
pub(super) struct Figures {
    pub(super) set_up: String,
    pub(super) sample: String,
    pub(super) spectrum: String,
    /// The beam in words.
    pub(super) energy: String,
    pub(super) limits: Vec<TableRow>,
    pub(super) notes: Vec<String>,
}

/// Draws the scene of a run, or the geometry of a retrieval. `device` draws the sample.
pub(super) fn of(
    run: &Subject,
    device: Option<&str>,
    reporter: &mut Reporter,
) -> Result<Figures, Failure> {
    let mut figures = Figures::default();
    let Some(scene) = run.scene() else { return Ok(figures) };
    let mut progress = |progress| reporter.update(progress);
    let mut control = Control::default().with_progress(&mut progress);
    let loaded = beamlet::load_sample(scene, &mut control).unwrap_or_else(|error| {
        figures.notes.push(format!(
            "The sample is not drawn, and errors of ray optics at objects are unknown: {error}"
        ));
        Sample::default()
    });
    reporter.doing("drawing");
    let drawing = set_up::draw(scene, &loaded)?;
    figures.set_up = drawing.to_svg("set-up", "The set-up from above");
    if !loaded.objects.is_empty() {
        match sample::draw(scene, &loaded, Camera::default(), device) {
            Ok(drawing) => {
                let label = "The sample; colours are materials";
                figures.sample = drawing.to_svg("sample-picture", label);
            }
            Err(error) => figures.notes.push(format!("The sample is not drawn: {error}")),
        }
    }
    figures.beam(scene);
    figures.limits(scene, &loaded);
    Ok(figures)
}

impl Figures {
    /// Expected errors of ray optics, and warnings of a scene outside it.
    fn limits(&mut self, scene: &Scene, sample: &Sample) {
        match RayLimits::of(scene, sample) {
            Ok(limits) => {
                let lines = limits.lines().into_iter();
                self.limits = lines.map(|(key, text)| TableRow::new(key, text)).collect();
                let warnings = limits.warning().into_iter();
                self.limits
                    .extend(warnings.map(|text| TableRow::new("warning", text).marked(true)));
            }
            Err(error) => self.notes.push(format!("The limits of ray optics are unknown: {error}")),
        }
    }

    /// The spectrum before and after its filters, or the one energy.
    fn beam(&mut self, scene: &Scene) {
        match &scene.source.beam {
            Beam::Energy(energy) => self.energy = format!("One photon energy, {energy} keV."),
            Beam::Spectrum(spec) => {
                let before = Spectrum::before_filters(scene, spec);
                match before.and_then(|before| Ok((before, Spectrum::after_filters(scene, spec)?)))
                {
                    Ok((before, after)) => {
                        let drawing = spectrum::draw("Photons by energy", &before, &after);
                        let label = "The spectrum before and after its filters";
                        self.spectrum = drawing.to_svg("spectrum", label);
                    }
                    Err(error) => self.notes.push(format!("The spectrum is not drawn: {error}")),
                }
            }
        }
    }
}
