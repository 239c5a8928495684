//! Arrays of numpy from and to the engine.

use beamlet::ndarray::{Array3, Array4, Axis, concatenate};
use beamlet::stack::{StackFile, Stacks};
use numpy::{IntoPyArray, PyArray4, PyArrayDyn, PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Counts of flat, sample and dark frames.
pub(crate) type CountArrays<'py> =
    (Bound<'py, PyArrayDyn<f32>>, Bound<'py, PyArray4<f32>>, Bound<'py, PyArrayDyn<f32>>);
/// Flat, sample, counts, and the record of the run as JSON.
pub(crate) type RunArrays<'py> =
    (Bound<'py, PyArrayDyn<f32>>, Bound<'py, PyArray4<f32>>, Option<CountArrays<'py>>, String);

/// Hands stacks to Python; their memory goes along.
pub(crate) fn handed_over(py: Python<'_>, stacks: Stacks) -> PyResult<RunArrays<'_>> {
    let all = |first: Array3<f32>, later: Array4<f32>| one_or_all(py, first, &later);
    let counts = match stacks.counts {
        None => None,
        Some(of) => Some((
            all(of.flat, of.later_flats)?,
            of.sample.into_pyarray(py),
            all(of.dark, of.later_darks)?,
        )),
    };
    let flat = all(stacks.flat, stacks.later_flats)?;
    Ok((flat, stacks.sample.into_pyarray(py), counts, json(&stacks.record)?))
}

/// A flat or dark `[step][row][column]`, or several of them `[index][step][row][column]`.
fn one_or_all<'py>(
    py: Python<'py>,
    first: Array3<f32>,
    later: &Array4<f32>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    if later.is_empty() {
        return Ok(first.into_dyn().into_pyarray(py));
    }
    let all = concatenate(Axis(0), &[first.view().insert_axis(Axis(0)), later.view()])
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(all.into_dyn().into_pyarray(py))
}

/// A value as JSON.
pub(crate) fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Values of numpy, as the engine's threads read them.
struct Values {
    first: *const f32,
    len: usize,
}

// SAFETY: it reads alone; `of_array` says how long the memory lives.
unsafe impl Send for Values {}
// SAFETY: as above.
unsafe impl Sync for Values {}

impl Values {
    fn part(&self, from: usize, to: usize) -> &[f32] {
        let to = to.min(self.len);
        let from = from.min(to);
        // SAFETY: within the array, which is contiguous and lives as `of_array` says.
        unsafe { std::slice::from_raw_parts(self.first.add(from), to - from) }
    }
}

/// A stack `[view][step][row][column]` over the memory of an array.
///
/// # Safety
/// The array must outlive the stack, and nothing may write to it meanwhile.
///
/// # Errors
/// Where it is not contiguous or has no values.
pub(crate) unsafe fn of_array(
    py: Python<'_>,
    name: &str,
    array: &PyReadonlyArray4<'_, f32>,
) -> PyResult<StackFile> {
    let [views, steps, rows, columns] = *array.shape() else {
        return Err(PyValueError::new_err(format!("{name}: four sides are allowed")));
    };
    let slice =
        array.as_slice().map_err(|error| PyValueError::new_err(format!("{name}: {error}")))?;
    let values = Values { first: slice.as_ptr(), len: slice.len() };
    let frame = rows * columns;
    let read = move |index: usize, range: std::ops::Range<usize>| {
        let from = index * frame;
        Ok(values.part(from + range.start * columns, from + range.end * columns).to_vec())
    };
    StackFile::of_values(name, [views, steps, rows, columns], read)
        .map_err(|error| crate::errors::raised(py, &error))
}
