//! Energies for cells that are made on the device: flat tables of f32.

use super::EnergyBinning;
use super::FULL_SHARE;
use super::bars::{FAINT, LITTLE};
use crate::sampling::{CellBatch, CellMoments};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use beamlet_interface::{
    Cell, CellRow, KEPT_WORDS, MERGED_COLUMNS, MOMENTS_HEAD, Ray, RepeatedRectangle,
};
use bytemuck::Zeroable;
use rayon::prelude::*;
use std::ops::Range;

/// Largest displacement of merged light, periods.
const REACH: f64 = 8.0;

/// Constants by energy, for the device.
#[derive(Debug)]
pub(crate) struct EnergyTables {
    /// Numbers of the materials that act on light.
    pub(crate) materials: Vec<u32>,
    /// `[node][material][2]`, behind the nodes at the constants of the rays.
    pub(crate) constants: Vec<f32>,
    /// `[node][2]`.
    pub(crate) ratios: Vec<f32>,
    /// Words of the variances by rough surfaces in the moments of a ray, by pair of materials that refract
    /// differently.
    pub(crate) pairs: Vec<u32>,
    /// `[node][pair]`: square of the step of delta.
    pub(crate) steps: Vec<f32>,
    pub(crate) nodes: u32,
    pub(crate) groups: u32,
    pub(crate) columns: u32,
    pub(crate) alike_rows: u32,
    /// Width of a cell of full accuracy, m.
    pub(crate) full_width: f32,
    /// Tolerance of mean displacements, and limits of their spread over energies along x and z, m.
    pub(crate) tolerance: f32,
    pub(crate) spread: [f32; 2],
    /// Largest displacement of leaked light that is merged, m.
    pub(crate) reach: f32,
    /// Cells below this share of the grazing incidence are traced exactly at each energy.
    pub(crate) repeated_below: f32,
}

impl EnergyBinning {
    /// Tables by energy.
    pub(crate) fn tables(&self) -> EnergyTables {
        let all = 0..=self.nodes();
        let of = |node: usize| {
            self.acting.iter().flat_map(move |material| {
                let at = node * self.materials + material;
                [self.mu[at], self.delta[at]]
            })
        };
        let ratios = self.delta_ratio.iter().zip(&self.exact_retrace_threshold);
        let steps = self.delta.chunks(self.materials).take(self.nodes()).flat_map(|delta| {
            self.pairs.iter().map(|([a, b], _)| single((delta[*a] - delta[*b]).powi(2)))
        });
        EnergyTables {
            materials: self.acting.iter().map(|it| numbers::count(*it)).collect(),
            constants: all.flat_map(of).map(single).collect(),
            ratios: ratios.flat_map(|(a, b)| [single(*a), single(*b)]).collect(),
            steps: steps.collect(),
            pairs: self.pairs.iter().map(|(_, word)| numbers::count(MOMENTS_HEAD + word)).collect(),
            nodes: numbers::count(self.nodes()),
            groups: numbers::count(self.groups.len()),
            columns: numbers::count(self.slopes.len()),
            alike_rows: self.lattice.alike_rows,
            full_width: single(self.lattice.period * FULL_SHARE),
            tolerance: single(self.tolerance),
            reach: single(REACH * self.lattice.period),
            repeated_below: single(
                self.exact_retrace_threshold.iter().fold(0.0, |most: f64, it| most.max(*it)),
            ),
            spread: self.spread.map(single),
        }
    }

