//! Volumes of sinograms: corrections, the method, truth.

use crate::engine::Engine;
use crate::lost_views::Angles;
use crate::reconstruct::{Circle, Grid, named, quantity};
use crate::scene::Scene;
use crate::work::interruptible;
use beamlet::ndarray::{Array3, ArrayView3};
use beamlet::reconstruct::{
    BeamHardening, Data, FbpOptions, Filter, HardeningChoice, IterativeOptions, Measured, Method,
    Quantity, ScanGeometry, Solver, Volume, VolumeGrid, VoxelMask, add_gradient_bias, find_axis,
    gradient_bias, suppress_rings,
};
use beamlet::{Error, RowsControl};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use std::collections::BTreeMap;

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
    find_centre: bool,
    rings: bool,
    /// Material, and the energy of μ, keV.
    beam_hardening: Option<(String, Option<f64>)>,
    truth: bool,
    /// Shape of the voxels that may differ from zero, or a file.
    mask_shape: Option<String>,
    /// Width of the curves without sample, m, for the bias by gradients of μ.
    flat_width: Option<f64>,
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

/// Arrays beside the sinograms: `[view][row][column]` weights and −ln T, `[z][y][x]` all others.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Given<'py> {
    weights: Option<PyReadonlyArray3<'py, f32>>,
    mask: Option<PyReadonlyArray3<'py, bool>>,
    start: Option<PyReadonlyArray3<'py, f32>>,
    /// −ln T of the pixels of refraction angles.
    attenuation: Option<PyReadonlyArray3<'py, f32>>,
    /// Volume of μ by which δ is corrected for gradients of μ.
    mu: Option<PyReadonlyArray3<'py, f32>>,
}

/// Views of [`Given`].
struct Views<'a> {
    weights: Option<ArrayView3<'a, f32>>,
    mask: Option<ArrayView3<'a, bool>>,
    start: Option<ArrayView3<'a, f32>>,
    attenuation: Option<ArrayView3<'a, f32>>,
    mu: Option<ArrayView3<'a, f32>>,
}

/// The values of an array, if there is one.
fn view<'a>(array: &'a Option<PyReadonlyArray3<'_, f32>>) -> Option<ArrayView3<'a, f32>> {
    array.as_ref().map(|array| array.as_array())
}

impl Given<'_> {
    fn views(&self) -> Views<'_> {
        Views {
            weights: view(&self.weights),
            mask: self.mask.as_ref().map(|mask| mask.as_array()),
            start: view(&self.start),
            attenuation: view(&self.attenuation),
            mu: view(&self.mu),
        }
    }
}

impl Views<'_> {
    /// Refuses arrays of pixels of another shape than the sinograms.
    fn check(&self, sinograms: &Array3<f32>) -> beamlet::Result<()> {
        let of_pixels = [("weights", &self.weights), ("attenuation", &self.attenuation)];
        let wanted = sinograms.dim();
        for (name, given) in of_pixels {
            if let Some(found) = given.map(|given| given.dim()).filter(|found| *found != wanted) {
                return Err(Error::argument(
                    name,
                    format!("shape {found:?}"),
                    format!("{wanted:?}, the shape of sinograms"),
                ));
            }
        }
        Ok(())
    }
}

/// Scene on the voxels.
struct TrueVolume {
    labels: Array3<u16>,
    names: BTreeMap<u32, String>,
    values: Option<Array3<f32>>,
    errors: String,
}

/// A volume with the results beside it.
struct Made {
    volume: Volume,
    residuals: Vec<f64>,
    best: usize,
    truth: Option<TrueVolume>,
    /// x of the axis of rotation, m.
    axis: f64,
    /// Energy of μ after the correction of beam hardening, keV.
    energy: Option<f64>,
    /// Length k of the bias of δ, m.
    bias: Option<f64>,
    /// Numbers of the views that lost their refraction.
    lost_views: Vec<usize>,
}

/// A reconstruction in work.
struct Work<'a> {
    engine: &'a beamlet::Engine,
    of: Quantity,
    method: Method,
    options: &'a Options,
    given: Views<'a>,
    scene: Option<&'a Scene>,
}

