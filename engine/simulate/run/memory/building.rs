//! Memory of the host while trees are built.

/// Peak bytes on the host per triangle while the tree is built, all meshes read.
const BUILD: u64 = 320;
/// Additional memory that allocators keep of freed vectors, per triangle, and its limit: smaller vectors
/// leave gaps, by the timing of threads, and large ones go back to the system.
const GAPS: [u64; 2] = [150, 60 << 20];

/// Peak memory of the host while a tree over `triangles` triangles is built, bytes.
pub(super) fn building(triangles: u64) -> u64 {
    BUILD.saturating_mul(triangles).saturating_add(GAPS[1].min(GAPS[0].saturating_mul(triangles)))
}
