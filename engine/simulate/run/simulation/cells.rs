//! The cells of a pose as they go to the illumination, for tests.

use super::Simulation;
use super::light::Pose;
use crate::sampling::{self, CellBatch, Responses};
use crate::trace::Tracer;
use beamlet_core::{Cancel, Result};
use beamlet_model::scene::Exposure;
use std::ops::Range;

/// The cells of some detector rows of a pose (scheme `cells`); of a detector with blur, of rows of
/// its grid.
///
/// # Errors
/// As [`Simulation::run`].
pub fn cells_of_rows(simulation: &Simulation, pose: u32, rows: Range<i64>) -> Result<CellBatch> {
    let mut tracer = simulation.tracer(&Cancel::default())?;
    let shadows = simulation.projected_bounds(pose);
    let pose = Pose { view: Exposure::Sample(simulation.view_of(pose)), index: pose, shadows };
    let responses = Responses::new(vec![simulation.response(pose.view)]);
    let mut view = simulation.pose_context(&pose, &responses);
    view.budget.audit = 0.0;
    let mut parts = Vec::new();
    let room = simulation.room();
    let mut keep = |_: &mut Tracer, part: &CellBatch| {
        parts.push(part.clone());
        Ok(())
    };
    let (all, ignored) = (rows.clone(), &mut |_: &Tracer, _| {});
    sampling::sample_rows(&view, &mut tracer, all, (&rows, &room), &mut keep, ignored)?;
    Ok(CellBatch::concat(parts))
}
