//! What is reconstructed from sinograms: volumes against closed forms.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![expect(clippy::cast_possible_truncation, reason = "sinograms are f32")]

#[path = "../reference/mod.rs"]
mod reference;
#[path = "../support/mod.rs"]
mod support;

mod arm;
mod corrections;
#[cfg(feature = "cli")]
mod faces;
mod fbp;
mod iterative;
mod lost_views;
mod moved;
mod paper_fan;
mod peers;
mod projector;
mod refused;
mod set_up;
mod sigma;
#[cfg(feature = "cli")]
mod verb;
