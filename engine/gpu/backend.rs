//! The two ways to find triangles.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Traversal backend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Backend {
    /// Hardware or driver acceleration structures through `VK_KHR_ray_query`.
    RayQuery,
    /// Software BVH in a compute shader.
    Bvh,
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RayQuery => "ray-query",
            Self::Bvh => "bvh",
        })
    }
}
