//! Retrieval from arrays.

use crate::engine::Engine;
use crate::scene::Scene;
use crate::stacks::{json, of_array};
use crate::work::interruptible;
use beamlet::Error;
use beamlet::retrieve::{IdealOptions, Input, Method, RetrieveOptions, Weights, retrieve_arrays};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray4};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Options of a retrieval, as `Images.retrieve` has them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    method: String,
    weights: String,
    gain: Option<f64>,
    read_noise: Option<f64>,
    saturation: Option<f32>,
    steps: Option<[usize; 2]>,
    sample_offsets: Option<Vec<f64>>,
    bad_pixels: Option<PathBuf>,
}

/// Images by name, `[view][row][column]`, record of the retrieval and geometry of the views as JSON.
pub(crate) type Retrieved<'py> =
    (BTreeMap<String, Bound<'py, PyArray3<f32>>>, String, Option<String>);

fn method(py: Python<'_>, name: &str) -> PyResult<Method> {
    let names = Method::ALL.map(Method::name).join(", ");
    Method::ALL.into_iter().find(|it| it.name() == name).ok_or_else(|| {
        crate::errors::raised(py, &Error::argument("method", format!("{name:?}"), names))
    })
}

fn weights(py: Python<'_>, name: &str) -> PyResult<Weights> {
    match name {
        "none" => Ok(Weights::None),
        "poisson" => Ok(Weights::Poisson),
        _ => Err(crate::errors::raised(
            py,
            &Error::argument("weights", format!("{name:?}"), "none, poisson"),
        )),
    }
}

/// Retrieves from arrays `[view][step][row][column]`. `kind`: "intensities" or "counts" of a
/// simulation, or "measured".
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "options by name in Python")]
pub(crate) fn retrieve<'py>(
    py: Python<'py>,
    engine: &Engine,
    scene: &Scene,
    kind: &str,
    flat: PyReadonlyArray4<'py, f32>,
    sample: PyReadonlyArray4<'py, f32>,
    dark: Option<PyReadonlyArray4<'py, f32>>,
    mask_offsets: Option<Vec<f64>>,
    options: Options,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Retrieved<'py>> {
    let engine = engine.get(py)?;
    // SAFETY: the arrays are borrowed until this returns, and the stacks end with the work below.
    let (flat_stack, sample_stack) =
        unsafe { (of_array(py, "flat", &flat)?, of_array(py, "sample", &sample)?) };
    // SAFETY: as above.
    let dark_stack = dark.as_ref().map(|dark| unsafe { of_array(py, "dark", dark) }).transpose()?;
    let mut chosen = RetrieveOptions::default()
        .with_method(method(py, &options.method)?)
        .with_weights(weights(py, &options.weights)?)
        .with_steps(options.steps)
        .with_sample_offsets(options.sample_offsets);
    let found = interruptible(py, progress, |watch| {
        let work = || {
            let mut geometry = scene.scene()?;
            if let Some(offsets) = mask_offsets {
                geometry.scan.mask_offsets = offsets;
            }
            let (flat, sample, dark) = (flat_stack, sample_stack, dark_stack);
            let input = match kind {
                "counts" => Input::simulated_counts(&geometry, flat, sample, dark)?,
                "measured" => Input::measured(&geometry, flat, sample, dark.as_ref())?,
                _ => Input::simulated(&geometry, flat, sample),
            };
            let mut input = input.saturated_at(options.saturation);
            if let Some(path) = &options.bad_pixels {
                input = input.with_bad_pixels(path)?;
            }
            if input.counts() {
                let [gain, noise] = input.noise().unwrap_or([1.0, 0.0]);
                chosen = chosen
                    .with_gain(options.gain.unwrap_or(gain))
                    .with_read_noise(options.read_noise.unwrap_or(noise));
            } else if options.gain.is_some() || chosen.weights == Weights::Poisson {
                let allowed = "counts; gain and weights = \"poisson\" are for counts";
                return Err(Error::argument("weights", "intensities", allowed));
            }
            watch.rows("retrieve", |mut control| {
                retrieve_arrays(&engine, input, &chosen, &mut control)
            })
        };
        work().map_err(|error| scene.located(error))
    })?;
    let images = found.images.into_iter().map(|(name, it)| (name, it.into_pyarray(py)));
    Ok((images.collect(), json(&found.record)?, found.geometry))
}

/// Images by name, geometry as JSON, reach (rad), rays, pixels beyond the tolerances.
pub(crate) type Ideal<'py> = (BTreeMap<String, Bound<'py, PyArray3<f32>>>, String, f64, u64, u64);

/// Ideal images of a scene.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "options by name in Python")]
pub(crate) fn ideal<'py>(
    py: Python<'py>,
    engine: &Engine,
    scene: &Scene,
    reach: Option<f64>,
    tolerance: f64,
    angle_tolerance: f64,
    most_rays: usize,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Ideal<'py>> {
    let engine = engine.get(py)?;
    let options = IdealOptions::default()
        .with_reach(reach)
        .with_tolerance(tolerance)
        .with_angle_tolerance(angle_tolerance)
        .with_most_rays(most_rays);
    let found = interruptible(py, progress, |watch| {
        let work = || {
            let scene = scene.scene()?;
            watch.rows("ideal", |mut control| {
                beamlet::retrieve::ideal(&engine, &scene, &options, &mut control)
            })
        };
        work().map_err(|error| scene.located(error))
    })?;
    let images = found.images.into_iter().map(|(name, it)| (name, it.into_pyarray(py)));
    Ok((images.collect(), found.geometry, found.reach, found.rays, found.beyond_tolerance))
}
