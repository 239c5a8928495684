//! Memory of a reconstruction, and the remainder of a limit for the device.

use super::geometry::ScanGeometry;
use super::method::Method;
use super::plan::VolumePlan;
use super::projector::AT_ONCE;
use super::quantity::Quantity;
use super::redundancy::Redundancy;
use super::resampling::Resampling;
use super::resident::{VALUE, product, require_room, resident_bytes};
use beamlet_core::numbers::length;
use beamlet_core::reserve::PROGRAM;
use beamlet_core::{Error, Result};
use beamlet_gpu::Compute;

/// Memory of a reconstruction at its peak, bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Memory {
    /// On the host, without the program.
    pub(super) host: u64,
    /// On the device: slabs of the volume and parts of the sinograms, or all vectors of an iterative method.
    pub(super) device: u64,
    /// Values of a volume, and of sinograms, that are on the device at once; `None`: all vectors of an
    /// iterative method.
    pub(super) at_once: Option<usize>,
}

impl Memory {
    /// The memory of a plan on a device, within the limit of the engine; `truth`: with volumes of the scene.
    ///
    /// # Errors
    /// [`Error::Memory`] where the limit is too low, or the device has no room for the vectors of an iterative method.
    pub(super) fn on(
        compute: &Compute,
        geometry: &ScanGeometry,
        plan: &VolumePlan,
        truth: bool,
    ) -> Result<Self> {
        let memory = Self::of(geometry, plan, truth, compute.options().memory_limit)?;
        if memory.at_once.is_none() {
            require_room(compute, (geometry, &plan.grid), memory.device)?;
        }
        Ok(memory)
    }

    /// The memory of a plan within a limit, the program included; `truth`: with volumes of the scene.
    ///
    /// # Errors
    /// [`Error::Memory`] where the limit is too low.
    fn of(
        geometry: &ScanGeometry,
        plan: &VolumePlan,
        truth: bool,
        limit: Option<u64>,
    ) -> Result<Self> {
        let host = host_bytes(geometry, plan, truth);
        let memory = match &plan.method {
            Method::Fbp(_) => Self::in_slabs(geometry, plan, host, limit),
            Method::Iterative { options, .. } => {
                let method = (options.solver, filters_gradients(plan));
                let extras = [plan.mask.is_some(), has_weights(plan)];
                let device = resident_bytes(geometry, &plan.grid, method, extras);
                Self { host, device, at_once: None }
            }
        };
        let needed = PROGRAM.saturating_add(memory.host).saturating_add(memory.device);
        match limit {
            Some(limit) if needed > limit => Err(Error::Memory {
                purpose: "a reconstruction".into(),
                needed,
                available: Some(limit),
                remedy: "raise the memory limit, use larger or fewer voxels (--voxel, --size), or \
                         reconstruct a part of the volume (--origin)"
                    .into(),
            }),
            _ => Ok(memory),
        }
    }

    /// The memory of filtered back-projection, with the largest slabs within a limit.
    fn in_slabs(geometry: &ScanGeometry, plan: &VolumePlan, host: u64, limit: Option<u64>) -> Self {
        let [x, y, z] = plan.grid.size.map(|side| side as u64);
        let [views, rows, columns] = geometry.shape().map(|side| side as u64);
        // Refraction angles are differences of one place more than columns.
        let places = (filtered_columns(geometry) as u64).max(columns + 1);
        let (plane, view) = (x.saturating_mul(y), rows.saturating_mul(places));
        let bytes = if passes(geometry, plan) > 0 { 2 * VALUE } else { VALUE };
        let rest = limit.map(|limit| limit.saturating_sub(PROGRAM).saturating_sub(host));
        let at_once = rest.map_or(u64::MAX, |rest| rest / (2 * bytes)).min(AT_ONCE as u64);
        let slab = at_once.max(plane).min(plane.saturating_mul(z));
        let part = at_once.max(view).min(view.saturating_mul(views));
        let device = bytes.saturating_mul(slab.saturating_add(part));
        Self { host, device, at_once: Some(length(at_once.max(1))) }
    }
}

/// True if gradients of an iterative method are filtered.
fn filters_gradients(plan: &VolumePlan) -> bool {
    matches!(plan.method, Method::Iterative { phase: false, .. })
        && plan.quantities.contains(&Quantity::Delta)
}

/// True if sinograms may have weights: 0 for views that lost their refraction.
fn has_weights(plan: &VolumePlan) -> bool {
    !plan.keep_views && plan.quantities.contains(&Quantity::Delta)
}

/// Corrections for lever arms over all quantities of a plan.
pub(super) fn passes(geometry: &ScanGeometry, plan: &VolumePlan) -> usize {
    let Some(options) = plan.method.filtered() else { return 0 };
    let is_turn = Redundancy::of(geometry).is_ok_and(|weights| weights.is_turn());
    plan.ordered().map(|quantity| options.passes(geometry, quantity, is_turn)).sum()
}

