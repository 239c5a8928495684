//! Retrieval from arrays.

use crate::engine::Engine;
use crate::errors::raised;
use crate::options::arguments;
use crate::scene::Scene;
use crate::stacks::{json, of_array};
use crate::work::interruptible;
use beamlet::Error;
use beamlet::cli_support::options::{Offsets, RetrieveArguments};
use beamlet::retrieve::{Input, retrieve_arrays};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;

/// Images by name, `[view][row][column]`, record of the retrieval and geometry of the views as JSON.
pub(crate) type Retrieved<'py> =
    (BTreeMap<String, Bound<'py, PyArray3<f32>>>, String, Option<String>);

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
    options: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Retrieved<'py>> {
    let engine = engine.get(py)?;
    let is_measured = kind == "measured";
    let given: RetrieveArguments =
        arguments("retrieve", options, |row| is_measured || !row.needs().contains(&"flat"))?;
    let steps = flat.shape()[1];
    let offsets = given.offsets.as_ref().map(Offsets::lengths).transpose();
    let offsets = offsets.map_err(|error| raised(py, &error))?;
    if let Some(offsets) = offsets.as_ref().filter(|offsets| offsets.len() != steps) {
        let allowed = format!("{}, as offsets", offsets.len());
        return Err(raised(py, &Error::argument("flat", format!("{steps} steps"), allowed)));
    }
    // SAFETY: the arrays are borrowed until this returns, and the stacks end with the work below.
    let (flat_stack, sample_stack) =
        unsafe { (of_array(py, "flat", &flat)?, of_array(py, "sample", &sample)?) };
    // SAFETY: as above.
    let dark_stack = dark.as_ref().map(|dark| unsafe { of_array(py, "dark", dark) }).transpose()?;
    let found = interruptible(py, progress, |watch| {
        let work = || {
            let mut geometry = scene.scene()?;
            if let Some(offsets) = offsets {
                geometry.scan.replace_offsets(offsets);
            }
            let (flat, sample, dark) = (flat_stack, sample_stack, dark_stack);
            let input = match kind {
                "counts" => Input::simulated_counts(&geometry, flat, sample, dark)?,
                "measured" => Input::measured(&geometry, flat, sample, dark.as_ref())?,
                _ => Input::simulated(&geometry, flat, sample),
            };
            let input = given.applied_to(input)?;
            let chosen = given.options(&input)?;
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
pub(crate) fn ideal<'py>(
    py: Python<'py>,
    engine: &Engine,
    scene: &Scene,
    options: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Ideal<'py>> {
    let engine = engine.get(py)?;
    let options: beamlet::IdealOptions = arguments("ideal", options, |_| true)?;
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
