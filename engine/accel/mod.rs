//! Acceleration: what the device needs to find the triangles that a ray meets.

mod bvh;

pub use bvh::Bvh;
