//! Which rays are traced: the schemes against one another and against many more rays, and the same
//! bits however a run is cut.

use beamlet_reference as reference;
#[path = "../support/mod.rs"]
mod support;

mod borders;
mod choice;
mod counts;
mod determinism;
mod estimated;
mod even_on_device;
mod foam;
mod heights_on_device;
mod level_faces;
mod on_device;
mod rims;
mod row_blur;
mod sampling;
mod tilted_faces;
mod traps;
mod truth;
