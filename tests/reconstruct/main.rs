//! What is reconstructed from sinograms: volumes against closed forms.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![expect(clippy::cast_possible_truncation, reason = "sinograms are f32")]

use beamlet_reference as reference;
#[path = "../support/mod.rs"]
mod support;

mod arm;
mod axis;
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
mod resident;
mod scattering;
mod set_up;
#[cfg(feature = "cli")]
mod truth;
#[cfg(feature = "cli")]
mod verb;
