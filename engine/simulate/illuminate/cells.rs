//! Illuminates cell rows of cells at every mask step.

use super::fill::items_each;
use super::fit::GrowingBuffer;
use super::light::{ApertureEdges, IlluminationBuffer};
use super::row_parts::parts_of;
use super::spectral::{Dispatches, Gatherer, Gathering};
use super::sums::PixelSums;
use crate::sampling::{CellBatch, balance, lands_near};
use beamlet_core::cancel::Cancel;
use beamlet_core::{Result, numbers};
use beamlet_gpu::{Buffer, Device, DeviceKind, LazyKernel, Pace, Recorder, Upload, push_bytes};
use beamlet_interface::{
    Address, Cell, CellRow, CellRowPart, EnergiesPush, EnergyResult, GROUP, GatherPush,
    IlluminatePush,
};
use std::ops::Range;
use std::sync::Arc;

/// Most mask steps of an invocation: they share the data of a cell row.
const STEPS_EACH: u32 = 16;

/// The kernels of cells.
#[derive(Debug)]
pub(crate) struct CellKernels {
    near: LazyKernel,
    /// For light that lands more than a row away.
    far: LazyKernel,
    /// For masks whose walls are slanted or whose bars have several layers.
    walls: LazyKernel,
    /// For masks whose apertures end along z.
    heights: LazyKernel,
    /// Results of cells at each energy, and the gathering of energies.
    energies: LazyKernel,
    gather: LazyKernel,
}

impl CellKernels {
    /// Kernels of a device.
    #[must_use]
    pub(crate) fn new(device: &Arc<Device>) -> Self {
        let kernel = |name| LazyKernel::new(device, name, push_bytes::<IlluminatePush>());
        Self {
            near: kernel("illuminate"),
            far: kernel("illuminate_far"),
            walls: kernel("illuminate_walls"),
            heights: kernel("illuminate_heights"),
            energies: LazyKernel::new(device, "energies", push_bytes::<EnergiesPush>()),
            gather: LazyKernel::new(device, "gather", push_bytes::<GatherPush>()),
        }
    }

    /// The kernels that gather energies.
    pub(crate) const fn gathering(&self) -> [&LazyKernel; 2] {
        [&self.energies, &self.gather]
    }

    /// The kernel of cells whose light lands in their row and the two beside it, or `far` in any row.
    pub(crate) const fn of(&self, edges: ApertureEdges, far: bool) -> &LazyKernel {
        match (edges, far) {
            (ApertureEdges::Heights, _) => &self.heights,
            (ApertureEdges::Walls, _) => &self.walls,
            (ApertureEdges::Straight, true) => &self.far,
            (ApertureEdges::Straight, false) => &self.near,
        }
    }
}

/// Cells that the buffers hold; they grow for larger lists.
const CELLS_TOGETHER: usize = 1 << 16;

/// Parts of cell rows times steps of the first submission on a GPU, and the least and most of one. Where a detector blurs
/// light along z, one takes milliseconds on a processor.
const SIZES: [u32; 3] = [1 << 16, 256, 1 << 26];

/// Illuminates cells.
#[derive(Debug)]
pub(crate) struct CellIlluminator {
    device: Arc<Device>,
    kernels: Arc<CellKernels>,
    cells: GrowingBuffer,
    cell_rows: GrowingBuffer,
    parts: GrowingBuffer,
    /// Inputs of gathering, and results at energies.
    inputs: GrowingBuffer,
    results: GrowingBuffer,
    /// Parts of cell rows times steps of a submission.
    pace: Pace,
    /// Dispatches of the next submission, and their cost.
    planned: Vec<PlannedDispatch>,
    /// Gathering that the next submission begins with.
    gathering: Option<Dispatches>,
    planned_cost: u64,
    cancel: Cancel,
}

impl CellIlluminator {
    /// Bytes of the buffers on the device.
    pub(crate) const BYTES: u64 = (CELLS_TOGETHER
        * (size_of::<Cell>().next_power_of_two()
            + size_of::<CellRow>().next_power_of_two()
            + size_of::<CellRowPart>().next_power_of_two()))
        as u64;

    /// An illuminator, which `cancel` ends between two submissions.
    pub(crate) fn new(device: &Arc<Device>, kernels: &Arc<CellKernels>, cancel: &Cancel) -> Self {
        let is_cpu = device.description().kind == DeviceKind::Cpu;
        Self {
            device: device.clone(),
            kernels: kernels.clone(),
            cells: GrowingBuffer::new(device, "cells"),
            cell_rows: GrowingBuffer::new(device, "cell rows"),
            parts: GrowingBuffer::new(device, "parts of cell rows"),
            inputs: GrowingBuffer::new(device, "cells and moments"),
            results: GrowingBuffer::new(device, "results of cells at energies"),
            pace: Pace::new(SIZES[0] >> if is_cpu { 6 } else { 0 }, SIZES[1], SIZES[2]),
            planned: Vec::new(),
            gathering: None,
            planned_cost: 0,
            cancel: cancel.clone(),
        }
    }

