//! Buffers and dispatches of the kernels that gather the energies of cells.

use super::EnergyBinning;
use super::bars::MaskTransmissionCache;
use crate::sampling::{CellBatch, balance};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::count;
use beamlet_gpu::{Buffer, Device, Recorder, Upload};
use beamlet_interface::{
    Address, Cell, CellRow, ENERGIES_EACH, EnergiesPush, EnergyParams, EnergyResult, EnergyRow,
    GROUP, GatherPush, RayResult,
};
use std::ops::Range;
use std::sync::Arc;

/// Places of gathered cells that a part of a batch has; one cell row may have more.
const PLACES: usize = 1 << 19;
/// Cells that are gathered at once: exact transport at each node takes 2 KiB and more a cell.
const MOST_CELLS: usize = 1 << 15;

/// Most cells of an invocation that gathers: of larger cell rows each has a part.
const CELLS_EACH: u32 = 512;

/// Cell rows that are gathered into the same lists.
#[derive(Debug, Default)]
pub(in crate::illuminate) struct GatheredRows {
    /// First those whose light may land far.
    pub(in crate::illuminate) cell_rows: Vec<CellRow>,
    /// Number of the cell rows whose light may land far.
    pub(in crate::illuminate) far: usize,
    /// Lists, as indices of the light of [`EnergyBinning::lights`].
    pub(in crate::illuminate) lists: Range<usize>,
    /// Places and bars.
    energy_rows: Vec<EnergyRow>,
    by_energy: bool,
}

impl GatheredRows {
    /// Cell rows of a list: of all, and again of those whose light may land far.
    pub(in crate::illuminate) fn rows_of_list(&self) -> usize {
        self.cell_rows.len() + self.far
    }
}

/// Work of the gathering of a part of a batch, until the device has done it.
#[derive(Debug)]
pub(crate) struct Gathering<'c> {
    cells: &'c CellBatch,
    /// [`EnergiesPush::exact`], `rays` and `repeated`.
    exact: Vec<u32>,
    rays: Vec<RayResult>,
    repeated: Vec<u32>,
    bars: Vec<f32>,
    /// Cell rows gathered by groups of energies, and cell rows gathered at each energy.
    pub(in crate::illuminate) rows: [GatheredRows; 2],
    /// Places of gathered cells.
    pub(in crate::illuminate) places: usize,
    /// Results of cells at energies.
    pub(in crate::illuminate) results: usize,
}

impl Gathering<'_> {
    /// Bytes that go to the device.
    pub(in crate::illuminate) fn bytes(&self) -> usize {
        self.inputs().iter().map(|input| input.len()).sum()
    }

    fn inputs(&self) -> [&[u8]; 10] {
        let [groups, energies] = &self.rows;
        [
            bytemuck::cast_slice(&self.cells.cells),
            bytemuck::cast_slice(&self.cells.moments.ends),
            bytemuck::cast_slice(&self.exact),
            bytemuck::cast_slice(&self.rays),
            bytemuck::cast_slice(&self.repeated),
            bytemuck::cast_slice(&self.bars),
            bytemuck::cast_slice(&groups.cell_rows),
            bytemuck::cast_slice(&groups.energy_rows),
            bytemuck::cast_slice(&energies.cell_rows),
            bytemuck::cast_slice(&energies.energy_rows),
        ]
    }
}

/// Gathers the energies of cells.
#[derive(Debug)]
pub(crate) struct Gatherer<'s> {
    binning: &'s EnergyBinning,
    params: Buffer,
    /// Constants, which the parameters point to.
    _constants: Buffer,
    bars: MaskTransmissionCache,
}

impl<'s> Gatherer<'s> {
    /// Bytes of its buffers on the device, and of the gathered cells; those of `MOST_CELLS` cells with moments of three
    /// materials.
    pub(crate) const BYTES: u64 = (PLACES
        * (size_of::<Cell>().next_power_of_two() + size_of::<EnergyResult>())
        + MOST_CELLS * 256) as u64;

    /// A gatherer of the energies of a scene.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`].
    pub(crate) fn new(device: &Arc<Device>, binning: &'s EnergyBinning) -> Result<Self> {
        let constants = device.upload("constants of energies", &binning.constants)?;
        let params = EnergyParams { constants: constants.address(), ..binning.params };
        Ok(Self {
            binning,
            params: device.upload("energies", &[params])?,
            _constants: constants,
            bars: MaskTransmissionCache::default(),
        })
    }

    /// Cells that are gathered at once.
    pub(crate) fn cells_at_once(&self) -> usize {
        (PLACES / (self.binning.nodes() * self.binning.groups.len().max(1))).min(MOST_CELLS)
    }

