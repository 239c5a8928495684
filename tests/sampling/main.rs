//! Which rays are traced: the schemes against one another and against many more rays, and the same
//! bits however a run is cut.

use beamlet_reference as reference;
#[path = "../support/mod.rs"]
mod support;

mod apertures;
mod audit;
mod borders;
mod counts;
mod designs;
mod determinism;
mod estimated;
mod foam;
mod kinds;
mod level_faces;
mod rims;
mod row_blur;
mod sampling;
mod tilted_faces;
mod traps;
mod truth;
mod unresolved;
