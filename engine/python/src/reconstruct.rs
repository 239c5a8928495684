//! Reconstruction of volumes.

use crate::engine::Engine;
use crate::errors::raised;
use crate::work::interruptible;
use beamlet::Error;
use beamlet::reconstruct::{FbpOptions, Filter, Quantity, ScanGeometry, VolumeGrid};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;

/// A scan on a circle, m and rad.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Circle {
    distances: [f64; 2],
    columns: Vec<f64>,
    rows: Vec<f64>,
    angles: Vec<f64>,
    axis: f64,
}

/// Voxels; what is `None` follows from the scan.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Grid {
    size: Option<[usize; 3]>,
    voxel: Option<f64>,
    origin: Option<[f64; 3]>,
}

impl Grid {
    /// A grid about the axis of rotation that covers the field of view.
    fn of(self, geometry: &ScanGeometry) -> beamlet::Result<VolumeGrid> {
        let whole = VolumeGrid::of(geometry)?;
        let voxel = self.voxel.map_or(whole.voxel, |side| [side; 3]);
        if !voxel.iter().all(|side| side.is_finite() && *side > 0.0) {
            let found = format!("{} m", voxel[0]);
            return Err(Error::argument("voxel", found, "a length above 0"));
        }
        let count = |axis: usize| {
            let voxels = whole.voxel[axis] * whole.size[axis] as f64 / voxel[axis];
            // A cast of a number above 0; what is too many for memory is an error below.
            (voxels - 1e-6).ceil().max(1.0) as usize
        };
        let size = self.size.unwrap_or_else(|| [0, 1, 2].map(count));
        let middle = |axis: usize| {
            whole.origin[axis] + whole.voxel[axis] * (whole.size[axis] as f64 - 1.0) / 2.0
        };
        let corner = |axis: usize| middle(axis) - voxel[axis] * (size[axis] as f64 - 1.0) / 2.0;
        Ok(VolumeGrid { size, voxel, origin: self.origin.unwrap_or([0, 1, 2].map(corner)) })
    }
}

fn quantity(py: Python<'_>, name: &str) -> PyResult<Quantity> {
    match name {
        "mu" => Ok(Quantity::Mu),
        "delta" => Ok(Quantity::Delta),
        "dark_field" => Ok(Quantity::DarkField),
        _ => Err(raised(
            py,
            &Error::argument("quantity", format!("{name:?}"), "mu, delta, dark_field"),
        )),
    }
}

fn filter(py: Python<'_>, name: &str) -> PyResult<Filter> {
    match name {
        "ram-lak" => Ok(Filter::RamLak),
        "shepp-logan" => Ok(Filter::SheppLogan),
        "hann" => Ok(Filter::Hann),
        _ => Err(raised(
            py,
            &Error::argument("filter", format!("{name:?}"), "ram-lak, shepp-logan, hann"),
        )),
    }
}

/// Values `[z][y][x]`, sides of a voxel and centre of the first one, m, and their unit.
type Reconstructed<'py> = (Bound<'py, PyArray3<f32>>, [f64; 3], [f64; 3], &'static str);

/// Filtered back-projection of sinograms `[view][row][column]`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "options by name in Python")]
pub(crate) fn fbp<'py>(
    py: Python<'py>,
    engine: &Engine,
    circle: Circle,
    sinograms: PyReadonlyArray3<'py, f32>,
    of: &str,
    grid: Grid,
    window: &str,
    cut_off: f64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Reconstructed<'py>> {
    let engine = engine.get(py)?;
    let (quantity, filter) = (quantity(py, of)?, filter(py, window)?);
    let Circle { distances, columns, rows, angles, axis } = circle;
    let mut geometry = ScanGeometry::new(distances, columns, rows, angles);
    geometry.axis = axis;
    let grid = grid.of(&geometry).map_err(|error| raised(py, &error))?;
    let options = FbpOptions::default().with_filter(filter).with_cut_off(cut_off);
    let sinograms = sinograms.as_array();
    let volume = interruptible(py, progress, |watch| {
        watch.rows("reconstruct", |mut control| {
            beamlet::reconstruct::fbp(
                &engine,
                &geometry,
                sinograms,
                quantity,
                &grid,
                &options,
                &mut control,
            )
        })
    })?;
    let unit = volume.quantity.unit();
    Ok((volume.values.into_pyarray(py), grid.voxel, grid.origin, unit))
}
