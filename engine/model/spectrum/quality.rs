//! Quality of a beam: the half-value layer of its air kerma in aluminium.

use super::Spectrum;
use super::absorption::Absorbing;
use crate::material::{self, Constants};
use beamlet_core::{Error, Result};

/// First half-value layer, m.
pub(super) fn half_value_layer(spectrum: &Spectrum) -> Result<f64> {
    let rows = spectrum.significant();
    let aluminium = material::of_builtin("aluminium", &rows.energies_kev)?;
    let kerma = |thickness: f64| -> f64 {
        let energies = rows.energies_kev.iter().zip(&rows.weights).zip(&aluminium);
        let part = |((energy, weight), constants): ((&f64, &f64), &Constants)| {
            weight * energy * Absorbing::Air.per_mass(*energy) * (-constants.mu * thickness).exp()
        };
        energies.map(part).sum()
    };
    let half = kerma(0.0) / 2.0;
    if !(half.is_finite() && half > 0.0) {
        let found = format!("an air kerma of {}", 2.0 * half);
        return Err(Error::scene("source.spectrum", found, "photons"));
    }
    let (mut low, mut high) = (0.0, 1e-6);
    while kerma(high) > half {
        high *= 2.0;
    }
    while high - low > 1e-9 * high {
        let middle = (low + high) / 2.0;
        *(if kerma(middle) > half { &mut low } else { &mut high }) = middle;
    }
    Ok(high)
}
