//! Memory of a reconstruction, and the remainder of a limit for the device.

use super::geometry::ScanGeometry;
use super::method::Method;
use super::plan::VolumePlan;
use super::projector::AT_ONCE;
use super::redundancy::Redundancy;
use super::resampling::Resampling;
use super::solver::Solver;
use crate::numbers::length;
use crate::run::PROGRAM;
use crate::{Error, Result};

/// Bytes of a value.
const VALUE: u64 = 4;

/// Memory of a reconstruction at its peak, bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Memory {
    /// On the host, without the program.
    pub(super) host: u64,
    /// On the device: slabs of the volume and parts of the sinograms.
    pub(super) device: u64,
    /// Values of a volume, and of sinograms, that are on the device at once.
    pub(super) at_once: usize,
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
        let host = host_bytes(geometry, plan, truth);
        let [x, y, z] = plan.grid.size.map(|side| side as u64);
        let [views, rows, columns] = geometry.shape().map(|side| side as u64);
        // Refraction angles are differences of one place more than columns.
        let places = (Resampling::of(&geometry.columns).len() as u64).max(columns + 1);
        let (plane, view) = (x.saturating_mul(y), rows.saturating_mul(places));
        let pairs = if passes(geometry, plan) > 0 { 2 } else { 1 };
        let of_device = |at_once: u64| {
            let slab = at_once.max(plane).min(plane.saturating_mul(z));
            let part = at_once.max(view).min(view.saturating_mul(views));
            (pairs * VALUE).saturating_mul(slab.saturating_add(part))
        };
        let mut at_once = AT_ONCE as u64;
        if let Some(limit) = limit {
            let rest = limit.saturating_sub(PROGRAM).saturating_sub(host);
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
        Ok(Self { host, device: of_device(at_once), at_once: length(at_once.max(1)) })
    }
}

/// Corrections for lever arms over all quantities of a plan.
pub(super) fn passes(geometry: &ScanGeometry, plan: &VolumePlan) -> usize {
    let Some(options) = plan.method.filtered() else { return 0 };
    let is_turn = Redundancy::of(geometry).is_ok_and(|weights| weights.is_turn());
    plan.quantities.iter().map(|quantity| options.passes(geometry, *quantity, is_turn)).sum()
}

/// Most bytes on the host at a time: volumes and sinograms that are alive together.
fn host_bytes(geometry: &ScanGeometry, plan: &VolumePlan, truth: bool) -> u64 {
    let product =
        |sides: [usize; 3]| sides.iter().fold(VALUE, |all, side| all.saturating_mul(*side as u64));
    let [views, rows, columns] = geometry.shape();
    let volume = product(plan.grid.size);
    let sinograms = product([views, rows, columns + 1]);
    let filtered = product([views, rows, Resampling::of(&geometry.columns).len()]);
    let counted = |volumes: u64, of_sinograms: u64, of_filtered: u64| {
        volume
            .saturating_mul(volumes)
            .saturating_add(sinograms.saturating_mul(of_sinograms))
            .saturating_add(filtered.saturating_mul(of_filtered))
    };
    // Volumes that are kept from one quantity to the next: μ, and the labels and values of the truth.
    let kept = u64::from(plan.gradient_bias.is_some()) + if truth { 2 } else { 0 };
    let weights = u64::from(plan.sigma);
    match &plan.method {
        Method::Fbp(_) => {
            let made = match passes(geometry, plan) > 0 {
                true => counted(kept + 2, 2, 1),
                false => counted(kept + 1, 1, 1),
            };
            // A map of deviations: the volume, deviations, and two variances for each.
            let map = if plan.sigma { counted(kept + 2, 1, 2) } else { 0 };
            made.max(map)
        }
        Method::Iterative { options, phase } => {
            let mask = 2 * u64::from(plan.mask.is_some());
            let start = u64::from(plan.start.is_some());
            let of_phase = 2 * u64::from(*phase);
            let (volumes, of_sinograms) = match options.solver {
                Solver::Cgls => (5, 5),
                Solver::Sirt => (6, 6),
                Solver::Bb => (9, 5),
            };
            let extra = 2 * weights + of_phase;
            let planes = filter_bytes(plan.grid.size);
            counted(kept + mask + start + volumes, of_sinograms + extra, 0).saturating_add(planes)
        }
    }
}

/// Bytes of the filter of slices: two padded planes of complex numbers for each thread.
fn filter_bytes([x, y, z]: [usize; 3]) -> u64 {
    let padded = |side: usize| (2 * side).next_power_of_two() as u64;
    let threads = rayon::current_num_threads().min(z) as u64;
    (2 * 8 * threads).saturating_mul(padded(x)).saturating_mul(padded(y))
}
