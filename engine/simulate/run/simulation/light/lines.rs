//! Light of cells of lines and rays through the sample.

use super::cells::CellLight;
use super::{Light, LitRows, Pose, Report, Seconds};
use crate::run::RunEstimate;
use crate::run::simulation::Simulation;
use crate::sampling::{self, CellBatch, Responses, Room};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::tally::Tally;
use beamlet_gpu::LazyKernel;
use beamlet_model::scene::Exposure;
use ndarray::Array3;
use std::ops::Range;
use std::time::Instant;

/// Light of lines, of each of some designs with one sample and one lattice.
pub(super) struct Lines<'s> {
    designs: &'s [Simulation],
    /// The first design, whose rays are traced.
    pub(super) simulation: &'s Simulation,
    pub(super) tracer: Tracer,
    /// Sums of each design.
    pub(super) cells: CellLight<'s>,
    room: Room,
    /// Index of the list of mask offsets in work, of each design.
    lists: Vec<usize>,
    /// Responses at these.
    responses: Responses,
    /// Seconds of [`Light::add`].
    seconds: f64,
}

impl<'s> Lines<'s> {
    pub(super) fn new(designs: &'s [Simulation], cancel: &Cancel) -> Result<Self> {
        let simulation = &designs[0];
        let tracer = simulation.tracer(cancel)?;
        let of_cells = CellLight::kernels(simulation);
        LazyKernel::make_all(&[tracer.wanted_kernels(), of_cells].concat(), cancel)?;
        Ok(Self {
            designs,
            simulation,
            tracer,
            cells: CellLight::new(designs, cancel)?,
            room: simulation.room(),
            lists: vec![0; designs.len()],
            responses: Responses::new(designs.iter().map(|it| it.response.clone()).collect()),
            seconds: 0.0,
        })
    }
}

impl Light for Lines<'_> {
    fn begin(&mut self, rows: &Range<u32>, view: Exposure) -> Result<()> {
        let list = |design: &Simulation| design.detector.optics().offsets.list_of(view);
        let lists: Vec<usize> = self.designs.iter().map(list).collect();
        if self.lists != lists {
            self.responses = Simulation::responses(self.designs, view);
            self.lists = lists;
        }
        self.cells.begin(rows, &self.lists)
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
            let view = simulation.pose_context(pose, &self.responses);
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

    fn intensities(&self) -> Result<Vec<Array3<f32>>> {
        self.cells.intensities()
    }

    fn tally(&self) -> Tally {
        self.tracer.tally()
    }

    fn seconds(&self) -> Seconds {
        let illuminate = self.cells.seconds();
        Seconds { trace: self.seconds - illuminate, illuminate, ..Seconds::default() }
    }

    fn estimate(&mut self) -> Result<RunEstimate> {
        self.survey()
    }
}