    /// Adds the light of lists of cell rows, one for each of `lights`, to the sums, at `steps` mask steps.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`], [`beamlet_core::Error::Device`]; [`beamlet_core::Error::Interrupted`].
    pub(crate) fn add(
        &mut self,
        lights: &[IlluminationBuffer],
        lists: &[CellBatch],
        sums: &PixelSums,
        steps: u32,
    ) -> Result<()> {
        let mut first = 0;
        while first < lists.len() {
            let mut cells = 0;
            let fits = |list: &&CellBatch| {
                cells += list.cells.len();
                cells <= CELLS_TOGETHER
            };
            let some = first..first + lists[first..].iter().take_while(fits).count().max(1);
            first = some.end;
            self.add_together(&lights[some.clone()], &lists[some], sums, steps)?;
        }
        Ok(())
    }

    /// Adds the light of lists that are on the device together.
    fn add_together(
        &mut self,
        lights: &[IlluminationBuffer],
        lists: &[CellBatch],
        sums: &PixelSums,
        steps: u32,
    ) -> Result<()> {
        let (mut ordered, mut parts, mut pieces) = (Vec::new(), Vec::new(), Vec::new());
        let mut cells = 0;
        for (light, list) in lights.iter().zip(lists) {
            // Light of parts of a spot that spread differently over rows has its own kernel, and so has
            // light of cells that lands far off.
            let near = |cell_row: &&CellRow| {
                !light.rows_apart() && lands_near(&list.cells[cell_row.first_cell as usize])
            };
            let (near, far): (Vec<_>, Vec<_>) = list.cell_rows.iter().partition(near);
            for (some, far) in [(near, false), (far, true)] {
                let first_row = ordered.len();
                let moved = |cell_row: &CellRow| CellRow {
                    first_cell: cell_row.first_cell + numbers::count(cells),
                    ..*cell_row
                };
                ordered.extend(some.into_iter().map(moved));
                balance(&mut ordered[first_row..]);
                let parts = add_parts(&mut parts, &ordered[first_row..], far);
                pieces.push(DispatchPart { light, far, parts, first_row });
            }
            cells += list.cells.len();
        }
        if ordered.is_empty() {
            return Ok(());
        }
        let buffers = self.fit(cells, ordered.len())?;
        let mut uploads = vec![Upload::new(&buffers[1], 0, &ordered)];
        let mut at = 0;
        for list in lists {
            uploads.push(Upload::new(&buffers[0], at, &list.cells));
            at += size_of_val(&list.cells[..]) as u64;
        }
        self.illuminate(&buffers, &DispatchParts { pieces, parts }, sums, steps, uploads)
    }

