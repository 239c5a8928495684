//! Filtered back-projection.

use super::back_projector::BackProjector;
use super::data::Data;
use super::fbp_options::FbpOptions;
use super::filtering::Filtering;
use super::geometry::ScanGeometry;
use super::grid::{Volume, VolumeGrid};
use super::model::Model;
use super::projector::{AT_ONCE, Arm};
use super::quantity::Quantity;
use super::work::reporting;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, parallel};
use beamlet_gpu::Compute;
use ndarray::{ArrayView3, Zip};

/// Filtered back-projection of sinograms, `[view][row][column]`: −ln T, refraction angles (rad) or
/// variances (rad²), as `quantity` says. One row is a fan, or a parallel beam; more are a cone, by
/// Feldkamp, Davis and Kress. Views over a whole turn count alike, those over less by Parker's
/// weights; over more than a turn, views of one direction share its weight. Where the axis is beside the middle of the detector (half-fan), lines that are seen once count
/// twice. Where a voxel is outside of the detector in a view, that view adds nothing. Lever arms are
/// corrected as [`FbpOptions::arm_passes`] says.
///
/// # Errors
/// [`Error::Argument`] for a geometry, grid or options that cannot be, sinograms of another shape or
/// with values that are not finite; [`Error::Interrupted`], [`Error::Device`], [`Error::Memory`].
///
/// # Example
///
/// ```no_run
/// use beamlet::reconstruct::{FbpOptions, Quantity, ScanGeometry, VolumeGrid, fbp};
/// use beamlet::{Engine, EngineOptions, RowsControl, ndarray::Array3, scene::Scene};
///
/// let geometry = ScanGeometry::of_scene(&Scene::load("scene.toml")?);
/// // `[view][row][column]`: −ln of the transmission.
/// let sinograms = Array3::<f32>::zeros((360, 4, 256));
/// let engine = Engine::open(&EngineOptions::default())?;
/// let volume = fbp(
///     &engine,
///     &geometry,
///     sinograms.view(),
///     Quantity::Mu,
///     &VolumeGrid::of(&geometry)?,
///     &FbpOptions::default(),
///     &mut RowsControl::default(),
/// )?;
/// println!("{:?} {}", volume.values.dim(), volume.quantity.unit());
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn fbp(
    compute: &Compute,
    geometry: &ScanGeometry,
    sinograms: ArrayView3<'_, f32>,
    quantity: Quantity,
    grid: &VolumeGrid,
    options: &FbpOptions,
    control: &mut RowsControl<'_>,
) -> Result<Volume> {
    check(geometry, sinograms)?;
    options.check(quantity)?;
    grid.check(geometry)?;
    parallel::start_threads()?;
    let filtering = Filtering::new(geometry, quantity, options)?;
    let mut projector = BackProjector::new(compute, geometry, filtering.columns(), grid, quantity)?;
    if let Some(at_once) = options.at_once {
        projector = projector.with_at_once(at_once);
    }
    let passes = options.passes(geometry, quantity, filtering.is_turn());
    let all = (2 * passes + 1) as f64;
    reporting(control, |work| {
        let mut values = work.stage([0.0, 1.0 / all], |work| {
            projector.sum(filtering.all(sinograms, &work.cancel)?.view(), work)
        })?;
        if passes == 0 {
            return Ok(Volume::new(*grid, quantity, values));
        }
        let data = Data::of(quantity);
        let arm = Arm { kind: data.arm(), per_lever: 1.0 / geometry.lever, less: 1.0 };
        let at_once = options.at_once.unwrap_or(AT_ONCE);
        let model = Model::with_arm(compute, geometry, grid, (data, arm), at_once)?;
        for pass in 0..passes {
            let stage = |n: usize| [n as f64 / all, (n + 1) as f64 / all];
            let mut corrected =
                work.stage(stage(2 * pass + 1), |work| model.forward(values.view(), work))?;
            Zip::from(&mut corrected)
                .and(sinograms)
                .for_each(|of_arm, given| *of_arm = given - *of_arm);
            values = work.stage(stage(2 * pass + 2), |work| {
                projector.sum(filtering.all(corrected.view(), &work.cancel)?.view(), work)
            })?;
        }
        Ok(Volume::new(*grid, quantity, values))
    })
}

/// # Errors
/// [`Error::Argument`].
pub(super) fn check(geometry: &ScanGeometry, sinograms: ArrayView3<'_, f32>) -> Result<()> {
    geometry.check()?;
    let needed = (geometry.angles.len(), geometry.rows.len(), geometry.columns.len());
    if sinograms.dim() != needed {
        let found = format!("{:?} views, rows and columns", sinograms.dim());
        return Err(Error::argument(
            "sinograms",
            found,
            format!("{needed:?}, as the geometry has"),
        ));
    }
    if let Some((place, value)) = sinograms.indexed_iter().find(|(_, value)| !value.is_finite()) {
        let (view, row, column) = place;
        let found = format!("{value} in view {view}, row {row}, column {column}");
        return Err(Error::argument("sinograms", found, "finite values"));
    }
    Ok(())
}
