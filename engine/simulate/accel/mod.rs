//! Acceleration: data for the device's search of triangles in the way of a ray.

mod bvh;
mod facet_tree;
mod placed;

pub use bvh::Bvh;
pub(crate) use facet_tree::{FacetTree, Fan, Met};
pub(crate) use placed::twofold;
