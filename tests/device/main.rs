//! Devices and drivers: the Vulkan wrapper, both traversal backends, other drivers, and devices that
//! fail.

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
