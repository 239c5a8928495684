//! Patches on which shadows of bodies fall.

use super::even::Bodies;
use super::heights::Features;
use crate::sampling::{PatchGrid, ViewContext};
use std::ops::Range;

/// Most bodies of a patch of lines: among more, rays are tried that are spread evenly.
const MOST_BODIES: u32 = 32;

/// Patches of some rows that shadows touch.
#[derive(Debug)]
pub(crate) struct PatchPlaces {
    grid: PatchGrid,
    touched: Vec<Option<Touched>>,
}

/// Bodies whose shadows fall on a patch.
#[derive(Debug, Clone, Default)]
pub(super) struct Touched {
    pub(super) features: Features,
    pub(super) bodies: Bodies,
}

impl PatchPlaces {
    /// Patches of some rows.
    pub(crate) fn new(view: &ViewContext<'_>, rows: Range<i64>) -> Self {
        let lattice = view.lattice;
        let grid = PatchGrid { rows, beamlets: lattice.beamlets.clone() };
        let mut touched: Vec<Option<Touched>> = vec![None; grid.count()];
        let recorded = view.recorded_rows();
        for shadow in view.projected_bounds {
            let beamlets = shadow.patches(lattice)[1].clone();
            for row in shadow.rows_that_count(lattice, &recorded, &grid.rows) {
                for at in grid.in_row(row, beamlets.clone()) {
                    let patch = touched[at].get_or_insert_default();
                    patch.bodies.count += 1;
                    patch.bodies.narrowest = patch.bodies.narrowest.min(shadow.width);
                    patch.bodies.lowest = patch.bodies.lowest.min(shadow.height);
                    patch.features.add(shadow, row);
                }
            }
        }
        Self { grid, touched }
    }

    pub(super) fn at(&self, beamlet: i64, row: i64) -> Option<&Touched> {
        self.grid.index(beamlet, row).and_then(|at| self.touched[at].as_ref())
    }

    /// True if no shadow falls that matters.
    pub(crate) fn is_empty(&self) -> bool {
        self.touched.iter().all(Option::is_none)
    }

    /// True if so many bodies may be in a patch that rays are tried.
    pub(crate) fn is_crowded(&self, beamlet: i64, row: i64) -> bool {
        self.at(beamlet, row).is_some_and(|it| it.bodies.count > MOST_BODIES)
    }

    /// True if a shadow falls on a patch.
    pub(crate) fn is_touched(&self, beamlet: i64, row: i64) -> bool {
        self.at(beamlet, row).is_some()
    }
}