impl Work<'_> {
    /// The scene, for an option that needs it.
    fn scene(&self, option: &str) -> beamlet::Result<beamlet::scene::Scene> {
        match self.scene {
            Some(scene) => scene.scene(),
            None => Err(Error::argument(option, "a geometry without its scene", "a Scene")),
        }
    }

    fn made(
        &self,
        mut geometry: ScanGeometry,
        grid: &Grid,
        mut sinograms: Array3<f32>,
        control: &mut RowsControl<'_>,
    ) -> beamlet::Result<Made> {
        self.method.check(self.of)?;
        self.given.check(&sinograms)?;
        let data = match self.of {
            Quantity::Mu => Data::Attenuation,
            Quantity::Delta => Data::Refraction,
            Quantity::DarkField => Data::DarkField,
        };
        if self.options.find_centre {
            geometry.axis = find_axis(&geometry, sinograms.view(), data, &control.cancel)?;
        }
        let grid = grid.choice().grid(&geometry)?;
        let hardening = self.hardening(&mut sinograms)?;
        let (weights, lost_views) = self.without_lost(&geometry, &mut sinograms)?;
        if self.options.rings {
            suppress_rings(&geometry, sinograms.view_mut(), &control.cancel)?;
        }
        let mask = self.mask(&grid)?;
        let mask = mask.as_ref().map(|mask| mask.view());
        let measured = Measured::new(data, sinograms.view())
            .with_weights(weights.as_ref().map(|weights| weights.view()))
            .with_mask(mask)
            .with_start(self.given.start);
        let made = self.method.volume(self.engine, &geometry, &measured, &grid, control)?;
        let mut volume = made.volume;
        let bias = self.add_bias(&mut volume)?;
        let truth = self.truth(&geometry, &volume, hardening.as_ref(), control)?;
        Ok(Made {
            volume,
            residuals: made.residuals,
            best: made.best,
            truth,
            axis: geometry.axis,
            energy: hardening.map(|polynomial| polynomial.energy),
            bias,
            lost_views,
        })
    }

    /// Corrects −ln T for beam hardening.
    fn hardening(&self, sinograms: &mut Array3<f32>) -> beamlet::Result<Option<BeamHardening>> {
        let Some((material, energy)) = &self.options.beam_hardening else { return Ok(None) };
        if self.of != Quantity::Mu {
            let allowed = "volumes of mu: refraction and dark field have no hardening to correct";
            return Err(Error::argument("beam_hardening", "no volume of mu", allowed));
        }
        let choice = HardeningChoice::new(self.scene("beam_hardening")?, material, *energy)?;
        let most = sinograms.iter().copied().fold(0.0, f32::max);
        let polynomial = BeamHardening::up_to(&choice, most.into())?;
        polynomial.apply(sinograms.view_mut());
        Ok(Some(polynomial))
    }

    /// Weights of iterative methods.
    fn weights(&self) -> Option<Array3<f32>> {
        let is_filtered = matches!(self.method, Method::Fbp(_));
        self.given.weights.filter(|_| !is_filtered).map(|weights| weights.to_owned())
    }

    /// Takes the weight of views that lost their refraction from δ: in the sinograms or in the
    /// weights. Returns the weights and the numbers of these views.
    fn without_lost(
        &self,
        geometry: &ScanGeometry,
        sinograms: &mut Array3<f32>,
    ) -> beamlet::Result<(Option<Array3<f32>>, Vec<usize>)> {
        let weights = self.weights();
        if self.of != Quantity::Delta {
            return Ok((weights, Vec::new()));
        }
        let angles = Angles {
            geometry,
            values: sinograms.view(),
            weights: weights.as_ref().map(|weights| weights.view()),
            attenuation: self.given.attenuation,
        };
        let mut lost = angles.lost()?;
        let chosen = (&self.method, self.options.keep_views);
        let weights = lost.leave_out(geometry, chosen, sinograms, weights)?;
        Ok((weights, lost.record().lost_views.iter().map(|lost| lost.view).collect()))
    }

    /// Voxels that may differ from zero.
    fn mask(&self, grid: &VolumeGrid) -> beamlet::Result<Option<Array3<bool>>> {
        if let Some(mask) = &self.given.mask {
            return Ok(Some(mask.to_owned()));
        }
        let shape: Option<VoxelMask> =
            self.options.mask_shape.as_deref().map(str::parse).transpose()?;
        shape.map(|mask| mask.on(grid)).transpose()
    }

    /// Adds kμ to a volume of δ, where μ is given. Returns k, m.
    fn add_bias(&self, volume: &mut Volume) -> beamlet::Result<Option<f64>> {
        let Some(mu) = &self.given.mu else { return Ok(None) };
        if mu.dim() != volume.values.dim() {
            let found = format!("shape {:?}", mu.dim());
            let allowed = format!("{:?}, the shape of delta", volume.values.dim());
            return Err(Error::argument("gradient_bias", found, allowed));
        }
        let width = self.options.flat_width.unwrap_or(f64::NAN);
        let k = gradient_bias(&self.scene("gradient_bias")?, width)?;
        add_gradient_bias(volume, &Volume::new(volume.grid, Quantity::Mu, mu.to_owned()), k)?;
        Ok(Some(k))
    }

    fn truth(
        &self,
        geometry: &ScanGeometry,
        volume: &Volume,
        hardening: Option<&BeamHardening>,
        control: &RowsControl<'_>,
    ) -> beamlet::Result<Option<TrueVolume>> {
        if !self.options.truth {
            return Ok(None);
        }
        let (scene, cancel) = (self.scene("truth")?, &control.cancel);
        if scene.objects.is_empty() {
            return Err(Error::argument(
                "truth",
                "a scene without objects",
                "a scene with its sample",
            ));
        }
        let mut truth = beamlet::truth(self.engine, &scene, geometry, &volume.grid, cancel)?;
        if let Some(polynomial) = hardening {
            truth = truth.with_mu_at(&scene, polynomial.energy)?;
        }
        Ok(Some(TrueVolume {
            names: truth.names(),
            values: truth.values(volume.quantity),
            errors: truth.errors(volume, cancel)?,
            labels: truth.labels().clone(),
        }))
    }
}

