//! Lattices of beamlets on the detector: vectors, places, and what a flat says of both.

use beamlet_core::numbers::whole;
use beamlet_core::units::Dimension::{Angle, Length};
use beamlet_core::{Error, Result};
use std::fmt;

/// Form of a lattice in messages.
const FORMS: &str = "two periods as \"40 um, 40 um\", with an angle as \"40 um, 40 um, 3 deg\", or two vectors \
                     as \"40 um, 0 um; 20 um, 34.6 um\", as they are on the detector";

/// Lattice of beamlets on the detector, x to the right and z upwards: two vectors, m.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Lattice {
    /// Vectors from a beamlet to the next.
    pub vectors: [[f64; 2]; 2],
}

impl Lattice {
    /// The lattice of two vectors, x and z, m.
    ///
    /// # Errors
    /// [`Error::Argument`] for vectors that are not finite, or are parallel.
    pub fn new(vectors: [[f64; 2]; 2]) -> Result<Self> {
        let [a, b] = vectors;
        let area = cross(a, b).abs();
        let is_one = area > 0.05 * length(a) * length(b) && area.is_finite();
        if !is_one {
            let found = Self { vectors }.to_string();
            return Err(Error::argument("lattice", found, "two vectors that are not parallel"));
        }
        Ok(Self { vectors: reduced(vectors) })
    }

    /// Periods along x and z, turned by an angle (rad) from x towards z.
    ///
    /// # Errors
    /// As [`Lattice::new`].
    pub fn turned([x, z]: [f64; 2], angle: f64) -> Result<Self> {
        let (sin, cos) = angle.sin_cos();
        Self::new([[x * cos, x * sin], [-z * sin, z * cos]])
    }

    /// Reads periods and an angle, or two vectors.
    ///
    /// # Errors
    /// [`Error::Argument`] for other words; as [`Lattice::new`].
    pub fn parse(text: &str) -> Result<Self> {
        let refused = |found: String| Error::argument("lattice", found, FORMS);
        let length = |word: &str| Length.parse(word).map_err(|error| refused(error.found));
        let parts: Vec<Vec<&str>> =
            text.split(';').map(|part| part.split(',').map(str::trim).collect()).collect();
        match parts.iter().map(Vec::as_slice).collect::<Vec<_>>()[..] {
            [[ax, az], [bx, bz]] => {
                Self::new([[length(ax)?, length(az)?], [length(bx)?, length(bz)?]])
            }
            [[x, z]] => Self::turned([length(x)?, length(z)?], 0.0),
            [[x, z, angle]] => {
                let angle = Angle.parse(angle).map_err(|error| refused(error.found))?;
                Self::turned([length(x)?, length(z)?], angle)
            }
            _ => Err(refused(format!("{text:?}"))),
        }
    }

    /// Indices of a place with their fractions, for a beamlet 0, 0 at the origin.
    pub(super) fn indices(&self, [x, z]: [f64; 2]) -> [f64; 2] {
        let [a, b] = self.vectors;
        let area = cross(a, b);
        [cross([x, z], b) / area, cross(a, [x, z]) / area]
    }

    /// Place of indices.
    pub(super) fn place(&self, [i, j]: [f64; 2]) -> [f64; 2] {
        let [a, b] = self.vectors;
        [i.mul_add(a[0], j * b[0]), i.mul_add(a[1], j * b[1])]
    }

    /// Indices of the beamlet nearest to a place.
    pub(super) fn nearest(&self, place: [f64; 2]) -> [i64; 2] {
        let around = self.indices(place).map(f64::round);
        let distance = |indices: [f64; 2]| {
            let [x, z] = self.place(indices);
            (place[0] - x).hypot(place[1] - z)
        };
        let mut best = (distance(around), around);
        // Vectors are reduced: the nearest is the rounded one or next to it.
        for [i, j] in neighbours() {
            let other = [around[0] + i, around[1] + j];
            let from = distance(other);
            if from < best.0 * (1.0 - 1e-12) {
                best = (from, other);
            }
        }
        best.1.map(whole::<i64>)
    }

    /// Places of the eight neighbours of a beamlet, from it.
    pub(super) fn around(&self) -> Vec<[f64; 2]> {
        neighbours().map(|indices| self.place(indices)).collect()
    }

