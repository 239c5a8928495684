//! Blur of edges off the rotation centre. Cells are blurred as if the sample lay in the plane of the
//! rotation centre (docs/physics.md, "Focal spot"); this module computes the error.

use beamlet_core::numbers;
use beamlet_geometry::{BeamExtent, Swept};
use beamlet_model::optics::{Mask, Optics};
use beamlet_model::scene::{Scene, Scheme};
use beamlet_model::spot::deviation;
use serde::Serialize;

/// Integral over one side of an edge of the light moved by a blur, per standard deviation: 1 / sqrt(2
/// pi).
const EDGE: f64 = 0.398_942_3;
/// Largest change of a distribution function per relative change of its deviation: one deviation off,
/// exp(-1/2) / sqrt(2 pi).
const STEEPEST: f64 = 0.241_970_7;
/// Error that is worth a warning, share of open beam: half of the error that pixels on silhouettes may
/// have.
const LEAST: f64 = 5e-4;
/// Error of opaque edges that is worth a warning if no ray decides.
const LEAST_UNTRACED: f64 = 1e-3;
/// Poses in which edges are looked for, at most.
const MOST_POSES: usize = 64;

/// Error of edges off the rotation centre, which the spot blurs as if they were there.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct EdgeBlur {
    /// Largest error of a recorded value, share of open beam.
    pub error: f64,
    /// True where rays from other points of the spot gave the error; false where it is the upper bound,
    /// of opaque edges.
    pub traced: bool,
    /// Object that has the edge.
    pub object: String,
    /// Place of the edge along the beam from the rotation centre, m; for a traced one the farther face of
    /// the object.
    pub y: f64,
}

impl EdgeBlur {
    /// Warning, where the error is beyond the tolerance of sampling and 5e-4 of open beam; upper bounds
    /// beyond 1e-3.
    #[must_use]
    pub fn warning(&self, tolerance: f64) -> Option<String> {
        let least = tolerance.max(if self.traced { LEAST } else { LEAST_UNTRACED });
        (self.error > least).then(|| {
            format!(
                "the blur by the focal spot is that at the rotation centre: edges of \"{}\", up to \
                 {:.1} mm {} it, err by up to {:.1e} of open beam{}; sampling.scheme = \"random\" \
                 blurs each edge in its own plane",
                self.object,
                self.y.abs() * 1e3,
                if self.y < 0.0 { "before" } else { "behind" },
                self.error,
                if self.traced { "" } else { " where they take all light" },
            )
        })
    }
}

/// Slits side by side: apertures of a mask, or pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slits {
    pub(super) period: f64,
    pub(super) width: f64,
    /// Centre of one of them, m from the axis.
    pub(super) centre: f64,
}

impl Slits {
    /// Slits of a mask across (0) or along its slits (1); `None` where no edge repeats.
    fn of(mask: &Mask, plane: f64, axis: usize) -> Option<Self> {
        let mask = mask.unshifted();
        let openings = mask.openings(plane);
        let (period, width) = (openings.period[axis], openings.narrowest(axis));
        let centre = match axis {
            0 => -mask.off_centre(0.0, plane),
            _ => mask.strips(plane, 1).map_or(0.0, |strips| strips.centre),
        };
        period.is_finite().then_some(Self { period, width, centre })
    }
}

/// The light along one axis: places in the plane of the rotation centre, m, and where rays from an
/// offset of the source through them go. Bars are opaque and thin.
#[derive(Debug, Clone, Copy)]
pub(super) struct LightPath {
    /// Standard deviation of the spot, m.
    pub(super) sigma: f64,
    /// Distance of the rotation centre from the source, m.
    pub(super) rotation: f64,
    /// Apertures of the sample mask in its plane, with the distance of that over the rotation centre's.
    pub(super) apertures: Option<(Slits, f64)>,
    /// Windows on the analyser.
    pub(crate) windows: Slits,
    /// Displacement on the analyser per offset of the source, of what lies at the rotation centre.
    pub(crate) lever: f64,
    /// Recorded value per metre of open beam.
    pub(crate) weight: f64,
}

