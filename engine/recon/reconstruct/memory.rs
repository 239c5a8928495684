//! Memory of a reconstruction, and the remainder of a limit for the device.

use super::geometry::ScanGeometry;
use super::method::Method;
use super::plan::VolumePlan;
use super::preconditioner::filter_bytes;
use super::projector::AT_ONCE;
use super::quantity::Quantity;
use super::redundancy::Redundancy;
use super::resampling::Resampling;
use super::resident::{VALUE, resident_bytes, vectors};
use super::vectors::Vectors;
use beamlet_core::numbers::length;
use beamlet_core::reserve::PROGRAM;
use beamlet_core::{Error, Result};

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
    /// The memory of a plan within a limit, the program included; `truth`: with volumes of the scene.
    ///
    /// # Errors
    /// [`Error::Memory`] where the limit is too low.
    pub(super) fn of(
        geometry: &ScanGeometry,
        plan: &VolumePlan,
        truth: bool,
        limit: Option<u64>,
    ) -> Result<Self> {
        if let Some(resident) = Self::resident(geometry, plan, truth)
            && limit.is_none_or(|limit| resident.needed() <= limit)
        {
            return Ok(resident);
        }
        let host = host_bytes(geometry, plan, [truth, false]);
        let [x, y, z] = plan.grid.size.map(|side| side as u64);
        let [views, rows, columns] = geometry.shape().map(|side| side as u64);
        // Refraction angles are differences of one place more than columns.
        let filtered = plan.method.filtered().map_or(0, |_| filtered_columns(geometry));
        let places = (filtered as u64).max(columns + 1);
        let (plane, view) = (x.saturating_mul(y), rows.saturating_mul(places));
        let pairs = if passes(geometry, plan) > 0 { 2 } else { 1 };
        // Factors of each column of a row: made on the host, and kept on the device.
        let factors = 4 * VALUE * rows.saturating_mul(columns);
        let (pieces, host) = match plan.method {
            Method::Fbp(_) => (0, host),
            Method::Iterative { .. } => {
                let filter = if filters_gradients(plan) { filter_bytes(plan.grid.size) } else { 0 };
                let pieces = 3 * VALUE * piece(geometry, plan);
                (pieces + factors + filter, host.saturating_add(factors))
            }
        };
        let of_device = |at_once: u64| {
            let slab = at_once.max(plane).min(plane.saturating_mul(z));
            let part = at_once.max(view).min(view.saturating_mul(views));
            (pairs * VALUE).saturating_mul(slab.saturating_add(part)).saturating_add(pieces)
        };
        let mut at_once = AT_ONCE as u64;
        if let Some(limit) = limit {
            let rest = limit.saturating_sub(PROGRAM).saturating_sub(host).saturating_sub(pieces);
            at_once = at_once.min(rest / (2 * pairs * VALUE));
            let needed = PROGRAM.saturating_add(host).saturating_add(of_device(at_once));
            if needed > limit {
                return Err(Error::Memory {
                    purpose: "a reconstruction".into(),
                    needed,
                    available: Some(limit),
                    remedy:
                        "raise the memory limit, use larger or fewer voxels (--voxel, --size), or \
                         reconstruct a part of the volume (--origin)"
                            .into(),
                });
            }
        }
        Ok(Self { host, device: of_device(at_once), at_once: Some(length(at_once.max(1))) })
    }

    /// The memory of an iterative method with all vectors on the device.
    fn resident(geometry: &ScanGeometry, plan: &VolumePlan, truth: bool) -> Option<Self> {
        let Method::Iterative { options, .. } = &plan.method else { return None };
        let method = (options.solver, filters_gradients(plan));
        let extras = [plan.mask.is_some(), has_weights(plan)];
        let device = resident_bytes(geometry, &plan.grid, method, extras);
        let host = host_bytes(geometry, plan, [truth, true]);
        Some(Self { host, device, at_once: None })
    }

    /// With the program.
    const fn needed(&self) -> u64 {
        PROGRAM.saturating_add(self.host).saturating_add(self.device)
    }
}

/// True if gradients of an iterative method are filtered.
fn filters_gradients(plan: &VolumePlan) -> bool {
    matches!(plan.method, Method::Iterative { phase: false, .. })
        && plan.quantities.contains(&Quantity::Delta)
}

/// Values of a piece of a vector that is on the host.
fn piece(geometry: &ScanGeometry, plan: &VolumePlan) -> u64 {
    let [views, rows, columns] = geometry.shape();
    let longest = plan.grid.size.iter().product::<usize>().max(views * rows * columns);
    let [x, y, _] = plan.grid.size;
    let planes = if filters_gradients(plan) { 2 * x * y } else { 0 };
    Vectors::piece(longest, planes.max(rows * columns)) as u64
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

/// Most bytes on the host at a time: volumes and sinograms that are alive together; `is_resident`: with the
/// vectors of an iterative method on the device.
fn host_bytes(geometry: &ScanGeometry, plan: &VolumePlan, [truth, is_resident]: [bool; 2]) -> u64 {
    let product =
        |sides: [usize; 3]| sides.iter().fold(VALUE, |all, side| all.saturating_mul(*side as u64));
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
        Method::Iterative { options, phase } => {
            let has_mask = plan.mask.is_some();
            // The mask and the start, and the volume that is made, where none of the vectors becomes it.
            let beside: u64 =
                [has_mask, plan.start.is_some(), is_resident].into_iter().map(u64::from).sum();
            // Weights and their copy in another unit; integrals and their drift.
            let extra = 2 * u64::from(has_weights(plan)) + 2 * u64::from(*phase);
            let [volumes, of_sinograms] = match is_resident {
                true => [u64::from(has_mask), 0],
                false => {
                    vectors(options.solver, filters_gradients(plan), [has_mask, has_weights(plan)])
                }
            };
            counted(kept + beside + volumes, 1 + extra + of_sinograms, 0)
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
    fn vectors_of_iterations_are_on_the_device_where_the_limit_allows_it() {
        let mut plan = plan();
        plan.quantities = vec![Quantity::Mu];
        plan.grid.size = [400, 400, 40];
        plan.method = Method::iterative(IterativeOptions::default(), false);
        let memory = |limit| Memory::of(&scan(0.0), &plan, false, limit).unwrap();
        let whole = memory(None);
        let (volume, sinograms) = (4 * 400 * 400 * 40, 4 * 90 * 3 * 101);
        // Volume, best volume, gradient and direction; residual and projections; rays, and tables.
        let (rays, tables) = (4 * 90 * 3 * 102, 16 * 3 * 101 + 512 * 90);
        assert_eq!(whole.device, 4 * volume + 2 * sinograms + rays + tables);
        assert_eq!((whole.host, whole.at_once), (volume + rays, None));
        let needed = PROGRAM + whole.host + whole.device;
        assert_eq!(memory(Some(needed)).device, whole.device);
        let slabs = memory(Some(needed - 1));
        assert!(slabs.at_once.is_some() && slabs.host > whole.host);
        assert!(PROGRAM + slabs.host + slabs.device < needed);
    }
}
