//! Retrieval from arrays.

use crate::engine::Engine;
use crate::errors::raised;
use crate::scene::Scene;
use crate::stacks::{json, of_array};
use crate::work::interruptible;
use beamlet::Error;
use beamlet::retrieve::{
    Aperture, Background, Columns, Corrections, Input, Lattice, Method, Region, RetrieveOptions,
    Weights, retrieve_arrays,
};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray4};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Options of a retrieval, as `Images.retrieve` has them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    method: Option<String>,
    background: Option<String>,
    weights: String,
    gain: Option<f64>,
    read_noise: Option<f64>,
    saturation: Option<f32>,
    bad_pixels: Option<PathBuf>,
    flats_every: Option<u32>,
    omit_steps: Option<Vec<usize>>,
    columns: Option<String>,
    bin: Option<[usize; 2]>,
    empty_beam: Option<([usize; 2], Option<[usize; 2]>)>,
    correct: Option<String>,
    phase: bool,
    lattice: Option<String>,
    aperture: Option<String>,
    detector_aperture: Option<String>,
    offsets_z: Option<Vec<f64>>,
}

impl Options {
    /// Options of the engine; noise and saturation depend on the input.
    fn of_engine(&self, py: Python<'_>) -> PyResult<RetrieveOptions> {
        let correct = self.correct.as_deref().map(Corrections::parse).transpose();
        let correct = correct.map_err(|error| raised(py, &error))?;
        let region = |(columns, rows): ([usize; 2], Option<[usize; 2]>)| {
            Region::new(columns[0]..columns[1], rows.map(|rows| rows[0]..rows[1]))
        };
        let lattice = self.lattice.as_deref().map(Lattice::parse).transpose();
        let [aperture, detector_aperture] =
            [("aperture", &self.aperture), ("detector_aperture", &self.detector_aperture)].map(
                |(name, text)| text.as_deref().map(|text| Aperture::parse(name, text)).transpose(),
            );
        let chosen = RetrieveOptions::default()
            .with_lattice(lattice.map_err(|error| raised(py, &error))?)
            .with_aperture(aperture.map_err(|error| raised(py, &error))?)
            .with_detector_aperture(detector_aperture.map_err(|error| raised(py, &error))?)
            .with_offsets_z(self.offsets_z.clone().unwrap_or_default());
        let chosen = match &self.method {
            Some(name) => chosen.with_method(method(py, name)?),
            None => chosen,
        };
        let background = self.background.as_deref().map(str::parse::<Background>).transpose();
        Ok(chosen
            .with_background(background.map_err(|error| raised(py, &error))?)
            .with_weights(weights(py, &self.weights)?)
            .with_empty_beam(self.empty_beam.map(region))
            .with_correct(correct.unwrap_or_default())
            .with_phase(self.phase))
    }

    /// The input with the pixels and values that are kept of it.
    fn applied_to(&self, input: Input) -> beamlet::Result<Input> {
        let mut input = input.saturated_at(self.saturation);
        if let Some(path) = &self.bad_pixels {
            input = input.with_bad_pixels(path)?;
        }
        if self.columns.is_some() || self.bin.is_some() {
            let columns = self.columns.as_deref().map(Columns::parse).transpose()?;
            input = input.with_selection(columns, self.bin)?;
        }
        Ok(input)
    }

    /// The noise of the values: as given, else of the scene's detector.
    fn with_noise(
        &self,
        chosen: RetrieveOptions,
        input: &Input,
    ) -> beamlet::Result<RetrieveOptions> {
        if input.counts() {
            let of_scene = input.noise();
            let [gain, noise] = of_scene.unwrap_or([1.0, 0.0]);
            return Ok(chosen
                .with_gain(self.gain.unwrap_or(gain))
                .with_gain_assumed(self.gain.is_none() && of_scene.is_none())
                .with_read_noise(self.read_noise.unwrap_or(noise)));
        }
        let given = [
            ("gain", self.gain.is_some()),
            ("read_noise", self.read_noise.is_some()),
            ("weights", chosen.weights == Weights::Poisson),
        ];
        match given.into_iter().find(|(_, given)| *given) {
            None => Ok(chosen),
            Some((name, _)) => {
                let allowed = "counts; gain, read_noise and weights=\"poisson\" are for counts";
                Err(Error::argument(name, "intensities", allowed))
            }
        }
    }
}

/// Images by name, `[view][row][column]`, record of the retrieval and geometry of the views as JSON.
pub(crate) type Retrieved<'py> =
    (BTreeMap<String, Bound<'py, PyArray3<f32>>>, String, Option<String>);

fn method(py: Python<'_>, name: &str) -> PyResult<Method> {
    let names = Method::ALL.map(Method::name).join(", ");
    Method::ALL
        .into_iter()
        .find(|it| it.name() == name)
        .ok_or_else(|| raised(py, &Error::argument("method", format!("{name:?}"), names)))
}

fn weights(py: Python<'_>, name: &str) -> PyResult<Weights> {
    match name {
        "none" => Ok(Weights::None),
        "poisson" => Ok(Weights::Poisson),
        _ => Err(raised(py, &Error::argument("weights", format!("{name:?}"), "none, poisson"))),
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
    let chosen = options.of_engine(py)?;
    let found = interruptible(py, progress, |watch| {
        let work = || {
            let mut geometry = scene.scene()?;
            if let Some(offsets) = mask_offsets {
                geometry.scan.replace_offsets(offsets);
            }
            let (flat, sample, dark) = (flat_stack, sample_stack, dark_stack);
            let input = match kind {
                "counts" => Input::simulated_counts(&geometry, flat, sample, dark)?,
                "measured" => Input::measured(&geometry, flat, sample, dark.as_ref())?
                    .without_steps(options.omit_steps.as_deref().unwrap_or_default())?
                    .with_flats_every(options.flats_every),
                _ => Input::simulated(&geometry, flat, sample),
            };
            let input = options.applied_to(input)?;
            let chosen = options.with_noise(chosen, &input)?;
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
    let options = beamlet::IdealOptions::default()
        .with_reach(reach)
        .with_tolerance(tolerance)
        .with_angle_tolerance(angle_tolerance)
        .with_most_rays(most_rays);
    let found = interruptible(py, progress, |watch| {
        let work = || {
            let scene = scene.scene()?;
            watch.rows("ideal", |mut control| {
                beamlet::ideal(&engine, &scene, &options, &mut control)
            })
        };
        work().map_err(|error| scene.located(error))
    })?;
    let images = found.images.into_iter().map(|(name, it)| (name, it.into_pyarray(py)));
    Ok((images.collect(), found.geometry, found.reach, found.rays, found.beyond_tolerance))
}
