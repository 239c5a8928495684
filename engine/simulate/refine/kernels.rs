//! Kernels of the refinement, and the turn that they take.

use crate::trace::{MadeRays, Tracer};
use beamlet_core::Result;
use beamlet_gpu::{Buffer, Device, Kernel, LazyKernel, Recorder, push_bytes};
use beamlet_interface::{
    HEAD_STAGES, RefinePush, STAGE_AGAIN, STAGE_BASE, STAGE_BUDGET, STAGE_EMIT, STAGE_ESTIMATE,
    STAGE_KEEP, STAGE_MERGE, STAGE_PLACE, STAGE_REPORT, STAGE_ROWS, STAGE_RUNS, STAGE_SELECT,
    STAGE_SPLIT, STAGE_WORDS,
};
use std::sync::Arc;

/// Maker of the cells of rectangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CellMaker {
    /// The device, at one energy.
    OneEnergy,
    /// The device, of the energies of a spectrum.
    Spectrum,
    /// The host, with moments: for energies or masks that the device does not know.
    Host,
}

/// The kernels of one device, each made when it is first wanted.
#[derive(Debug)]
pub(crate) struct RefineKernels {
    plan: LazyKernel,
    /// Kernels in the order of `STAGE_`, at one energy.
    stages: [LazyKernel; 11],
    /// Kernels under a spectrum: keep moments, make cells, make cells of merged light, put cells in order.
    of_spectrum: [LazyKernel; 4],
    /// Lists rectangles for the host, in place of runs.
    leaves: LazyKernel,
}

impl RefineKernels {
    /// Kernels of a device.
    #[must_use]
    pub(crate) fn new(device: &Arc<Device>) -> Self {
        let kernel = |name| LazyKernel::new(device, name, push_bytes::<RefinePush>());
        Self {
            plan: kernel("refine_plan"),
            stages: [
                "refine_base",
                "refine_split",
                "refine_keep",
                "refine_estimate",
                "refine_again",
                "refine_budget",
                "refine_select",
                "refine_runs",
                "refine_report",
                "refine_emit",
                "refine_rows",
            ]
            .map(kernel),
            of_spectrum: [
                "refine_keep_moments",
                "refine_emit_energies",
                "refine_merge",
                "refine_place",
            ]
            .map(kernel),
            leaves: kernel("refine_leaves"),
        }
    }

    /// Kernels of a scene, in the order of `STAGE_`.
    fn stages(&self, maker: CellMaker) -> impl Iterator<Item = &LazyKernel> {
        let [keep, emit, merge, place] = &self.of_spectrum;
        let spectrum = maker == CellMaker::Spectrum;
        let own = (0..).zip(&self.stages).map(move |(stage, kernel)| match stage {
            STAGE_KEEP if spectrum => keep,
            STAGE_EMIT if spectrum => emit,
            STAGE_RUNS if maker == CellMaker::Host => &self.leaves,
            _ => kernel,
        });
        own.chain([merge, place].into_iter().filter(move |_| spectrum))
    }

    /// All kernels of a scene.
    pub(crate) fn all(&self, maker: CellMaker) -> impl Iterator<Item = &LazyKernel> {
        std::iter::once(&self.plan).chain(self.stages(maker))
    }

    /// The kernels, made.
    ///
    /// # Errors
    /// As [`LazyKernel::get`].
    pub(super) fn made(&self, maker: CellMaker) -> Result<Stages<'_>> {
        let stages = self.stages(maker).map(LazyKernel::get).collect::<Result<_>>()?;
        Ok(Stages { plan: self.plan.get()?, stages })
    }
}

/// Kernels that are made.
pub(super) struct Stages<'k> {
    plan: &'k Kernel,
    stages: Vec<&'k Kernel>,
}

impl Stages<'_> {
    /// Records the planning of a stage.
    fn plan(&self, r: &mut Recorder<'_>, params: u64, stage: u32) {
        let push = RefinePush { params, stage, unused: 0 };
        r.barrier();
        r.dispatch(self.plan, bytemuck::bytes_of(&push), [1; 3]);
        r.barrier();
    }

    /// Records a stage, of the size that was planned.
    fn run(&self, r: &mut Recorder<'_>, (params, head): (u64, &Buffer), stage: u32) {
        let push = RefinePush { params, stage, unused: 0 };
        let at = u64::from(HEAD_STAGES + stage * STAGE_WORDS + 2) * 4;
        r.dispatch_indirect(self.stages[stage as usize], bytemuck::bytes_of(&push), head, at);
    }

    /// Records the end of a submission: cells of merged light and the order of cell rows under a `spectrum`, and the
    /// report where all cells are made.
    pub(super) fn record_end(&self, r: &mut Recorder<'_>, of: (u64, &Buffer), spectrum: bool) {
        if spectrum {
            self.plan(r, of.0, STAGE_MERGE);
            self.run(r, of, STAGE_MERGE);
        }
        self.plan(r, of.0, STAGE_PLACE);
        if spectrum {
            self.run(r, of, STAGE_PLACE);
        }
        self.run(r, of, STAGE_REPORT);
    }

    /// Records one turn: traces new rays, estimates new rectangles, chooses the next rectangles to split, and makes
    /// cells where none is chosen. Stages that have nothing to do have no workgroups.
    pub(super) fn record_turn(
        &self,
        r: &mut Recorder<'_>,
        (params, head): (u64, &Buffer),
        tracer: &Tracer,
        made: &MadeRays<'_>,
    ) {
        let plan = |r: &mut Recorder<'_>, stage| self.plan(r, params, stage);
        let run = |r: &mut Recorder<'_>, stage| self.run(r, (params, head), stage);
        plan(r, STAGE_BASE);
        run(r, STAGE_BASE);
        run(r, STAGE_SPLIT);
        tracer.record_made(r, made);
        r.barrier();
        run(r, STAGE_KEEP);
        plan(r, STAGE_ESTIMATE);
        run(r, STAGE_ESTIMATE);
        plan(r, STAGE_AGAIN);
        run(r, STAGE_AGAIN);
        r.barrier();
        run(r, STAGE_BUDGET);
        plan(r, STAGE_SELECT);
        run(r, STAGE_SELECT);
        plan(r, STAGE_RUNS);
        run(r, STAGE_RUNS);
        plan(r, STAGE_EMIT);
        run(r, STAGE_EMIT);
        r.barrier();
        run(r, STAGE_ROWS);
    }
}
