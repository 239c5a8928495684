//! Acceleration: what the device needs to find the triangles that a ray meets.

mod backend;
mod bvh;
mod placed;

pub use backend::Backend;
pub(crate) use bvh::Bvh;
