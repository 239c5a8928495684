//! Stacks pixel by pixel.

use beamlet::stack::Stacks;
use ndarray::{Array4, Axis};
use std::fmt;

/// Variance of the light of a random ray at least: rays land beside a pixel that is all lit.
const LEAST_VARIANCE: f64 = 0.01;

/// How far values of two stacks may differ, share of open beam.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) sample: f64,
    pub(crate) flat: f64,
    /// Random rays of a pixel, whose noise adds to the limits.
    pub(crate) rays: Option<f64>,
}

/// The place where two stacks differ most, by the limit there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Difference {
    stack: &'static str,
    /// View, step, row and column.
    place: (usize, usize, usize, usize),
    values: [f32; 2],
    limit: f64,
}

impl Difference {
    pub(crate) fn amount(&self) -> f64 {
        let amount = f64::from((self.values[0] - self.values[1]).abs());
        if amount.is_nan() { f64::INFINITY } else { amount }
    }

    /// The difference in limits: above 1 it is too large.
    pub(crate) fn ratio(&self) -> f64 {
        if self.amount() > 0.0 { self.amount() / self.limit } else { 0.0 }
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ((_, step, row, column), [ours, theirs]) = (self.place, self.values);
        write!(
            f,
            "{} step {step} row {row} column {column}: {ours} and {theirs} differ by {:.2e} of {:.2e} allowed",
            self.stack,
            self.amount(),
            self.limit
        )
    }
}

/// A flat with a dimension for the views, which are one.
pub(crate) fn flat_of(stacks: &Stacks) -> Array4<f32> {
    stacks.flat.clone().insert_axis(Axis(0))
}

/// The largest difference of two stacks by its limit.
pub(crate) fn largest(
    stack: &'static str,
    [ours, theirs]: [&Array4<f32>; 2],
    limits: &Limits,
) -> Difference {
    assert_eq!(ours.dim(), theirs.dim(), "stacks of one size");
    let base = if stack == "flat" { limits.flat } else { limits.sample };
    let at = |(place, &value): ((usize, usize, usize, usize), &f32)| {
        let noise = limits.rays.map_or(0.0, |rays| {
            let share = f64::from(value).clamp(0.0, 1.0);
            6.0 * ((share * (1.0 - share)).max(LEAST_VARIANCE) / rays).sqrt()
        });
        Difference { stack, place, values: [value, theirs[place]], limit: base + noise }
    };
    let worse = |a: Difference, b: Difference| if b.ratio() > a.ratio() { b } else { a };
    ours.indexed_iter().map(at).reduce(worse).expect("a stack has pixels")
}
