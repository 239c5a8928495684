//! Devices and drivers: the Vulkan wrapper, both traversal backends, other drivers, and devices that
//! fail.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a test that cannot go on has failed; numbers of tests are small, and its figures are printed"
)]

use beamlet_reference as reference;
#[path = "../support/mod.rs"]
mod support;

mod backends;
mod counts;
mod drivers;
mod faults;
mod gpu;
mod handle;
mod interface;
mod layer;
mod light;
