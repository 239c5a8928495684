//! Independent f64 reference: brute-force ray tracing, masks and integrals over the focal spot.
//!
//! It shares no function with the engine and follows the statements of physics, not the
//! engine's algorithms: full vector Snell on n = 1 - delta, hits in order with moved hit points,
//! box bars cut by every ray, and sums over source points whose rays are traced again.
//! `waves` propagates fields by FFT.
//! Frame and signs: +y source to detector, +x across the slits, +z up, origin at the rotation
//! centre; metres and radians throughout.

#![allow(dead_code, reason = "every test binary uses another part of the reference")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "bin and cell indices come from floored, clamped floats"
)]
#![allow(clippy::float_cmp, reason = "media of the very same constants do not deflect")]

pub mod apertures;
pub mod blobs;
pub mod bundle;
pub mod closed_form;
pub mod draws;
pub mod fit;
pub mod masks;
pub mod normal;
pub mod panels;
mod pieces;
pub mod rays;
pub mod rough;
pub mod round_bodies;
pub mod scattering;
pub mod scenes;
pub mod silhouettes;
pub mod stack;
pub mod surfaces;
pub mod vector;
pub mod walls;
pub mod waves;
