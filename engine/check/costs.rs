//! The errors that sampling may leave in a run, and what makes a scene slower than it needs to be.

use super::CheckReport;
use beamlet_core::Result;
use beamlet_core::printed::{duration, number};
use beamlet_model::scene::{Counts, Object, Quality, Scene, ShapeOrMesh, Tolerances};
use beamlet_simulate::run::quality;
use serde::Serialize;

/// Ratio of the expected deviation to a tolerance from which on a larger tolerance is advised: by noise it
/// is ten, rounded.
const NEEDLESS: f64 = 40.0;

/// Errors that sampling may leave in a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CheckedTolerances {
    /// Error of a recorded value, share of open beam.
    pub tolerance: f64,
    /// Error of the mean refraction angle, rad.
    pub angle_tolerance: f64,
    /// Standard deviation of the noise of an open pixel, share of open beam; `None` without photons.
    pub open_noise: Option<f64>,
    /// Standard deviation of the refraction angle of a pixel without a sample, rad, by thin masks; `None`
    /// without photons or a mask, or with fewer than three offsets.
    pub expected_angle: Option<f64>,
}

/// The tolerances of a scene whose numbers are resolved.
///
/// # Errors
/// Errors of the materials of masks and beam.
pub(super) fn tolerances(scene: &Scene) -> Result<CheckedTolerances> {
    let of = scene.sampling.tolerances();
    let noise = |counts: &Counts| quality::open_variance(scene, counts);
    let variance = scene.detector.counts.as_ref().map(noise).transpose()?;
    Ok(CheckedTolerances {
        tolerance: of.light,
        angle_tolerance: of.angle,
        open_noise: variance.map(|variance| variance.of(1.0).sqrt()),
        expected_angle: quality::expected_angle(scene)?,
    })
}

impl CheckedTolerances {
    /// Tolerances as text, beside the noise.
    pub(super) fn text(&self) -> String {
        let Self { tolerance, angle_tolerance, .. } = self;
        format!("{tolerance:.1e} of open beam, angles {} nrad", number(angle_tolerance * 1e9))
    }
}

/// Warnings of choices that make a run slower than it needs to be, with the remedy.
pub(super) fn warnings(scene: &Scene, report: &CheckReport) -> Vec<String> {
    let pairs =
        report.objects.iter().flat_map(|it| it.cut_by.iter().map(|later| [&it.name, later]));
    pairs.filter_map(|pair| meshes(scene, report, pair)).collect()
}

/// The remedy where an exact shape and a mesh overlap, and the shape becomes a mesh for it.
fn meshes(scene: &Scene, report: &CheckReport, [earlier, later]: [&String; 2]) -> Option<String> {
    let named = |name: &String| scene.objects.iter().find(|object| object.name == *name);
    let is_cut = |object: &Object| {
        report.objects.iter().any(|it| it.name == object.name && it.triangles > 0)
    };
    let (first, second) = (named(earlier)?, named(later)?);
    let (exact, mesh) = match [first, second].map(|it| is_exact(&it.geometry)) {
        [true, false] => (first, second),
        [false, true] => (second, first),
        _ => return None,
    };
    is_cut(exact).then(|| {
        let (exact, mesh) = (&exact.name, &mesh.name);
        format!(
            "\"{exact}\" crosses \"{mesh}\", which has facets: it becomes a mesh there, about ten times \
             slower; exact shapes that cross each other stay exact"
        )
    })
}

/// True if an object has exact curved surfaces.
fn is_exact(geometry: &ShapeOrMesh) -> bool {
    let ShapeOrMesh::Shape(shape) = geometry else { return false };
    !shape.has_facets()
}

/// The scene with the tolerances of its noise in place of numbers far below that; nothing where there are
/// none.
///
/// # Errors
/// Errors of the materials of masks and beam.
pub(super) fn by_noise(scene: &Scene, of: &CheckedTolerances) -> Result<Option<Scene>> {
    let [light, angle] = too_small(scene, of);
    if light.is_none() && angle.is_none() {
        return Ok(None);
    }
    let mut faster = scene.clone();
    let sampling = &mut faster.sampling;
    sampling.quality = Some(Quality::Noise);
    sampling.tolerance = sampling.tolerance.filter(|_| light.is_none());
    sampling.angle_tolerance = sampling.angle_tolerance.filter(|_| angle.is_none());
    quality::resolved(&faster).map(Some)
}

/// The noise that tolerances are far below, which somebody gave as numbers: of light and of angles.
fn too_small(scene: &Scene, of: &CheckedTolerances) -> [Option<f64>; 2] {
    if scene.sampling.quality == Some(Quality::Fine) {
        return [None; 2];
    }
    [(of.open_noise, of.tolerance), (of.expected_angle, of.angle_tolerance)]
        .map(|(noise, tolerance)| noise.filter(|noise| *noise > NEEDLESS * tolerance))
}

/// Tolerances far below the noise. `instead`: the tolerances by the noise, and the seconds of a run with
/// them where these are known.
pub(super) fn needless(
    scene: &Scene,
    of: &CheckedTolerances,
    instead: (Tolerances, Option<f64>),
) -> Vec<String> {
    let [light, angle] = too_small(scene, of);
    let (Tolerances { light: own_light, angle: own_angle }, seconds) = instead;
    // The limits of `quality` may lie far below the noise, too: nothing is faster there.
    let light = light.filter(|_| own_light > of.tolerance);
    let angle = angle.filter(|_| own_angle > of.angle_tolerance);
    let time = seconds.map_or(String::new(), |it| format!(": about {}", duration(it)));
    let text = |key: &str, found: String, times: f64, noise: String, tenth: String| {
        format!(
            "sampling.{key} of {found} is {} times below the noise of {noise}: omit it and \
             set sampling.quality = \"noise\", which uses {tenth} and is faster{time}",
            number(times.round())
        )
    };
    let nrad = |angle: f64| format!("{} nrad", number(angle * 1e9));
    let mut warnings = Vec::new();
    if let Some(noise) = light {
        let (found, times) = (format!("{:e}", of.tolerance), noise / of.tolerance);
        let what = format!("an open pixel, {noise:.1e}");
        warnings.push(text("tolerance", found, times, what, format!("{own_light:e}")));
    }
    if let Some(sigma) = angle {
        let times = sigma / of.angle_tolerance;
        let what = format!("the refraction angle, {} nrad", number((sigma * 1e9).round()));
        let found = nrad(of.angle_tolerance);
        warnings.push(text("angle_tolerance", found, times, what, nrad(own_angle)));
    }
    warnings
}
