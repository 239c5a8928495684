//! Energies of a scene with a spectrum, on the device.

use super::buffers::Buffers;
use super::group::Group;
use super::tables::{address, table};
use crate::illuminate::{EnergyBinning, EnergyTables};
use crate::sampling::CellBatch;
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_gpu::{Buffer, Device, Memory, Upload};
use beamlet_interface::{RefinedSpectrum, RepeatedRectangle};
use std::ops::Range;
use std::sync::Arc;

/// Tables by energy on the device, and the shares of light by rows as far as they are known.
#[derive(Debug)]
pub(super) struct Spectrum<'s> {
    energies: &'s EnergyBinning,
    pub(super) tables: EnergyTables,
    materials: Buffer,
    constants: Buffer,
    ratios: Buffer,
    /// Where surfaces are rough.
    pairs: Option<Buffer>,
    steps: Option<Buffer>,
    counts: Buffer,
    record: Buffer,
    shares: Option<Buffer>,
    /// Blocks of rows of the shares; shares that the device does not have yet.
    blocks: Range<i64>,
    unsent: Vec<f32>,
    sent: [RefinedSpectrum; 1],
}

impl<'s> Spectrum<'s> {
    pub(super) fn new(device: &Arc<Device>, energies: &'s EnergyBinning) -> Result<Self> {
        let tables = energies.tables();
        let lists = u64::from(tables.groups + tables.nodes);
        let make = |name, bytes| device.buffer(name, bytes, Memory::Device);
        Ok(Self {
            materials: device.upload("materials of a spectrum", &with_one(&tables.materials))?,
            constants: device.upload("constants by energy", &with_one(&tables.constants))?,
            ratios: device.upload("strengths of refraction by energy", &tables.ratios)?,
            pairs: table(device, "pairs of materials", &tables.pairs)?,
            steps: table(device, "steps of delta by energy", &tables.steps)?,
            counts: make("numbers of cells by list", 4 * (4 * lists + 1))?,
            record: make("energies of refinement", size_of::<RefinedSpectrum>() as u64)?,
            shares: None,
            blocks: 0..0,
            unsent: Vec::new(),
            sent: bytemuck::Zeroable::zeroed(),
            energies,
            tables,
        })
    }

    /// Words that are kept of the moments of a ray, and groups of light.
    pub(super) fn sizes(&self) -> [u32; 2] {
        [numbers::count(self.energies.kept_words()), self.tables.groups]
    }

    /// Words of the numbers of cells: by list, and of all.
    pub(super) fn count_words(&self) -> usize {
        2 * (self.tables.groups + self.tables.nodes) as usize + 1
    }

    pub(super) const fn counts(&self) -> &Buffer {
        &self.counts
    }

    pub(super) fn address(&self) -> u64 {
        self.record.address()
    }

    /// Prepares the rows of a group, whose rectangles are in these buffers.
    pub(super) fn take(
        &mut self,
        device: &Arc<Device>,
        (buffers, tracer): (&Buffers, &Tracer),
        group: &Group,
    ) -> Result<()> {
        let blocks = self.energies.blocks_of(&group.rows());
        if blocks.start < self.blocks.start || blocks.end > self.blocks.end {
            self.unsent = self.energies.shares_of(&blocks);
            let bytes = 4 * self.unsent.len() as u64;
            if self.shares.as_ref().is_none_or(|known| known.len() < bytes) {
                self.shares =
                    Some(device.buffer("shares of light by energy", bytes, Memory::Device)?);
            }
            self.blocks = blocks;
        }
        self.sent = [RefinedSpectrum {
            traced: tracer.moments().address(),
            kept: address(&buffers.kept),
            materials: self.materials.address(),
            constants: self.constants.address(),
            ratios: self.ratios.address(),
            pairs: address(&self.pairs),
            steps: address(&self.steps),
            shares: address(&self.shares),
            counts: self.counts.address(),
            marks: address(&buffers.marks),
            merged: address(&buffers.merged),
            repeated: address(&buffers.repeated),
            nodes: self.tables.nodes,
            material_count: numbers::count(self.tables.materials.len()),
            pair_count: numbers::count(self.tables.pairs.len()),
            stride: tracer.moment_stride(),
            groups: self.tables.groups,
            columns: self.tables.columns,
            alike_rows: self.tables.alike_rows,
            first_block: numbers::narrow::<i32>(self.blocks.start),
            full_width: self.tables.full_width,
            tolerance: self.tables.tolerance,
            spread: self.tables.spread[0],
            spread_z: self.tables.spread[1],
            reach: self.tables.reach,
            repeated_below: self.tables.repeated_below,
        }];
        Ok(())
    }

    /// Uploads of the first submission of a group.
    pub(super) fn uploads(&self) -> Vec<Upload<'_>> {
        let mut uploads = vec![Upload::new(&self.record, 0, &self.sent)];
        if let Some(shares) = self.shares.as_ref().filter(|_| !self.unsent.is_empty()) {
            uploads.push(Upload::new(shares, 0, &self.unsent));
        }
        uploads
    }

    /// Cells of rectangles whose rays are traced exactly at each energy, by list.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(super) fn repeat(
        &self,
        tracer: &Tracer,
        pose: u32,
        rectangles: &[RepeatedRectangle],
    ) -> Result<Vec<CellBatch>> {
        self.energies.cells_at_nodes(tracer, pose, rectangles)
    }

    /// Notes that a group was begun.
    pub(super) fn is_sent(&mut self) {
        self.unsent.clear();
    }
}

/// A table, which is not empty.
fn with_one<T: bytemuck::Zeroable + Copy>(table: &[T]) -> Vec<T> {
    let mut table = table.to_vec();
    table.resize(table.len().max(1), T::zeroed());
    table
}
