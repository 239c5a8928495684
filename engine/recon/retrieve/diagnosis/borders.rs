//! Both sides of an image, where they look as empty beam does: one transmission, one refraction and no
//! dark field on both.

use super::empty_beam::values;
use super::estimate::Estimate;
use crate::retrieve::images::Images;
use std::ops::Range;

/// Pixels of each half of a strip, at least.
const FEWEST: usize = 8;
/// Part of the columns that a strip has.
const SHARE: usize = 20;
/// Standard deviations from which on a difference counts.
const SIGNIFICANT: f64 = 5.0;
/// Part of the scatter of a pixel from which on a difference matters to an image.
const OF_PIXEL: f64 = 0.2;
/// Least differences that count: of the transmission, and of the centre in widths of the flat's curve.
const LEAST: [f64; 2] = [5e-3, 2e-3];
/// Dark field, in squared widths of the flat's curve, that an empty beam may have: a Gaussian that is
/// not the curve is wider or narrower as a drift moves the curve over the offsets.
const DARK_FIELD: f64 = 0.05;

/// Transmission and refraction at both borders of an image.
#[derive(Debug, Clone, Copy)]
pub(in crate::retrieve) struct Borders {
    pub(super) transmission: Estimate,
    /// Refraction along x and z; `None` along an axis without it.
    pub(super) refraction: [Option<Estimate>; 2],
    /// Dark field along x; `None` for methods without it.
    pub(super) dark_field: Option<Estimate>,
    /// Columns of a strip.
    pub(in crate::retrieve) width: usize,
    /// The transmission is not 1.
    pub(super) has_other_dose: bool,
    /// The refraction along x and z is not 0.
    pub(super) has_drift: [bool; 2],
}

impl Borders {
    /// `None` where they do not look empty. `angles`: of a shift by a width of the flat's curve along x and z, rad.
    pub(in crate::retrieve) fn of(
        images: &Images,
        [rows, columns]: [usize; 2],
        angles: [f64; 2],
    ) -> Option<Self> {
        let width = (columns / SHARE).max(2 * FEWEST.div_ceil(rows.max(1))).next_multiple_of(2);
        if 4 * width > columns {
            return None;
        }
        let half = width / 2;
        let starts = [0, half, columns - width, columns - half];
        let strips = starts.map(|start| [0..rows, start..start + half]);
        let transmission = common(images, "transmission", &strips, LEAST[0])?;
        let (mut refraction, mut dark_fields) = ([None; 2], [None; 2]);
        let names = [["refraction", "dark_field"], ["refraction_z", "dark_field_z"]];
        for (axis, [of_angle, of_scatter]) in names.into_iter().enumerate() {
            if has_values(images, of_angle) {
                let slack = LEAST[1] * angles[axis];
                refraction[axis] = Some(common(images, of_angle, &strips, slack)?);
            }
            if has_values(images, of_scatter) {
                let slack = DARK_FIELD * angles[axis] * angles[axis];
                let found = common(images, of_scatter, &strips, slack)?;
                // Scatter widens the curve: a strip that has it is not empty.
                if found.differs(0.0, SIGNIFICANT, slack) {
                    return None;
                }
                dark_fields[axis] = Some(found);
            }
        }
        let differs = |of: &Estimate, from: f64, least: f64| {
            of.differs(from, SIGNIFICANT, (OF_PIXEL * of.scatter).max(least))
        };
        let moved = |axis: usize| {
            refraction[axis].is_some_and(|of| differs(&of, 0.0, LEAST[1] * angles[axis]))
        };
        Some(Self {
            transmission,
            refraction,
            dark_field: dark_fields[0],
            width,
            has_other_dose: differs(&transmission, 1.0, LEAST[0]),
            has_drift: [moved(0), moved(1)],
        })
    }
}

/// True for an image with a value: steps that change no light along an axis give none.
fn has_values(images: &Images, name: &str) -> bool {
    images.get(name).is_some_and(|image| image.iter().any(|value| !value.is_nan()))
}

/// The value that all strips have; `None` where they differ, or have too few pixels.
fn common(
    images: &Images,
    name: &str,
    strips: &[[Range<usize>; 2]],
    slack: f64,
) -> Option<Estimate> {
    let all: Vec<Vec<f64>> = strips.iter().map(|strip| values(images, name, strip)).collect();
    let is_enough = |(values, [rows, columns]): (&Vec<f64>, &[Range<usize>; 2])| {
        5 * values.len() >= 4 * rows.len() * columns.len() && values.len() >= FEWEST
    };
    if !all.iter().zip(strips).all(is_enough) {
        return None;
    }
    let estimates: Vec<Estimate> =
        all.iter().map(|values| Estimate::of(values.clone())).collect::<Option<_>>()?;
    let is_one = estimates
        .iter()
        .enumerate()
        .all(|(i, one)| estimates[i + 1..].iter().all(|other| one.agrees(other, slack)));
    if !is_one {
        return None;
    }
    Estimate::of(all.into_iter().flatten().collect())
}
