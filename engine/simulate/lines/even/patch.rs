//! A patch of evenly spread rays: their places, and the order in which they are traced.

use super::columns::part;
use crate::sampling::ProjectedBounds;
use beamlet_core::numbers::{self, single};
use beamlet_core::random::GOLDEN;
use beamlet_interface::{BUNDLE_LANES, RAYS_PER_LANE, Ray, RayResult};
use std::f64::consts::SQRT_2;

/// Rays that walk together where a device walks them in bundles.
const BUNDLE: u32 = BUNDLE_LANES * RAYS_PER_LANE;

/// A patch whose rays are spread evenly.
#[derive(Debug)]
pub(crate) struct EvenPatch {
    pub beamlet: i64,
    pub row: i64,
    /// Borders of its cells along x, m from the middle of the beamlet.
    pub(super) borders: Vec<f32>,
    pub(super) lines: u32,
    pub(super) bodies: Bodies,
    /// Number of its trials so far; 0 where the number of rays is settled.
    pub(super) trial: u32,
    /// Results of its rays, ordered by line, then x.
    pub(in crate::lines) results: Vec<RayResult>,
    /// Rays of it and of its trials.
    pub(in crate::lines) rays: u32,
    /// Estimated error of its light, share of open beam.
    pub(in crate::lines) error: f64,
}

/// A cell of a patch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EvenCell {
    pub x: [f32; 2],
    /// Share of the row, downwards.
    pub z: [f32; 2],
    /// Place of its ray.
    pub ray: [f32; 2],
    pub result: RayResult,
}

impl EvenPatch {
    /// Cells, by height, then x.
    pub(crate) fn cells(&self) -> impl Iterator<Item = EvenCell> {
        (0..self.count()).map(|index| self.cell(index))
    }

    /// A cell by its index.
    pub(in crate::lines) fn cell(&self, index: u32) -> EvenCell {
        let (x, z, ray) = self.place(index);
        EvenCell { x, z, ray, result: self.results[index as usize] }
    }

    /// Places of its rays, in the order in which they are traced.
    pub(in crate::lines) fn rays(&self) -> impl Iterator<Item = [f32; 2]> {
        self.traced().map(|index| self.place(index).2)
    }

    /// Indices of its rays in the order in which they are traced: by bands of lines, and column by column in a band, forth
    /// and back, so that rays which follow one another are neighbours.
    pub(in crate::lines) fn traced(&self) -> impl Iterator<Item = u32> {
        let (columns, lines) = (self.columns(), self.band());
        let of_band = columns * lines;
        (0..self.count()).map(move |at| {
            let (band, within) = (at / of_band, at % of_band);
            let from_end = columns - 1 - within / lines;
            let column = if band % 2 == 0 { within / lines } else { from_end };
            (band * lines + within % lines) * columns + column
        })
    }

    /// Lines whose rays are traced together, a power of two. A bundle of rays meets the fewest bodies where it is as much
    /// wider than high as they are.
    fn band(&self) -> u32 {
        let widths = self.borders.windows(2).map(|pair| f64::from(pair[1] - pair[0]));
        let column = widths.fold(f64::INFINITY, f64::min);
        let slimness = self.bodies.lowest / self.bodies.narrowest;
        let band = (f64::from(BUNDLE * self.lines) * column * slimness).sqrt();
        // The nearest power.
        let band = (SQRT_2 * band).max(1.0).min(self.lines.into());
        1 << numbers::whole::<u32>(band).ilog2()
    }

    /// Takes the results of its rays, in the order in which they are traced.
    pub(super) fn add(&mut self, results: &[RayResult]) {
        self.rays += numbers::count(results.len());
        let mut ordered = results.to_vec();
        for (index, result) in self.traced().zip(results) {
            ordered[index as usize] = *result;
        }
        self.results = ordered;
    }

    const fn columns(&self) -> u32 {
        numbers::count(self.borders.len()) - 1
    }

    /// Bytes of its rays and results.
    pub(in crate::lines) fn bytes(&self) -> u64 {
        u64::from(self.count()) * (size_of::<Ray>() + 2 * size_of::<RayResult>()) as u64
    }

    /// Number of its rays.
    pub(in crate::lines) fn count(&self) -> u32 {
        self.lines * self.columns()
    }

