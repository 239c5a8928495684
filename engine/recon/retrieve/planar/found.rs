//! A lattice found in a flat: the place of its origin, and vectors a few per cent from the given ones.

use super::super::equations::Equations;
use super::lattice::Lattice;
use beamlet_core::numbers::whole;
use beamlet_core::{Error, Result};
use ndarray::ArrayView2;
use std::f64::consts::TAU;

/// Periods of a block whose phases are found together.
const BLOCK: f64 = 6.0;
/// Amplitude of the first harmonics over the mean of the frame, below which there is no lattice.
const LEAST_CONTRAST: f64 = 0.02;
/// Part of these amplitudes that is left of their sum over the frame where all blocks have the same lattice.
const LEAST_COHERENCE: f64 = 0.7;
/// Largest change of a vector, as a part of it, that a flat may have.
const MOST_CHANGE: f64 = 0.06;

/// Pixels of a frame on the detector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// Rows and columns.
    pub(super) shape: [usize; 2],
    /// Width and height of a pixel, m.
    pub(super) pitch: [f64; 2],
}

impl Frame {
    /// Centre of a pixel, x and z from the middle of the frame, m.
    pub(super) fn place(&self, row: i64, column: i64) -> [f64; 2] {
        let [rows, columns] = self.shape.map(|count| count as f64);
        let x = (column as f64 + 0.5 - columns / 2.0) * self.pitch[0];
        [x, (rows / 2.0 - 0.5 - row as f64) * self.pitch[1]]
    }

    /// Row and column of a place, with their fractions.
    pub(super) fn pixel(&self, [x, z]: [f64; 2]) -> [f64; 2] {
        let [rows, columns] = self.shape.map(|count| count as f64);
        [rows / 2.0 - 0.5 - z / self.pitch[1], x / self.pitch[0] + columns / 2.0 - 0.5]
    }
}

/// A lattice with the place of one of its beamlets.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlacedLattice {
    pub(super) lattice: Lattice,
    pub(super) origin: [f64; 2],
}

/// Sums of a block: its centroid of light, and light times the waves of both harmonics.
struct Block {
    middle: [f64; 2],
    light: f64,
    waves: [[f64; 2]; 2],
}

impl PlacedLattice {
    /// Finds a lattice in a flat by the phases of its first harmonics: of light that is even about its centre they
    /// are the places of the centres.
    ///
    /// # Errors
    /// [`Error::Argument`] where the flat has no such lattice.
    pub(super) fn find(flat: ArrayView2<'_, f32>, frame: &Frame, given: Lattice) -> Result<Self> {
        let mut found = Self { lattice: given, origin: [0.0; 2] };
        for _ in 0..3 {
            found = found.improved(flat, frame)?;
        }
        if !found.is_near(&given, MOST_CHANGE) {
            return Err(absent(format!("{} in the flat", found.lattice)));
        }
        found.check(flat, frame)?;
        Ok(found)
    }

    /// Places a lattice of known vectors by the phases of the first harmonics of a flat.
    ///
    /// # Errors
    /// [`Error::Argument`] where the flat has no such lattice.
    pub(super) fn place(
        flat: ArrayView2<'_, f32>,
        frame: &Frame,
        lattice: Lattice,
    ) -> Result<Self> {
        let known = || flat.iter().filter(|value| value.is_finite()).map(|value| f64::from(*value));
        let light: f64 = known().sum();
        let mean = light / known().count() as f64;
        let mut waves = [[0.0; 2]; 2];
        for ((row, column), value) in flat.indexed_iter().filter(|(_, value)| value.is_finite()) {
            let at = lattice.indices(frame.place(row as i64, column as i64));
            for (wave, at) in waves.iter_mut().zip(at) {
                let (sin, cos) = (TAU * at).sin_cos();
                // Without its mean the light of parts of periods has no wave.
                let above = f64::from(*value) - mean;
                *wave = [above.mul_add(cos, wave[0]), above.mul_add(sin, wave[1])];
            }
        }
        let least = waves.iter().map(|[cos, sin]| cos.hypot(*sin)).fold(f64::INFINITY, f64::min);
        if least.is_nan() || light.is_nan() || least < LEAST_CONTRAST * light {
            let share = least / light;
            return Err(absent(format!(
                "a flat with {share:.3} of its mean in the first harmonic"
            )));
        }
        let origin = lattice.place(waves.map(|[cos, sin]| sin.atan2(cos) / TAU));
        Ok(Self { lattice, origin })
    }

