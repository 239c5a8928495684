//! Errors of the engine as exceptions of `beamlet._errors`, with what they say as attributes.

use beamlet::Error;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The exception of an error.
pub(crate) fn raised(py: Python<'_>, error: &Error) -> PyErr {
    exception(py, error).map_or_else(|failed| failed, PyErr::from_value)
}

fn exception<'py>(py: Python<'py>, error: &Error) -> PyResult<Bound<'py, PyAny>> {
    let facts = PyDict::new(py);
    let name = match error {
        Error::Scene { place, key, found, allowed, .. } => {
            facts.set_item("key", key)?;
            facts.set_item("found", found)?;
            facts.set_item("allowed", allowed)?;
            facts.set_item("place", place.to_string())?;
            facts.set_item("file", place.file.as_ref())?;
            facts.set_item("line", place.line_column.map(|(line, _)| line))?;
            "SceneError"
        }
        Error::Several { .. } => {
            let each: Vec<_> =
                error.each().iter().map(|e| exception(py, e)).collect::<PyResult<_>>()?;
            facts.set_item("errors", each)?;
            "SceneError"
        }
        Error::Argument { name, found, allowed, .. } => {
            facts.set_item("key", name)?;
            facts.set_item("found", found)?;
            facts.set_item("allowed", allowed)?;
            "ArgumentError"
        }
        Error::Mesh { object, problem, place, .. } => {
            facts.set_item("key", object)?;
            facts.set_item("found", problem)?;
            facts.set_item("place", place)?;
            "MeshError"
        }
        Error::Device { wanted, found, remedy, .. } => {
            facts.set_item("key", wanted)?;
            facts.set_item("found", found)?;
            facts.set_item("remedy", remedy)?;
            "DeviceError"
        }
        Error::Memory { purpose, remedy, .. } => {
            facts.set_item("key", purpose)?;
            facts.set_item("remedy", remedy)?;
            "OutOfMemoryError"
        }
        Error::File { path, problem, .. } => {
            facts.set_item("file", path)?;
            facts.set_item("found", problem)?;
            "FileError"
        }
        Error::Tally(what) => {
            facts.set_item("found", what)?;
            "TallyError"
        }
        Error::Interrupted => "InterruptedWork",
        _ => "Error",
    };
    py.import("beamlet._errors")?
        .getattr("of_engine")?
        .call((name, error.to_string()), Some(&facts))
}
