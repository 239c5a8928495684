//! Counts of a run: shaders cannot return errors.

use crate::{Error, Result, numbers};
use serde::{Deserialize, Serialize};

/// A run fails when more than this share of its rays stays unbalanced.
const UNBALANCED_SHARE: f64 = 1e-5;

/// Counts of a run: shaders cannot return errors.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Tally {
    /// Rays traced to first order.
    pub rays: u64,
    /// Rays traced again exactly (or exactly alone with `transport = exact`).
    pub exact: u64,
    /// Rays that entered and left some object unequally often after all re-tracing.
    pub unbalanced: u64,
    /// Rays with a negative path in a material: a surface with defects is wound wrongly there.
    pub negative: u64,
    /// Rays that could not be followed exactly after all re-tracing; they count with their first
    /// order.
    pub unordered: u64,
    /// Ray-query rays traced again with the software BVH.
    pub retraced: u64,
    /// Cells or crossings dropped at a limit.
    pub dropped: u64,
    /// Rays that were totally reflected at least once; by waves at each energy.
    pub reflected: u64,
    /// Light of lines that crosses surfaces near grazing, which is computed by rays: sum over the patches, in 1e-9 of
    /// the light of a patch.
    pub grazing_light: u64,
    /// Rays with a value that is not finite; their light is left out.
    pub not_finite: u64,
    /// Cells whose light landed outside the detector or too far off to follow.
    pub landed_off: u64,
    /// Objects of the sample whose surface is open or crosses itself, let through by
    /// `allow_defects`.
    pub defective_objects: u64,
    /// Detector numbers that the bit depth clipped at its upper end.
    pub saturated: u64,
    /// Detector numbers that the bit depth clipped at 0.
    pub clipped_at_zero: u64,
    /// Patches (beamlet and detector row) that the sample touches.
    pub patches: u64,
    /// Their lines.
    pub lines: u64,
    /// Their rays.
    pub patch_rays: u64,
    /// Rays of the patch that has the most.
    pub most_patch_rays: u64,
    /// Sum of the squares of the estimated errors of sampling, in 1e-18 of open beam squared; for each
    /// patch the error of the worst mask step.
    pub error_squares: u64,
    /// Largest of these errors, in 1e-9 of open beam.
    pub worst_error: u64,
    /// Patches whose estimated error of light or of the displacement exceeds its tolerance.
    pub beyond_tolerance: u64,
    /// Audit of the errors of sampling.
    #[serde(skip_serializing_if = "Audit::is_empty")]
    pub audit: Audit,
}

/// Audit of the errors of sampling: patches that were drawn, compared with fresh rays.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Audit {
    /// Patches that silhouettes cross, or whose rays draw normals.
    pub silhouettes: AuditSums,
    /// Patches of many bodies, which rays do not resolve.
    pub unresolved: AuditSums,
    /// All others.
    pub rest: AuditSums,
}

impl Audit {
    /// True if nothing was audited.
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Sums over all patches.
    #[must_use]
    pub fn all(self) -> AuditSums {
        self.silhouettes + self.unresolved + self.rest
    }

    fn with(self, other: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            silhouettes: self.silhouettes.with(other.silhouettes, &f),
            unresolved: self.unresolved.with(other.unresolved, &f),
            rest: self.rest.with(other.rest, &f),
        }
    }
}

/// Sums over the drawn patches of a class, each weighted by the inverse of the probability that it is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct AuditSums {
    /// Patches that were drawn.
    pub patches: u64,
    /// Estimated squared errors above 0, in 1e-9 of the squared tolerance.
    pub above: u64,
    /// Estimated squared errors below 0, which are as large by chance.
    pub below: u64,
    /// Variance of the difference of both, in 1e-9 of the fourth power of the tolerance.
    pub variance: u64,
}

impl AuditSums {
    /// Unit of the squares and of the variance.
    const UNIT: f64 = 1e-9;

    /// A drawn patch, whose squared error, in squared tolerances, stands for the sum.
    #[doc(hidden)]
    #[must_use]
    pub fn new(square: f64, variance: f64) -> Self {
        let parts = |value: f64| numbers::whole::<u64>(value.max(0.0) / Self::UNIT);
        Self { patches: 1, above: parts(square), below: parts(-square), variance: parts(variance) }
    }

    /// Sum of the squared errors of all patches, in squared tolerances, and its standard error.
    #[must_use]
    pub fn squares(self) -> [f64; 2] {
        let [above, below] = [self.above, self.below].map(|it| it as f64);
        [Self::UNIT * (above - below), (Self::UNIT * self.variance as f64).sqrt()]
    }

    fn with(self, other: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            patches: f(self.patches, other.patches),
            above: f(self.above, other.above),
            below: f(self.below, other.below),
            variance: f(self.variance, other.variance),
        }
    }
}

impl std::ops::Add for AuditSums {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.with(other, u64::saturating_add)
    }
}

impl Tally {
    /// Every count of the two combined by `f`, except the objects, which are equal, and maxima.
    fn with(self, other: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            rays: f(self.rays, other.rays),
            exact: f(self.exact, other.exact),
            unbalanced: f(self.unbalanced, other.unbalanced),
            negative: f(self.negative, other.negative),
            unordered: f(self.unordered, other.unordered),
            retraced: f(self.retraced, other.retraced),
            dropped: f(self.dropped, other.dropped),
            reflected: f(self.reflected, other.reflected),
            grazing_light: f(self.grazing_light, other.grazing_light),
            not_finite: f(self.not_finite, other.not_finite),
            landed_off: f(self.landed_off, other.landed_off),
            saturated: f(self.saturated, other.saturated),
            clipped_at_zero: f(self.clipped_at_zero, other.clipped_at_zero),
            patches: f(self.patches, other.patches),
            lines: f(self.lines, other.lines),
            patch_rays: f(self.patch_rays, other.patch_rays),
            error_squares: f(self.error_squares, other.error_squares),
            beyond_tolerance: f(self.beyond_tolerance, other.beyond_tolerance),
            audit: self.audit.with(other.audit, &f),
            most_patch_rays: self.most_patch_rays.max(other.most_patch_rays),
            worst_error: self.worst_error.max(other.worst_error),
            defective_objects: self.defective_objects.max(other.defective_objects),
        }
    }

    /// Refuses counts of a whole run of which too many rays are out of balance; warns where objects
    /// with defects explain them.
    ///
    /// # Errors
    /// [`Error::Tally`].
    #[doc(hidden)]
    pub fn refuse_unbalanced(&self) -> Result<()> {
        if self.unbalanced as f64 <= UNBALANCED_SHARE * self.rays as f64 {
            return Ok(());
        }
        let problem = format!(
            "{} of {} rays entered and left an object unequally often",
            self.unbalanced, self.rays
        );
        // Rays through a hole are out of balance.
        match self.defective_objects {
            0 => Err(Error::Tally(problem)),
            objects => {
                log::warn!("{problem}: {objects} objects have defects");
                Ok(())
            }
        }
    }

    /// Counts since `earlier`; maxima are its own.
    #[doc(hidden)]
    pub fn since(self, earlier: Self) -> Self {
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
