//! The device: simulate, check.

use crate::errors::raised;
use crate::scene::Scene;
use crate::stacks::{RunArrays, handed_over, json};
use crate::work::interruptible;
use beamlet::check::Check;
use beamlet::cli_support::start_threads;
use beamlet::stack::{ArraySink, Format, RunDirectory, Stacks};
use beamlet::{EngineOptions, Error, Result};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// A Vulkan device that serves many scenes, in any thread.
#[pyclass(frozen, module = "beamlet._beamlet")]
pub(crate) struct Engine {
    engine: Mutex<Option<beamlet::Engine>>,
}

/// A word of an option as its type.
pub(crate) fn word<T: for<'a> serde::Deserialize<'a>>(
    py: Python<'_>,
    option: &str,
    word: &str,
    allowed: &str,
) -> PyResult<T> {
    serde_json::from_value(word.into())
        .map_err(|_| raised(py, &Error::argument(option, format!("{word:?}"), allowed)))
}

impl Engine {
    /// The engine, unless it is closed.
    pub(crate) fn get(&self, py: Python<'_>) -> PyResult<beamlet::Engine> {
        start_threads().map_err(|error| raised(py, &error))?;
        let engine = self.engine.lock().unwrap_or_else(PoisonError::into_inner).clone();
        engine.ok_or_else(|| {
            raised(py, &Error::device("the engine", "it is closed", "open another Engine"))
        })
    }
}

#[pymethods]
impl Engine {
    /// Opens a device.
    #[new]
    fn new(
        py: Python<'_>,
        device: Option<String>,
        backend: Option<&str>,
        memory_limit: Option<u64>,
        validation: bool,
        profile: bool,
    ) -> PyResult<Self> {
        let backend: Option<beamlet::Backend> = match backend {
            None | Some("auto") => None,
            Some(name) => Some(word(py, "backend", name, "auto, bvh, ray-query")?),
        };
        let options = EngineOptions::default()
            .with_device(device)
            .with_backend(backend)
            .with_memory_limit(memory_limit)
            .with_validation(validation)
            .with_profile(profile);
        let engine = interruptible(py, None, |_| beamlet::Engine::open(&options))?;
        Ok(Self { engine: Mutex::new(Some(engine)) })
    }

    /// Description of the device as JSON.
    fn description(&self, py: Python<'_>) -> PyResult<String> {
        json(self.get(py)?.description())
    }

    /// Work of the device since it was opened, as JSON.
    fn profile(&self, py: Python<'_>) -> PyResult<String> {
        json(&self.get(py)?.profile())
    }

    /// Closes the device. Returns whether it is destroyed.
    fn close(&self, py: Python<'_>) -> bool {
        let engine = self.engine.lock().unwrap_or_else(PoisonError::into_inner).take();
        py.detach(|| engine.is_none_or(beamlet::Engine::close))
    }

    /// Simulates a scene into arrays.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        scene: &Scene,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<RunArrays<'py>> {
        let engine = self.get(py)?;
        let stacks = interruptible(py, progress, |watch| {
            let work = || {
                let mut sink = ArraySink::new();
                let scene = scene.scene()?;
                watch.control(|control| engine.run(&scene, &mut sink, control))?;
                finished(sink)
            };
            work().map_err(|error| scene.located(error))
        })?;
        handed_over(py, stacks)
    }

    /// Simulates a scene into a run directory; meshes given as arrays go into `meshes`. Returns the
    /// record of the run as JSON.
    #[expect(clippy::too_many_arguments, reason = "options by name in Python")]
    fn simulate_to(
        &self,
        py: Python<'_>,
        scene: &Scene,
        path: PathBuf,
        meshes: PathBuf,
        format: &str,
        overwrite: bool,
        resume: bool,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<String> {
        let engine = self.get(py)?;
        let format: Format = word(py, "format", format, "exr, npy, tiff")?;
        let record = interruptible(py, progress, |watch| {
            let work = || {
                let mut scene = scene.scene_with_files(&meshes)?;
                let sink = if resume {
                    scene = RunDirectory::scene_of_resumed(&path, &scene)?;
                    RunDirectory::resume(&path, &scene)?
                } else {
                    if overwrite {
                        RunDirectory::reading(&path, &scene.input_files())?;
                    }
                    RunDirectory::create(&path, format, overwrite)?
                };
                let mut sink = sink.command("python");
                watch.control(|control| {
                    let control = control.going_on(&sink);
                    engine.run(&scene, &mut sink, control)
                })
            };
            work().map_err(|error| scene.located(error))
        })?;
        json(&record)
    }

    /// Checks a scene: the report as text and as JSON.
    fn check(
        &self,
        py: Python<'_>,
        scene: &Scene,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(String, String)> {
        let engine = self.get(py)?;
        let report = interruptible(py, progress, |watch| {
            let work = || {
                let scene = scene.scene()?;
                let check = Check::of(&scene).with_engine(&engine);
                watch.control(|mut control| check.run_with(&mut control))
            };
            work().map_err(|error| scene.located(error))
        })?;
        Ok((report.to_string(), json(&report)?))
    }
}

/// The stacks of a run that has ended.
fn finished(sink: ArraySink) -> Result<Stacks> {
    sink.into_stacks().ok_or(Error::Interrupted)
}

/// Every device that Vulkan shows, as JSON.
#[pyfunction]
pub(crate) fn devices(py: Python<'_>) -> PyResult<String> {
    json(&interruptible(py, None, |_| beamlet::devices())?)
}
