//! Quality of a beam: the half-value layer of its air kerma in aluminium.

use super::Spectrum;
use crate::material::{self, Constants};
use beamlet_core::interpolation::log_log;
use beamlet_core::{Error, Result};

/// Energy, keV, and mass energy-absorption coefficient of dry air, cm2/g: J. H. Hubbell and S. M.
/// Seltzer, NISTIR 5632 (1995), <https://www.nist.gov/pml/x-ray-mass-attenuation-coefficients>.
const AIR: [(f64, f64); 28] = [
    (1.0, 3599.0),
    (1.5, 1188.0),
    (2.0, 526.2),
    (3.0, 161.4),
    (3.2029, 133.0),
    (3.20291, 146.0),
    (4.0, 76.36),
    (5.0, 39.31),
    (6.0, 22.7),
    (8.0, 9.446),
    (10.0, 4.742),
    (15.0, 1.334),
    (20.0, 0.5389),
    (30.0, 0.1537),
    (40.0, 0.06833),
    (50.0, 0.04098),
    (60.0, 0.03041),
    (80.0, 0.02407),
    (100.0, 0.02325),
    (150.0, 0.02496),
    (200.0, 0.02672),
    (300.0, 0.02872),
    (400.0, 0.02949),
    (500.0, 0.02966),
    (600.0, 0.02953),
    (800.0, 0.02882),
    (1000.0, 0.02789),
    (1250.0, 0.02666),
];

/// Mass energy-absorption coefficient of air, cm2/g, linear in the logarithms; the law of the
/// first two or last two rows beyond them.
fn absorption_of_air(energy: f64) -> f64 {
    let above = AIR.partition_point(|row| row.0 < energy).clamp(1, AIR.len() - 1);
    log_log(energy, AIR[above - 1].into(), AIR[above].into())
}

/// First half-value layer, m.
pub(super) fn half_value_layer(spectrum: &Spectrum) -> Result<f64> {
    let rows = spectrum.significant();
    let aluminium = material::of_builtin("aluminium", &rows.energies_kev)?;
    let kerma = |thickness: f64| -> f64 {
        let energies = rows.energies_kev.iter().zip(&rows.weights).zip(&aluminium);
        let part = |((energy, weight), constants): ((&f64, &f64), &Constants)| {
            weight * energy * absorption_of_air(*energy) * (-constants.mu * thickness).exp()
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
