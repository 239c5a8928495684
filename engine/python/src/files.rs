//! Run directories and stacks in files; sizes of memory as text.

use crate::errors::raised;
use crate::retrieve::Retrieved;
use crate::stacks::json;
use crate::work::interruptible;
use beamlet::Error;
use beamlet::ndarray::{Array4, Axis, stack};
use beamlet::retrieve::Record;
use beamlet::stack::{GeometryFile, Maps, OpenRun, StackFile, layout};
use numpy::{IntoPyArray, PyArray4};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// File or folder of a stack, and its views, steps, rows and columns.
type Place = (PathBuf, [usize; 4]);
/// Flat and sample, their counts and dark frames, and the record of the run as JSON.
type Opened = (Place, Place, Option<(Place, Place, Option<Place>)>, String);

fn place(stack: &StackFile) -> Place {
    (stack.path().to_path_buf(), stack.shape())
}

/// Opens a run directory.
#[pyfunction]
pub(crate) fn open_run(py: Python<'_>, path: PathBuf) -> PyResult<Opened> {
    let opened = || {
        let run = OpenRun::open(&path)?;
        let dark = run.dark()?.as_ref().map(place);
        let counts = match (run.counts_flat()?, run.counts_sample()?) {
            (Some(flat), Some(sample)) => Some((place(&flat), place(&sample), dark)),
            _ => None,
        };
        Ok((place(&run.flat()?), place(&run.sample()?), counts, run.record().clone()))
    };
    let (flat, sample, counts, record) = opened().map_err(|error: Error| raised(py, &error))?;
    Ok((flat, sample, counts, json(&record)?))
}

/// Reads the first `views` views of a stack of `steps` steps, `[view][step][row][column]`.
#[pyfunction]
pub(crate) fn read_stack<'py>(
    py: Python<'py>,
    path: PathBuf,
    steps: usize,
    views: usize,
) -> PyResult<Bound<'py, PyArray4<f32>>> {
    let values = interruptible(py, None, |watch| {
        let stack = StackFile::open(&path)?.with_steps(steps)?;
        let [_, _, rows, columns] = stack.shape();
        let purpose = || Error::argument("run", "stacks beyond the memory", "format npy is mapped");
        let mut all = Vec::new();
        let count = [views, steps, rows, columns].iter().product();
        all.try_reserve_exact(count).map_err(|_| purpose())?;
        for view in 0..views {
            watch.check()?;
            all.extend(stack.view(view)?.iter());
        }
        Array4::from_shape_vec((views, steps, rows, columns), all).map_err(|_| purpose())
    })?;
    Ok(values.into_pyarray(py))
}

/// Images of a run directory or of a folder of retrieved images, with record and geometry.
#[pyfunction]
pub(crate) fn read_images(py: Python<'_>, path: PathBuf) -> PyResult<Retrieved<'_>> {
    let folder = match layout::is_run(&path) {
        true => path.join(layout::RETRIEVED),
        false => path,
    };
    let (record, geometry, images) = interruptible(py, None, |watch| {
        let record = Record::read(&folder.join(layout::RECORD))?;
        let geometry = match folder.join(layout::GEOMETRY).exists() {
            true => Some(GeometryFile::read(&folder)?),
            false => None,
        };
        let maps = Maps::open(&folder)?;
        let mut images = BTreeMap::new();
        for name in maps.names() {
            watch.check()?;
            let views = match name.contains("flat") {
                true => 1,
                false => maps.views(),
            };
            let views: Vec<_> =
                (0..views).map(|view| maps.map(name, view)).collect::<beamlet::Result<_>>()?;
            let views: Vec<_> = views.iter().map(|image| image.view()).collect();
            let stack = stack(Axis(0), &views)
                .map_err(|error| Error::argument(name, error.to_string(), "one shape"))?;
            images.insert(name.to_owned(), stack);
        }
        Ok((record, geometry, images))
    })?;
    let images = images.into_iter().map(|(name, it)| (name, it.into_pyarray(py))).collect();
    Ok((images, json(&record)?, geometry.as_ref().map(json).transpose()?))
}

/// Bytes of a size of memory such as "2 GiB".
#[pyfunction]
pub(crate) fn memory_size(py: Python<'_>, text: &str) -> PyResult<u64> {
    beamlet::cli_support::units::memory_size(text)
        .map_err(|error| raised(py, &Error::argument("memory_limit", error.found, error.allowed)))
}
