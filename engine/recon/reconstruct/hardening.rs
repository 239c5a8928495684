//! Beam hardening: −ln of a transmission under a spectrum, and the same of one energy.

use beamlet_core::numbers::single;
use beamlet_core::{Cancel, Error, Result};
use beamlet_model::material::{constants_at, constants_over};
use beamlet_model::optics::modulated;
use beamlet_model::scene::{self, Scene};
use beamlet_model::spectrum::{Spectrum, response};
use ndarray::{Array3, ArrayViewMut3, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Terms of the polynomial, from the first power.
const TERMS: usize = 6;
/// Lengths that it is fitted to.
const POINTS: u32 = 200;
/// Longest way through a material, m.
const LONGEST: f64 = 1e3;

/// Polynomial that makes −ln T of one energy of −ln T under a spectrum, for samples of one material.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BeamHardening {
    /// Energy that μ is quoted at, keV.
    pub energy: f64,
    /// Factors of the first power and those above.
    pub coefficients: Vec<f64>,
    /// Largest −ln T under the spectrum that it is fitted to.
    pub most: f64,
    /// Largest error of the fit, a share of −ln T.
    pub error: f64,
}

/// Material of a sample whose beam hardening is corrected, and the energy that μ is quoted at.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct HardeningChoice {
    /// Scene with the spectrum, its filters, the detector and the materials.
    pub scene: Scene,
    /// Material of the sample.
    pub material: String,
    /// Energy of μ, keV. `None`: the mean of the detected light that the masks modulate, without a sample.
    pub energy: Option<f64>,
}

/// Material and energy of a correction of beam hardening, without the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Hardening {
    /// Material of the sample.
    pub material: String,
    /// Energy of μ, keV; `None`: the mean of the detected light.
    pub energy: Option<f64>,
}

impl HardeningChoice {
    /// A choice of material and energy (keV) for the spectrum of a scene.
    ///
    /// # Errors
    /// [`Error::Argument`] for a source of one energy, and for energies that are not above zero; errors
    /// of the scene's spectrum and material.
    pub fn new(scene: Scene, material: &str, energy: Option<f64>) -> Result<Self> {
        if scene.source.beam.single_energy().is_some() {
            let allowed = "a source with a spectrum: a beam of one energy does not harden";
            return Err(Error::argument("beam_hardening", "a source of one energy", allowed));
        }
        if let Some(energy) = energy.filter(|energy| !(energy.is_finite() && *energy > 0.0)) {
            let found = format!("{energy} keV");
            return Err(Error::argument("beam_hardening", found, "an energy above 0 keV"));
        }
        let made = Self { scene, material: material.to_owned(), energy };
        constants_at(&made.scene, material, made.quoted()?)?;
        Ok(made)
    }

    /// Energy that μ is quoted at, keV.
    ///
    /// # Errors
    /// Errors of the scene's spectrum.
    pub fn quoted(&self) -> Result<f64> {
        self.energy.map_or_else(|| Ok(BeamEnergy::of(&self.scene)?.kev), Ok)
    }
}

/// Energy of a beam.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct BeamEnergy {
    /// The one energy, or the mean of the detected light that the masks modulate, without a sample, keV.
    pub kev: f64,
    /// True if the beam has a spectrum.
    pub spectrum: bool,
}

impl BeamEnergy {
    /// The energy of the beam of a scene.
    ///
    /// # Errors
    /// Errors of the scene's spectrum.
    pub fn of(scene: &Scene) -> Result<Self> {
        let (energies, weights) = seen(scene)?;
        let spectrum = scene.source.beam.single_energy().is_none();
        Ok(Self { kev: mean(&energies, &weights), spectrum })
    }
}

impl BeamHardening {
    /// A polynomial for the spectrum of a scene as its masks modulate it and its detector sees it, and up to
    /// `longest` m of a material.
    ///
    /// # Errors
    /// [`Error::Argument`] for a length that is not above zero; errors of the scene's spectrum and
    /// material.
    pub fn new(scene: &Scene, material: &str, longest: f64) -> Result<Self> {
        Beam::of(scene, material, None)?.polynomial(longest)
    }

