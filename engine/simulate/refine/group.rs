//! Patches that are refined together, and the patches beside them, whose base rays their estimates need.

use crate::sampling::{ProjectedBounds, ROWS_TOGETHER, ViewContext, Walls};
use beamlet_core::numbers;
use beamlet_interface::{PATCH_MISSED, PATCH_UNKNOWN, RefinedPatch, RefinedWall};
use std::collections::HashMap;
use std::ops::Range;

/// Base rectangles of a patch along x, where a scene does not say.
const BASE_COLUMNS: u32 = 6;
/// The same at most of a patch beside the recorded rows, which has one along z.
const BASE_COLUMNS_OUTSIDE: u32 = 4;
/// Least base rectangles along z.
const BASE_ROWS: u32 = 2;
/// Most base rectangles of a patch along x and z.
const MOST_BASE: [u32; 2] = [128, 64];

/// Base rectangles of the patches that a sample touches, by beamlet and row.
#[derive(Debug)]
pub(super) struct Touched {
    base: HashMap<(i64, i64), [u32; 2]>,
    /// Rows and beamlets that are known.
    rows: Range<i64>,
    beamlets: Range<i64>,
    walls: Walls,
}

impl Touched {
    /// The patches of some rows, and of one row on either side, that a shadow touches and whose light may be
    /// recorded: of other rows than the recorded ones only where a surface throws light out of its row.
    pub(super) fn new(view: &ViewContext<'_>, rows: &Range<i64>) -> Self {
        let lattice = view.lattice;
        let known = rows.start - 1..rows.end + 1;
        let recorded = view.recorded_rows();
        let sampling = &view.optics.sampling;
        let columns = sampling.cells.unwrap_or(BASE_COLUMNS);
        let inside = [columns, sampling.rows.max(BASE_ROWS)];
        let outside = [columns.min(BASE_COLUMNS_OUTSIDE), 1];
        let mut base = HashMap::new();
        for bounds in view.projected_bounds {
            let own = dense_for(bounds, lattice.period);
            let beamlets = bounds.patches(lattice)[1].clone();
            for row in bounds.rows_that_count(lattice, &recorded, &known) {
                let least = if recorded.contains(&row) { inside } else { outside };
                for beamlet in beamlets.clone() {
                    let of_patch = base.entry((beamlet, row)).or_insert(least);
                    *of_patch = [0, 1].map(|axis| of_patch[axis].max(own[axis]));
                }
            }
        }
        let walls = Walls::new(view, rows, inside);
        Self { base, rows: known, beamlets: lattice.beamlets.clone(), walls }
    }

    /// True if a shadow touches a patch.
    pub(super) fn has(&self, at: &(i64, i64)) -> bool {
        self.base.contains_key(at)
    }

    /// The touched patches of rows, in an order that keeps neighbours together.
    pub(super) fn of_rows(&self, rows: &Range<i64>) -> Vec<(i64, i64)> {
        let mut own: Vec<(i64, i64)> =
            self.base.keys().filter(|at| rows.contains(&at.1)).copied().collect();
        own.sort_unstable_by_key(|&(beamlet, row)| (row.div_euclid(ROWS_TOGETHER), beamlet, row));
        own
    }

    /// Base rectangles of a patch.
    pub(super) fn base_of(&self, at: &(i64, i64)) -> u32 {
        self.base.get(at).map_or(0, |[x, z]| x * z)
    }

    /// Patches as the device takes them, with the patches beside them behind.
    pub(super) fn group(
        &self,
        view: &ViewContext<'_>,
        own: &[(i64, i64)],
        lit: &Range<i64>,
    ) -> Group {
        let mut index: HashMap<(i64, i64), u32> = (0..).zip(own).map(|(n, at)| (*at, n)).collect();
        let beside = |&(beamlet, row): &(i64, i64)| {
            [(beamlet - 1, row), (beamlet + 1, row), (beamlet, row - 1), (beamlet, row + 1)]
        };
        let mut all = own.to_vec();
        for at in own.iter().flat_map(beside) {
            if self.has(&at) && !index.contains_key(&at) {
                index.insert(at, numbers::count(all.len()));
                all.push(at);
            }
        }
        let of = |at: (i64, i64)| match index.get(&at) {
            Some(index) => *index,
            None if self.beamlets.contains(&at.0) && self.rows.contains(&at.1) => PATCH_MISSED,
            None => PATCH_UNKNOWN,
        };
        let mut first = 0;
        let mut own_base = 0;
        let mut walls = Vec::new();
        let mut patches = Vec::with_capacity(all.len());
        for (number, at) in all.iter().enumerate() {
            let base = self.base[at];
            let [low, high, above, below] = beside(at).map(of);
            let own_walls = if number < own.len() { self.walls.of(at.0, at.1) } else { &[] };
            let is_lit = lit.contains(&at.1) && view.lattice.direct.contains(&at.0);
            patches.push(RefinedPatch {
                column: numbers::narrow::<u32>(at.0 - view.lattice.beamlets.start),
                row: numbers::narrow::<i32>(at.1),
                first,
                base,
                low,
                high,
                above,
                below,
                is_lit: is_lit.into(),
                first_wall: numbers::count(walls.len()),
                walls: numbers::count(own_walls.len()),
            });
            walls.extend_from_slice(own_walls);
            first += base[0] * base[1];
            if number + 1 == own.len() {
                own_base = first;
            }
        }
        Group { patches, walls, own: numbers::count(own.len()), own_base, all_base: first }
    }
}

/// Patches to refine, with the patches beside them behind.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) patches: Vec<RefinedPatch>,
    /// Facets that rays may miss, by patch.
    pub(super) walls: Vec<RefinedWall>,
    /// Number of the patches to refine.
    pub(super) own: u32,
    /// Their base rectangles, and all.
    pub(super) own_base: u32,
    pub(super) all_base: u32,
}

impl Group {
    /// Rows of all patches.
    pub(super) fn rows(&self) -> Range<i32> {
        let rows = || self.patches.iter().map(|patch| patch.row);
        rows().min().unwrap_or(0)..rows().max().map_or(0, |row| row + 1)
    }
}

/// Base rectangles along x and z that hide no component: at half of its mean chord two rays cross it wherever it is
/// thicker.
fn dense_for(bounds: &ProjectedBounds, period: f64) -> [u32; 2] {
    let count = |whole: f64, part: f64| numbers::whole::<u32>((whole / part).ceil().min(1e9));
    let wanted = [count(period, bounds.width), count(1.0, bounds.height)];
    [0, 1].map(|axis| wanted[axis].min(MOST_BASE[axis]))
}