    /// Shares of light by masks for the device (`refine/shares.glsl`), of all columns in blocks of rows.
    pub(crate) fn shares_of(&self, blocks: &Range<i64>) -> Vec<f32> {
        let columns = numbers::count(self.slopes.len());
        let places: Vec<(u32, i64)> = blocks
            .clone()
            .flat_map(|block| (0..columns).map(move |column| (column, block)))
            .collect();
        let of_place = |place: &(u32, i64)| {
            let bars = self.bars(*place);
            let mut words = vec![f64::from(u8::from(bars.apart))];
            // A column whose energies are apart has no shares where the scene has no groups.
            bars.by_node.iter().for_each(|share| words.push(*share));
            words.resize(1 + self.nodes(), 0.0);
            let groups = bars.nodes.iter().zip(bars.shares.chunks(self.nodes())).zip(&self.groups);
            words.extend(groups.flat_map(|((nodes, shares), leaks)| {
                // Merged light is even along z.
                let merges = leaks.contains(&true) && !self.lattice.heights;
                let merged = merged_columns(merges, shares.iter().sum());
                [nodes.start as f64, nodes.end as f64, merged.into()]
            }));
            words.extend(&bars.shares);
            words.extend(bars.narrowings.iter().flatten());
            words.resize(self.words_of_shares(), 0.0);
            words.into_iter().map(single).collect::<Vec<f32>>()
        };
        places.par_iter().flat_map_iter(of_place).collect()
    }

    /// Cells of rectangles whose rays are traced exactly at each node, by list.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(crate) fn cells_at_nodes(
        &self,
        tracer: &Tracer,
        pose: u32,
        rectangles: &[RepeatedRectangle],
    ) -> Result<Vec<CellBatch>> {
        let ray = |it: &RepeatedRectangle| Ray {
            x: it.x,
            z: it.z,
            slope_x: it.slope_x,
            slope_z: it.slope_z,
            pose,
            key: 0,
        };
        let rays: Vec<Ray> = rectangles.iter().map(ray).collect();
        let results = tracer.walk_at_nodes(&vec![rays; self.nodes()])?;
        let mut lists = vec![CellBatch::default(); self.groups.len() + self.nodes()];
        let nodes = results.iter().zip(&self.delta_ratio);
        for ((of_node, ratio), list) in nodes.zip(&mut lists[self.groups.len()..]) {
            for (it, result) in rectangles.iter().zip(of_node) {
                let (row, mut cells) = (row_of(it), Vec::new());
                let place = Cell { x_low: it.x_low, x_high: it.x_high, ..Cell::zeroed() };
                self.push_exact(&mut cells, &row, &place, [result; 2], [0.0, 1.0]);
                let rough = it.variance * single(ratio * ratio);
                cells.iter_mut().for_each(|cell| cell.displacement_variance += rough);
                if !cells.is_empty() {
                    list.push(row, &cells, &CellMoments::default());
                }
            }
        }
        Ok(lists)
    }

    fn words_of_shares(&self) -> usize {
        1 + self.nodes() + self.groups.len() * (3 + self.nodes()) + 2 * self.nodes()
    }

    /// Words that the device keeps of the moments of a ray.
    pub(crate) const fn kept_words(&self) -> usize {
        self.acting.len() * KEPT_WORDS as usize + self.pairs.len()
    }

    /// Number of the groups of light.
    pub(crate) const fn group_count(&self) -> usize {
        self.groups.len()
    }

    /// Blocks of rows that a range of rows is in.
    pub(crate) fn blocks_of(&self, rows: &Range<i32>) -> Range<i64> {
        let block = |row: i32| i64::from(row).div_euclid(self.lattice.alike_rows.into());
        block(rows.start)..block((rows.end - 1).max(rows.start)) + 1
    }
}

/// The row of a cell of a rectangle.
fn row_of(it: &RepeatedRectangle) -> CellRow {
    CellRow {
        column: it.column,
        row: it.row,
        top: it.z_low,
        bottom: it.z_high,
        rows: 1,
        ..CellRow::zeroed()
    }
}

/// Columns of a patch that the light of a group is merged into; 0: it is not.
fn merged_columns(merges: bool, share: f64) -> u32 {
    match share {
        _ if !merges || share >= LITTLE => 0,
        _ if share < FAINT => 1,
        _ => MERGED_COLUMNS,
    }
}