    /// Cell of a ray, and its place.
    fn place(&self, index: u32) -> ([f32; 2], [f32; 2], [f32; 2]) {
        let columns = self.columns();
        let (line, column) = (index / columns, (index % columns) as usize);
        let x = [self.borders[column], self.borders[column + 1]];
        let z = part([0.0, 1.0], line, self.lines);
        // No two lines have rays above one another.
        let reversed = line.reverse_bits() >> (32 - self.lines.ilog2());
        let share = (reversed as f32 + 0.5) / self.lines as f32;
        // Any cells that follow one another cover the line.
        let height = single((0.5 + f64::from(index) * GOLDEN).fract());
        let ray = [x[0] + share * (x[1] - x[0]), z[0] + height * (z[1] - z[0])];
        (x, z, ray)
    }
}

/// Bodies whose shadows fall on a patch.
#[derive(Debug, Clone, Copy)]
pub(in crate::lines) struct Bodies {
    pub count: u32,
    /// Width of the narrowest, m.
    pub narrowest: f64,
    /// Height of the lowest, rows.
    pub lowest: f64,
}

impl Bodies {
    /// Adds a body whose shadow falls on the patch.
    pub(in crate::lines) fn add(&mut self, shadow: &ProjectedBounds) {
        self.count += 1;
        self.narrowest = self.narrowest.min(shadow.width);
        self.lowest = self.lowest.min(shadow.height);
    }
}

impl Default for Bodies {
    fn default() -> Self {
        Self { count: 0, narrowest: f64::INFINITY, lowest: f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn patch(lines: u32, columns: u16, bodies: Bodies) -> EvenPatch {
        let borders = (0..=columns).map(|it| 1e-6 * (f32::from(it) - 40.0)).collect();
        let results = Vec::new();
        EvenPatch {
            beamlet: 3,
            row: 5,
            borders,
            lines,
            bodies,
            trial: 1,
            results,
            rays: 0,
            error: 0.0,
        }
    }

    #[test]
    fn each_ray_is_traced_once_and_takes_its_own_result() {
        let bodies = [[2e-6, 20.0], [2e-6, 2e-2], [1e-3, 1e-3], [f64::INFINITY; 2], [1e-6, 0.0]];
        for [narrowest, lowest] in bodies {
            for (lines, columns) in [(4, 1), (4, 12), (8, 75), (32, 7)] {
                let mut patch = patch(lines, columns, Bodies { count: 40, narrowest, lowest });
                let traced: Vec<u32> = patch.traced().collect();
                let result = |index: &u32| RayResult { crossings: *index, ..Zeroable::zeroed() };
                patch.add(&traced.iter().map(result).collect::<Vec<_>>());
                let found: Vec<u32> = patch.cells().map(|cell| cell.result.crossings).collect();
                assert_eq!(found, (0..patch.count()).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn bundles_are_as_narrow_or_as_flat_as_bodies() {
        // 8 lines of 80 columns of 1 um, 1/8 of a row high: size of a bundle, um and rows.
        let size = |narrowest, lowest| {
            let patch = patch(8, 80, Bodies { count: 40, narrowest, lowest });
            let rays: Vec<[f32; 2]> = patch.rays().collect();
            let extent = |axis: usize| {
                let of = |bundle: &[[f32; 2]]| {
                    let all = || bundle.iter().map(|ray| ray[axis]);
                    all().fold(f32::MIN, f32::max) - all().fold(f32::MAX, f32::min)
                };
                rays.chunks(BUNDLE as usize).map(of).fold(0.0, f32::max)
            };
            [1e6 * extent(0), extent(1)]
        };
        // Upright fibres of 5 um, bubbles of 5 um in rows of 40 um, and fibres that lie.
        let [upright, bubbles, lying] = [size(2e-6, 10.0), size(2e-6, 0.05), size(1e-3, 0.05)];
        assert!(upright[0] <= 4.0 && upright[1] > 0.8, "{upright:?}");
        assert!(bubbles[0] <= 17.0 && bubbles[1] <= 0.25, "{bubbles:?}");
        // Where a line ends, a bundle goes on in the next.
        assert!(lying[0] <= 32.0 && lying[1] <= 0.25, "{lying:?}");
    }
}