/// Truth as Python takes it.
type TrueArrays<'py> =
    (Bound<'py, PyArray3<u16>>, BTreeMap<u32, String>, Option<Bound<'py, PyArray3<f32>>>, String);

/// A volume as Python takes it, by the names of the items.
#[derive(IntoPyObject)]
pub(crate) struct Found<'py> {
    values: Bound<'py, PyArray3<f32>>,
    voxel: [f64; 3],
    origin: [f64; 3],
    unit: &'static str,
    residuals: Vec<f64>,
    best: usize,
    truth: Option<TrueArrays<'py>>,
    axis: f64,
    energy: Option<f64>,
    bias: Option<f64>,
    lost_views: Vec<usize>,
}

/// Reconstructs sinograms `[view][row][column]`.
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
    given: Given<'py>,
    scene: Option<&Scene>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Found<'py>> {
    let (engine, method) = (engine.get(py)?, options.method(py)?);
    let work = Work {
        engine: &engine,
        of: quantity(py, of)?,
        method,
        options: &options,
        given: given.views(),
        scene,
    };
    let (geometry, sinograms) = (circle.geometry(), sinograms.as_array());
    let made = interruptible(py, progress, |watch| {
        watch.rows("reconstruct", |mut control| {
            work.made(geometry, &grid, sinograms.to_owned(), &mut control)
        })
    })?;
    let truth = made.truth.map(|it| {
        let values = it.values.map(|values| values.into_pyarray(py));
        (it.labels.into_pyarray(py), it.names, values, it.errors)
    });
    let VolumeGrid { voxel, origin, .. } = made.volume.grid;
    Ok(Found {
        unit: made.volume.quantity.unit(),
        values: made.volume.values.into_pyarray(py),
        voxel,
        origin,
        residuals: made.residuals,
        best: made.best,
        truth,
        axis: made.axis,
        energy: made.energy,
        bias: made.bias,
        lost_views: made.lost_views,
    })
}
