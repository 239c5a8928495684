//! Bodies in a periodic box, sorted by cells.

use std::ops::Range;

use arrayvec::ArrayVec;
use rayon::prelude::*;

use beamlet_core::{Result, numbers, reserve};

/// Purpose of the memory.
pub(super) const PURPOSE: &str = "packing instances";

/// A disc (D = 2) or sphere (D = 3).
#[derive(Debug, Clone, Copy)]
pub(super) struct Body<const D: usize> {
    /// Centre, m, each coordinate from 0 up to the side of the box.
    pub(crate) at: [f64; D],
    pub(crate) radius: f64,
    pub(crate) number: u32,
}

/// The periodic box, cut into cells not smaller than the largest body.
#[derive(Debug, Clone)]
pub(super) struct Cells<const D: usize> {
    pub(crate) sides: [f64; D],
    pub(crate) counts: [usize; D],
}

impl<const D: usize> Cells<D> {
    /// Even numbers of cells, 4 or more along each side; about one per body.
    pub(super) fn new(sides: [f64; D], diameter: f64, bodies: usize) -> Self {
        let volume: f64 = sides.iter().product();
        let roomy = libm::pow(volume / (2 * bodies.max(1)) as f64, 1.0 / D as f64);
        let mut size = diameter.max(roomy);
        loop {
            // The small excess keeps cells from being smaller than a body by rounding.
            let half = |side: f64| (side / (2.0 * size * (1.0 + 1e-9))).floor().max(2.0);
            let counts = sides.map(|side| 2.0 * half(side));
            // Flat boxes have more cells than their volume says.
            if counts.iter().product::<f64>() <= 1e6 + 16.0 * bodies as f64 {
                return Self { sides, counts: counts.map(numbers::whole) };
            }
            size *= 1.25;
        }
    }

    /// Least side of a box for bodies of this diameter.
    pub(super) fn least_side(diameter: f64) -> f64 {
        4.0 * diameter * (1.0 + 1e-8)
    }

    pub(super) fn len(&self) -> usize {
        self.counts.iter().product()
    }

    pub(super) fn coordinates(&self, at: &[f64; D]) -> [usize; D] {
        std::array::from_fn(|k| {
            let cell = numbers::whole::<usize>(at[k] / self.sides[k] * self.counts[k] as f64);
            cell.min(self.counts[k] - 1)
        })
    }

    pub(super) fn index(&self, cell: [usize; D]) -> usize {
        cell.iter().zip(self.counts).fold(0, |index, (&cell, count)| index * count + cell)
    }

    /// Coordinates of a cell by its index.
    pub(super) fn cell(&self, mut index: usize) -> [usize; D] {
        let mut cell = [0; D];
        for axis in (0..D).rev() {
            cell[axis] = index % self.counts[axis];
            index /= self.counts[axis];
        }
        cell
    }

    /// Runs of cells that follow one another: all that touch a cell, and itself. Its own are first.
    pub(super) fn around(&self, cell: [usize; D]) -> ArrayVec<Range<usize>, 18> {
        let mut runs = ArrayVec::new();
        let (last, length) = (cell[D - 1], self.counts[D - 1]);
        for which in 0..if D == 2 { 3 } else { 9 } {
            let mut rest = which;
            let mut near = cell;
            for axis in 0..D - 1 {
                let moved = cell[axis] + [0, 1, self.counts[axis] - 1][rest % 3];
                near[axis] =
                    if moved >= self.counts[axis] { moved - self.counts[axis] } else { moved };
                rest /= 3;
            }
            near[D - 1] = 0;
            let row = self.index(near);
            runs.push(row + last.saturating_sub(1)..row + (last + 2).min(length));
            if last == 0 {
                runs.push(row + length - 1..row + length);
            } else if last + 1 == length {
                runs.push(row..row + 1);
            }
        }
        runs
    }

    /// The vector from `b` to `a`, across the borders where that is shorter.
    #[inline]
    pub(super) fn between(&self, a: &[f64; D], b: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|k| {
            let (across, side) = (a[k] - b[k], self.sides[k]);
            if across > side / 2.0 {
                across - side
            } else if across < -side / 2.0 {
                across + side
            } else {
                across
            }
        })
    }

    /// Square of the distance of two points, across the borders where that is shorter.
    #[inline]
    pub(super) fn square_distance(&self, a: &[f64; D], b: &[f64; D]) -> f64 {
        let mut sum = 0.0;
        for k in 0..D {
            let across = (a[k] - b[k]).abs();
            let shorter = across.min(self.sides[k] - across);
            sum += shorter * shorter;
        }
        sum
    }

    /// A point moved by a vector shorter than the box.
    pub(super) fn moved(&self, at: &[f64; D], by: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|k| {
            let (moved, side) = (at[k] + by[k], self.sides[k]);
            if moved >= side {
                moved - side
            } else if moved < 0.0 {
                // A small negative number may round up to the side.
                let inside = moved + side;
                if inside >= side { 0.0 } else { inside }
            } else {
                moved
            }
        })
    }
}

/// Bodies sorted by their cells, and where each cell begins.
pub(super) struct Sorted<const D: usize> {
    pub(crate) bodies: Vec<Body<D>>,
    begins: Vec<u32>,
}

impl<const D: usize> Sorted<D> {
    /// # Errors
    /// [`beamlet_core::Error::Memory`].
    pub(super) fn new(bodies: &[Body<D>], cells: &Cells<D>) -> Result<Self> {
        let cell = |body: &Body<D>| numbers::count(cells.index(cells.coordinates(&body.at)));
        let mut begins = reserve::filled(0_u32, cells.len() + 1, PURPOSE)?;
        let of_body: Vec<u32> = bodies.par_iter().map(cell).collect();
        of_body.iter().for_each(|cell| begins[*cell as usize + 1] += 1);
        for index in 1..begins.len() {
            begins[index] += begins[index - 1];
        }
        let mut next = begins.clone();
        let empty = Body { at: [0.0; D], radius: 0.0, number: 0 };
        let mut sorted = reserve::filled(empty, bodies.len(), PURPOSE)?;
        for (body, cell) in bodies.iter().zip(of_body) {
            let place = &mut next[cell as usize];
            sorted[*place as usize] = *body;
            *place += 1;
        }
        Ok(Self { bodies: sorted, begins })
    }

    /// Indices of the bodies in a run of cells.
    pub(super) fn range(&self, cells: &Range<usize>) -> Range<usize> {
        self.begins[cells.start] as usize..self.begins[cells.end] as usize
    }

    /// Runs of bodies in the cells around a cell, and in itself.
    pub(super) fn near(&self, cells: &Cells<D>, cell: [usize; D]) -> ArrayVec<Range<usize>, 18> {
        cells.around(cell).iter().map(|run| self.range(run)).filter(|run| !run.is_empty()).collect()
    }
}
