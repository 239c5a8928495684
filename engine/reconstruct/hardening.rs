//! Beam hardening: −ln of a transmission under a spectrum, and the same of one energy.

use crate::material::{constants_at, constants_over};
use crate::numbers::single;
use crate::scene::{Beam, Scene};
use crate::spectrum::{Spectrum, response};
use crate::{Error, Result};
use ndarray::ArrayViewMut3;
use rayon::prelude::*;

/// Terms of the polynomial, from the first power.
const TERMS: usize = 6;
/// Lengths that it is fitted to.
const POINTS: u32 = 200;

/// Polynomial that makes −ln T of one energy of −ln T under a spectrum, for samples of one material.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BeamHardening {
    /// Energy of μ, keV: the mean of the detected photons without a sample.
    pub energy: f64,
    /// Factors of the first power and those above.
    pub coefficients: Vec<f64>,
    /// Largest −ln T under the spectrum that it is fitted to.
    pub most: f64,
    /// Largest error of the fit, a share of −ln T.
    pub error: f64,
}

impl BeamHardening {
    /// A polynomial for the spectrum of a scene as its detector sees it, and up to `longest` m of a
    /// material.
    ///
    /// # Errors
    /// [`Error::Argument`] for a length that is not above zero; errors of the scene's spectrum and
    /// material.
    pub fn new(scene: &Scene, material: &str, longest: f64) -> Result<Self> {
        if !(longest.is_finite() && longest > 0.0) {
            let found = longest.to_string();
            return Err(Error::argument("longest", found, "a length above zero, m"));
        }
        let (energies, weights) = seen(scene)?;
        let energy = energies.iter().zip(&weights).map(|(energy, weight)| energy * weight).sum();
        let mu: Vec<f64> =
            constants_over(scene, material, &energies)?.iter().map(|it| it.mu).collect();
        let of_energy = constants_at(scene, material, energy)?.mu;
        let polychromatic = |length: f64| {
            let term = |(weight, mu): (&f64, &f64)| weight * libm::exp(-mu * length);
            -libm::log(weights.iter().zip(&mu).map(term).sum::<f64>())
        };
        let points: Vec<[f64; 2]> = (1..=POINTS)
            .map(|n| longest * f64::from(n) / f64::from(POINTS))
            .map(|length| [polychromatic(length), of_energy * length])
            .collect();
        let most = points[points.len() - 1][0];
        let coefficients = fitted(&points, most)?;
        let mut made = Self { energy, coefficients, most, error: 0.0 };
        let off = |[p, wanted]: &[f64; 2]| (made.value(*p) / wanted - 1.0).abs();
        made.error = points.iter().map(off).fold(0.0, f64::max);
        Ok(made)
    }

    /// −ln T of one energy. Beyond [`BeamHardening::most`] it goes on straight.
    #[must_use]
    pub fn value(&self, p: f64) -> f64 {
        let polynomial = |p: f64| {
            let sum = self.coefficients.iter().rev().fold(0.0, |sum, c| sum * p + c);
            sum * p
        };
        if p <= 0.0 {
            return p * self.coefficients[0];
        }
        if p <= self.most {
            return polynomial(p);
        }
        let step = 1e-3 * self.most;
        let slope = (polynomial(self.most) - polynomial(self.most - step)) / step;
        polynomial(self.most) + slope * (p - self.most)
    }

    /// Corrects sinograms of −ln T in place.
    pub fn apply(&self, mut sinograms: ArrayViewMut3<'_, f32>) {
        if let Some(values) = sinograms.as_slice_mut() {
            values.par_iter_mut().for_each(|value| *value = single(self.value((*value).into())));
        } else {
            sinograms.mapv_inplace(|value| single(self.value(value.into())));
        }
    }
}

/// Energies, keV, and their shares of the signal without a sample: all rows of the spectrum, since nodes
/// serve the materials of the scene alone.
fn seen(scene: &Scene) -> Result<(Vec<f64>, Vec<f64>)> {
    let spec = match &scene.source.beam {
        Beam::Energy(energy) => return Ok((vec![*energy], vec![1.0])),
        Beam::Spectrum(spec) => spec,
    };
    let mut spectrum = Spectrum::after_filters(scene, spec)?.significant();
    for (energy, weight) in spectrum.energies_kev.iter().zip(&mut spectrum.weights) {
        *weight *= response(scene, *energy)?;
    }
    let total = spectrum.total();
    if total.is_nan() || total <= 0.0 {
        let allowed = "energies that the detector responds to";
        return Err(Error::scene("source.spectrum", "nothing that the detector sees", allowed));
    }
    let weights = spectrum.weights.iter().map(|weight| weight / total).collect();
    Ok((spectrum.energies_kev, weights))
}

/// Least squares of relative errors, in powers of shares of `most`.
fn fitted(points: &[[f64; 2]], most: f64) -> Result<Vec<f64>> {
    // Rows of the normal equations, with the right side behind.
    let mut rows = [[0.0; TERMS + 1]; TERMS];
    for [p, wanted] in points {
        let share = p / most;
        let mut terms = [1.0; TERMS + 1];
        let mut power = 1.0 / wanted;
        for term in &mut terms[..TERMS] {
            power *= share;
            *term = power;
        }
        for (row, own) in rows.iter_mut().zip(terms) {
            row.iter_mut().zip(terms).for_each(|(sum, term)| *sum += own * term);
        }
    }
    for pivot in 0..TERMS {
        let size = |row: &usize| rows[*row][pivot].abs();
        let largest = (pivot..TERMS).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(pivot);
        rows.swap(pivot, largest);
        let leading = rows[pivot];
        if leading[pivot].abs() < f64::MIN_POSITIVE {
            let found = "no attenuation";
            return Err(Error::argument("material", found, "one that attenuates"));
        }
        for row in &mut rows[pivot + 1..] {
            let factor = row[pivot] / leading[pivot];
            row.iter_mut().zip(leading).for_each(|(value, above)| *value -= factor * above);
        }
    }
    let mut solved = [0.0; TERMS];
    for (n, row) in rows.iter().enumerate().rev() {
        let known: f64 = row[n + 1..TERMS].iter().zip(&solved[n + 1..]).map(|(a, b)| a * b).sum();
        solved[n] = (row[TERMS] - known) / row[n];
    }
    let mut power = 1.0;
    let scaled = solved.map(|factor| {
        power /= most;
        factor * power
    });
    Ok(scaled.to_vec())
}
