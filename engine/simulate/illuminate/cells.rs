//! Illuminates cell rows of cells at every mask step.

use super::fill::items_each;
use super::fit::fit;
use super::light::{ApertureEdges, IlluminationBuffer};
use super::row_parts::parts_of;
use super::spectral::{Dispatches, Gatherer, Gathering};
use super::sums::PixelSums;
use crate::sampling::{CellBatch, lands_near};
use beamlet_core::cancel::Cancel;
use beamlet_core::{Result, numbers};
use beamlet_gpu::{Buffer, Device, DeviceKind, LazyKernel, Pace, Recorder, Upload, push_bytes};
use beamlet_interface::{
    Address, Cell, CellRow, CellRowPart, EnergiesPush, GROUP, GatherPush, IlluminatePush,
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

    /// The kernel of most cells.
    pub(crate) const fn usual(&self, edges: ApertureEdges) -> &LazyKernel {
        match edges {
            ApertureEdges::Straight => &self.near,
            ApertureEdges::Walls => &self.walls,
            ApertureEdges::Heights => &self.heights,
        }
    }

    /// The kernel of cells.
    fn of(&self, reach: Reach) -> &LazyKernel {
        match reach {
            Reach::Near => &self.near,
            Reach::Far => &self.far,
            Reach::Walls => &self.walls,
            Reach::Heights => &self.heights,
        }
    }
}

/// Where light of cells may land.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reach {
    /// In their row and the two beside it.
    Near,
    /// In any row.
    Far,
    /// In any row, past such walls.
    Walls,
    /// In any row, through apertures that end along z.
    Heights,
}

impl Reach {
    fn of(light: &IlluminationBuffer, far: bool) -> Self {
        match (light.edges(), far) {
            (ApertureEdges::Heights, _) => Self::Heights,
            (ApertureEdges::Walls, _) => Self::Walls,
            (ApertureEdges::Straight, true) => Self::Far,
            (ApertureEdges::Straight, false) => Self::Near,
        }
    }
}

/// Cells that the buffers hold: lists that share a submission have no more. They grow for larger lists.
const CELLS_TOGETHER: usize = 1 << 16;

/// Parts of cell rows times steps of the first submission on a GPU, and the least and most of one. Where a detector blurs
/// light along z, one takes milliseconds on a processor.
const SIZES: [u32; 3] = [1 << 16, 256, 1 << 26];