    /// The work of gathering cells; `tracer`: `None` for cells without a sample.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(crate) fn plan<'c>(
        &mut self,
        tracer: Option<&Tracer>,
        cells: &'c CellBatch,
    ) -> Result<Gathering<'c>> {
        let binning = self.binning;
        let (rays, repeated) = binning.exact_results(tracer, cells)?;
        let mut exact = vec![0; cells.cells.len()];
        for (number, it) in (1..).zip(&cells.moments.exact) {
            exact[it.cell as usize] = number;
        }
        self.bars.set_places(binning, &cells.cell_rows);
        let at_places = self.bars.places();
        let parts = |row: CellRow| {
            let ends = (0..row.cell_count).step_by(CELLS_EACH as usize);
            ends.map(move |first| CellRow {
                first_cell: row.first_cell + first,
                cell_count: CELLS_EACH.min(row.cell_count - first),
                ..row
            })
        };
        let mut ordered: Vec<CellRow> = cells.cell_rows.iter().copied().flat_map(parts).collect();
        balance(&mut ordered);
        let mut all: Vec<(CellRow, usize, bool)> = ordered
            .iter()
            .map(|row| {
                (*row, self.bars.index(binning, row), binning.may_land_far(cells, &exact, row))
            })
            .collect();
        all.sort_by_key(|(_, _, is_far)| !is_far);
        let (groups, nodes) = (binning.groups.len(), binning.nodes());
        let words = count(at_places.first().map_or(0, |(_, bars)| bars.words.len()));
        let mut rows = [GatheredRows::default(), GatheredRows::default()];
        (rows[0].lists, rows[1].lists) = (0..groups, groups..groups + nodes);
        rows[1].by_energy = true;
        let mut places = 0;
        for (row, bars, is_far) in all {
            let of = &mut rows[usize::from(at_places[bars].1.apart)];
            of.cell_rows.push(row);
            of.far += usize::from(is_far);
            of.energy_rows.push(EnergyRow { bars: count(bars) * words, first_cell: count(places) });
            let of_cell = if of.by_energy { 1 } else { nodes };
            places += row.cell_count as usize * of_cell * of.lists.len();
        }
        let bars = at_places.iter().flat_map(|(_, bars)| &bars.words).copied().collect();
        let results = cells.cells.len() * nodes;
        Ok(Gathering { cells, exact, rays, repeated, bars, rows, places, results })
    }

    /// Adds the uploads of work, and gives its dispatches into buffers of cells and of cell rows.
    pub(in crate::illuminate) fn prepare<'u>(
        &self,
        work: &'u Gathering<'_>,
        [inputs, results]: &'u [Arc<Buffer>; 2],
        [gathered, gathered_rows]: &[Arc<Buffer>; 2],
        uploads: &mut Vec<Upload<'u>>,
    ) -> Dispatches {
        let Gathering { cells, rows, .. } = work;
        let mut end = 0;
        let addresses = work.inputs().map(|input| {
            let at = end;
            end += input.len() as u64;
            uploads.push(Upload::new(inputs, at, input));
            inputs.address() + at
        });
        let [of_cells, moments, exact, rays, repeated, bars, of_rows @ ..] = addresses;
        let energies = EnergiesPush {
            params: self.params.address(),
            cells: of_cells,
            moments,
            exact,
            rays,
            repeated,
            results: results.address(),
            cell_count: count(cells.cells.len()),
            has_moments: (!cells.moments.ends.is_empty()).into(),
        };
        let mut first_row = 0;
        let gather = rows.iter().zip(of_rows.chunks(2)).map(|(rows, of_rows)| {
            let push = GatherPush {
                params: self.params.address(),
                cell_rows: of_rows[0],
                energy_rows: of_rows[1],
                cells: of_cells,
                results: results.address(),
                bars,
                gathered: gathered.address(),
                gathered_rows: gathered_rows.address() + first_row,
                row_count: count(rows.cell_rows.len()),
                far_count: count(rows.far),
                by_energy: rows.by_energy.into(),
            };
            first_row += (rows.rows_of_list() * rows.lists.len() * size_of::<CellRow>()) as Address;
            GatherDispatch { push, lists: count(rows.lists.len()) }
        });
        let gather = gather.collect();
        Dispatches { energies, energy_count: count(self.binning.nodes()), gather }
    }
}

/// Dispatch that gathers cell rows into lists.
#[derive(Debug)]
struct GatherDispatch {
    push: GatherPush,
    /// Number of the lists.
    lists: u32,
}

/// Dispatches of the gathering.
#[derive(Debug)]
pub(in crate::illuminate) struct Dispatches {
    energies: EnergiesPush,
    energy_count: u32,
    gather: Vec<GatherDispatch>,
}

impl Dispatches {
    /// Records them with a barrier behind.
    pub(in crate::illuminate) fn record(
        &self,
        [energies, gather]: [&beamlet_gpu::Kernel; 2],
        r: &mut Recorder<'_>,
    ) {
        let push = &self.energies;
        let groups =
            [push.cell_count.div_ceil(GROUP), self.energy_count.div_ceil(ENERGIES_EACH), 1];
        r.dispatch(energies, bytemuck::bytes_of(push), groups);
        r.barrier();
        for GatherDispatch { push, lists } in &self.gather {
            let groups = [push.row_count.div_ceil(GROUP), *lists, 1];
            r.dispatch(gather, bytemuck::bytes_of(push), groups);
        }
        r.barrier();
    }
}
