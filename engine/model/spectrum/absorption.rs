//! Energy that dry air and water absorb from photons: J. H. Hubbell and S. M. Seltzer, NISTIR 5632 (1995),
//! <https://www.nist.gov/pml/x-ray-mass-attenuation-coefficients>.

use beamlet_core::interpolation::log_log;

/// Energy, keV, and mass energy-absorption coefficient of dry air, cm2/g, in turn.
const AIR: [f64; 56] = [
    1.0, 3599.0, 1.5, 1188.0, 2.0, 526.2, 3.0, 161.4, 3.2029, 133.0, 3.20291, 146.0, 4.0, 76.36,
    5.0, 39.31, 6.0, 22.7, 8.0, 9.446, 10.0, 4.742, 15.0, 1.334, 20.0, 0.5389, 30.0, 0.1537, 40.0,
    0.06833, 50.0, 0.04098, 60.0, 0.03041, 80.0, 0.02407, 100.0, 0.02325, 150.0, 0.02496, 200.0,
    0.02672, 300.0, 0.02872, 400.0, 0.02949, 500.0, 0.02966, 600.0, 0.02953, 800.0, 0.02882,
    1000.0, 0.02789, 1250.0, 0.02666,
];

/// The same of liquid water.
const WATER: [f64; 52] = [
    1.0, 4065.0, 1.5, 1372.0, 2.0, 615.2, 3.0, 191.7, 4.0, 81.91, 5.0, 41.88, 6.0, 24.05, 8.0,
    9.915, 10.0, 4.944, 15.0, 1.374, 20.0, 0.5503, 30.0, 0.1557, 40.0, 0.06947, 50.0, 0.04223,
    60.0, 0.0319, 80.0, 0.02597, 100.0, 0.02546, 150.0, 0.02764, 200.0, 0.02967, 300.0, 0.03192,
    400.0, 0.03279, 500.0, 0.03299, 600.0, 0.03284, 800.0, 0.03206, 1000.0, 0.03103, 1250.0,
    0.02965,
];

/// A material whose energy absorption is tabulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Absorbing {
    /// Dry air: its dose is the air kerma below 1000 keV.
    Air,
    /// Liquid water.
    Water,
}

impl Absorbing {
    /// The material with this name among the built-in ones; `None` for all others.
    #[must_use]
    pub fn named(builtin: &str) -> Option<Self> {
        match builtin {
            "air" => Some(Self::Air),
            "water" => Some(Self::Water),
            _ => None,
        }
    }

    /// Mass energy-absorption coefficient, cm2/g, at an energy in keV: linear in the logarithms; the law of the first
    /// two or last two rows beyond them.
    #[must_use]
    pub fn per_mass(self, energy: f64) -> f64 {
        let table: &[[f64; 2]] = match self {
            Self::Air => AIR.as_chunks().0,
            Self::Water => WATER.as_chunks().0,
        };
        let above = table.partition_point(|row| row[0] < energy).clamp(1, table.len() - 1);
        log_log(energy, table[above - 1], table[above])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Water over air: oxygen absorbs more than nitrogen, until Compton scattering leaves the ratio of electrons per
    /// mass, 0.5551 / 0.4992; argon of air makes up for it around 30 keV. The ratio moves by less than 3 % from row to
    /// row, but for the K edge of argon at 3.2 keV.
    #[test]
    fn water_is_to_air_as_its_electrons_and_varies_slowly() {
        let ratio = |energy| Absorbing::Water.per_mass(energy) / Absorbing::Air.per_mass(energy);
        for [low, high] in WATER.as_chunks::<2>().0.windows(2).map(|rows| [rows[0][0], rows[1][0]])
        {
            let step = ratio(high) / ratio(low) - 1.0;
            assert!(step.abs() < 0.03 || low < 4.0, "{low} to {high} keV: {step}");
        }
        assert!((ratio(1000.0) / (0.5551 / 0.4992) - 1.0).abs() < 1e-3, "{}", ratio(1000.0));
        assert!((ratio(30.0) - 1.013).abs() < 1e-3);
    }
}
