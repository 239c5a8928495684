//! One run: every view of a scene, traced, illuminated and handed to a sink.

use crate::geometry::{LoadProgress, Watcher};
use crate::kept::KeptWriter;
use crate::stack::View;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::atomic::AtomicBool;

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

/// What a caller may steer while a run goes on.
#[derive(Default)]
pub struct Control<'a> {
    /// Called from the calling thread: at each step of the loading of objects and ten times a
    /// second while it lasts, then now and then while views are made.
    pub progress: Option<&'a mut dyn FnMut(Progress)>,
    /// Set to true to end the run with [`crate::Error::Interrupted`].
    pub cancel: Option<&'a AtomicBool>,
    /// Views that are committed already and are not computed again.
    pub skip: Vec<View>,
    /// What was counted while those were made ([`crate::stack::RunDirectory::counted`]); it is
    /// added to the run's own tally.
    pub counted: Tally,
    /// Keeps the moments of the rays, for [`crate::Engine::reilluminate`]; the engine must have
    /// been opened with [`crate::EngineOptions::keep_moments`]. Cells only; refused where the scene
    /// is itself made from kept moments.
    pub keep: Option<&'a mut KeptWriter>,
}

/// Calls `work` with a watcher of the loading of objects that reports to `progress`.
pub(crate) fn watching<T>(
    progress: Option<&mut (dyn FnMut(Progress) + '_)>,
    cancel: Option<&AtomicBool>,
    work: impl FnOnce(Watcher<'_>) -> T,
) -> T {
    match progress {
        None => work(Watcher { progress: None, cancel }),
        Some(progress) => {
            let mut told = |loading| progress(Progress::Loading(loading));
            work(Watcher { progress: Some(&mut told), cancel })
        }
    }
}

impl fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control").field("skip", &self.skip).finish_non_exhaustive()
    }
}

/// How far a run is.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Progress {
    /// Objects are read and checked, before the first ray.
    Loading(LoadProgress),
    /// Views are made.
    Views(ViewProgress),
}

/// How far the views of a run are.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ViewProgress {
    /// Work done, in pixel rows (over all views, the flat included).
    pub rows_done: u64,
    /// All work of this run.
    pub rows_total: u64,
    /// The view in work.
    pub view: View,
    /// Rays traced so far.
    pub rays: u64,
}

/// Counts of a run: shaders cannot return errors.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Tally {
    /// Rays traced to first order.
    pub rays: u64,
    /// Rays traced again in order (or in order alone with `transport = exact`).
    pub exact: u64,
    /// Cells split by refinement.
    pub split: u64,
    /// Rays that entered and left some object unequally often after all re-tracing.
    pub unbalanced: u64,
    /// Rays that could not be followed in order after all re-tracing; they count with their first
    /// order.
    pub unordered: u64,
    /// Ray-query rays traced again with the software BVH.
    pub retraced: u64,
    /// Cells or crossings dropped at a limit.
    pub dropped: u64,
    /// Rays that were totally reflected at least once.
    pub reflected: u64,
    /// Rays with a value that is not finite; their light is left out.
    pub not_finite: u64,
    /// Cells whose light landed outside the detector or too far off to follow.
    pub landed_off: u64,
    /// Objects of the sample whose surface is open or crosses itself, let through by
    /// `allow_defects`.
    pub defective_objects: u64,
    /// Detector numbers that the bit depth clipped at its upper end.
    pub saturated: u64,
    /// Patches (beamlet and detector row) that the sample touches.
    pub patches: u64,
    /// Their rays.
    pub patch_rays: u64,
    /// Rays of the patch that has the most.
    pub most_patch_rays: u64,
    /// Sum of the squares of the estimated errors of sampling, in 1e-18 of open beam squared; of
    /// each patch that of the mask step where it is largest.
    pub error_squares: u64,
    /// Largest of these errors, in 1e-9 of open beam.
    pub worst_error: u64,
    /// Patches whose estimated error exceeds the tolerance.
    pub beyond_tolerance: u64,
}

