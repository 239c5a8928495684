//! Volumes of sinograms: corrections, the method, truth.

use crate::engine::Engine;
use crate::options::arguments;
use crate::reconstruct::{Circle, quantity};
use crate::scene::Scene;
use crate::work::interruptible;
use beamlet::cli_support::options::{Centre, Need, Options, ReconstructArguments};
use beamlet::cli_support::reconstruct::{Sinograms, reconstruct_sinograms};
use beamlet::ndarray::{Array3, ArrayView3};
use beamlet::reconstruct::{
    BeamHardening, Data, Method, Quantity, ScanGeometry, Volume, VolumeGrid, add_gradient_bias,
    find_axis, reaching_ends,
};
use beamlet::{Error, RowsControl};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;

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
    /// Width of the curves without sample, m, for this correction.
    flat_width: Option<f64>,
}

/// Views of [`Given`].
struct Views<'a> {
    weights: Option<ArrayView3<'a, f32>>,
    mask: Option<ArrayView3<'a, bool>>,
    start: Option<ArrayView3<'a, f32>>,
    attenuation: Option<ArrayView3<'a, f32>>,
    mu: Option<ArrayView3<'a, f32>>,
    flat_width: Option<f64>,
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
            flat_width: self.flat_width,
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
    options: &'a ReconstructArguments,
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
        sinograms: Array3<f32>,
        control: &mut RowsControl<'_>,
    ) -> beamlet::Result<Made> {
        let (options, given) = (self.options, &self.given);
        let method = options.method();
        if given.weights.is_some() && matches!(method, Method::Fbp(_)) {
            return Err(Error::argument("weights", "an array for fbp", "cgls, sirt or bb"));
        }
        // An argument with a default may go to every method.
        let mut own = options.clone();
        own.given.retain(|name, _| {
            ReconstructArguments::ROWS
                .iter()
                .any(|row| row.name == name && matches!(row.need, Need::Without(_)))
        });
        own.check_method(method.name())?;
        method.check(self.of)?;
        given.check(&sinograms)?;
        match options.centre {
            Some(Centre::Auto) => {
                let data = Data::of(self.of);
                geometry.axis = find_axis(&geometry, sinograms.view(), data, &control.cancel)?;
            }
            Some(Centre::Column(column)) => geometry.set_axis_column(column),
            None => {}
        }
        let scene = match (options.beam_hardening.is_some(), given.mu.is_some()) {
            (true, _) => Some(self.scene("beam_hardening")?),
            (false, true) => Some(self.scene("gradient_bias")?),
            (false, false) => None,
        };
        let plan = options.plan(vec![self.of], &geometry, scene.as_ref(), given.flat_width)?;
        let mask = match &given.mask {
            Some(_) => None,
            None => plan.mask.as_ref().map(|mask| mask.on(&plan.grid)).transpose()?,
        };
        let sinograms = Sinograms {
            quantity: self.of,
            values: sinograms,
            weights: given.weights.map(|weights| weights.to_owned()),
            reaching: given.attenuation.map(reaching_ends),
            mask: given.mask.or(mask.as_ref().map(|mask| mask.view())),
            start: given.start,
        };
        let found = reconstruct_sinograms(self.engine, &geometry, &plan, sinograms, control)?;
        let mut volume = found.made.volume;
        let bias = self.add_bias(&mut volume, plan.gradient_bias)?;
        let truth = self.truth(&geometry, &volume, found.hardening.as_ref(), control)?;
        let lost = found.moments.map(|moments| moments.lost_views).unwrap_or_default();
        Ok(Made {
            volume,
            residuals: found.made.residuals,
            best: found.made.best,
            truth,
            axis: geometry.axis,
            energy: found.hardening.map(|polynomial| polynomial.energy),
            bias,
            lost_views: lost.iter().map(|lost| lost.view).collect(),
        })
    }

    /// Adds kμ to a volume of δ, where μ is given. Returns k, m.
    fn add_bias(&self, volume: &mut Volume, k: Option<f64>) -> beamlet::Result<Option<f64>> {
        let Some(mu) = &self.given.mu else { return Ok(None) };
        if mu.dim() != volume.values.dim() {
            let found = format!("shape {:?}", mu.dim());
            let allowed = format!("{:?}, the shape of delta", volume.values.dim());
            return Err(Error::argument("gradient_bias", found, allowed));
        }
        let Some(k) = k else {
            let found = "a set-up without the bias";
            return Err(Error::argument("gradient_bias", found, "two masks and curves of a width"));
        };
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
    options: &Bound<'py, PyDict>,
    given: Given<'py>,
    scene: Option<&Scene>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Found<'py>> {
    let engine = engine.get(py)?;
    let options: ReconstructArguments = arguments("reconstruct", options, |_| true)?;
    let work = Work {
        engine: &engine,
        of: quantity(py, of)?,
        options: &options,
        given: given.views(),
        scene,
    };
    let (geometry, sinograms) = (circle.geometry(), sinograms.as_array());
    let made = interruptible(py, progress, |watch| {
        watch.rows("reconstruct", |mut control| {
            work.made(geometry, sinograms.to_owned(), &mut control)
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
