//! Kernels of the walks.

use super::push_bytes;
use crate::accel::Backend;
use crate::gpu::{Device, LazyKernel, shaders};
use crate::interface::{
    BUNDLE_LANES, CrossingsPush, ExactPush, GROUP, KIND_ELLIPSOID, KIND_FRUSTUM, KIND_MOVED,
    KIND_TORUS, RAYS_PER_LANE, TracePush,
};
use crate::numbers;
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Sizes of subgroups whose rays walk the tree as a bundle. Smaller ones cannot hold a node; in
/// larger ones too few of the rays meet the same nodes.
const BUNDLES: RangeInclusive<u32> = BUNDLE_LANES..=2 * BUNDLE_LANES;

/// The kernels of one device, each made when it is first wanted.
#[derive(Debug)]
pub struct TraceKernels {
    /// By what is placed in a sample: `KIND_` bits.
    bvh: [Walks; KINDS],
    ray_query: Option<[Walks; KINDS]>,
    /// Lists of crossings.
    pub(in crate::trace) crossings: LazyKernel,
}

/// Combinations of `KIND_` bits.
const KINDS: usize = 2 * KIND_MOVED as usize;

/// The walks of a backend.
#[derive(Debug)]
pub(super) struct Walks {
    pub(super) order_free: OrderFree,
    pub(super) exact: LazyKernel,
}

/// The order-free walk of a backend.
#[derive(Debug)]
pub(super) struct OrderFree {
    /// For few materials, whose sums stay in registers.
    pub(super) few: LazyKernel,
    /// For any number of materials.
    pub(super) many: LazyKernel,
    /// Rays of a workgroup.
    pub(super) rays: u32,
}

impl TraceKernels {
    /// Kernels of a device.
    #[must_use]
    pub fn new(device: &Arc<Device>) -> Self {
        let description = device.description();
        let bundles = description.subgroup_exchange && BUNDLES.contains(&description.subgroup_size);
        let kind = |kinds: usize| numbers::count(kinds);
        Self {
            bvh: std::array::from_fn(|kinds| Walks::bvh(device, kind(kinds), bundles)),
            ray_query: description
                .ray_query
                .then(|| std::array::from_fn(|kinds| Walks::ray_query(device, kind(kinds)))),
            crossings: LazyKernel::new(
                device,
                "crossings",
                shaders::CROSSINGS,
                push_bytes::<CrossingsPush>(),
            ),
        }
    }

    /// Of a backend; `kinds`: what is placed in the sample.
    pub(super) fn of(&self, backend: Backend, kinds: u32) -> &Walks {
        let walks = match (&self.ray_query, backend) {
            (Some(walks), Backend::RayQuery) => walks,
            _ => &self.bvh,
        };
        &walks[kinds as usize % KINDS]
    }
}

/// Kernels by name: for few materials, for many, and exact.
type Named = [(&'static str, &'static [u32]); 3];

impl Walks {
    fn new(device: &Arc<Device>, kinds: u32, rays: u32, [few, many, exact]: Named) -> Self {
        let kernel = |(name, spirv), push_bytes| {
            let kernel = LazyKernel::new(device, name, spirv, push_bytes);
            if kinds == 0 { kernel } else { kernel.with_constant(kinds) }
        };
        let order_free = |named| kernel(named, push_bytes::<TracePush>());
        Self {
            order_free: OrderFree { few: order_free(few), many: order_free(many), rays },
            exact: kernel(exact, push_bytes::<ExactPush>()),
        }
    }

    fn bvh(device: &Arc<Device>, kinds: u32, bundles: bool) -> Self {
        let torus = kinds & KIND_TORUS != 0;
        let exact = match kinds {
            0 => ("exact_bvh", shaders::EXACT_BVH),
            _ if torus => ("exact_bvh_torus", shaders::EXACT_BVH_TORUS),
            _ => ("exact_bvh_placed", shaders::EXACT_BVH_PLACED),
        };
        let convex = kinds & !(KIND_FRUSTUM | KIND_ELLIPSOID | KIND_MOVED) == 0;
        let [few, many] = match (kinds, bundles && convex) {
            (0, true) => [
                ("trace_bundles", shaders::TRACE_BUNDLES),
                ("trace_bundles_many", shaders::TRACE_BUNDLES_MANY),
            ],
            (0, false) => {
                [("trace_bvh", shaders::TRACE_BVH), ("trace_bvh_many", shaders::TRACE_BVH_MANY)]
            }
            (_, true) => [
                ("trace_bundles_placed", shaders::TRACE_BUNDLES_PLACED),
                ("trace_bundles_placed_many", shaders::TRACE_BUNDLES_PLACED_MANY),
            ],
            (_, false) if torus => [
                ("trace_bvh_torus", shaders::TRACE_BVH_TORUS),
                ("trace_bvh_torus_many", shaders::TRACE_BVH_TORUS_MANY),
            ],
            (_, false) => [
                ("trace_bvh_placed", shaders::TRACE_BVH_PLACED),
                ("trace_bvh_placed_many", shaders::TRACE_BVH_PLACED_MANY),
            ],
        };
        let rays = if bundles && convex { GROUP * RAYS_PER_LANE } else { GROUP };
        Self::new(device, kinds, rays, [few, many, exact])
    }

    fn ray_query(device: &Arc<Device>, kinds: u32) -> Self {
        let named = match kinds {
            0 => [
                ("trace_ray_query", shaders::TRACE_RAY_QUERY),
                ("trace_ray_query_many", shaders::TRACE_RAY_QUERY_MANY),
                ("exact_ray_query", shaders::EXACT_RAY_QUERY),
            ],
            _ if kinds & KIND_TORUS != 0 => [
                ("trace_ray_query_torus", shaders::TRACE_RAY_QUERY_TORUS),
                ("trace_ray_query_torus_many", shaders::TRACE_RAY_QUERY_TORUS_MANY),
                ("exact_ray_query_torus", shaders::EXACT_RAY_QUERY_TORUS),
            ],
            _ => [
                ("trace_ray_query_placed", shaders::TRACE_RAY_QUERY_PLACED),
                ("trace_ray_query_placed_many", shaders::TRACE_RAY_QUERY_PLACED_MANY),
                ("exact_ray_query_placed", shaders::EXACT_RAY_QUERY_PLACED),
            ],
        };
        Self::new(device, kinds, GROUP, named)
    }
}
