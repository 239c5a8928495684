//! Materials: attenuation and refraction constants at an energy.

/// Optical constants of a material at one energy.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Constants {
    /// Linear attenuation coefficient, 1/m.
    pub mu: f64,
    /// Refractive index decrement (n = 1 - delta + i beta).
    pub delta: f64,
}
