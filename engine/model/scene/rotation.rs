//! Rotation of a mask in its plane: turns after which its apertures are again strips that repeat along x and z.

use super::{ApertureLattice, ApertureShape, MaskSpec, Rectangle};
use beamlet_core::units::Dimension::Angle;
use beamlet_core::{Error, Result, numbers};
use std::f64::consts::{FRAC_PI_2, SQRT_2};

/// Relative difference of lengths and of turns that are equal but for rounding.
const SAME: f64 = 1e-9;

/// Number of turns by `step` in an angle, if it is whole.
fn turns(angle: f64, step: f64) -> Option<i64> {
    let turns = angle / step;
    ((turns - turns.round()).abs() < SAME).then(|| numbers::whole(turns.round()))
}

/// True if lengths are equal but for rounding.
fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * a.abs().max(b.abs())
}

impl MaskSpec {
    /// The mask turned about the middle of a period by an angle (rad), right-handed about +y: clockwise as the source
    /// sees it, from +z to +x. Offsets displace the turned mask.
    ///
    /// # Errors
    /// [`Error::Scene`] for an angle after which the apertures do not repeat along x and z, or have edges that are not
    /// along x and z: other multiples of 90° but of slits, of 45° for circles on a square lattice, of 30° for circles
    /// on a lattice of equilateral triangles.
    pub fn rotated(&self, angle: f64) -> Result<Self> {
        if let (Some(quarters), Some(_)) = (turns(angle, FRAC_PI_2), self.heights()) {
            return Ok(self.turned(quarters.rem_euclid(4)));
        }
        if turns(angle, 4.0 * FRAC_PI_2).is_some() {
            return Ok(self.clone());
        }
        let (what, allowed, turned) = match self.circles() {
            _ if self.heights().is_none() => {
                ("slits", "no value, or a `shape` other than \"slit\"", None)
            }
            Some(Circles::Square) => (
                "circles on a square lattice",
                "a multiple of 45 deg",
                turns(angle, FRAC_PI_2 / 2.0).map(|_| self.by_half_a_quarter()),
            ),
            Some(Circles::Triangular) => (
                "circles on a lattice of equilateral triangles",
                "a multiple of 30 deg",
                turns(angle, FRAC_PI_2 / 3.0).map(|number| self.turned(number.rem_euclid(2))),
            ),
            None => {
                let (what, allowed) = self.quarters_only();
                (what, allowed, None)
            }
        };
        turned.ok_or_else(|| {
            Error::scene("rotation", format!("{} of {what}", Angle.rounded(angle)), allowed)
        })
    }

    /// Apertures that only quarter turns serve, and the allowed angles with the reason.
    fn quarters_only(&self) -> (&'static str, &'static str) {
        let edges = "a multiple of 90 deg: edges of apertures lie along x and z";
        match (self.list_key(), self.shape) {
            (Some("pattern"), _) => ("a pattern", edges),
            (Some(_), _) => ("a list of rectangles", edges),
            (None, ApertureShape::Cross) => ("crosses", edges),
            (None, ApertureShape::Round) if self.is_circle() => {
                let allowed = "a multiple of 90 deg: after others they do not repeat along x and z";
                ("circles on this lattice", allowed)
            }
            (None, ApertureShape::Round) => ("ellipses", edges),
            (None, _) => ("rectangles", edges),
        }
    }

    /// True if apertures are as high as wide, and round.
    fn is_circle(&self) -> bool {
        let height = self.heights().map(|[height, _]| height);
        self.shape == ApertureShape::Round && height.is_some_and(|it| same(it, self.aperture))
    }

    /// The mask after quarter turns.
    fn turned(&self, quarters: i64) -> Self {
        let quarters: usize = numbers::narrow(quarters);
        let mut mask = self.clone();
        if let Some((pattern, pixel)) = self.pattern.as_ref().zip(self.pattern_pixel) {
            let [width, height] = pixel;
            let pixel = if quarters.is_multiple_of(2) { pixel } else { [height, width] };
            return mask.with_pattern(pattern.turned(quarters), pixel);
        }
        for _ in 0..quarters {
            mask = mask.by_a_quarter();
        }
        mask
    }

    fn by_a_quarter(&self) -> Self {
        let mut mask = self.clone();
        let quarter = |it: &Rectangle| {
            let ([x, z], [width, height]) = (it.centre, it.size);
            Rectangle { centre: [z, -x], size: [height, width] }
        };
        mask.rectangles = self.rectangles.iter().map(quarter).collect();
        let Some([height, rows]) = self.heights() else { return mask };
        (mask.aperture, mask.aperture_z) = (height, Some(self.aperture));
        // A period of all rows becomes the period along x.
        let repeats = f64::from(self.rows_of_period());
        (mask.period, mask.period_z) = (repeats * rows, Some(self.period / repeats));
        mask
    }

