//! Reconstruction of volumes, and the projector.

use crate::engine::Engine;
use crate::errors::raised;
use crate::work::interruptible;
use beamlet::Error;
use beamlet::ndarray::{Array2, Array3, ArrayView3};
use beamlet::reconstruct::{
    Data, FbpOptions, Filter, GridChoice, IterativeOptions, LostViews, Measured, Method, Model, PixelCounts,
    Quantity, ScanGeometry, Solver, VolumeGrid, deviation_weights, fill_images,
    prepare_sinograms, reaching_ends,
};
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
    lever: Option<f64>,
}

impl Circle {
    fn geometry(self) -> ScanGeometry {
        let mut geometry = ScanGeometry::new(self.distances, self.columns, self.rows, self.angles);
        geometry.axis = self.axis;
        geometry.lever = self.lever.unwrap_or(f64::INFINITY);
        geometry
    }
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
    fn of(self, py: Python<'_>, geometry: &ScanGeometry) -> PyResult<VolumeGrid> {
        let choice = GridChoice::default()
            .with_voxel(self.voxel)
            .with_size(self.size)
            .with_origin(self.origin);
        choice.grid(geometry).map_err(|error| raised(py, &error))
    }
}

/// Options of all methods; each method reads its own.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    method: String,
    filter: String,
    cut_off: f64,
    arm_passes: Option<usize>,
    extrapolate: bool,
    iterations: usize,
    discrepancy: Option<f64>,
    non_negative: bool,
    phase: bool,
    keep_views: bool,
}

/// The entry of a list that has this name.
fn named<T>(py: Python<'_>, option: &str, name: &str, all: &[(&str, T)]) -> PyResult<T>
where
    T: Copy,
{
    all.iter().find(|(known, _)| *known == name).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(known, _)| *known).collect();
        raised(py, &Error::argument(option, format!("{name:?}"), names.join(", ")))
    })
}

fn quantity(py: Python<'_>, name: &str) -> PyResult<Quantity> {
    let all =
        [("mu", Quantity::Mu), ("delta", Quantity::Delta), ("dark_field", Quantity::DarkField)];
    named(py, "quantity", name, &all)
}

const FILTERS: [(&str, Filter); 3] =
    [("ram-lak", Filter::RamLak), ("shepp-logan", Filter::SheppLogan), ("hann", Filter::Hann)];
const METHODS: [(&str, Option<Solver>); 4] = [
    ("fbp", None),
    ("cgls", Some(Solver::Cgls)),
    ("sirt", Some(Solver::Sirt)),
    ("bb", Some(Solver::Bb)),
];

impl Options {
    fn method(&self, py: Python<'_>) -> PyResult<Method> {
        let filter = named(py, "filter", &self.filter, &FILTERS)?;
        Ok(match named(py, "method", &self.method, &METHODS)? {
            None => Method::Fbp(
                FbpOptions::default()
                    .with_filter(filter)
                    .with_cut_off(self.cut_off)
                    .with_arm_passes(self.arm_passes)
                    .with_extrapolate(self.extrapolate),
            ),
            Some(solver) => {
                let options = IterativeOptions::default()
                    .with_solver(solver)
                    .with_iterations(self.iterations)
                    .with_discrepancy(self.discrepancy)
                    .with_non_negative(self.non_negative);
                Method::iterative(options, self.phase)
            }
        })
    }
}

/// Values `[z][y][x]`, sides of a voxel and centre of the first one, m, their unit, and of iterative
/// methods the residuals and the number of the iterate; numbers of views that lost their refraction.
type Reconstructed<'py> =
    (Bound<'py, PyArray3<f32>>, [f64; 3], [f64; 3], &'static str, Vec<f64>, usize, Vec<usize>);