impl LightPath {
    /// Across the slits (0), or along them (1), where rows are the windows.
    pub(super) fn new(scene: &Scene, axis: usize) -> Self {
        let optics = Optics::of(scene);
        let (rotation, detector) = (optics.rotation, &optics.detector);
        let sigma = deviation(scene.source.spot.fwhm()[axis]);
        let pitch = detector.pitch[axis];
        let pixels = |plane: f64| {
            let period = detector.pitch_at(axis, plane);
            let shift = if detector.pixels[axis].is_multiple_of(2) { 0.5 } else { 0.0 };
            Slits { period, width: period, centre: shift * period }
        };
        let per_pixel = |open: f64| open * detector.distance / (rotation * pitch);
        let of_sample_mask = |mask: &Mask| {
            let slits = Slits::of(mask, mask.distance(), axis)?;
            Some((slits, mask.distance() / rotation))
        };
        let apertures = optics.sample_mask.as_ref().and_then(of_sample_mask);
        if axis == 1 {
            // The most of a row that masks let through.
            let overlapping = optics.overlapping_apertures().into_iter().filter(|w| *w > 0.0);
            let least = overlapping.fold(detector.pitch_at(0, optics.analyser), f64::min);
            return Self {
                sigma,
                rotation,
                apertures,
                windows: pixels(detector.distance),
                lever: detector.distance / rotation - 1.0,
                weight: per_pixel(least / detector.pitch_at(0, optics.analyser)),
            };
        }
        let plane = optics.analyser;
        let masked = optics.detector_mask.as_ref().and_then(|mask| Slits::of(mask, plane, axis));
        Self {
            sigma,
            rotation,
            apertures,
            windows: masked.unwrap_or_else(|| pixels(plane)),
            lever: plane / rotation - 1.0,
            weight: per_pixel(1.0),
        }
    }

    /// Largest change of a recorded value by the blur of an opaque edge at `y` behind the rotation
    /// centre: for an edge at an end of an aperture or a window, against which the source moves it.
    pub(super) fn bound(&self, y: f64) -> f64 {
        let own = y / (self.rotation + y);
        let of_aperture = self.apertures.map(|(_, ratio)| (1.0 - ratio) / -ratio);
        let of_window = Some(self.lever / (1.0 + self.lever));
        let error = |end: f64| {
            let (assumed, there) = (end.abs(), (end - own).abs());
            let apart = (assumed - there).abs();
            // In wide pixels, and in those that are narrower than the blur.
            let narrow = STEEPEST * apart / assumed.min(there).max(f64::MIN_POSITIVE);
            (EDGE * self.sigma * apart * self.weight).min(narrow)
        };
        of_aperture.into_iter().chain(of_window).map(error).fold(0.0, f64::max)
    }
}

/// An object in a pose whose edges may be wrong.
#[derive(Debug, Clone)]
pub(super) struct Suspect {
    pub object: String,
    pub(crate) pose: u32,
    pub(super) extent: BeamExtent,
    /// Upper bound, and the place along the beam that has it, m.
    pub(crate) bound: f64,
    pub y: f64,
}

/// Objects by pose, those with the largest bound first; none where each ray draws its source point.
pub(super) fn suspects(scene: &Scene, swept: &Swept) -> Vec<Suspect> {
    if scene.sampling.scheme == Scheme::Random {
        return Vec::new();
    }
    let paths = [0, 1].map(|axis| LightPath::new(scene, axis));
    let bound = |y: f64| paths.iter().map(|path| path.bound(y)).fold(0.0, f64::max);
    let poses = scene.scan.poses();
    let every = poses.div_ceil(MOST_POSES).max(1);
    let mut suspects = Vec::new();
    for pose in (0..poses).step_by(every) {
        for (object, extent) in swept.extents_of_objects(scene, pose) {
            let [near, far] = extent.y;
            let y = if bound(near) > bound(far) { near } else { far };
            let object = object.to_owned();
            suspects.push(Suspect {
                object,
                pose: numbers::count(pose),
                extent,
                bound: bound(y),
                y,
            });
        }
    }
    suspects.sort_by(|a, b| b.bound.total_cmp(&a.bound));
    suspects
}

/// The upper bound over all objects; nothing where no object has an error of this kind.
pub fn bounded(scene: &Scene, swept: &Swept) -> Option<EdgeBlur> {
    let Suspect { object, bound, y, .. } = suspects(scene, swept).into_iter().next()?;
    Some(EdgeBlur { error: bound, traced: false, object, y })
}
