//! Light of cells of lines and rays through the sample.

use super::cells::CellLight;
use super::{Light, LitRows, Pose, Report};
use crate::run::RunEstimate;
use crate::run::simulation::Simulation;
use crate::run::simulation::seconds::Seconds;
use crate::sampling::{self, CellBatch, Response, Room};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::tally::Tally;
use beamlet_gpu::LazyKernel;
use beamlet_model::scene::Exposure;
use ndarray::Array3;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// Light of lines.
pub(super) struct Lines<'s> {
    pub(super) simulation: &'s Simulation,
    pub(super) tracer: Tracer,
    pub(super) cells: CellLight<'s>,
    room: Room,
    /// Index of the list of mask offsets in work.
    list: usize,
    /// Response at these.
    response: Arc<Response>,
    /// Seconds of [`Light::add`].
    seconds: f64,
}

impl<'s> Lines<'s> {
    pub(super) fn new(simulation: &'s Simulation, cancel: &Cancel) -> Result<Self> {
        let mut tracer = simulation.tracer()?;
        tracer.set_cancel(cancel.clone());
        let [walk, exact] = tracer.wanted_kernels();
        LazyKernel::make_all(&[exact, walk, CellLight::kernel(simulation)], cancel)?;
        Ok(Self {
            simulation,
            tracer,
            cells: CellLight::new(simulation, cancel)?,
            room: simulation.room(),
            list: 0,
            response: simulation.response.clone(),
            seconds: 0.0,
        })
    }
}

impl Light for Lines<'_> {
    fn begin(&mut self, rows: &Range<u32>, view: Exposure) -> Result<()> {
        let list = self.simulation.detector.optics().offsets.list_of(view);
        if self.list != list {
            (self.list, self.response) = (list, self.simulation.response(view));
        }
        self.cells.begin(rows, list)
    }

    fn items_of_row(&self, pose: &Pose) -> u64 {
        self.simulation.cells_of_row(pose)
    }

    fn add(&mut self, pose: &Pose, rows: &LitRows, report: Report<'_>) -> Result<Tally> {
        let begin = Instant::now();
        let Self { simulation, tracer, cells, .. } = self;
        let mut tally = Tally::default();
        if pose.shadows.is_empty() {
            cells.add_undeflected(simulation, rows)?;
        } else {
            let lit = rows.direct(&simulation.lattice);
            let view = simulation.pose_context(pose, &self.response);
            let mut add = |tracer: &mut Tracer, batch: &CellBatch| {
                tally.landed_off += batch.landed_off;
                tally = tally + batch.tally;
                cells.add(Some(tracer), batch)
            };
            let mut advance = |tracer: &Tracer, part| report(tracer.rays_traced(), part);
            let lit = (&lit, &self.room);
            sampling::sample_rows(&view, tracer, rows.rows.clone(), lit, &mut add, &mut advance)?;
        }
        self.seconds += begin.elapsed().as_secs_f64();
        Ok(tally)
    }

    fn intensities(&self) -> Result<Array3<f32>> {
        self.cells.intensities()
    }

    fn tally(&self) -> Tally {
        self.tracer.tally()
    }

    fn seconds(&self) -> Seconds {
        let illuminate = self.cells.illumination + self.cells.gathering;
        Seconds { trace: self.seconds - illuminate, illuminate, ..Seconds::default() }
    }

    fn estimate(&mut self) -> Result<RunEstimate> {
        self.survey()
    }
}
