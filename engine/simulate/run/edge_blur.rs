//! Blur of edges off the rotation centre. Cells are blurred as if the sample lay in the plane of the
//! rotation centre (docs/physics.md, "Focal spot"); this module bounds the error.

use beamlet_geometry::Swept;
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
/// Error of opaque edges that is worth a warning, share of open beam.
const LEAST: f64 = 1e-3;
/// Poses in which edges are looked for, at most.
const MOST_POSES: usize = 64;

/// Upper bound of the error of edges off the rotation centre, which the spot blurs as if they were there.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct EdgeBlur {
    /// Largest error of a recorded value for an edge that takes all light, share of open beam.
    pub error: f64,
    /// Object that has the edge.
    pub object: String,
    /// Place of the edge along the beam from the rotation centre, m.
    pub y: f64,
}

impl EdgeBlur {
    /// Warning, where the bound is beyond the tolerance of sampling and 1e-3 of open beam.
    #[must_use]
    pub fn warning(&self, tolerance: f64) -> Option<String> {
        (self.error > tolerance.max(LEAST)).then(|| {
            format!(
                "the blur by the focal spot is that at the rotation centre: edges of \"{}\", up to \
                 {:.1} mm {} it, err by up to {:.1e} of open beam where they take all light; sampling.scheme = \"random\" \
                 blurs each edge in its own plane",
                self.object,
                self.y.abs() * 1e3,
                if self.y < 0.0 { "before" } else { "behind" },
                self.error,
            )
        })
    }
}

/// The light along one axis. Bars are opaque and thin.
#[derive(Debug, Clone, Copy)]
struct LightPath {
    /// Standard deviation of the spot, m.
    sigma: f64,
    /// Distance of the rotation centre from the source, m.
    rotation: f64,
    /// Distance of the sample mask over the distance of the rotation centre, where edges of the mask repeat.
    mask: Option<f64>,
    /// Displacement on the analyser per offset of the source, of what lies at the rotation centre.
    lever: f64,
    /// Recorded value per metre of open beam.
    weight: f64,
}

impl LightPath {
    /// Across the slits (0), or along them (1), where rows are the windows.
    fn new(scene: &Scene, axis: usize) -> Self {
        let optics = Optics::of(scene);
        let (rotation, detector) = (optics.rotation, &optics.detector);
        let per_pixel = |open: f64| open * detector.distance / (rotation * detector.pitch[axis]);
        let repeats = |mask: &&Mask| mask.openings(mask.distance()).period[axis].is_finite();
        let mask = optics.sample_mask.as_ref().filter(repeats);
        let [plane, open] = match axis {
            0 => [optics.analyser, 1.0],
            _ => {
                // The most of a row that masks let through.
                let overlapping = optics.overlapping_apertures().into_iter().filter(|w| *w > 0.0);
                let pitch = detector.pitch_at(0, optics.analyser);
                [detector.distance, overlapping.fold(pitch, f64::min) / pitch]
            }
        };
        Self {
            sigma: deviation(scene.source.spot.fwhm()[axis]),
            rotation,
            mask: mask.map(|mask| mask.distance() / rotation),
            lever: plane / rotation - 1.0,
            weight: per_pixel(open),
        }
    }

    /// Largest change of a recorded value by the blur of an opaque edge at `y` behind the rotation
    /// centre: for an edge at an end of an aperture or a window, against which the source moves it.
    fn bound(&self, y: f64) -> f64 {
        let own = y / (self.rotation + y);
        let of_aperture = self.mask.map(|ratio| (1.0 - ratio) / -ratio);
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

/// The bound over all objects in their poses; `None` where each ray draws its source point, or without objects.
pub fn bounded(scene: &Scene, swept: &Swept) -> Option<EdgeBlur> {
    if scene.sampling.scheme == Scheme::Random {
        return None;
    }
    let paths = [0, 1].map(|axis| LightPath::new(scene, axis));
    let bound = |y: f64| paths.iter().map(|path| path.bound(y)).fold(0.0, f64::max);
    let poses = scene.scan.poses();
    let every = poses.div_ceil(MOST_POSES).max(1);
    let mut largest: Option<EdgeBlur> = None;
    for pose in (0..poses).step_by(every) {
        for (object, extent) in swept.extents_of_objects(scene, pose) {
            for y in extent.y {
                let error = bound(y);
                if largest.as_ref().is_none_or(|it| error > it.error) {
                    largest = Some(EdgeBlur { error, object: object.to_owned(), y });
                }
            }
        }
    }
    largest
}