/// Number of columns of a filtered row: even columns, and the columns that a half-fan adds on its shorter side.
fn filtered_columns(geometry: &ScanGeometry) -> usize {
    let even = Resampling::of(&geometry.columns);
    let added = Redundancy::of(geometry)
        .map_or([0; 2], |weights| weights.missing(geometry, [even.first, even.pitch], even.len()));
    even.len() + added[0] + added[1]
}

/// Most bytes on the host at a time: volumes and sinograms that are alive together.
fn host_bytes(geometry: &ScanGeometry, plan: &VolumePlan, truth: bool) -> u64 {
    let [views, rows, columns] = geometry.shape();
    let volume = product(plan.grid.size);
    let sinograms = product([views, rows, columns + 1]);
    let filtered = product([views, rows, filtered_columns(geometry)]);
    let counted = |volumes: u64, of_sinograms: u64, of_filtered: u64| {
        volume
            .saturating_mul(volumes)
            .saturating_add(sinograms.saturating_mul(of_sinograms))
            .saturating_add(filtered.saturating_mul(of_filtered))
    };
    // Volumes that are kept from one quantity to the next: μ, and the labels and values of the truth.
    let kept = u64::from(plan.gradient_bias.is_some()) + 2 * u64::from(truth);
    match &plan.method {
        Method::Fbp(_) => match passes(geometry, plan) > 0 {
            true => counted(kept + 2, 2, 1),
            false => counted(kept + 1, 1, 1),
        },
        Method::Iterative { phase, .. } => {
            // The mask and its copy as numbers, the start, and the volume that is made.
            let beside = 2 * u64::from(plan.mask.is_some()) + u64::from(plan.start.is_some()) + 1;
            // Weights and their copy in another unit; integrals and their drift.
            let extra = 2 * u64::from(has_weights(plan)) + 2 * u64::from(*phase);
            counted(kept + beside, 1 + extra, 0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::{IterativeOptions, Quantity, VolumeGrid};

    /// A parallel beam over a whole turn, with the axis `shift` columns beside the middle of 101.
    fn scan(shift: f64) -> ScanGeometry {
        let columns = (0..101).map(|n| f64::from(n) - 50.0).collect();
        let angles = (0..90).map(|n| f64::from(4 * n).to_radians()).collect();
        let mut geometry =
            ScanGeometry::new([f64::INFINITY, 1.0], columns, vec![1.0, 0.0, -1.0], angles);
        geometry.axis = shift;
        geometry
    }

    fn plan() -> VolumePlan {
        let grid = VolumeGrid { size: [20, 20, 3], voxel: [1.0; 3], origin: [-9.5, -9.5, -1.0] };
        VolumePlan::new(vec![Quantity::Mu, Quantity::Delta], grid, Method::default())
    }

    #[test]
    fn memory_counts_what_is_alive_together() {
        let host = |shift, plan: &VolumePlan| {
            Memory::of(&scan(shift), plan, false, None).map(|memory| memory.host)
        };
        let (volume, rows) = (4 * 20 * 20 * 3, 4 * 90 * 3);
        // Sinograms with a column more, and filtered rows.
        assert_eq!(host(0.0, &plan()).unwrap(), volume + rows * (102 + 101));
        // A half-fan whose shorter side is 50 columns less than the longer one.
        assert_eq!(host(25.0, &plan()).unwrap(), volume + rows * (102 + 151));
        // μ is kept for δ.
        assert_eq!(
            host(0.0, &plan().with_gradient_bias(1e-9)).unwrap(),
            2 * volume + rows * (102 + 101)
        );
    }

    #[test]
    fn vectors_of_iterations_are_on_the_device_or_refused_with_their_size() {
        let mut plan = plan();
        plan.quantities = vec![Quantity::Mu];
        plan.grid.size = [400, 400, 40];
        plan.method = Method::iterative(IterativeOptions::default(), false);
        let memory = |limit| Memory::of(&scan(0.0), &plan, false, limit);
        let whole = memory(None).unwrap();
        let (volume, sinograms) = (4 * 400 * 400 * 40, 4 * 90 * 3 * 101);
        // Volume, best volume, gradient and direction; residual and projections; rays, and tables.
        let (rays, tables) = (4 * 90 * 3 * 102, 16 * 3 * 101 + 512 * 90);
        assert_eq!(whole.device, 4 * volume + 2 * sinograms + rays + tables);
        assert_eq!((whole.host, whole.at_once), (volume + rays, None));
        let least = PROGRAM + whole.host + whole.device;
        assert_eq!(memory(Some(least)).unwrap().device, whole.device);
        let Err(Error::Memory { needed, available, .. }) = memory(Some(least - 1)) else {
            panic!("a limit of a byte less is refused");
        };
        assert_eq!((needed, available), (least, Some(least - 1)));
    }
}
