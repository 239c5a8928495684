//! What run.json records.

use beamlet_core::tally::{Audit, AuditSums, Tally};
use beamlet_gpu::{Backend, Profile, Traffic};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The part of the record that is known when a run begins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunStart {
    /// Device name.
    pub device: String,
    /// Driver name and version.
    pub driver: String,
    /// Backend used.
    pub backend: Backend,
    /// Why that backend.
    pub backend_reason: String,
    /// Counts by which the backend was chosen; `None` without a choice.
    pub search: Option<SearchCounts>,
    /// SHA-256 of the meshes by the name of their object, as
    /// `beamlet_geometry::ObjectSummary::hash`; shapes have none.
    pub mesh_hashes: BTreeMap<String, String>,
    /// Objects whose facets diffract as edges, under `transport = "wave"`.
    pub facet_kinks: Vec<FacetKink>,
}

/// Object whose facets bend the phase so much over a shear that they diffract as edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FacetKink {
    /// Name in the scene.
    pub object: String,
    /// Bend of the phase over the shear where facets are steepest, rad.
    pub bend: f64,
    /// Value of `sides` that would do; `None` for meshes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sides: Option<u32>,
    /// Triangles that would do, if they are refined evenly.
    pub triangles: u64,
}

impl FacetKink {
    /// An object without a number of sides.
    #[must_use]
    pub fn new(object: impl Into<String>, bend: f64, triangles: u64) -> Self {
        Self { object: object.into(), bend, sides: None, triangles }
    }
}

impl std::fmt::Display for FacetKink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { object, bend, sides, triangles } = self;
        write!(
            f,
            "the facets of \"{object}\" bend the phase by up to {bend:.1} rad over a shear, and diffract as edges: "
        )?;
        match sides {
            Some(sides) => write!(f, "sides = {sides}, or an exact shape, would do"),
            None => write!(f, "{triangles} triangles would do"),
        }
    }
}

impl RunStart {
    /// A run on a device and backend, for reasons in words; nothing was counted, and no mesh read.
    pub fn new(
        device: impl Into<String>,
        driver: impl Into<String>,
        backend: Backend,
        backend_reason: impl Into<String>,
    ) -> Self {
        Self {
            device: device.into(),
            driver: driver.into(),
            backend,
            backend_reason: backend_reason.into(),
            search: None,
            mesh_hashes: BTreeMap::new(),
            facet_kinks: Vec::new(),
        }
    }
}

/// Inputs of the bits of a run beside its scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Platform {
    /// Version of beamlet.
    pub version: String,
    /// Device name.
    pub device: String,
    /// Driver name and version.
    pub driver: String,
    /// Backend used.
    pub backend: Backend,
}

impl Platform {
    /// Names and values of what differs: name, here, there.
    pub(super) fn differences(&self, other: &Self) -> Vec<[String; 3]> {
        let values = |of: &Self| {
            [of.version.clone(), of.device.clone(), of.driver.clone(), of.backend.to_string()]
        };
        let names = ["version", "device", "driver", "backend"];
        let pairs = names.into_iter().zip(values(self)).zip(values(other));
        let triples = pairs.map(|((name, here), there)| [name.to_owned(), here, there]);
        triples.filter(|[_, here, there]| here != there).collect()
    }
}

/// Provenance of a run, stored as run.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Version of beamlet.
    pub version: String,
    /// Commit of its repository that it was built from; `None` in packages and incremental builds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub commit: Option<String>,
    /// Device name.
    pub device: String,
    /// Driver name and version.
    pub driver: String,
    /// Backend used.
    pub backend: Backend,
    /// Why that backend.
    pub backend_reason: String,
    /// Counts by which the backend was chosen; `None` without a choice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<SearchCounts>,
    /// Seed.
    pub seed: u64,
    /// Counts.
    pub tally: Tally,
    /// Rays and errors of the patches that the sample touches; `None`: unknown, as under
    /// `scheme = "random"`, or nothing was sampled.
    pub sampling: Option<SamplingSummary>,
    /// Measured error of sampling; `None`: unknown, where nothing was audited (`sampling.audit`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampling_error: Option<SamplingError>,
    /// Objects whose facets diffract as edges, under `transport = "wave"`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub facet_kinks: Vec<FacetKink>,
    /// Upper bound of the error of a recorded value from edges off the rotation centre, share of open beam: the
    /// spot blurs them as if they were at the centre. `None`: unknown; and under `scheme = "random"`, which has no such error.
    pub edge_error: Option<f64>,
    /// Warnings for the user: a sample outside the field of view, errors that may exceed a tolerance.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Seconds by stage.
    pub seconds: BTreeMap<String, f64>,
    /// Work of the device, with `--profile` ([`beamlet_gpu::EngineOptions::profile`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<RunProfile>,
}

/// Work of the device for a run, of the process that ended it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RunProfile {
    /// All of it.
    #[serde(flatten)]
    pub all: Profile,
    /// The part before the first view: scene, sample and kernels.
    pub before_views: Traffic,
    /// The part up to the end of the first view.
    pub first_view: Traffic,
    /// The part of all later views.
    pub later_views: Traffic,
    /// Number of views that this process made.
    pub views: usize,
}