    /// True if no vector differs from another lattice's by more than a part of it.
    fn is_near(&self, other: &Lattice, part: f64) -> bool {
        self.lattice.vectors.iter().zip(other.vectors).all(|(vector, before)| {
            let change = (vector[0] - before[0]).hypot(vector[1] - before[1]);
            change <= part * before[0].hypot(before[1])
        })
    }

    /// Refuses a lattice whose waves differ in phase over the frame.
    fn check(&self, flat: ArrayView2<'_, f32>, frame: &Frame) -> Result<()> {
        let blocks = self.blocks(flat, frame);
        for axis in [0, 1] {
            let [cos, sin, amplitude] = blocks.iter().fold([0.0; 3], |sum, block| {
                let [cos, sin] = block.waves[axis];
                [sum[0] + cos, sum[1] + sin, sum[2] + f64::hypot(cos, sin)]
            });
            let coherence = f64::hypot(cos, sin) / amplitude;
            if coherence.is_nan() || coherence < LEAST_COHERENCE {
                let found = format!("a flat in which {coherence:.2} of the light follows it");
                return Err(absent(found));
            }
        }
        Ok(())
    }

    /// The lattice through centres of beamlets, by their indices, with least squares.
    pub(super) fn through(&self, centres: &[([i64; 2], [f64; 2])]) -> Option<Self> {
        let along = |axis: usize| {
            plane(
                centres
                    .iter()
                    .map(|(index, centre)| (index.map(|index| index as f64), [1.0, centre[axis]])),
            )
        };
        let ([x, ax, bx], [z, az, bz]) = (along(0)?, along(1)?);
        let found = Self { lattice: Lattice { vectors: [[ax, az], [bx, bz]] }, origin: [x, z] };
        found.is_near(&self.lattice, MOST_CHANGE).then_some(found)
    }

    /// Places of first harmonics relative to the present lattice: a plane of phases over the frame for each.
    fn improved(&self, flat: ArrayView2<'_, f32>, frame: &Frame) -> Result<Self> {
        let blocks = self.blocks(flat, frame);
        let light: f64 = blocks.iter().map(|block| block.light).sum();
        let mut planes = [[0.0; 3]; 2];
        for (axis, plane) in planes.iter_mut().enumerate() {
            let total = blocks.iter().fold([0.0; 2], |sum, block| {
                [sum[0] + block.waves[axis][0], sum[1] + block.waves[axis][1]]
            });
            let amplitude: f64 =
                blocks.iter().map(|block| block.waves[axis][0].hypot(block.waves[axis][1])).sum();
            if amplitude.is_nan() || light.is_nan() || amplitude < LEAST_CONTRAST * light {
                let share = amplitude / light;
                return Err(absent(format!(
                    "a flat with {share:.3} of its mean in the first harmonic"
                )));
            }
            *plane = plane_of(&blocks, axis, total[1].atan2(total[0]) / TAU);
        }
        // Indices u become u - phase(u): origin and vectors follow by the inverse.
        let shift = [planes[0][0], planes[1][0]];
        let slope = [[planes[0][1], planes[0][2]], [planes[1][1], planes[1][2]]];
        let changed = |unit: [f64; 2]| {
            // Solves (1 - slope) d = unit to second order of the slopes.
            let first = apply(slope, unit);
            let second = apply(slope, first);
            [0, 1].map(|k| unit[k] + first[k] + second[k])
        };
        let vectors = [[1.0, 0.0], [0.0, 1.0]].map(|unit| self.lattice.place(changed(unit)));
        let [x, z] = self.lattice.place(changed(shift));
        let lattice = Lattice { vectors };
        Ok(Self { lattice, origin: [self.origin[0] + x, self.origin[1] + z] })
    }

