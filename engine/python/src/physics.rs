//! Materials and spectra; differences of files.

use crate::errors::raised;
use crate::scene::Scene;
use crate::stacks::json;
use crate::work::interruptible;
use beamlet::cli_support::material::builtin;
use beamlet::scene::{Beam, Detector, MaterialSpec, Source};
use beamlet::spectrum::{Nodes, Spectrum, nodes};
use beamlet::{Error, material as materials};
use pyo3::prelude::*;
use serde::Serialize;
use std::path::PathBuf;

/// Attenuation (1/m) and decrement of a material at energies, keV. `name`: a material of `scene`, a
/// built-in one, or with `density` (g/cm3) a formula.
#[pyfunction]
pub(crate) fn material(
    py: Python<'_>,
    name: &str,
    energies: Vec<f64>,
    density: Option<f64>,
    scene: Option<&Scene>,
) -> PyResult<(Vec<f64>, Vec<f64>)> {
    let constants = || {
        let mut scene = match scene {
            Some(scene) => scene.scene()?,
            None => {
                let source = Source::new(1.0, [1e-6; 2], Beam::Energy(30.0));
                beamlet::scene::Scene::new(source, Detector::new(2.0, [1, 1], [1e-4; 2]))
            }
        };
        if let Some(density) = density {
            if !(density.is_finite() && density > 0.0) {
                let found = format!("{density} g/cm3");
                return Err(Error::argument("density", found, "a number above 0"));
            }
            let formula = match (scene.materials.get(name), builtin(name)) {
                (Some(MaterialSpec::Formula { formula, .. }), _) => formula.clone(),
                (None, Some(found)) if !found.formula.is_empty() => found.formula.into_owned(),
                _ => name.to_owned(),
            };
            scene.materials.insert(name.to_owned(), MaterialSpec::Formula { formula, density });
        }
        materials::constants_over(&scene, name, &energies)
    };
    let found = constants().map_err(|error| raised(py, &error))?;
    Ok(found.into_iter().map(|it| (it.mu, it.delta)).unzip())
}

/// The beam of a scene.
#[derive(Serialize)]
struct BeamReport {
    before_filters: Option<Spectrum>,
    after_filters: Option<Spectrum>,
    mean_energy_kev: f64,
    half_value_layer_m: Option<f64>,
    nodes: Nodes,
}

/// The spectrum of a scene before and after its filters, and its energy nodes, as JSON.
#[pyfunction]
pub(crate) fn spectrum(py: Python<'_>, scene: &Scene) -> PyResult<String> {
    let report = || {
        let scene = scene.scene()?;
        let [before, after] = match &scene.source.beam {
            Beam::Spectrum(spec) => [
                Some(Spectrum::before_filters(&scene, spec)?),
                Some(Spectrum::after_filters(&scene, spec)?),
            ],
            _ => [None, None],
        };
        let nodes = nodes(&scene)?;
        Ok(BeamReport {
            mean_energy_kev: after.as_ref().map_or(nodes.mean_energy(), Spectrum::mean_energy),
            half_value_layer_m: after.as_ref().map(Spectrum::half_value_layer).transpose()?,
            before_filters: before,
            after_filters: after,
            nodes,
        })
    };
    json(&report().map_err(|error: Error| raised(py, &scene.located(error)))?)
}

/// Differences of two runs, retrievals or stacks in files, as JSON.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    a: PathBuf,
    b: PathBuf,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    json(&interruptible(py, progress, |watch| {
        watch.rows("compare", |mut control| beamlet::compare::compare(&a, &b, None, &mut control))
    })?)
}
