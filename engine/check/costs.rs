//! The errors that sampling may leave in a run, and what makes a scene slower than it needs to be.

use super::CheckReport;
use crate::Result;
use crate::geometry::ContactKind;
use crate::printed::number;
use crate::run::quality;
use crate::scene::{Counts, Quality, Scene, Shape, ShapeOrMesh};
use serde::Serialize;

/// Ratio of the expected deviation to a tolerance from which on a larger tolerance is advised: by noise it
/// is ten, rounded.
const NEEDLESS: f64 = 40.0;

/// Errors that sampling may leave in a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CheckedTolerances {
    /// Of a recorded value, share of open beam.
    pub tolerance: f64,
    /// Of the mean refraction angle, rad.
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
/// Those of the materials of masks and beam.
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

/// What makes a run slower than it needs to be, with the remedy.
pub(super) fn warnings(scene: &Scene, report: &CheckReport) -> Vec<String> {
    let mut warnings = needless(scene, &report.work.tolerances);
    for contact in &report.contacts {
        let crosses = matches!(contact.kind, ContactKind::Overlap { .. });
        let cut = |name: &String| {
            let object = scene.objects.iter().find(|object| object.name == *name);
            let faceted = report.objects.iter().any(|it| it.name == *name && it.triangles > 0);
            object.is_some_and(|object| is_exact(&object.geometry)) && faceted
        };
        if crosses && (cut(&contact.earlier) || cut(&contact.later)) {
            warnings.push(format!(
                "\"{}\" crosses \"{}\": exact shapes that cross become meshes, which takes about ten times \
                 as long; end one inside the other where the sample allows it",
                contact.later, contact.earlier
            ));
        }
    }
    warnings
}

/// Whether an object has exact curved surfaces.
fn is_exact(geometry: &ShapeOrMesh) -> bool {
    let ShapeOrMesh::Shape(shape) = geometry else { return false };
    match shape {
        Shape::Cylinder { sides, .. }
        | Shape::Cone { sides, .. }
        | Shape::Sphere { sides, .. }
        | Shape::Ellipsoid { sides, .. }
        | Shape::Torus { sides, .. }
        | Shape::Tube { sides, .. } => sides.is_none(),
        Shape::Box { .. } | Shape::Prism { .. } | Shape::Extrusion { .. } => false,
    }
}

/// Tolerances far below the noise, which somebody gave as numbers.
fn needless(scene: &Scene, of: &CheckedTolerances) -> Vec<String> {
    if scene.sampling.quality == Some(Quality::Fine) {
        return Vec::new();
    }
    let mut warnings = Vec::new();
    if let Some(noise) = of.open_noise.filter(|noise| *noise > NEEDLESS * of.tolerance) {
        warnings.push(format!(
            "sampling.tolerance of {:e} is {:.0} times below the noise of an open pixel, {noise:.1e}: without \
             a number sampling.quality = \"noise\" takes a tenth of the noise, which is faster",
            of.tolerance,
            noise / of.tolerance
        ));
    }
    if let Some(sigma) = of.expected_angle.filter(|sigma| *sigma > NEEDLESS * of.angle_tolerance) {
        warnings.push(format!(
            "sampling.angle_tolerance of {} nrad is {:.0} times below the noise of the refraction angle, {} \
             nrad: without a number sampling.quality = \"noise\" takes a tenth of the noise, which is faster",
            number(of.angle_tolerance * 1e9),
            sigma / of.angle_tolerance,
            number((sigma * 1e9).round())
        ));
    }
    warnings
}