/// Reconstructs sinograms `[view][row][column]`. `attenuation`: −ln of the transmission of the same pixels, which shows
/// bodies that reach an end of a row.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "options by name in Python")]
pub(crate) fn reconstruct<'py>(
    py: Python<'py>,
    engine: &Engine,
    circle: Circle,
    sinograms: PyReadonlyArray3<'py, f32>,
    of: &str,
    grid: Grid,
    options: Options,
    weights: Option<PyReadonlyArray3<'py, f32>>,
    mask: Option<PyReadonlyArray3<'py, bool>>,
    start: Option<PyReadonlyArray3<'py, f32>>,
    attenuation: Option<PyReadonlyArray3<'py, f32>>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Reconstructed<'py>> {
    let engine = engine.get(py)?;
    let quantity = quantity(py, of)?;
    let method = options.method(py)?;
    let geometry = circle.geometry();
    let grid = grid.of(py, &geometry)?;
    let sinograms = sinograms.as_array();
    let [weights, start] = [&weights, &start].map(|it| it.as_ref().map(|it| it.as_array()));
    let mask = mask.as_ref().map(|mask| mask.as_array());
    let attenuation = attenuation.as_ref().map(|it| it.as_array());
    let (volume, residuals, best, lost) = interruptible(py, progress, |watch| {
        watch.rows("reconstruct", |mut control| {
            method.check(quantity)?;
            let data = match quantity {
                Quantity::Mu => Data::Attenuation,
                Quantity::Delta => Data::Refraction,
                Quantity::DarkField => Data::DarkField,
            };
            let mut own = (None, None);
            let mut lost = Vec::new();
            if quantity == Quantity::Delta {
                let given = Given { geometry: &geometry, sinograms, weights, attenuation };
                (own, lost) = given.without_lost(&method, options.keep_views)?;
            }
            let measured = Measured::new(data, own.0.as_ref().map_or(sinograms, |it| it.view()))
                .with_weights(own.1.as_ref().map(|it| it.view()).or(weights))
                .with_mask(mask)
                .with_start(start);
            let made = method.volume(&engine, &geometry, &measured, &grid, &mut control)?;
            Ok((made.volume, made.residuals, made.best, lost))
        })
    })?;
    let unit = volume.quantity.unit();
    let values = volume.values.into_pyarray(py);
    Ok((values, grid.voxel, grid.origin, unit, residuals, best, lost))
}

/// Refraction angles with all that belongs to them, `[view][row][column]`.
struct Given<'a> {
    geometry: &'a ScanGeometry,
    sinograms: ArrayView3<'a, f32>,
    weights: Option<ArrayView3<'a, f32>>,
    attenuation: Option<ArrayView3<'a, f32>>,
}

/// Sinograms and weights in place of the given ones.
type Changed = (Option<Array3<f32>>, Option<Array3<f32>>);

impl Given<'_> {
    /// Sinograms and weights without views that lost their refraction, where there are any, and the numbers of these
    /// views.
    fn without_lost(&self, method: &Method, keep: bool) -> beamlet::Result<(Changed, Vec<usize>)> {
        let (views, rows, _) = self.sinograms.dim();
        let mut unknown = match self.attenuation {
            Some(attenuation) => reaching_ends(attenuation),
            None => Array2::default((views, rows)),
        };
        let known = self.weights.map(|weights| self.known(weights, &mut unknown)).transpose()?;
        let compared = known.as_ref().map_or(self.sinograms, |known| known.view());
        let mut lost = LostViews::find(self.geometry, compared, Some(unknown.view()))?;
        let numbers: Vec<usize> = lost.record().lost_views.iter().map(|of| of.view).collect();
        if numbers.is_empty() {
            return Ok(((None, None), numbers));
        }
        let mut sinograms = self.sinograms.to_owned();
        let weights = self.weights.map(|weights| weights.to_owned());
        let weights = lost.leave_out(self.geometry, (method, keep), &mut sinograms, weights)?;
        Ok(((Some(sinograms), weights), numbers))
    }

    /// Refraction angles, with values of weight 0, which may be anything, filled from the pixels beside them; views without
    /// any weight are unknown.
    fn known(
        &self,
        weights: ArrayView3<'_, f32>,
        unknown: &mut Array2<bool>,
    ) -> beamlet::Result<Array3<f32>> {
        let mut angles = self.sinograms.to_owned();
        if weights.dim() != angles.dim() {
            return Ok(angles);
        }
        for (view, (mut image, weights)) in
            angles.outer_iter_mut().zip(weights.outer_iter()).enumerate()
        {
            if weights.iter().all(|weight| *weight == 0.0) {
                image.fill(0.0);
                unknown.row_mut(view).fill(true);
                continue;
            }
            image.zip_mut_with(&weights, |angle, weight| {
                if *weight == 0.0 {
                    *angle = f32::NAN;
                }
            });
        }
        let places = [&self.geometry.columns, &self.geometry.rows].map(Vec::as_slice);
        Ok(fill_images(places, Quantity::Delta, angles.view(), None)?.0)
    }
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
        grid: Grid,
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
        let grid = grid.of(py, &geometry)?;
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
