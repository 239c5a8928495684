//! Fields over x and z: a mask and bodies that change along z, in one plane.

use super::body::Body;
use super::field::Grid;
use super::setup::{Setup, Slits};
use rustfft::FftDirection;
use rustfft::num_complex::Complex;
use std::f64::consts::PI;

/// Intensity over x of each line z at the analyser, for a sample in the plane of the mask. `at` has the
/// bodies of a line as it sees them; `lines` is the grid along z, which repeats.
pub fn intensity(
    setup: &Setup,
    slits: &Slits,
    grid: Grid,
    lines: Grid,
    at: impl Fn(f64) -> Vec<Body>,
) -> Vec<Vec<f64>> {
    let mask = grid.behind(slits);
    let line = |i| {
        let sample = grid.through(setup, &at(lines.x(i)), 0.0);
        mask.iter().zip(sample).map(|(mask, sample)| mask * sample).collect()
    };
    let mut fields: Vec<Vec<Complex<f64>>> = (0..lines.count).map(line).collect();
    let distance = setup.effective(setup.mask, setup.analyser);
    let mut column = vec![Complex::ZERO; lines.count];
    for x in 0..grid.count {
        column.iter_mut().zip(&fields).for_each(|(value, field)| *value = field[x]);
        lines.propagate(&mut column, setup.wavelength, distance);
        fields.iter_mut().zip(&column).for_each(|(field, value)| field[x] = *value);
    }
    for field in &mut fields {
        grid.propagate(field, setup.wavelength, distance);
    }
    fields.iter().map(|field| field.iter().map(Complex::norm_sqr).collect()).collect()
}

/// Sums of lines of a row from `low` to `high` in z, each line over its spacing: lines blurred by a
/// Gaussian of standard deviation `blur` (m) along z.
pub fn row_sum(intensity: &[Vec<f64>], lines: Grid, [low, high]: [f64; 2], blur: f64) -> Vec<f64> {
    // The share of each line: the row blurred, by its transform.
    let mut share: Vec<Complex<f64>> = (0..lines.count)
        .map(|i| {
            let [from, to] = [-0.5, 0.5].map(|side| lines.x(i) + side * lines.spacing);
            ((to.min(high) - from.max(low)).max(0.0) / lines.spacing).into()
        })
        .collect();
    Grid::transform(&mut share, FftDirection::Forward);
    for (i, value) in share.iter_mut().enumerate() {
        let exponent = -2.0 * (PI * lines.frequency(i) * blur).powi(2);
        *value *= exponent.exp() / lines.count as f64;
    }
    Grid::transform(&mut share, FftDirection::Inverse);
    let mut sums = vec![0.0; intensity[0].len()];
    for (line, share) in intensity.iter().zip(share) {
        sums.iter_mut().zip(line).for_each(|(sum, value)| *sum += share.re * value);
    }
    sums
}
