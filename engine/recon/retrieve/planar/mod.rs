//! Retrieval in two directions: refraction along x and z, and the directional dark field.
//!
//! | file | content |
//! |---|---|
//! | `fit.rs` | the fit of a curve, with what its values determine |
//! | `moments.rs` | moments in closed form |
//! | `lattice.rs` | lattices of beamlets |
//! | `found.rs` | a lattice found in a flat |
//! | `windows.rs` | pixels of beamlets |
//! | `aperture.rs` | apertures as strips |
//! | `offsets.rs` | lists of offsets, and the contrasts that they determine |
//! | `geometry.rs` | designs, masks and blur of a scene |
//! | `models.rs` | models of beamlets and of curves over offsets |
//! | `expected.rs` | uncertainties without a sample |
//! | `response.rs` | small contrasts as they are retrieved |
//! | `retriever.rs` | a design made ready: fits of flat and sample |

mod aperture;
mod expected;
mod fit;
mod found;
mod geometry;
mod lattice;
mod models;
mod moments;
mod offsets;
mod response;
mod retriever;
mod windows;

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests")]
#[allow(clippy::cast_possible_truncation, reason = "frames of f32")]
mod tests;

pub use aperture::Aperture;
pub use expected::sigmas_in_two_directions;
pub(crate) use fit::PlanarFit;
pub(crate) use geometry::{Design, aperture, knows_curve};
pub use lattice::Lattice;
pub(crate) use retriever::{Fits, PlanarRetriever};
