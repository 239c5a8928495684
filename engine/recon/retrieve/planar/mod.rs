//! Retrieval in two directions: refraction along x and z, and the directional dark field.
//!
//! | file | content |
//! |---|---|
//! | `lattice.rs` | lattices of beamlets |
//! | `found.rs` | a lattice found in a flat |
//! | `windows.rs` | pixels of beamlets |
//! | `aperture.rs` | apertures as strips |
//! | `offsets.rs` | lists of offsets, and the contrasts that they determine |
//! | `geometry.rs` | designs, masks and blur of a scene |
//! | `lattice_beamlets.rs` | beamlets of a frame on a lattice |
//! | `step_curves.rs` | curves of pixels over offsets |

mod aperture;
mod found;
mod geometry;
mod lattice;
mod lattice_beamlets;
mod offsets;
mod step_curves;
mod windows;

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests")]
#[allow(clippy::cast_possible_truncation, reason = "frames of f32")]
mod tests;

pub use aperture::Aperture;
pub(crate) use geometry::{Design, aperture, knows_curve};
pub use lattice::Lattice;
pub(super) use lattice_beamlets::{LatticeBeamlets, LatticeDesign};
pub(super) use step_curves::StepCurves;
