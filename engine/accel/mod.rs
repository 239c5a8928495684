//! Acceleration: data for the device's search of triangles in the way of a ray.

mod backend;
mod bvh;
mod placed;

pub use backend::Backend;
pub(crate) use bvh::Bvh;