    /// Circles of a square lattice after 45°: rows that are displaced by half a period in turn, and back.
    fn by_half_a_quarter(&self) -> Self {
        let mut mask = self.clone();
        (mask.lattice, mask.period, mask.period_z) = match self.lattice {
            ApertureLattice::Rectangular => {
                (ApertureLattice::Hexagonal, self.period * SQRT_2, Some(self.period / SQRT_2))
            }
            ApertureLattice::Hexagonal => {
                let period = self.period / SQRT_2;
                (ApertureLattice::Rectangular, period, Some(period))
            }
        };
        mask
    }

    /// Lattice of circles that has more turns than quarters.
    fn circles(&self) -> Option<Circles> {
        let [_, rows] = self.heights()?;
        let height = rows / self.period;
        match self.lattice {
            _ if !self.is_circle() => None,
            ApertureLattice::Rectangular => same(height, 1.0).then_some(Circles::Square),
            ApertureLattice::Hexagonal if same(height, 0.5) => Some(Circles::Square),
            ApertureLattice::Hexagonal => {
                same(height, 0.75_f64.sqrt()).then_some(Circles::Triangular)
            }
        }
    }
}

/// Lattices of circles.
#[derive(Debug, Clone, Copy)]
enum Circles {
    /// Four neighbours at equal distances.
    Square,
    /// Six neighbours at equal distances.
    Triangular,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::MaskBody;

    fn lattice(shape: ApertureShape, aperture: [f64; 2], period: [f64; 2]) -> MaskSpec {
        let body = MaskBody::Sheet { transmission: 0.0 };
        MaskSpec::new(1.0, period[0], aperture[0], body).with_heights(shape, aperture[1], period[1])
    }

    fn turned(mask: &MaskSpec, degrees: f64) -> MaskSpec {
        mask.rotated(degrees.to_radians()).expect("an allowed angle")
    }

    /// Middles of the circles near the axis of a mask with an aperture on it, by angle-free keys: distances from it and
    /// from a point aside.
    fn centres(mask: &MaskSpec) -> Vec<[f64; 2]> {
        let rows = mask.period_z.expect("rows");
        let hexagonal = mask.lattice == ApertureLattice::Hexagonal;
        let at = |row: i32, column: i32| {
            let aside = if hexagonal && row % 2 != 0 { 0.5 } else { 0.0 };
            [(f64::from(column) + aside) * mask.period, f64::from(row) * rows]
        };
        let places = (-9..=9).flat_map(|row| (-9..=9).map(move |column| (row, column)));
        places.map(|(row, column)| at(row, column)).collect()
    }

    #[test]
    fn circles_are_where_the_turned_circles_are() {
        let square = lattice(ApertureShape::Round, [0.3; 2], [1.0; 2]);
        let mut triangles = lattice(ApertureShape::Round, [0.3; 2], [1.0, 0.75_f64.sqrt()]);
        triangles.lattice = ApertureLattice::Hexagonal;
        let mut oblong = lattice(ApertureShape::Round, [0.3, 0.2], [1.0, 0.7]);
        oblong.lattice = ApertureLattice::Hexagonal;
        let cases = [
            (&square, 45.0),
            (&square, 135.0),
            (&square, 90.0),
            (&triangles, 30.0),
            (&triangles, -60.0),
            (&oblong, 90.0),
            (&oblong, 180.0),
        ];
        for (mask, degrees) in cases {
            let (sin, cos) = f64::to_radians(degrees).sin_cos();
            let want: Vec<_> = centres(mask)
                .iter()
                .map(|[x, z]| [cos * x + sin * z, cos * z - sin * x])
                .filter(|[x, z]| x.hypot(*z) < 4.0)
                .collect();
            let got = centres(&turned(mask, degrees));
            let got: Vec<_> = got.iter().filter(|[x, z]| x.hypot(*z) < 4.0).collect();
            assert_eq!(got.len(), want.len(), "{degrees}");
            for [x, z] in got {
                let is_near = |[a, b]: &[f64; 2]| (a - x).hypot(b - z) < 1e-9;
                assert!(want.iter().any(is_near), "{degrees}: {x} {z}");
            }
        }
        // Back to the first lattice.
        let back = turned(&turned(&square, 45.0), 45.0);
        assert!(back.lattice == square.lattice && same(back.period, 1.0));
    }
}
