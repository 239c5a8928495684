//! `beamlet._beamlet`: the engine for Python. `python/beamlet` wraps it; nothing else uses it.
//!
//! | file | holds |
//! |---|---|
//! | `errors.rs` | errors of the engine as exceptions of `beamlet._errors` |
//! | `work.rs` | long work on a thread: signals, progress, its end with the process |
//! | `scene.rs` | scenes, and meshes given as arrays |
//! | `stacks.rs` | arrays of numpy from and to the engine |
//! | `engine.rs` | the device: simulate, check |
//! | `options.rs` | options of verbs from keywords, by their tables |
//! | `retrieve.rs` | retrieval |
//! | `reconstruct.rs` | scans, sinograms and the projector |
//! | `volume.rs` | volumes |
//! | `sweep.rs` | designs of a scene |
//! | `files.rs` | run directories and stacks in files |
//! | `physics.rs` | materials and spectra; differences of files |

mod engine;
mod errors;
mod files;
mod options;
mod physics;
mod reconstruct;
mod retrieve;
mod scene;
mod stacks;
mod sweep;
mod volume;
mod work;

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the program `beamlet` with these arguments and returns its exit code. Once in a process.
#[pyfunction]
fn program(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| beamlet_program::run(words))
}

/// The engine of beamlet.
#[pymodule]
fn _beamlet(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<engine::Engine>()?;
    module.add_class::<scene::Scene>()?;
    module.add_function(wrap_pyfunction!(program, module)?)?;
    module.add_function(wrap_pyfunction!(work::stop, module)?)?;
    module.add_function(wrap_pyfunction!(engine::devices, module)?)?;
    module.add_function(wrap_pyfunction!(files::open_run, module)?)?;
    module.add_function(wrap_pyfunction!(files::read_images, module)?)?;
    module.add_function(wrap_pyfunction!(files::read_stack, module)?)?;
    module.add_function(wrap_pyfunction!(files::memory_size, module)?)?;
    module.add_function(wrap_pyfunction!(options::keywords, module)?)?;
    module.add_function(wrap_pyfunction!(retrieve::retrieve, module)?)?;
    module.add_class::<reconstruct::Projector>()?;
    module.add_function(wrap_pyfunction!(volume::reconstruct, module)?)?;
    module.add_function(wrap_pyfunction!(reconstruct::fill, module)?)?;
    module.add_function(wrap_pyfunction!(reconstruct::prepare, module)?)?;
    module.add_function(wrap_pyfunction!(reconstruct::weights, module)?)?;
    module.add_function(wrap_pyfunction!(retrieve::ideal, module)?)?;
    module.add_function(wrap_pyfunction!(physics::material, module)?)?;
    module.add_function(wrap_pyfunction!(physics::spectrum, module)?)?;
    module.add_function(wrap_pyfunction!(physics::compare, module)?)?;
    module.add_function(wrap_pyfunction!(sweep::sweep, module)?)?;
    Ok(())
}