/// Illuminates cells.
#[derive(Debug)]
pub(crate) struct CellIlluminator {
    device: Arc<Device>,
    kernels: Arc<CellKernels>,
    parts: Option<Buffer>,
    cell_rows: Option<Buffer>,
    cells: Option<Buffer>,
    /// Parts of cell rows times steps of a submission.
    pace: Pace,
    /// Dispatches of the next submission, and their cost.
    planned: Vec<(Reach, IlluminatePush)>,
    /// Dispatches before these.
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
            parts: None,
            cell_rows: None,
            cells: None,
            pace: Pace::new(SIZES[0] >> if is_cpu { 6 } else { 0 }, SIZES[1], SIZES[2]),
            planned: Vec::new(),
            gathering: None,
            planned_cost: 0,
            cancel: cancel.clone(),
        }
    }

    /// Adds the light of lists of cell rows to the sums, at `steps` mask steps.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`], [`beamlet_core::Error::Device`]; [`beamlet_core::Error::Interrupted`].
    pub(crate) fn add<'l>(
        &mut self,
        lists: impl Iterator<Item = (&'l IlluminationBuffer, &'l CellBatch)>,
        sums: &PixelSums,
        steps: u32,
    ) -> Result<()> {
        let lists = lists.filter(|(_, list)| !list.cell_rows.is_empty() && !list.cells.is_empty());
        let lists: Vec<_> = lists.collect();
        let mut rest = &lists[..];
        while !rest.is_empty() {
            let mut cells = 0;
            let fits = |(_, list): &&(&IlluminationBuffer, &CellBatch)| {
                cells += list.cells.len();
                cells <= CELLS_TOGETHER
            };
            let count = rest.iter().take_while(fits).count().max(1);
            self.add_together(&rest[..count], sums, steps)?;
            rest = &rest[count..];
        }
        Ok(())
    }

    /// Adds the light of all energies of cells to the sums, at `steps` mask steps. `lights`: of the lists of the gatherer.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub(crate) fn add_gathered(
        &mut self,
        gatherer: &mut Gatherer<'_>,
        gathering: &Gathering<'_>,
        lights: &[IlluminationBuffer],
        sums: &PixelSums,
        steps: u32,
    ) -> Result<()> {
        let of_lists = gathering.rows.iter().map(|it| it.rows_of_list() * it.lists.len());
        self.fit(gathering.places, of_lists.sum())?;
        let (Some(cells), Some(cell_rows)) = (self.cells.take(), self.cell_rows.take()) else {
            unreachable!("both were made")
        };
        let (mut parts, mut pieces, mut address) = (Vec::new(), Vec::new(), cell_rows.address());
        for rows in &gathering.rows {
            let mut add = |some: &[CellRow], first_row: u32, far: bool| {
                let first = numbers::count(parts.len());
                let own = parts_of(some, first_row, far).into_iter().map(|part| {
                    // Energies may have several cells for a traced one.
                    let is_last = part.last == some[(part.cell_row - first_row) as usize].cell_count;
                    CellRowPart { last: if is_last { u32::MAX } else { part.last }, ..part }
                });
                parts.extend(own);
                first..numbers::count(parts.len())
            };
            let all = &rows.cell_rows;
            let near = if gatherer.lands_far() { &[][..] } else { all };
            let near = add(near, 0, false);
            let far = add(&all[..rows.far as usize], numbers::count(all.len()), true);
            for light in &lights[rows.lists.clone()] {
                for (far, parts) in [(light.rows_apart(), near.clone()), (true, far.clone())] {
                    pieces.push(DispatchPart { light, far, parts, cell_rows: address });
                }
                address += (rows.rows_of_list() * size_of::<CellRow>()) as Address;
            }
        }
        let mut uploads = Vec::new();
        self.gathering = Some(gatherer.prepare(gathering, (&cells, &cell_rows), &mut uploads)?);
        self.run_pieces((&cells, sums), (&pieces, &parts), steps, uploads)?;
        (self.cells, self.cell_rows) = (Some(cells), Some(cell_rows));
        Ok(())
    }

    /// Makes the buffers large enough for this many cells and cell rows.
    fn fit(&mut self, cells: usize, cell_rows: usize) -> Result<()> {
        let [cells, cell_rows] = [cells, cell_rows].map(|it| it.max(CELLS_TOGETHER));
        self.cells = Some(fit::<Cell>(&self.device, self.cells.take(), "cells", cells)?);
        let before = self.cell_rows.take();
        self.cell_rows = Some(fit::<CellRow>(&self.device, before, "cell rows", cell_rows)?);
        Ok(())
    }

    /// Adds the light of lists that are on the device together.
    fn add_together(
        &mut self,
        lists: &[(&IlluminationBuffer, &CellBatch)],
        sums: &PixelSums,
        steps: u32,
    ) -> Result<()> {
        let count = |of: fn(&CellBatch) -> usize| lists.iter().map(|(_, list)| of(list)).sum();
        let rows: usize = count(|l| l.cell_rows.len());
        self.fit(count(|l| l.cells.len()), rows)?;
        let (Some(cells), Some(cell_rows)) = (self.cells.take(), self.cell_rows.take()) else {
            unreachable!("both were made")
        };
        let mut uploads = Vec::new();
        let mut ordered = Vec::with_capacity(rows);
        let mut parts = Vec::with_capacity(rows);
        let mut pieces = Vec::new();
        let mut first_cell = 0;
        for (light, list) in lists {
            let at = (first_cell * size_of::<Cell>()) as u64;
            uploads.push(Upload::new(&cells, at, &list.cells));
            // Light of parts of a spot that spread differently over rows has its own kernel, and so has
            // light of cells that lands far off.
            let near = |cell_row: &&CellRow| {
                !light.rows_apart() && lands_near(&list.cells[cell_row.first_cell as usize])
            };
            let (near, far): (Vec<_>, Vec<_>) = list.cell_rows.iter().partition(near);
            for (some, far) in [(near, false), (far, true)] {
                let (first_row, first_part) = (ordered.len(), numbers::count(parts.len()));
                let moved = |cell_row: &CellRow| CellRow {
                    first_cell: cell_row.first_cell + numbers::count(first_cell),
                    ..*cell_row
                };
                ordered.extend(some.into_iter().map(moved));
                parts.extend(parts_of(&ordered[first_row..], numbers::count(first_row), far));
                let parts = first_part..numbers::count(parts.len());
                pieces.push(DispatchPart { light, far, parts, cell_rows: cell_rows.address() });
            }
            first_cell += list.cells.len();
        }
        uploads.push(Upload::new(&cell_rows, 0, &ordered));
        self.run_pieces((&cells, sums), (&pieces, &parts), steps, uploads)?;
        (self.cells, self.cell_rows) = (Some(cells), Some(cell_rows));
        Ok(())
    }

    /// Illuminates pieces, whose parts are those of the range of each, after uploads.
    fn run_pieces(
        &mut self,
        (cells, sums): (&Buffer, &PixelSums),
        (pieces, parts): (&[DispatchPart<'_>], &[CellRowPart]),
        steps: u32,
        uploads: Vec<Upload<'_>>,
    ) -> Result<()> {
        let most = parts.len().max(CELLS_TOGETHER);
        let before = self.parts.take();
        let buffer = fit::<CellRowPart>(&self.device, before, "parts of cell rows", most)?;
        let mut uploads: Vec<Upload<'_>> = uploads;
        uploads.push(Upload::new(&buffer, 0, parts));
        let template = IlluminatePush {
            parts: buffer.address(),
            cells: cells.address(),
            sums: sums.buffer.address(),
            steps,
            ..bytemuck::Zeroable::zeroed()
        };
        pieces.iter().try_for_each(|piece| self.plan(piece, template, steps, &mut uploads))?;
        self.run(&mut uploads)?;
        drop(uploads);
        self.parts = Some(buffer);
        Ok(())
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
        let DispatchPart { light, far, parts, cell_rows } = piece;
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
                        cell_rows: *cell_rows,
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
                    self.planned.push((Reach::of(light, *far), push));
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
        let made: Vec<_> =
            planned.iter().map(|(reach, _)| kernels.of(*reach).get()).collect::<Result<_>>()?;
        let uploads = std::mem::take(uploads);
        let gathering = self.gathering.take();
        let gathers = gathering
            .map(|it| Ok((it, [kernels.energies.get()?, kernels.gather.get()?])))
            .transpose()?;
        let record = |r: &mut Recorder<'_>| {
            if let Some((gathering, kernels)) = &gathers {
                gathering.record(*kernels, r);
            }
            for ((_, push), kernel) in planned.iter().zip(&made) {
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

/// Parts of cell rows for one kernel.
struct DispatchPart<'l> {
    light: &'l IlluminationBuffer,
    far: bool,
    parts: Range<u32>,
    /// Address of the first of its cell rows.
    cell_rows: Address,
}