    /// Adds the light of all energies of cells to the sums, at `steps` mask steps. `lights`: of the lists of the gatherer.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub(crate) fn add_gathered(
        &mut self,
        gatherer: &Gatherer<'_>,
        gathering: &Gathering<'_>,
        lights: &[IlluminationBuffer],
        sums: &PixelSums,
        steps: u32,
    ) -> Result<()> {
        let (mut parts, mut pieces, mut first_row) = (Vec::new(), Vec::new(), 0);
        let rows_apart = lights.iter().any(IlluminationBuffer::rows_apart);
        for rows in &gathering.rows {
            let all = add_parts(&mut parts, &rows.cell_rows, rows_apart);
            let far = add_parts(&mut parts, &rows.cell_rows[..rows.far], true);
            for light in &lights[rows.lists.clone()] {
                let mut add = |parts: &Range<u32>, far, first_row| {
                    pieces.push(DispatchPart { light, far, parts: parts.clone(), first_row });
                };
                add(&all, rows_apart, first_row);
                add(&far, true, first_row + rows.cell_rows.len());
                first_row += rows.rows_of_list();
            }
        }
        let buffers = self.fit(gathering.places, first_row)?;
        let mut uploads = Vec::new();
        let inputs = self.inputs.fit::<u8>(gathering.bytes())?;
        let inputs = [inputs, self.results.fit::<EnergyResult>(gathering.results)?];
        self.gathering = Some(gatherer.prepare(gathering, &inputs, &buffers, &mut uploads));
        self.illuminate(&buffers, &DispatchParts { pieces, parts }, sums, steps, uploads)
    }

    /// Buffers of this many cells, and of cell rows.
    fn fit(&mut self, cells: usize, cell_rows: usize) -> Result<[Arc<Buffer>; 2]> {
        let [cells, cell_rows] = [cells, cell_rows].map(|count| count.max(CELLS_TOGETHER));
        Ok([self.cells.fit::<Cell>(cells)?, self.cell_rows.fit::<CellRow>(cell_rows)?])
    }

    /// Illuminates pieces, after uploads.
    fn illuminate(
        &mut self,
        [cells, cell_rows]: &[Arc<Buffer>; 2],
        DispatchParts { pieces, parts }: &DispatchParts<'_>,
        sums: &PixelSums,
        steps: u32,
        uploads: Vec<Upload<'_>>,
    ) -> Result<()> {
        let buffer = self.parts.fit::<CellRowPart>(parts.len().max(CELLS_TOGETHER))?;
        // These live no longer than the buffer.
        let mut uploads: Vec<Upload<'_>> = uploads;
        uploads.push(Upload::new(&buffer, 0, parts));
        let template = IlluminatePush {
            parts: buffer.address(),
            cell_rows: cell_rows.address(),
            cells: cells.address(),
            sums: sums.buffer.address(),
            steps,
            ..bytemuck::Zeroable::zeroed()
        };
        pieces.iter().try_for_each(|piece| self.plan(piece, template, steps, &mut uploads))?;
        self.run(&mut uploads)
    }

    /// Plans the dispatches of a piece; runs those before it as they fill a submission. The first has the
    /// `uploads`.
    fn plan(
        &mut self,
        piece: &DispatchPart<'_>,
        template: IlluminatePush,
        steps: u32,
        uploads: &mut Vec<Upload<'_>>,
    ) -> Result<()> {
        let DispatchPart { light, far, parts, first_row } = piece;
        let cell_rows = template.cell_rows + (first_row * size_of::<CellRow>()) as Address;
        let kind = self.device.description().kind;
        // Light that no sample mask moves is the same at every step, and has its own sums.
        let steps = if light.same_at_all_steps { steps..steps + 1 } else { 0..steps };
        for light_ref in light.addresses() {
            let mut first_part = parts.start;
            while first_part < parts.end {
                let left = parts.end - first_part;
                let part_count = left.min(self.pace.size().min(1 << 20)).max(1);
                let at_once =
                    (self.pace.size() / part_count).clamp(1, 4096).min(steps.end - steps.start);
                let mut first_step = steps.start;
                while first_step < steps.end {
                    let last_step = steps.end.min(first_step + at_once);
                    let steps = last_step - first_step;
                    let items = u64::from(part_count) * u64::from(steps);
                    let steps_each = items_each(kind, items, STEPS_EACH.min(steps));
                    let push = IlluminatePush {
                        light_ref,
                        cell_rows,
                        part_count,
                        first_part,
                        first_step,
                        last_step,
                        steps_each,
                        ..template
                    };
                    if self.planned_cost + items > u64::from(self.pace.size()) {
                        self.run(uploads)?;
                    }
                    self.planned.push(PlannedDispatch { edges: light.edges(), far: *far, push });
                    self.planned_cost += items;
                    first_step = last_step;
                }
                first_part += part_count;
            }
        }
        Ok(())
    }

    /// Runs the plan, after the uploads.
    fn run(&mut self, uploads: &mut Vec<Upload<'_>>) -> Result<()> {
        self.cancel.check()?;
        let planned = std::mem::take(&mut self.planned);
        self.planned_cost = 0;
        let kernels = self.kernels.clone();
        let made = planned.iter().map(|it| kernels.of(it.edges, it.far).get());
        let made: Vec<_> = made.collect::<Result<_>>()?;
        let uploads = std::mem::take(uploads);
        let gathering = self.gathering.take();
        let gather = |it| Ok((it, [kernels.energies.get()?, kernels.gather.get()?]));
        let gathering = gathering.map(gather).transpose()?;
        let record = |r: &mut Recorder<'_>| {
            if let Some((gathering, kernels)) = &gathering {
                gathering.record(*kernels, r);
            }
            for (PlannedDispatch { push, .. }, kernel) in planned.iter().zip(&made) {
                let shares = (push.last_step - push.first_step).div_ceil(push.steps_each);
                let groups = [push.part_count.div_ceil(GROUP), shares, 1];
                r.dispatch(kernel, bytemuck::bytes_of(push), groups);
            }
        };
        let time = self.device.run_with(&uploads, record, &mut [])?;
        self.pace.adapt(time);
        Ok(())
    }
}

/// Dispatch of a kernel of cells.
#[derive(Debug)]
struct PlannedDispatch {
    edges: ApertureEdges,
    /// Light may land in any row.
    far: bool,
    push: IlluminatePush,
}

/// Parts of cell rows, and what kernels do with them.
struct DispatchParts<'l> {
    pieces: Vec<DispatchPart<'l>>,
    parts: Vec<CellRowPart>,
}

/// Parts of cell rows for one kernel.
struct DispatchPart<'l> {
    light: &'l IlluminationBuffer,
    far: bool,
    parts: Range<u32>,
    /// Index of the cell row that parts count from.
    first_row: usize,
}

/// Appends the parts of cell rows; their range.
fn add_parts(parts: &mut Vec<CellRowPart>, cell_rows: &[CellRow], far: bool) -> Range<u32> {
    let first = numbers::count(parts.len());
    parts.extend(parts_of(cell_rows, far));
    first..numbers::count(parts.len())
}
