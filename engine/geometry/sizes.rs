//! Meshes whose size suggests a wrong unit, and shapes too small to be seen.

use super::{ObjectSummary, Sample};
use beamlet_core::units::Dimension::Length;
use beamlet_model::scene::{Mesh, Object, Scene, ShapeOrMesh};

/// Fields of view that a part may be across.
const MOST_FIELDS: f64 = 20.0;
/// Pixels that it should be across.
const LEAST_PIXELS: f64 = 2.0;
/// Pixels across below which a shape is too thin for any image, along two of its axes at least.
const THIN_PIXELS: f64 = 0.1;
/// Units that files are written in, m.
const UNITS: [f64; 5] = [1e-3, 1e-6, 1e-2, 25.4e-3, 1.0];

/// Meshes of files that are more than 20 fields of view across, or less than 2 pixels, in words,
/// with the unit that was probably meant; shapes that no image can show.
pub fn unit_warnings(scene: &Scene, sample: &Sample) -> Vec<String> {
    let named = |(object, summary): (&Object, &ObjectSummary)| {
        Some(format!("\"{}\" {}", summary.name, unit_doubt(scene, object, summary)?))
    };
    scene.objects.iter().zip(&sample.objects).filter_map(named).collect()
}

/// The suspected unit error of an object, by its size.
pub(super) fn unit_doubt(
    scene: &Scene,
    object: &Object,
    summary: &ObjectSummary,
) -> Option<String> {
    let shrink = scene.source.distance / scene.detector.distance;
    let field = scene.detector.size().into_iter().fold(0.0, f64::max) * shrink;
    let pixel = scene.detector.pitch.into_iter().fold(0.0, f64::max) * shrink;
    let [low, high] = summary.bounds;
    let across = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    let ShapeOrMesh::Mesh(Mesh::File { unit, .. }) = &object.geometry else {
        let mut sides = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        sides.sort_by(f64::total_cmp);
        // Films are thin along one axis.
        let is_thin = sides[1] < THIN_PIXELS * pixel && object.instances.is_none();
        return is_thin.then(|| {
            format!(
                "is {} across, {:.2e} pixels at the rotation centre: are its unit and `scale` right?",
                rounded(sides[1]),
                sides[1] / pixel
            )
        });
    };
    let is_small = |across: f64| across < LEAST_PIXELS * pixel;
    let is_large = |across: f64| across > MOST_FIELDS * field;
    let size = if is_large(across) {
        format!("{:.1} fields of view", across / field)
    } else if is_small(across) && object.instances.is_none() {
        // Of many instances each may be as small as it likes.
        format!("{:.2e} pixels", across / pixel)
    } else {
        return None;
    };
    let meant = unit.and_then(|unit| {
        let fits = |across: f64| !is_small(across) && !is_large(across);
        let meant = UNITS.into_iter().find(|it| fits(across * it / unit))?;
        let word = Length.rounded(meant);
        let word = word.strip_prefix("1 ").unwrap_or(&word).to_owned();
        Some(format!(" With unit = \"{word}\" it would be {}", rounded(across * meant / unit)))
    });
    let key = if unit.is_some() { "`unit` (or `scale`)" } else { "`scale`, or the file's unit," };
    Some(format!(
        "is {} across, {size} at the rotation centre: is its {key} the right one?{}",
        rounded(across),
        meant.unwrap_or_default()
    ))
}

/// A length to three digits.
fn rounded(length: f64) -> String {
    let three = format!("{length:.2e}").parse().unwrap_or(length);
    Length.rounded(three)
}
