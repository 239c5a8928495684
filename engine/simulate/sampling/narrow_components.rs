//! Components that may hide between the base rays of a patch.

use super::patch_error::NarrowComponent;
use super::patch_grid::PatchGrid;
use super::projected_bounds::ProjectedBounds;
use super::view_context::ViewContext;
use beamlet_core::numbers::single;
use rayon::prelude::*;
use std::ops::Range;

/// Components that take less light than this share of the budget together may hide.
const HIDDEN: f64 = 0.05;

/// Components that may hide between the base rays of each patch, in its coordinates.
#[derive(Debug)]
pub(super) struct NarrowComponents {
    grid: PatchGrid,
    /// Components of each patch, in the order of their light.
    components: Vec<Vec<NarrowComponent>>,
}

impl NarrowComponents {
    /// The components of the patches of some rows, each of `base` rectangles in x and z.
    pub(super) fn new(view: &ViewContext<'_>, rows: &Range<i64>, base: [u32; 2]) -> Self {
        let lattice = view.lattice;
        let cell = [lattice.period / f64::from(base[0]), 1.0 / f64::from(base[1])];
        let grid = PatchGrid { rows: rows.clone(), beamlets: lattice.beamlets.clone() };
        let mut touched: Vec<Vec<u32>> = vec![Vec::new(); grid.count()];
        for (index, bounds) in (0..).zip(view.projected_bounds) {
            if bounds.width >= cell[0] && bounds.height >= cell[1] {
                continue;
            }
            let [own, beamlets] = bounds.patches(lattice);
            for row in own.start.max(rows.start)..own.end.min(rows.end) {
                touched[grid.in_row(row, beamlets.clone())]
                    .iter_mut()
                    .for_each(|patch| patch.push(index));
            }
        }
        let components = touched
            .into_par_iter()
            .enumerate()
            .map(|(patch, touched)| {
                let (beamlet, row) = grid.place(patch);
                let (centre, row) = (lattice.centre(beamlet), row as f64);
                let component = |index: u32| {
                    let bounds: &ProjectedBounds = &view.projected_bounds[index as usize];
                    NarrowComponent {
                        x: bounds.x.map(|x| single(x - centre)),
                        z: bounds.rows.map(|z| single(z - row)),
                        width: single(bounds.width),
                        height: single(bounds.height),
                        light: bounds.area * f64::from(view.response.weight),
                    }
                };
                shown(touched.into_iter().map(component).collect(), HIDDEN * view.budget.light)
            })
            .collect();
        Self { grid, components }
    }

    /// Components of a patch.
    pub(super) fn of(&self, beamlet: i64, row: i64) -> &[NarrowComponent] {
        self.grid.index(beamlet, row).map_or(&[], |patch| &self.components[patch])
    }
}

/// The components except the faintest, which take at most `least` light together: booleans may leave
/// thousands of slivers.
fn shown(mut components: Vec<NarrowComponent>, least: f64) -> Vec<NarrowComponent> {
    components.sort_by(|a, b| a.light.total_cmp(&b.light));
    let mut sum = 0.0;
    let is_hidden = |component: &&NarrowComponent| {
        sum += component.light;
        sum <= least
    };
    let hidden = components.iter().take_while(is_hidden).count();
    components.drain(..hidden);
    components
}
