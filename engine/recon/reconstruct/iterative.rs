//! Iterative reconstruction.

use super::data::Data;
use super::geometry::ScanGeometry;
use super::grid::{Volume, VolumeGrid};
use super::measured::Measured;
use super::model::Model;
use super::problem::Problem;
use super::resident::{require_room, resident_bytes};
use super::solver::{IterativeOptions, Solver};
use super::work::reporting;
use beamlet_core::Result;
use beamlet_core::rows_control::RowsControl;
use beamlet_gpu::Compute;

/// A volume, and how it came about.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Iterated {
    /// The iterate of the least residual.
    pub volume: Volume,
    /// Root mean square of the weighted residuals: of the start, then after each iteration.
    pub residuals: Vec<f64>,
    /// Number of the iterate that was taken, 0 for the start.
    pub best: usize,
}

/// Reconstructs a volume iteratively: weighted least squares of sinograms and those that [`Model`]
/// makes of the volume. Refraction angles are fitted as they are, as differences over each column;
/// their gradients are filtered by 1/|k| in the plane of a slice, without which low frequencies take
/// hundreds of iterations.
///
/// # Errors
/// [`beamlet_core::Error::Argument`] for a geometry, grid or options that cannot be, arrays of other shapes, values
/// of weight that are not finite, weights below zero or all zero, a start that is not finite, views
/// that do not meet the volume, and methods that do not fit: SIRT for refraction angles, bounds for
/// conjugate gradients; [`beamlet_core::Error::Memory`] where the device has no room for all volumes and sinograms of the
/// method; [`beamlet_core::Error::Interrupted`], [`beamlet_core::Error::Device`].
///
/// # Example
///
/// ```no_run
/// use beamlet::reconstruct::{Data, IterativeOptions, Measured, ScanGeometry, VolumeGrid, iterate};
/// use beamlet::{Engine, EngineOptions, RowsControl, ndarray::Array3, scene::Scene};
///
/// let geometry = ScanGeometry::of_scene(&Scene::load("scene.toml")?);
/// // `[view][row][column]`: refraction angles, rad.
/// let angles = Array3::<f32>::zeros((360, 4, 256));
/// let engine = Engine::open(&EngineOptions::default())?;
/// let made = iterate(
///     &engine,
///     &geometry,
///     &Measured::new(Data::Refraction, angles.view()),
///     &VolumeGrid::of(&geometry)?,
///     &IterativeOptions::default().with_iterations(10),
///     &mut RowsControl::default(),
/// )?;
/// println!("{} {:?}", made.best, made.residuals);
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn iterate(
    compute: &Compute,
    geometry: &ScanGeometry,
    measured: &Measured<'_>,
    grid: &VolumeGrid,
    options: &IterativeOptions,
    control: &mut RowsControl<'_>,
) -> Result<Iterated> {
    geometry.check()?;
    options.check(measured.data)?;
    measured.check(geometry, grid)?;
    let model = Model::new(compute, geometry, grid, measured.data, None)?;
    let method = (options.solver, measured.data == Data::Refraction);
    let extras = [measured.mask.is_some(), measured.weights.is_some()];
    let needed = resident_bytes(geometry, grid, method, extras);
    require_room(compute, (geometry, grid), needed)?;
    let mut problem = Problem::new(&model, measured, options)?;
    reporting(control, |work| match options.solver {
        Solver::Cgls => problem.cgls(work),
        Solver::Sirt => problem.sirt(work),
        Solver::Bb => problem.bb(work),
    })?;
    let (values, residuals, best) = problem.finish(grid.size)?;
    Ok(Iterated { volume: Volume::new(*grid, measured.data.quantity(), values), residuals, best })
}