impl RunProfile {
    /// The profile of a run: the work before it, states after its preparation and its first view, and
    /// the work in all at its end.
    #[must_use]
    pub fn of(prepared: Traffic, first: Traffic, all: Profile, views: usize) -> Self {
        Self {
            before_views: prepared,
            first_view: first.since(prepared),
            later_views: all.traffic.since(first),
            views,
            all,
        }
    }
}

impl RunRecord {
    /// Inputs of the bits of the run beside its scene.
    #[must_use]
    pub fn platform(&self) -> Platform {
        Platform {
            version: self.version.clone(),
            device: self.device.clone(),
            driver: self.driver.clone(),
            backend: self.backend,
        }
    }

    /// The record of a run that begins: nothing is counted yet.
    #[must_use]
    pub fn begin(start: &RunStart, seed: u64) -> Self {
        Self {
            version: beamlet_core::program::VERSION.to_owned(),
            commit: beamlet_core::program::commit(),
            device: start.device.clone(),
            driver: start.driver.clone(),
            backend: start.backend,
            backend_reason: start.backend_reason.clone(),
            search: start.search,
            seed,
            tally: Tally::default(),
            sampling: None,
            sampling_error: None,
            facet_kinks: start.facet_kinks.clone(),
            edge_error: None,
            warnings: Vec::new(),
            seconds: BTreeMap::new(),
            profile: None,
        }
    }
}

/// Work of a search for surfaces in a scene, in counts, independent of any clock.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SearchCounts {
    /// Leaves of the tree: triangles, shapes and placed meshes.
    pub leaves: u32,
    /// Mean number of surfaces that a ray through the shadow of the sample crosses (a ray counts
    /// up to 64).
    pub crossings_per_ray: f64,
}

impl SearchCounts {
    /// Counts of a scene.
    #[must_use]
    pub const fn new(leaves: u32, crossings_per_ray: f64) -> Self {
        Self { leaves, crossings_per_ray }
    }
}

/// Fineness of the sampling of patches (beamlet and detector row), and its estimated error in recorded
/// values: for each patch the error of the worst mask step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
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
    /// Patches that may exceed it, or the tolerance of angles.
    pub beyond_tolerance: u64,
}

impl SamplingSummary {
    /// From the counts of a run, where `tolerance` was allowed; `None` where nothing was sampled.
    #[doc(hidden)]
    pub fn of(tally: &Tally, tolerance: f64) -> Option<Self> {
        let float = |count: u64| count as f64;
        (tally.patches > 0).then(|| Self {
            patches: tally.patches,
            mean_rays: float(tally.patch_rays) / float(tally.patches),
            most_rays: tally.most_patch_rays,
            rms_error: 1e-9 * (float(tally.error_squares) / float(tally.patches)).sqrt(),
            worst_error: 1e-9 * float(tally.worst_error),
            tolerance,
            beyond_tolerance: tally.beyond_tolerance,
        })
    }
}

/// Measured error of the light that a patch (beamlet and detector row) sends to pixels, root mean square over all patches
/// and mask steps: an audit compares patches that it draws with rays of their own (docs/developers/sampling.md).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SamplingError {
    /// Of all patches.
    #[serde(flatten)]
    pub all: AuditedError,
    /// Part of patches that silhouettes cross; squares of the parts add up to that of all.
    pub silhouettes: AuditedError,
    /// Part of patches of many bodies, which rays do not resolve.
    pub unresolved: AuditedError,
    /// Part of all others.
    pub rest: AuditedError,
}

/// Measured error of patches of a class.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct AuditedError {
    /// Root mean square, share of open beam; 0 where the mean square is not above 0.
    pub rms: f64,
    /// Standard error of `rms` upwards, share of open beam.
    pub standard_error: f64,
    /// Patches that were drawn.
    pub patches: u64,
}

impl AuditedError {
    /// From a mean square, in squared tolerances, and its standard error, of some patches that were drawn.
    #[doc(hidden)]
    pub fn of([square, error]: [f64; 2], patches: u64, tolerance: f64) -> Self {
        let rms = square.max(0.0).sqrt();
        let standard_error = (square.max(0.0) + error).sqrt() - rms;
        Self { rms: tolerance * rms, standard_error: tolerance * standard_error, patches }
    }
}

impl SamplingError {
    /// From the counts of a run, where `tolerance` was allowed; `None` where nothing was audited.
    #[doc(hidden)]
    pub fn of(tally: &Tally, tolerance: f64) -> Option<Self> {
        let Audit { silhouettes, unresolved, rest } = tally.audit;
        let of = |sums: AuditSums| {
            let square = sums.squares().map(|it| it / tally.patches as f64);
            AuditedError::of(square, sums.patches, tolerance)
        };
        let all = of(tally.audit.all());
        (all.patches > 0).then(|| Self {
            all,
            silhouettes: of(silhouettes),
            unresolved: of(unresolved),
            rest: of(rest),
        })
    }

    /// Warning where it exceeds a third of the tolerance by more than its standard error.
    #[doc(hidden)]
    #[must_use]
    pub fn warning(&self, tolerance: f64) -> Option<String> {
        let AuditedError { rms, standard_error, patches } = self.all;
        (rms - standard_error > tolerance / 3.0).then(|| {
            format!(
                "the measured error of sampling is {rms:.1e} of open beam (rms; {patches} beamlets and rows, standard error {standard_error:.1e}): \
                 more than a third of sampling.tolerance, {tolerance:.1e}"
            )
        })
    }
}