    /// Distance of the nearest neighbours, m.
    pub(super) fn distance(&self) -> f64 {
        self.around().iter().map(|place| length(*place)).fold(f64::INFINITY, f64::min)
    }

    /// Half the size of a box about the places that are nearest to a beamlet, m.
    pub(super) fn half_cell(&self) -> [f64; 2] {
        let [a, b] = self.vectors;
        // Corners of the cell are within half a diagonal.
        [0, 1].map(|axis| (a[axis].abs() + b[axis].abs()) / 2.0 + 1e-9 * length(a))
    }
}

impl fmt::Display for Lattice {
    /// Both vectors in um.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [[ax, az], [bx, bz]] = self.vectors.map(|vector| vector.map(|at| 1e6 * at));
        write!(f, "{ax:.3} um, {az:.3} um; {bx:.3} um, {bz:.3} um")
    }
}

/// Indices of the eight neighbours.
fn neighbours() -> impl Iterator<Item = [f64; 2]> {
    let all = [-1.0_f64, 0.0, 1.0];
    all.into_iter()
        .flat_map(move |i| all.into_iter().map(move |j| [i, j]))
        .filter(|[i, j]| i.abs() + j.abs() > 0.0)
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn length(a: [f64; 2]) -> f64 {
    a[0].hypot(a[1])
}

/// The shortest vectors of the same lattice (Gauss), the first the one that is nearer to +x, the second
/// upwards.
fn reduced([mut a, mut b]: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    for _ in 0..64 {
        if length(b) < length(a) {
            std::mem::swap(&mut a, &mut b);
        }
        let turns = ((a[0] * b[0] + a[1] * b[1]) / (length(a) * length(a)) - 1e-9).round();
        if turns == 0.0 {
            break;
        }
        b = [b[0] - turns * a[0], b[1] - turns * a[1]];
    }
    let slope = |v: [f64; 2]| v[1].abs() / length(v);
    if slope(b) < slope(a) * (1.0 - 1e-9) {
        std::mem::swap(&mut a, &mut b);
    }
    let turned = |v: [f64; 2], axis: usize| if v[axis] < 0.0 { v.map(|part| -part) } else { v };
    [turned(a, 0), turned(b, 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_angles_and_vectors_are_read() {
        let square = Lattice::parse("40 um, 30 um").unwrap();
        assert_eq!(square.vectors, [[40e-6, 0.0], [-0.0, 30e-6]]);
        let turned = Lattice::parse("40 um, 40 um, 90 deg").unwrap();
        assert!((turned.vectors[0][0] - 40e-6).abs() < 1e-18, "{turned:?}");
        let hexagonal = Lattice::parse("40 um, 0 um; -20 um, -34.6 um").unwrap();
        assert!(hexagonal.vectors[1][1] > 0.0 && (hexagonal.distance() - 40e-6).abs() < 1e-7);
        for wrong in ["40 um", "40, 40", "40 um, 0 um; 80 um, 0 um", "1 um, 1 um, 3 um", ""] {
            assert!(Lattice::parse(wrong).is_err(), "{wrong}");
        }
    }

    /// Every place of a grid is nearer to its beamlet than to all within three periods.
    #[test]
    fn places_belong_to_the_nearest_beamlet() {
        for text in ["40 um, 55 um, 7 deg", "40 um, 0 um; 20 um, 34.6 um", "40 um, 40 um, 45 deg"] {
            let lattice = Lattice::parse(text).unwrap();
            for k in 0..400 {
                let place = [f64::from(k % 20) * 7e-6 - 7e-5, f64::from(k / 20) * 7e-6 - 7e-5];
                let distance = |[i, j]: [f64; 2]| {
                    let [x, z] = lattice.place([i, j]);
                    (place[0] - x).hypot(place[1] - z)
                };
                let found = lattice.nearest(place).map(|index| index as f64);
                for i in -3..=3 {
                    for j in -3..=3 {
                        let other = [found[0] + f64::from(i), found[1] + f64::from(j)];
                        assert!(distance(found) <= distance(other) + 1e-18, "{text} {place:?}");
                    }
                }
            }
        }
    }
}
