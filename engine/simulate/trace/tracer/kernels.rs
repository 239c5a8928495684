//! Kernels of the walks.

use beamlet_gpu::{Backend, Device, LazyKernel, push_bytes};
use beamlet_interface::{
    BUNDLE_LANES, CrossingsPush, ExactPush, GROUP, KIND_CROSSED, KIND_ELLIPSOID, KIND_FRUSTUM,
    KIND_HEIGHTS, KIND_MOVED, KIND_ROUGH, KIND_SCATTERING, KIND_SCATTERING_AXIS, KIND_SMOOTH,
    KIND_TUBE, RAYS_PER_LANE, TracePush,
};
use std::ops::RangeInclusive;
use std::sync::{Arc, OnceLock};

/// Sizes of subgroups whose rays walk the tree as a bundle. Smaller ones cannot hold a node; in larger
/// ones too few of the rays share nodes.
const BUNDLES: RangeInclusive<u32> = BUNDLE_LANES..=2 * BUNDLE_LANES;

/// The kernels of one device, each made when it is first wanted.
#[derive(Debug)]
pub struct TraceKernels {
    device: Arc<Device>,
    /// Walks by the kinds in a sample: `KIND_` bits.
    bvh: Vec<OnceLock<Walks>>,
    ray_query: Vec<OnceLock<Walks>>,
    /// Lists of crossings.
    pub(in crate::trace) crossings: LazyKernel,
}

/// Surfaces at which bundles leave rays to the walk of single ones: surfaces that refract by other normals
/// than the normals of their facets or shapes, and shapes that others cross.
const ONE_BY_ONE: u32 = KIND_ROUGH | KIND_HEIGHTS | KIND_SMOOTH | KIND_CROSSED;

/// Combinations of `KIND_` bits.
const KINDS: usize = 2 * KIND_SCATTERING_AXIS as usize;

/// The walks of a backend.
#[derive(Debug)]
pub(super) struct Walks {
    order_free: OrderFree,
    /// For rays one by one, where some kinds of surfaces need that and `order_free` walks bundles.
    one_by_one: Option<OrderFree>,
    pub(crate) exact: LazyKernel,
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
        let each = || (0..KINDS).map(|_| OnceLock::new()).collect();
        Self {
            device: device.clone(),
            bvh: each(),
            ray_query: each(),
            crossings: LazyKernel::new(device, "crossings", push_bytes::<CrossingsPush>()),
        }
    }

    /// Kernels of a backend; `kinds`: the kinds in the sample.
    pub(super) fn of(&self, backend: Backend, kinds: u32) -> &Walks {
        let description = self.device.description();
        let place = kinds as usize % KINDS;
        if backend == Backend::RayQuery && description.ray_query {
            return self.ray_query[place].get_or_init(|| Walks::ray_query(&self.device, kinds));
        }
        self.bvh[place].get_or_init(|| {
            let size = description.subgroup_size;
            let bundles = description.subgroup_exchange && BUNDLES.contains(&size);
            Walks::bvh(&self.device, kinds, bundles)
        })
    }
}

impl OrderFree {
    fn new(device: &Arc<Device>, kinds: u32, rays: u32, [few, many]: [&'static str; 2]) -> Self {
        let kernel = |named| kernel_of(device, kinds, named, push_bytes::<TracePush>());
        Self { few: kernel(few), many: kernel(many), rays }
    }
}

fn kernel_of(device: &Arc<Device>, kinds: u32, name: &'static str, push_bytes: u32) -> LazyKernel {
    let kernel = LazyKernel::new(device, name, push_bytes);
    if kinds == 0 { kernel } else { kernel.with_constant(kinds) }
}

impl Walks {
    /// The order-free walk of rays that come in the order of a list; `bundled`: as they are traced first.
    pub(super) fn order_free(&self, bundled: bool) -> &OrderFree {
        self.one_by_one.as_ref().filter(|_| !bundled).unwrap_or(&self.order_free)
    }

    /// True if the walk of bundles leaves some rays to the walk of single ones.
    pub(super) const fn leaves_rays(&self) -> bool {
        self.one_by_one.is_some()
    }

    fn bvh(device: &Arc<Device>, kinds: u32, bundles: bool) -> Self {
        let exact = match kinds {
            0 => "exact_bvh",
            _ => "exact_bvh_placed",
        };
        let bundled = KIND_FRUSTUM
            | KIND_ELLIPSOID
            | KIND_TUBE
            | KIND_MOVED
            | KIND_SCATTERING
            | KIND_SCATTERING_AXIS
            | ONE_BY_ONE;
        let bundles = bundles && kinds & !bundled == 0;
        let single = match kinds {
            0 => ["trace_bvh", "trace_bvh_many"],
            _ => ["trace_bvh_placed", "trace_bvh_placed_many"],
        };
        let bundle = match kinds {
            0 => ["trace_bundles", "trace_bundles_many"],
            _ => ["trace_bundles_placed", "trace_bundles_placed_many"],
        };
        let single = OrderFree::new(device, kinds, GROUP, single);
        let exact = kernel_of(device, kinds, exact, push_bytes::<ExactPush>());
        if !bundles {
            return Self { order_free: single, one_by_one: None, exact };
        }
        let order_free = OrderFree::new(device, kinds, GROUP * RAYS_PER_LANE, bundle);
        let leaves = kinds & ONE_BY_ONE != 0;
        Self { order_free, one_by_one: leaves.then_some(single), exact }
    }

    fn ray_query(device: &Arc<Device>, kinds: u32) -> Self {
        let [few, many, exact] = match kinds {
            0 => ["trace_ray_query", "trace_ray_query_many", "exact_ray_query"],
            _ => {
                ["trace_ray_query_placed", "trace_ray_query_placed_many", "exact_ray_query_placed"]
            }
        };
        Self {
            order_free: OrderFree::new(device, kinds, GROUP, [few, many]),
            one_by_one: None,
            exact: kernel_of(device, kinds, exact, push_bytes::<ExactPush>()),
        }
    }
}
