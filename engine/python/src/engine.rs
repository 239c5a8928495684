//! The device: simulate, illuminate, check.

use crate::errors::raised;
use crate::scene::Scene;
use crate::stacks::{RunArrays, handed_over, json};
use crate::work::interruptible;
use beamlet::check::Check;
use beamlet::cli_support::start_threads;
use beamlet::moments::{MomentWriter, StoredMoments};
use beamlet::ndarray::ArrayView3;
use beamlet::scene::Exposure;
use beamlet::stack::{ArraySink, Format, RunDirectory, RunStart, Sink, Stacks, layout};
use beamlet::{EngineOptions, Error, Result, RunRecord, Tally};
use pyo3::prelude::*;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// A Vulkan device that serves many scenes, in any thread.
#[pyclass(frozen, module = "beamlet._beamlet")]
pub(crate) struct Engine {
    engine: Mutex<Option<beamlet::Engine>>,
    keep_moments: bool,
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
        keep_moments: bool,
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
            .with_keep_moments(keep_moments)
            .with_validation(validation)
            .with_profile(profile);
        let engine = interruptible(py, None, |_| beamlet::Engine::open(&options))?;
        Ok(Self { engine: Mutex::new(Some(engine)), keep_moments })
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

    /// Simulates a scene into arrays. `kept`: folder of its scene and moments.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        scene: &Scene,
        kept: Option<PathBuf>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<RunArrays<'py>> {
        let engine = self.get(py)?;
        let stacks = interruptible(py, progress, |watch| {
            let work = || {
                let Some(folder) = kept else {
                    let mut sink = ArraySink::new();
                    let scene = scene.scene()?;
                    watch.control(None, |control| engine.run(&scene, &mut sink, control))?;
                    return finished(sink);
                };
                let of_files = scene.scene_with_files(&folder)?;
                let mut keep = MomentWriter::new(&folder);
                let mut sink = KeptSink { folder, arrays: ArraySink::new() };
                watch.control(Some(&mut keep), |control| {
                    engine.run(&of_files, &mut sink, control)
                })?;
                finished(sink.arrays)
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
                let mut sink = sink.keep_moments(self.keep_moments).command("python");
                let mut keep = self.keep_moments.then(|| MomentWriter::new(&path));
                watch.control(keep.as_mut(), |control| {
                    let control = control.going_on(&sink);
                    engine.run(&scene, &mut sink, control)
                })
            };
            work().map_err(|error| scene.located(error))
        })?;
        json(&record)
    }

    /// Makes the stacks of a scene from the moments in `kept`.
    fn illuminate<'py>(
        &self,
        py: Python<'py>,
        kept: PathBuf,
        scene: &Scene,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<RunArrays<'py>> {
        let engine = self.get(py)?;
        let stacks = interruptible(py, progress, |watch| {
            let work = || {
                let moments = StoredMoments::open(&kept)?;
                let scene = scene.scene_with_files(&kept)?;
                let mut sink = ArraySink::new();
                watch.control(None, |mut control| {
                    let ready = engine.reilluminate_with(&moments, &scene, &mut control)?;
                    ready.run(&mut sink, control)
                })?;
                finished(sink)
            };
            work().map_err(|error| scene.located(error))
        })?;
        handed_over(py, stacks)
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
                watch.control(None, |mut control| check.run_with(&mut control))
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

/// Arrays, and the scene of the run in a folder, to which its moments belong.
struct KeptSink {
    folder: PathBuf,
    arrays: ArraySink,
}

impl Sink for KeptSink {
    fn begin(&mut self, scene: &beamlet::scene::Scene, start: &RunStart) -> Result<()> {
        let text = scene.to_toml(&self.folder, &start.mesh_hashes, &[])?;
        let path = self.folder.join(layout::SCENE);
        std::fs::write(&path, text)
            .map_err(|error| Error::file(&path, "cannot be written", Some(error)))?;
        self.arrays.begin(scene, start)
    }

    fn write(&mut self, view: Exposure, rows: Range<u32>, data: ArrayView3<'_, f32>) -> Result<()> {
        self.arrays.write(view, rows, data)
    }

    fn write_counts(
        &mut self,
        view: Exposure,
        rows: Range<u32>,
        numbers: ArrayView3<'_, f32>,
    ) -> Result<()> {
        self.arrays.write_counts(view, rows, numbers)
    }

    fn tally(&mut self, view: Exposure, tally: &Tally) -> Result<()> {
        self.arrays.tally(view, tally)
    }

    fn commit(&mut self, view: Exposure) -> Result<()> {
        self.arrays.commit(view)
    }

    fn finish(&mut self, record: &RunRecord) -> Result<()> {
        self.arrays.finish(record)
    }
}

/// Every device that Vulkan shows, as JSON.
#[pyfunction]
pub(crate) fn devices(py: Python<'_>) -> PyResult<String> {
    json(&interruptible(py, None, |_| beamlet::devices())?)
}
