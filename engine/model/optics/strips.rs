//! Apertures that end along z, as strips: intervals of z in which the openings along x are the same.

use super::Mask;
use crate::scene::{ApertureShape, MaskSpec, Strip};
use std::f64::consts::PI;

/// A strip displaced along x and z.
fn moved(strip: &Strip, [x, z]: [f64; 2]) -> Strip {
    Strip {
        z: strip.z.map(|end| end + z),
        x: strip.x.iter().map(|ends| ends.map(|end| end + x)).collect(),
        middle: strip.middle + z,
    }
}

/// A strip as it is seen `scale` times as large.
fn scaled(strip: &Strip, scale: f64) -> Strip {
    Strip {
        z: strip.z.map(|end| end * scale),
        x: strip.x.iter().map(|ends| ends.map(|end| end * scale)).collect(),
        middle: strip.middle * scale,
    }
}

/// Strips of a mask seen in a plane, for one period along z, which repeats; bars are between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Strips {
    /// Distance along z from a period to the next, m.
    pub period: f64,
    /// Height of the centre of some period above the optical axis, m.
    pub centre: f64,
    /// Strips, ascending along z, without overlap.
    pub strips: Vec<Strip>,
}

impl Strips {
    /// Share of a period along z that lies in strips.
    pub fn open_share(&self) -> f64 {
        self.strips.iter().map(|strip| strip.z[1] - strip.z[0]).sum::<f64>() / self.period
    }
}

impl Mask {
    /// Strips seen in the plane at `plane`, m there; `None` of slits. An ellipse has `fineness` of them,
    /// each with its area; other outlines are exact.
    pub fn strips(&self, plane: f64, fineness: u32) -> Option<Strips> {
        let scale = self.scale_at(plane);
        let [height, period] = self.spec().heights()?;
        let MaskSpec { aperture, offset_z, shape, .. } = self.spec();
        let half = [0.5 * aperture * scale, 0.5 * height * scale];
        // Aperture k of R rows of pixels is at (k + 1/2 - R/2) periods.
        let shift = if self.rows().is_multiple_of(2) { 0.5 } else { 0.0 };
        let own = match self.spec().listed_strips() {
            Some(strips) => strips.iter().map(|strip| scaled(strip, scale)).collect(),
            None => of_shape(*shape, half, fineness),
        };
        let rows = self.spec().rows_of_period();
        let [between, across] = [period * scale, 0.5 * self.spec().period * scale];
        let row = |number: u32| {
            let up = (f64::from(number) - 0.5 * f64::from(rows - 1)) * between;
            let aside = [f64::from(number) * across, up];
            own.iter().map(|strip| moved(strip, aside)).collect::<Vec<_>>()
        };
        Some(Strips {
            period: f64::from(rows) * between,
            centre: (shift * period + offset_z) * scale + 0.5 * f64::from(rows - 1) * between,
            strips: (0..rows).flat_map(row).collect(),
        })
    }
}

/// Apertures of a mask that end along z as the source sees them, in its plane.
#[derive(Debug, Clone, PartialEq)]
pub struct FrontView {
    /// Distance along x from a period to the next, m.
    pub period: f64,
    /// Centre of some period along x, m.
    pub centre: f64,
    /// Strips of a period, which repeat along z.
    pub strips: Strips,
}

impl FrontView {
    /// The view of a mask before a detector of this number of columns and rows, an ellipse as `fineness` strips;
    /// `None` of slits.
    pub fn of(spec: &MaskSpec, [columns, rows]: [u32; 2], fineness: u32) -> Option<Self> {
        let mask = Mask::new("mask", spec, columns, columns).before_rows(rows);
        let strips = mask.strips(spec.distance, fineness)?;
        let openings = mask.openings(spec.distance);
        let period = openings.period[0];
        let between = if columns.is_multiple_of(2) { 0.5 * period } else { 0.0 };
        Some(Self { period, centre: openings.offset + between, strips })
    }
}

/// Strips of an aperture of these half axes along x and z.
fn of_shape(shape: ApertureShape, half: [f64; 2], fineness: u32) -> Vec<Strip> {
    let [width, height] = half;
    let about = |z: [f64; 2], x: f64| Strip { z, x: vec![[-x, x]], middle: 0.0 };
    match shape {
        ApertureShape::Slit => Vec::new(),
        ApertureShape::Rectangle => vec![about([-height, height], width)],
        ApertureShape::Round => ellipse(half, fineness),
        ApertureShape::Cross => {
            let arm = height / 3.0;
            vec![
                about([-height, -arm], width / 3.0),
                about([-arm, arm], width),
                about([arm, height], width / 3.0),
            ]
        }
    }
}

/// Strips of an ellipse between equally spaced angles about its centre, each as wide as the mean chord.
fn ellipse([width, height]: [f64; 2], fineness: u32) -> Vec<Strip> {
    // Area of the unit disc beside a line at `t` from the centre, over half the axis.
    let area = |t: f64| t * (1.0 - t * t).max(0.0).sqrt() + libm::asin(t);
    let place = |k: u32| match 2 * k == fineness {
        true => 0.0,
        false => -libm::cos(PI * f64::from(k) / f64::from(fineness)).clamp(-1.0, 1.0),
    };
    (0..fineness)
        .map(|k| {
            let [low, high] = [place(k), place(k + 1)];
            let half = 0.5 * width * (area(high) - area(low)) / (high - low);
            Strip { z: [low * height, high * height], x: vec![[-half, half]], middle: 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(strips: &[Strip]) -> f64 {
        let of = |strip: &Strip| {
            let width: f64 = strip.x.iter().map(|[low, high]| high - low).sum();
            width * (strip.z[1] - strip.z[0])
        };
        strips.iter().map(of).sum()
    }

    /// Strips keep the area of the outline, whatever their number.
    #[test]
    fn strips_have_the_area_of_the_aperture() {
        let half = [7.5e-6, 5e-6];
        for fineness in [1, 2, 16, 129] {
            let round = area(&of_shape(ApertureShape::Round, half, fineness));
            assert!((round / (PI * half[0] * half[1]) - 1.0).abs() < 1e-12, "{fineness}: {round}");
        }
        let whole = 4.0 * half[0] * half[1];
        assert!((area(&of_shape(ApertureShape::Rectangle, half, 1)) / whole - 1.0).abs() < 1e-12);
        assert!((area(&of_shape(ApertureShape::Cross, half, 1)) / whole - 5.0 / 9.0).abs() < 1e-12);
    }

    /// Strips lie side by side from the lower end to the upper one, and the widest is the aperture's width.
    #[test]
    fn strips_of_an_ellipse_fill_its_height_and_near_its_width() {
        let strips = ellipse([3.0, 2.0], 16);
        assert!((strips[0].z[0] + 2.0).abs() < 1e-12 && (strips[15].z[1] - 2.0).abs() < 1e-12);
        assert!(strips.windows(2).all(|pair| pair[0].z[1].to_bits() == pair[1].z[0].to_bits()));
        let widest = strips.iter().map(|strip| strip.x[0][1]).fold(0.0, f64::max);
        assert!(widest < 3.0 && widest > 2.95, "{widest}");
    }
}
