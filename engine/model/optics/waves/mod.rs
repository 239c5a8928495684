//! Limits of ray optics: light behind thin masks and round bodies by waves and by rays, in f64
//! (docs/physics.md, "Limits of rays").
//!
//! The frame is the plane of the sample mask; lengths are metres there. `pixel` has a pixel with its masks,
//! `flat` its light without a sample and `error` the error of rays, `structure` the structure functions of round
//! bodies, `bodies` the dark field of many of them. A wavelength of 0 gives rays.

mod bodies;
mod error;
mod flat;
mod pixel;
mod quadrature;
mod series;
mod structure;
#[cfg(test)]
mod tests;

pub use bodies::{Bodies, Body};
pub use error::{FlatError, remedies};
pub use pixel::Pixel;
pub use structure::Form;
pub(crate) use structure::{structure_by_rays, structure_by_waves};

/// Energy node: photon energy in keV, weight, and light that the bars of both masks transmit.
pub type Node = (f64, f64, [f64; 2]);

/// Planck's constant times the speed of light, keV m.
const HC: f64 = 1.239_841_984e-9;

/// Wavelength of a photon energy (keV), m.
#[must_use]
pub fn wavelength(energy: f64) -> f64 {
    HC / energy
}