    /// A polynomial up to the largest −ln T of sinograms.
    ///
    /// # Errors
    /// [`Error::Argument`] for a largest −ln T that is not above zero, or that no length of the material
    /// reaches; errors of the scene's spectrum and material.
    pub fn up_to(choice: &HardeningChoice, most: f64) -> Result<Self> {
        let HardeningChoice { scene, material, energy } = choice;
        let seen = Beam::of(scene, material, *energy)?;
        if !(most.is_finite() && most > 0.0) {
            let found = format!("{most} as the largest −ln T");
            return Err(Error::argument("beam_hardening", found, "sinograms that attenuate"));
        }
        let mut ends = [0.0, 1e-6];
        while seen.log(ends[1]) < most {
            ends = [ends[1], 2.0 * ends[1]];
            if ends[1] > LONGEST {
                let found = format!("−ln T = {most} behind {material}");
                let allowed = format!("at most the attenuation of {LONGEST} m of the material");
                return Err(Error::argument("beam_hardening", found, allowed));
            }
        }
        for _ in 0..60 {
            let middle = f64::midpoint(ends[0], ends[1]);
            ends[usize::from(seen.log(middle) >= most)] = middle;
        }
        seen.polynomial(ends[1])
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

    /// Corrects sinograms of −ln T in place, view by view.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(super) fn apply_until(&self, sinograms: &mut Array3<f32>, cancel: &Cancel) -> Result<()> {
        for view in sinograms.axis_chunks_iter_mut(Axis(0), 1) {
            cancel.check()?;
            self.apply(view);
        }
        Ok(())
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

/// Modulated light as the detector sees it, and a material in it.
struct Beam {
    /// Energy that μ is quoted at, keV.
    energy: f64,
    /// Share of the light without a sample, and μ of the material, 1/m.
    lines: Vec<[f64; 2]>,
    /// μ at the energy that it is quoted at, 1/m.
    of_energy: f64,
}

impl Beam {
    fn of(scene: &Scene, material: &str, energy: Option<f64>) -> Result<Self> {
        let (energies, weights) = seen(scene)?;
        let energy = energy.unwrap_or_else(|| mean(&energies, &weights));
        let constants = constants_over(scene, material, &energies)?;
        let lines = weights.iter().zip(&constants).map(|(weight, it)| [*weight, it.mu]).collect();
        Ok(Self { energy, lines, of_energy: constants_at(scene, material, energy)?.mu })
    }

    /// −ln T behind a length, m.
    fn log(&self, length: f64) -> f64 {
        let term = |[weight, mu]: &[f64; 2]| weight * libm::exp(-mu * length);
        -libm::log(self.lines.iter().map(term).sum::<f64>())
    }

    fn polynomial(&self, longest: f64) -> Result<BeamHardening> {
        if !(longest.is_finite() && longest > 0.0) {
            let found = longest.to_string();
            return Err(Error::argument("longest", found, "a length above zero, m"));
        }
        let points: Vec<[f64; 2]> = (1..=POINTS)
            .map(|n| longest * f64::from(n) / f64::from(POINTS))
            .map(|length| [self.log(length), self.of_energy * length])
            .collect();
        let most = points[points.len() - 1][0];
        let coefficients = fitted(&points, most)?;
        let mut made = BeamHardening { energy: self.energy, coefficients, most, error: 0.0 };
        let off = |[p, wanted]: &[f64; 2]| (made.value(*p) / wanted - 1.0).abs();
        made.error = points.iter().map(off).fold(0.0, f64::max);
        Ok(made)
    }
}

/// Mean of energies by their weights, which sum to 1.
fn mean(energies: &[f64], weights: &[f64]) -> f64 {
    energies.iter().zip(weights).map(|(energy, weight)| energy * weight).sum()
}

/// Energies, keV, and their shares of the modulated light without a sample as the detector sees it: all rows
/// of the spectrum, since nodes serve the materials of the scene alone.
pub(super) fn seen(scene: &Scene) -> Result<(Vec<f64>, Vec<f64>)> {
    let spec = match &scene.source.beam {
        scene::Beam::Energy(energy) => return Ok((vec![*energy], vec![1.0])),
        scene::Beam::Spectrum(spec) => spec,
    };
    let mut spectrum = Spectrum::after_filters(scene, spec)?.significant();
    for (energy, weight) in spectrum.energies_kev.iter().zip(&mut spectrum.weights) {
        *weight *= response(scene, *energy)?;
    }
    let total = spectrum.total();
    if total.is_nan() || total <= 0.0 {
        let allowed = "energies above thresholds and where the absorber absorbs";
        return Err(Error::scene(
            "source.spectrum",
            "no energy that the detector responds to",
            allowed,
        ));
    }
    let weights = modulated(scene, (&spectrum.energies_kev, &spectrum.weights))?;
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
            return Err(Error::argument("material", found, "a material that attenuates"));
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
