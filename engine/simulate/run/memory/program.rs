//! Memory of the program itself, and of the trees that it builds.

use beamlet_core::reserve::PROGRAM;
use beamlet_model::scene::{Normals, Object, Scene, ShapeOrMesh};

/// Additional memory of its kernels for curved, rough or placed surfaces.
const KERNELS: u64 = 100 << 20;

/// Peak bytes on the host per triangle while the tree is built, all meshes read.
const BUILD: u64 = 320;
/// Additional memory that allocators keep of freed vectors, per triangle, and its limit: smaller vectors
/// leave gaps, by the timing of threads, and large ones go back to the system.
const GAPS: [u64; 2] = [100, 40 << 20];

/// Bytes of the program, the driver and its kernels.
pub(super) fn program(scene: &Scene) -> u64 {
    let is_simple = |object: &Object| {
        let has_facets = match &object.geometry {
            ShapeOrMesh::Shape(shape) => shape.has_facets(),
            ShapeOrMesh::Mesh(_) => true,
        };
        let is_flat = has_facets && object.normals == Normals::Facets;
        is_flat && object.instances.is_none() && object.roughness <= 0.0
    };
    let scatters = scene.objects.iter().any(|object| scene.scatters(&object.material));
    PROGRAM + if scene.objects.iter().all(is_simple) && !scatters { 0 } else { KERNELS }
}

/// Peak memory of the host while a tree over `triangles` triangles is built, bytes.
pub(super) fn building(triangles: u64) -> u64 {
    BUILD.saturating_mul(triangles).saturating_add(GAPS[1].min(GAPS[0].saturating_mul(triangles)))
}
