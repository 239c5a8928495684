//! Memory of the program itself.

use beamlet_core::reserve::PROGRAM;
use beamlet_model::scene::{Normals, Object, Scene, ShapeOrMesh};

/// Additional memory of its kernels for curved, rough or placed surfaces.
const KERNELS: u64 = 100 << 20;

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