    /// Blocks of the frame, in indices of the lattice from its origin.
    fn blocks(&self, flat: ArrayView2<'_, f32>, frame: &Frame) -> Vec<Block> {
        let mut blocks = std::collections::BTreeMap::<[i64; 2], Block>::new();
        for ((row, column), value) in flat.indexed_iter() {
            let value = f64::from(*value);
            if !value.is_finite() {
                continue;
            }
            let [x, z] = frame.place(row as i64, column as i64);
            let at = self.lattice.indices([x - self.origin[0], z - self.origin[1]]);
            let key = at.map(|index| whole::<i64>((index / BLOCK).floor()));
            let block = blocks.entry(key).or_insert_with(|| Block {
                middle: [0.0; 2],
                light: 0.0,
                waves: [[0.0; 2]; 2],
            });
            block.light += value;
            for axis in [0, 1] {
                block.middle[axis] += value * at[axis];
                let (sin, cos) = (TAU * at[axis]).sin_cos();
                block.waves[axis][0] += value * cos;
                block.waves[axis][1] += value * sin;
            }
        }
        let mut all: Vec<Block> = blocks.into_values().filter(|block| block.light > 0.0).collect();
        for block in &mut all {
            block.middle = block.middle.map(|sum| sum / block.light);
        }
        all
    }
}

/// Plane of the phases of blocks, turns: constant, and slopes by both indices. Phases are unwrapped about
/// the plane so far, which begins at the phase of all blocks.
fn plane_of(blocks: &[Block], axis: usize, first: f64) -> [f64; 3] {
    let mut found = [first, 0.0, 0.0];
    for _ in 0..4 {
        let of = |block: &Block| {
            let [cos, sin] = block.waves[axis];
            let terms = [1.0, block.middle[0], block.middle[1]];
            let here: f64 = found.iter().zip(terms).map(|(a, b)| a * b).sum();
            let rest = sin.atan2(cos) / TAU - here;
            (block.middle, [cos.hypot(sin), rest - rest.round()])
        };
        let Some(step) = plane(blocks.iter().map(of)) else { break };
        for (value, by) in found.iter_mut().zip(step) {
            *value += by;
        }
    }
    found
}

/// Constant and slopes of a plane by two coordinates, through values with these weights; `None` if they do not determine
/// it, as one block.
fn plane(values: impl Iterator<Item = ([f64; 2], [f64; 2])>) -> Option<[f64; 3]> {
    let mut equations = Equations::new(&[false, false, false, true, true, true, true]);
    for ([a, b], [weight, value]) in values {
        equations.add(&[1.0, a, b, 0.0, 0.0, 0.0, 0.0], weight, value);
    }
    let [first, by_a, by_b, ..] = equations.solve(0.0)?;
    Some([first, by_a, by_b])
}

fn apply(matrix: [[f64; 2]; 2], [x, z]: [f64; 2]) -> [f64; 2] {
    matrix.map(|[by_x, by_z]| by_x * x + by_z * z)
}

