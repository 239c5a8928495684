//! What sampling may leave in recorded values, and what it is estimated to have left.

use crate::run::SamplingSummary;

/// What sampling may leave, by patch.
#[derive(Debug, Clone, Copy)]
pub struct ErrorBudget {
    /// Error of a recorded value, share of open beam.
    pub light: f64,
    /// Error of the mean displacement on the analyser where no silhouette crosses, m; infinite
    /// without a sample mask.
    pub displacement: f64,
    /// Most rays of a patch.
    pub max_rays: u32,
}

/// Estimated errors of the recorded values of patches: of each patch the largest over the mask
/// steps, share of open beam.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SamplingEstimate {
    /// Patches that the sample touches.
    pub patches: u64,
    /// Their rays.
    pub rays: u64,
    /// Rays of the patch with the most.
    pub most_rays: u32,
    /// Sum of the squared errors.
    pub square: f64,
    /// Largest error.
    pub worst: f64,
    /// Patches whose error exceeds the tolerance.
    pub beyond: u64,
}

impl SamplingEstimate {
    /// Adds a patch.
    pub(super) fn add(&mut self, light: f64, rays: u32, tolerance: f64) {
        self.join(&Self {
            patches: 1,
            rays: rays.into(),
            most_rays: rays,
            square: light * light,
            worst: light,
            beyond: u64::from(light > tolerance),
        });
    }

    /// What a run says of it; nothing where no patch was sampled.
    #[must_use]
    pub(crate) fn summary(&self, tolerance: f64) -> Option<SamplingSummary> {
        if self.patches == 0 {
            return None;
        }
        let patches = self.patches as f64;
        Some(SamplingSummary {
            patches: self.patches,
            mean_rays: self.rays as f64 / patches,
            most_rays: self.most_rays,
            rms_error: (self.square / patches).sqrt(),
            worst_error: self.worst,
            tolerance,
            beyond_tolerance: self.beyond,
        })
    }

    /// Adds those of other patches.
    pub fn join(&mut self, other: &Self) {
        self.patches += other.patches;
        self.rays += other.rays;
        self.most_rays = self.most_rays.max(other.most_rays);
        self.square += other.square;
        self.worst = self.worst.max(other.worst);
        self.beyond += other.beyond;
    }
}
