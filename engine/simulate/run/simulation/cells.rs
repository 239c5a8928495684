//! The cells of a pose as they go to the illumination, for tests.

use super::Simulation;
use crate::sampling::{self, CellBatch};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_model::scene::Exposure;
use std::ops::Range;

/// The cells of some detector rows of a pose (scheme `cells`); of a detector with blur, of rows of
/// its grid.
///
/// # Errors
/// As [`Simulation::run`].
pub fn cells_of_rows(simulation: &Simulation, pose: u32, rows: Range<i64>) -> Result<CellBatch> {
    let projected_bounds = simulation.projected_bounds(pose);
    let mut tracer = simulation.tracer(simulation.start.backend, &simulation.alone)?;
    let response = simulation.response(Exposure::Sample(simulation.view_of(pose)));
    let mut view = simulation.pose_context(pose, &projected_bounds, &response);
    view.budget.audit = 0.0;
    let mut parts = Vec::new();
    let room = simulation.room(&simulation.alone);
    let mut keep = |_: &mut Tracer, part: &CellBatch| {
        parts.push(part.clone());
        Ok(())
    };
    let (all, ignored) = (rows.clone(), &mut |_: &Tracer, _| {});
    sampling::sample_rows(&view, &mut tracer, all, (&rows, &room), &mut keep, ignored)?;
    Ok(CellBatch::concat(parts))
}