impl Tally {
    /// Every count of the two put together by `f`, but for the objects, which are the same, and
    /// what is the largest of all.
    fn with(self, other: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            rays: f(self.rays, other.rays),
            exact: f(self.exact, other.exact),
            split: f(self.split, other.split),
            unbalanced: f(self.unbalanced, other.unbalanced),
            unordered: f(self.unordered, other.unordered),
            retraced: f(self.retraced, other.retraced),
            dropped: f(self.dropped, other.dropped),
            reflected: f(self.reflected, other.reflected),
            not_finite: f(self.not_finite, other.not_finite),
            landed_off: f(self.landed_off, other.landed_off),
            saturated: f(self.saturated, other.saturated),
            patches: f(self.patches, other.patches),
            patch_rays: f(self.patch_rays, other.patch_rays),
            error_squares: f(self.error_squares, other.error_squares),
            beyond_tolerance: f(self.beyond_tolerance, other.beyond_tolerance),
            most_patch_rays: self.most_patch_rays.max(other.most_patch_rays),
            worst_error: self.worst_error.max(other.worst_error),
            defective_objects: self.defective_objects.max(other.defective_objects),
        }
    }

    /// How finely the sample was sampled, where `tolerance` was allowed, share of open beam.
    pub(crate) fn sampling(&self, tolerance: f64) -> Option<SamplingSummary> {
        #[allow(clippy::cast_precision_loss, reason = "means of many")]
        let float = |count: u64| count as f64;
        (self.patches > 0).then(|| SamplingSummary {
            patches: self.patches,
            mean_rays: float(self.patch_rays) / float(self.patches),
            most_rays: self.most_patch_rays,
            rms_error: 1e-9 * (float(self.error_squares) / float(self.patches)).sqrt(),
            worst_error: 1e-9 * float(self.worst_error),
            tolerance,
            beyond_tolerance: self.beyond_tolerance,
        })
    }

    /// What was counted since `earlier`; the largest of all are its own.
    pub(crate) fn since(self, earlier: Self) -> Self {
        let Self { most_patch_rays, worst_error, .. } = self;
        Self { most_patch_rays, worst_error, ..self.with(earlier, u64::saturating_sub) }
    }
}

impl std::ops::Add for Tally {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.with(other, u64::saturating_add)
    }
}

impl std::iter::Sum for Tally {
    fn sum<I: Iterator<Item = Self>>(tallies: I) -> Self {
        tallies.fold(Self::default(), |a, b| a + b)
    }
}

/// Provenance of a run, stored as run.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Version of beamlet.
    pub version: String,
    /// Device name.
    pub device: String,
    /// Driver name and version.
    pub driver: String,
    /// Backend used.
    pub backend: Backend,
    /// Why that backend.
    pub backend_reason: String,
    /// Calibration: million rays a second by backend name.
    pub calibration: std::collections::BTreeMap<String, f64>,
    /// Seed.
    pub seed: u64,
    /// Counts.
    pub tally: Tally,
    /// Rays and errors of the patches that the sample touches; `None` where none was sampled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampling: Option<SamplingSummary>,
    /// Seconds by stage.
    pub seconds: std::collections::BTreeMap<String, f64>,
}

/// How finely patches (beamlet and detector row) were sampled, and what that is estimated to have
/// left in recorded values: of each patch the error of the mask step that has the largest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SamplingSummary {
    /// Patches that the sample touches.
    pub patches: u64,
    /// Rays of a patch, mean.
    pub mean_rays: f64,
    /// Rays of the patch that has the most.
    pub most_rays: u64,
    /// Estimated error, root mean square over the patches, share of open beam.
    pub rms_error: f64,
    /// Largest estimated error, share of open beam.
    pub worst_error: f64,
    /// Error that was allowed, share of open beam.
    pub tolerance: f64,
    /// Patches that may exceed it.
    pub beyond_tolerance: u64,
}

/// What a run is estimated to cost, from a sparse look at its scene ([`crate::Simulation::estimate`]).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct RunEstimate {
    /// Rays of one view, mean over the views.
    pub rays_per_view: f64,
    /// Rays of all views. The flat needs none.
    pub rays: f64,
    /// Cells that refinement splits, of all views.
    pub splits: f64,
    /// Seconds on this device: preparation, tracing and illumination, without noise and output.
    pub seconds: f64,
    /// Patches (beamlet and detector row) that were refined for the estimate.
    pub patches_refined: f64,
}
