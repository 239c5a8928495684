//! Base rays of some rows and one ring around them, at fixed places in every patch. Their results do not
//! depend on bands of rows, so refinement may use neighbours.

use super::patch::part;
use super::patch_grid::PatchGrid;
use super::view_context::ViewContext;
use crate::lines::PatchPlaces;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use beamlet_interface::{Ray, RayResult};
use std::ops::Range;

/// Rows whose rays go to the device side by side: cells are narrow and rows high, so rays at one x of a
/// few rows are closer than the rays of one row.
pub(crate) const ROWS_TOGETHER: i64 = 4;

/// Results of the base rays of some rows and beamlets.
#[derive(Debug)]
pub(crate) struct BaseLattice {
    grid: PatchGrid,
    /// Rectangles of a patch in x and z.
    pub(super) base: [u32; 2],
    period: f32,
    /// Place of the results of a patch, by row and beamlet; none where no shadow falls.
    places: Vec<Option<u32>>,
    results: Vec<RayResult>,
    /// Result of rays that miss the sample.
    empty: RayResult,
}

/// A result found beside a rectangle, with the centre that it holds for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    pub(super) result: RayResult,
    /// From the centre of the patch's own beamlet, and from its own row.
    pub(super) x: f32,
    pub(super) z: f32,
}

impl BaseLattice {
    /// Traces the base rays of the patches of `rows`, and of those around them, that a shadow
    /// touches, except the rays of `before`: another lattice of the same view.
    pub(super) fn trace(
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        rows: &Range<i64>,
        patches: &PatchPlaces,
        before: Option<&Self>,
    ) -> Result<Self> {
        let rows = rows.start - 1..rows.end + 1;
        let grid = PatchGrid { rows, beamlets: view.lattice.beamlets.clone() };
        let mut places = vec![None; grid.count()];
        mark_near_rays(patches, &grid, &mut places);
        let base = [view.lattice.cells, view.optics.sampling.rows];
        let size = base[0] * base[1];
        let mut count = 0;
        for place in places.iter_mut().flatten() {
            *place = count;
            count += size;
        }
        let mut lattice = Self {
            grid,
            base,
            period: single(view.lattice.period),
            places,
            results: Vec::new(),
            empty: bytemuck::Zeroable::zeroed(),
        };
        let known = |beamlet, row| before.and_then(|before| before.patch(beamlet, row));
        let (order, rays) = lattice.rays(view, &|beamlet, row| known(beamlet, row).is_none());
        let traced = tracer.trace(&rays)?;
        lattice.results = bytemuck::zeroed_vec(count as usize);
        for row in lattice.grid.rows.clone() {
            for beamlet in lattice.grid.beamlets.clone() {
                let place = lattice.grid.index(beamlet, row).and_then(|at| lattice.places[at]);
                if let (Some(first), Some(results)) = (place, known(beamlet, row)) {
                    let first = first as usize;
                    lattice.results[first..first + results.len()].copy_from_slice(results);
                }
            }
        }
        for (at, result) in order.iter().zip(traced) {
            lattice.results[*at as usize] = result;
        }
        Ok(lattice)
    }

    /// Results of a patch by z, then x; nothing where no shadow falls that matters.
    pub(super) fn patch(&self, beamlet: i64, row: i64) -> Option<&[RayResult]> {
        let first = self.places[self.grid.index(beamlet, row)?]? as usize;
        Some(&self.results[first..first + (self.base[0] * self.base[1]) as usize])
    }

    /// Centre of a base rectangle.
    fn centre(&self, column: u32, line: u32) -> [f32; 2] {
        let half = 0.5 * self.period;
        let middle = |[low, high]: [f32; 2]| 0.5 * (low + high);
        [
            middle(part([-half, half], column, self.base[0])),
            middle(part([0.0, 1.0], line, self.base[1])),
        ]
    }

    /// Width of a base rectangle, m.
    pub(super) fn width(&self) -> f32 {
        self.period / self.base[0] as f32
    }

    /// Result of the base ray nearest to a place, relative to the patch `beamlet` and `row`; `None`
    /// beyond the lattice.
    pub(super) fn at(&self, beamlet: i64, row: i64, [x, z]: [f32; 2]) -> Option<Found> {
        let side = numbers::whole::<i64>(f64::from((x / self.period + 0.5).floor()));
        let level = numbers::whole::<i64>(f64::from(z.floor()));
        let [shift_x, shift_z] = [side as f32 * self.period, level as f32];
        let index = self.grid.index(beamlet + side, row + level)?;
        let cell = |share: f32, count: u32| {
            numbers::whole::<u32>(f64::from(share * count as f32)).min(count - 1)
        };
        let column = cell((x - shift_x) / self.period + 0.5, self.base[0]);
        let line = cell(z - shift_z, self.base[1]);
        let result = self.places[index].map_or(self.empty, |first| {
            self.results[(first + line * self.base[0] + column) as usize]
        });
        let [x, z] = self.centre(column, line);
        Some(Found { result, x: x + shift_x, z: z + shift_z })
    }

    /// The rays of the patches that are `wanted`, in an order that keeps neighbours together, and the place
    /// of each in the results.
    fn rays(
        &self,
        view: &ViewContext<'_>,
        wanted: &dyn Fn(i64, i64) -> bool,
    ) -> (Vec<u32>, Vec<Ray>) {
        let (mut order, mut rays) = (Vec::new(), Vec::new());
        let PatchGrid { rows, beamlets } = &self.grid;
        let mut first = rows.start;
        while first < rows.end {
            let together = first..(first + ROWS_TOGETHER).min(rows.end);
            for beamlet in beamlets.clone() {
                let rows: Vec<i64> = together.clone().filter(|row| wanted(beamlet, *row)).collect();
                for column in 0..self.base[0] {
                    for row in rows.iter().copied() {
                        let index = self.grid.index(beamlet, row);
                        let Some(first) = index.and_then(|index| self.places[index]) else {
                            continue;
                        };
                        for line in 0..self.base[1] {
                            let [x, z] = self.centre(column, line);
                            order.push(first + line * self.base[0] + column);
                            rays.push(view.ray(beamlet, row, x, z));
                        }
                    }
                }
            }
            first = together.end;
        }
        (order, rays)
    }
}

/// Marks patches whose rays are chosen, and those beside them.
fn mark_near_rays(patches: &PatchPlaces, grid: &PatchGrid, places: &mut [Option<u32>]) {
    for (at, place) in places.iter_mut().enumerate() {
        let (beamlet, row) = grid.place(at);
        if patches.is_near_rays(beamlet, row) {
            *place = Some(0);
        }
    }
}
