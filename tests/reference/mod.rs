//! Independent f64 reference: brute-force ray tracing, masks and integrals over the focal spot.
//!
//! It shares no function with the engine and follows the statements of physics, not the
//! engine's algorithms: full vector Snell on n = 1 - delta, hits in order with moved hit points,
//! box bars cut by every ray, and sums over source points whose rays are traced again.
//! Frame and signs: +y source to detector, +x across the slits, +z up, origin at the rotation
//! centre; metres and radians throughout.

#![allow(dead_code, reason = "every test binary uses another part of the reference")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "bin and cell indices come from floored, clamped floats"
)]
#![allow(clippy::float_cmp, reason = "media of the very same constants do not deflect")]

pub(crate) mod blobs;
pub(crate) mod bundle;
pub(crate) mod closed_form;
pub(crate) mod draws;
pub(crate) mod fit;
pub(crate) mod masks;
pub(crate) mod normal;
pub(crate) mod rays;
pub(crate) mod rough;
pub(crate) mod scenes;
pub(crate) mod silhouettes;
pub(crate) mod stack;
pub(crate) mod surfaces;
pub(crate) mod vector;
