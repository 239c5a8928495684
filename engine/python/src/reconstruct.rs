//! Scans and voxels of reconstructions, sinograms of images, and the projector.

use crate::engine::Engine;
use crate::errors::raised;
use crate::options::arguments;
use crate::work::interruptible;
use beamlet::Error;
use beamlet::cli_support::options::ReconstructArguments;
use beamlet::reconstruct::{
    Data, Model, PixelCounts, Quantity, ScanGeometry, VolumeGrid, deviation_weights, fill_images,
    prepare_sinograms,
};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A scan on a circle, m and rad.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Circle {
    distances: [f64; 2],
    columns: Vec<f64>,
    rows: Vec<f64>,
    angles: Vec<f64>,
    axis: f64,
    lever: Option<f64>,
}

impl Circle {
    pub(crate) fn geometry(self) -> ScanGeometry {
        let mut geometry = ScanGeometry::new(self.distances, self.columns, self.rows, self.angles);
        geometry.axis = self.axis;
        geometry.lever = self.lever.unwrap_or(f64::INFINITY);
        geometry
    }
}

/// The entry of a list that has this name.
pub(crate) fn named<T>(py: Python<'_>, option: &str, name: &str, all: &[(&str, T)]) -> PyResult<T>
where
    T: Copy,
{
    all.iter().find(|(known, _)| *known == name).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(known, _)| *known).collect();
        raised(py, &Error::argument(option, format!("{name:?}"), names.join(", ")))
    })
}

pub(crate) fn quantity(py: Python<'_>, name: &str) -> PyResult<Quantity> {
    let all =
        [("mu", Quantity::Mu), ("delta", Quantity::Delta), ("dark_field", Quantity::DarkField)];
    named(py, "quantity", name, &all)
}

/// Pixels in all; without a result, not above 0, and misfits.
type Counted = (u64, u64, u64, u64);

/// Sinograms of a retrieved image `[view][row][column]`: -ln of transmissions, pixels without a value
/// filled, and their numbers.
#[pyfunction]
pub(crate) fn prepare<'py>(
    py: Python<'py>,
    circle: Circle,
    of: &str,
    image: PyReadonlyArray3<'py, f32>,
    flags: Option<PyReadonlyArray3<'py, f32>>,
) -> PyResult<(Bound<'py, PyArray3<f32>>, Counted)> {
    let (quantity, geometry) = (quantity(py, of)?, circle.geometry());
    let (image, flags) = (image.as_array(), flags.as_ref().map(|flags| flags.as_array()));
    let (sinograms, counts) =
        interruptible(py, None, |_| prepare_sinograms(&geometry, quantity, image, flags))?;
    let PixelCounts { pixels, without_answer, dark, misfits, .. } = counts;
    Ok((sinograms.into_pyarray(py), (pixels, without_answer, dark, misfits)))
}

/// A retrieved image `[view][row][column]` with the values of its sinograms where it has none, and their number.
#[pyfunction]
pub(crate) fn fill<'py>(
    py: Python<'py>,
    places: [Vec<f64>; 2],
    of: &str,
    image: PyReadonlyArray3<'py, f32>,
    flags: Option<PyReadonlyArray3<'py, f32>>,
) -> PyResult<(Bound<'py, PyArray3<f32>>, u64)> {
    let quantity = quantity(py, of)?;
    let (image, flags) = (image.as_array(), flags.as_ref().map(|flags| flags.as_array()));
    let places = places.each_ref().map(Vec::as_slice);
    let (filled, count) = interruptible(py, None, |_| fill_images(places, quantity, image, flags))?;
    Ok((filled.into_pyarray(py), count))
}

/// Weights of values by their standard deviations, `[view][row][column]`.
#[pyfunction]
pub(crate) fn weights<'py>(
    py: Python<'py>,
    sigmas: PyReadonlyArray3<'py, f32>,
) -> Bound<'py, PyArray3<f32>> {
    deviation_weights(sigmas.as_array().to_owned()).into_pyarray(py)
}

/// The projector of a scan and its transpose.
#[pyclass(frozen, module = "beamlet._beamlet")]
pub(crate) struct Projector {
    model: Model,
    grid: VolumeGrid,
    shape: [usize; 3],
    unit: &'static str,
    volume_unit: &'static str,
}

#[pymethods]
impl Projector {
    #[new]
    fn new(
        py: Python<'_>,
        engine: &Engine,
        circle: Circle,
        data: &str,
        options: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let engine = engine.get(py)?;
        let all = [
            ("attenuation", (Data::Attenuation, "1")),
            ("refraction", (Data::Refraction, "rad")),
            ("phase", (Data::Phase, "m")),
            ("dark_field", (Data::DarkField, "rad²")),
        ];
        let (data, unit) = named(py, "data", data, &all)?;
        let geometry = circle.geometry();
        let options: ReconstructArguments =
            arguments("Projector", options, |row| ["voxel", "size", "origin"].contains(&row.name))?;
        let grid = options.grid().grid(&geometry).map_err(|error| raised(py, &error))?;
        let shape = geometry.shape();
        let model = interruptible(py, None, |_| Model::new(&engine, &geometry, &grid, data, None))?;
        Ok(Self { model, grid, shape, unit, volume_unit: data.quantity().unit() })
    }

    /// Sinograms `[view][row][column]` of a volume `[z][y][x]`.
    fn project<'py>(
        &self,
        py: Python<'py>,
        volume: PyReadonlyArray3<'py, f32>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let volume = volume.as_array();
        let found = interruptible(py, progress, |watch| {
            watch.rows("project", |mut control| self.model.project(volume, &mut control))
        })?;
        Ok(found.into_pyarray(py))
    }

    /// The transpose: a volume `[z][y][x]` of sinograms `[view][row][column]`.
    fn transpose<'py>(
        &self,
        py: Python<'py>,
        sinograms: PyReadonlyArray3<'py, f32>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let sinograms = sinograms.as_array();
        let found = interruptible(py, progress, |watch| {
            watch.rows("project back", |mut control| self.model.transpose(sinograms, &mut control))
        })?;
        Ok(found.into_pyarray(py))
    }

    /// Views, rows and columns.
    #[getter]
    fn sinograms(&self) -> [usize; 3] {
        self.shape
    }

    /// Voxels along x, y and z.
    #[getter]
    fn size(&self) -> [usize; 3] {
        self.grid.size
    }

    /// Sides of a voxel, m.
    #[getter]
    fn voxel(&self) -> [f64; 3] {
        self.grid.voxel
    }

    /// Centre of the first voxel, m.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.grid.origin
    }

    /// Units of sinograms and volume.
    #[getter]
    fn units(&self) -> (&'static str, &'static str) {
        (self.unit, self.volume_unit)
    }
}
