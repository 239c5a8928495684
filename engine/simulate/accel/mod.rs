//! Acceleration: data for the device's search of triangles in the way of a ray.

mod bvh;
mod placed;

pub use bvh::Bvh;
