//! Fourier series of light over the mask offset.

use glam::DVec2;
use std::f64::consts::TAU;

/// Light at a mask offset o: Re Σ t e^{−2πijo/p} over its terms, j ≥ 0, share of open beam.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Series {
    /// Period p, m of offset.
    pub(super) period: f64,
    /// Real and imaginary part of the terms t, by j.
    pub(super) terms: Vec<DVec2>,
}

impl Series {
    /// Light at an offset, m.
    pub(super) fn at(&self, offset: f64) -> f64 {
        let step = DVec2::from_angle(-TAU * (offset / self.period));
        // Horner's rule from the highest term.
        self.terms.iter().rev().fold(DVec2::ZERO, |sum, term| sum.rotate(step) + *term).x
    }

    /// Adds `weight` times another series of the same period.
    pub(super) fn add(&mut self, weight: f64, other: &Self) {
        self.terms.resize(self.terms.len().max(other.terms.len()), DVec2::ZERO);
        self.terms.iter_mut().zip(&other.terms).for_each(|(sum, term)| *sum += weight * *term);
    }

    /// Weighted sum of series of one period; `None` without any.
    pub(super) fn sum<'a>(parts: impl IntoIterator<Item = (f64, &'a Self)>) -> Option<Self> {
        parts.into_iter().fold(None, |sum, (weight, part)| {
            let empty = || Self { period: part.period, terms: Vec::new() };
            let mut sum: Self = sum.unwrap_or_else(empty);
            sum.add(weight, part);
            Some(sum)
        })
    }
}