fn absent(found: String) -> Error {
    Error::argument("lattice", found, "the lattice of the flat's beamlets, to 5 %")
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_core::numbers::single;
    use ndarray::Array2;

    /// A lattice that is given 1.5 % too wide and 0.4 degrees off is found to a twentieth of its period.
    #[test]
    fn lattice_of_a_flat_is_found_near_the_given_one() {
        let frame = Frame { shape: [90, 120], pitch: [1.0, 1.0] };
        for (periods, angle) in [([6.3, 5.6], 0.0), ([7.2, 7.2], 0.05), ([5.1, 8.0], -0.1)] {
            let truth = Lattice::turned(periods, angle).unwrap();
            let origin = [1.3, -2.2];
            let flat = Array2::from_shape_fn((90, 120), |(row, column)| {
                let [x, z] = frame.place(row as i64, column as i64);
                let [x, z] = [x - origin[0], z - origin[1]];
                let [i, j] = truth.nearest([x, z]).map(|index| index as f64);
                let [cx, cz] = truth.place([i, j]);
                single((-((x - cx).powi(2) + (z - cz).powi(2)) / 2.0).exp())
            });
            let given = Lattice::turned(periods.map(|p| 1.015 * p), angle + 0.007).unwrap();
            let found = PlacedLattice::find(flat.view(), &frame, given).unwrap();
            for index in [[0.0, 0.0], [6.0, 0.0], [0.0, -5.0], [5.0, 5.0]] {
                let [x, z] = truth.place(index);
                let [u, v] = found
                    .lattice
                    .indices([x + origin[0] - found.origin[0], z + origin[1] - found.origin[1]]);
                let off = (u - u.round()).hypot(v - v.round());
                assert!(off < 0.05, "{periods:?} {angle} {index:?}: {off} {found:?}");
            }
        }
    }

    /// A known lattice is placed in frames of fewer periods than show their vectors.
    #[test]
    fn known_lattices_are_placed_in_small_frames() {
        for (shape, periods) in [([17, 16], [7.5, 7.5]), ([9, 40], [6.0, 8.0])] {
            let frame = Frame { shape, pitch: [1.0, 1.0] };
            let lattice = Lattice::turned(periods, 0.0).unwrap();
            let origin = [1.2, -0.7];
            let flat = Array2::from_shape_fn((shape[0], shape[1]), |(row, column)| {
                let [x, z] = frame.place(row as i64, column as i64);
                let wave = |at: f64, axis: usize| (TAU * (at - origin[axis]) / periods[axis]).cos();
                single((2.0 + wave(x, 0)) * (2.0 + wave(z, 1)))
            });
            let found = PlacedLattice::place(flat.view(), &frame, lattice).unwrap();
            let [u, v] = lattice.indices([0, 1].map(|axis| found.origin[axis] - origin[axis]));
            // Harmonics of parts of periods: 0.014 of a period; centres of beamlets place it better.
            assert!((u - u.round()).hypot(v - v.round()) < 0.03, "{shape:?}: {found:?}");
            assert_eq!(found.lattice, lattice);
        }
    }

    #[test]
    fn flats_of_another_lattice_or_none_are_refused() {
        let frame = Frame { shape: [90, 90], pitch: [1.0, 1.0] };
        let spots = |px: f64, pz: f64| {
            Array2::from_shape_fn((90, 90), |(row, column)| {
                let [x, z] = frame.place(row as i64, column as i64);
                let [x, z] = [x - px * (x / px).round(), z - pz * (z / pz).round()];
                single((-(x * x + z * z) / 2.0).exp())
            })
        };
        let even = Array2::from_elem((90, 90), 1.0_f32);
        for (flat, periods) in [
            (even, [6.0, 6.0]),
            (spots(7.5, 7.5), [6.0, 7.5]),
            (spots(7.5, 7.5), [7.5, 9.0]),
            (spots(7.5, 7.5), [5.5, 5.5]),
        ] {
            let given = Lattice::turned(periods, 0.0).unwrap();
            let found = PlacedLattice::find(flat.view(), &frame, given);
            assert!(found.is_err(), "{periods:?}: {found:?}");
        }
        let given = Lattice::turned([7.4, 7.6], 0.01).unwrap();
        assert!(PlacedLattice::find(spots(7.5, 7.5).view(), &frame, given).is_ok());
    }
}
