//! Kernels of the walks.

use super::push_bytes;
use crate::accel::Backend;
use crate::gpu::{Device, LazyKernel, shaders};
use crate::interface::{BUNDLE_LANES, ExactPush, GROUP, RAYS_PER_LANE, TracePush};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Sizes of subgroups whose rays walk the tree as a bundle. Smaller ones cannot hold a node; in
/// larger ones too few of the rays meet the same nodes.
const BUNDLES: RangeInclusive<u32> = BUNDLE_LANES..=2 * BUNDLE_LANES;

/// The kernels of one device, each made when it is first wanted.
#[derive(Debug)]
pub struct TraceKernels {
    pub(super) trace_bvh: OrderFree,
    pub(super) exact_bvh: LazyKernel,
    ray_query: Option<(OrderFree, LazyKernel)>,
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
        let kernel = |name, spirv| LazyKernel::new(device, name, spirv, push_bytes::<TracePush>());
        let exact = |name, spirv| LazyKernel::new(device, name, spirv, push_bytes::<ExactPush>());
        let description = device.description();
        let ray_query = description.ray_query.then(|| {
            let walk = OrderFree {
                few: kernel("trace_ray_query", shaders::TRACE_RAY_QUERY),
                many: kernel("trace_ray_query_many", shaders::TRACE_RAY_QUERY_MANY),
                rays: GROUP,
            };
            (walk, exact("exact_ray_query", shaders::EXACT_RAY_QUERY))
        });
        let bundles = description.subgroup_exchange && BUNDLES.contains(&description.subgroup_size);
        let trace_bvh = if bundles {
            OrderFree {
                few: kernel("trace_bundles", shaders::TRACE_BUNDLES),
                many: kernel("trace_bundles_many", shaders::TRACE_BUNDLES_MANY),
                rays: GROUP * RAYS_PER_LANE,
            }
        } else {
            OrderFree {
                few: kernel("trace_bvh", shaders::TRACE_BVH),
                many: kernel("trace_bvh_many", shaders::TRACE_BVH_MANY),
                rays: GROUP,
            }
        };
        let exact_bvh = exact("exact_bvh", shaders::EXACT_BVH);
        Self { trace_bvh, exact_bvh, ray_query }
    }

    pub(super) const fn of(&self, backend: Backend) -> (&OrderFree, &LazyKernel) {
        match (&self.ray_query, backend) {
            (Some((trace, exact)), Backend::RayQuery) => (trace, exact),
            _ => (&self.trace_bvh, &self.exact_bvh),
        }
    }
}
