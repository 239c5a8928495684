//! Vectors of ASTRA's `cone_vec` as motions of the sample before a set-up at rest.

use super::{Motion, Scene};
use beamlet_core::{Error, Result, input_file};
use glam::{DMat3, DVec3};
use std::path::Path;

/// Most that distances, places and pitches may be off, m.
const LENGTH: f64 = 1e-9;
/// Most that directions may be off right angles, rad.
const ANGLE: f64 = 1e-6;

/// Reads the vectors of a file: 12 numbers in a line, mm, separated by blanks, tabs, commas or
/// semicolons.
///
/// # Errors
/// [`Error::File`] with the line, counted from 1.
pub(super) fn read(path: &Path) -> Result<Vec<[f64; 12]>> {
    let text =
        input_file::text(path).map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
    let mut rows = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let words = line.split([',', ';', ' ', '\t']).filter(|word| !word.is_empty());
        let values: Vec<f64> = words.map(|word| word.parse().unwrap_or(f64::NAN)).collect();
        if values.is_empty() {
            continue;
        }
        match <[f64; 12]>::try_from(values) {
            Ok(row) if row.iter().all(|value| value.is_finite()) => rows.push(row),
            Ok(_) => {
                let problem = format!("line {}: not 12 finite numbers", number + 1);
                return Err(Error::file(path, problem, None));
            }
            Err(values) => {
                let problem = format!("line {}: {} numbers; 12 in mm", number + 1, values.len());
                return Err(Error::file(path, problem, None));
            }
        }
    }
    if rows.is_empty() {
        return Err(Error::file(path, "has no vectors", None));
    }
    Ok(rows)
}

/// The motion of the sample that gives the set-up of a scene the vectors of a view.
///
/// # Errors
/// A difference from the set-up: found and allowed value.
pub(super) fn motion(scene: &Scene, row: &[f64; 12]) -> std::result::Result<Motion, [String; 2]> {
    let vector = |at: usize| 1e-3 * DVec3::new(row[at], row[at + 1], row[at + 2]);
    let [source, detector, column, row] = [0, 3, 6, 9].map(vector);
    let um = |length: f64| format!("{:.6} um", 1e6 * length);
    for (name, found, pitch) in
        [("columns", column, scene.detector.pitch[0]), ("rows", row, scene.detector.pitch[1])]
    {
        if (found.length() - pitch).abs() > LENGTH {
            let found = format!("{name} {} apart", um(found.length()));
            return Err([found, format!("{}, as detector.pitch, to 1 nm", um(pitch))]);
        }
    }
    let (x, down) = (column.normalize(), row.normalize());
    let skew = x.dot(down);
    if skew.abs() > ANGLE {
        let found = format!("columns and rows {:.3} urad off right angles", 1e6 * skew);
        return Err([found, "right angles to 1 urad".to_owned()]);
    }
    let z = (x * skew - down).normalize();
    let y = z.cross(x);
    let line = detector - source;
    let [across, along, up] = [x, y, z].map(|axis| axis.dot(line));
    if along < 0.0 {
        // A mirror image, which no motion of the sample makes.
        let found = if down.z > 0.0 {
            "rows that run up (+z), as in ASTRA's own geometries"
        } else {
            "columns from right to left, seen from the source"
        };
        let allowed = match down.z > 0.0 {
            true => {
                "rows that run down: negate the last three numbers of each line, and turn the rows of \
                 the images over"
            }
            false => {
                "columns from left to right, seen from the source: negate numbers 7 to 9 of each line, \
                 and turn the columns of the images over"
            }
        };
        return Err([found.to_owned(), allowed.to_owned()]);
    }
    let distance = scene.detector.distance;
    if (along - distance).abs() > LENGTH {
        let found = format!("the detector {along:.9} m from the source");
        return Err([found, format!("{distance:.9} m, as detector.distance, to 1 nm")]);
    }
    if across.abs() > LENGTH || up.abs() > LENGTH {
        let found = format!(
            "the centre of the detector {} and {} off the foot of the source",
            um(across),
            um(up)
        );
        return Err([found, "at the foot of the source on the detector, to 1 nm".to_owned()]);
    }
    let turned = DMat3::from_cols(x, y, z).transpose();
    let columns = [turned.x_axis, turned.y_axis, turned.z_axis].map(|axis| axis.to_array());
    let [x, y, z] = (turned * source).to_array();
    let by = Motion::translation([-x, -y - scene.source.distance, -z]);
    match Motion::with_axes(columns) {
        Ok(turn) => Ok(turn.then(&by)),
        Err(error) => Err([error.to_string(), "a rotation".to_owned()]),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Beam, Detector, Source};
    use super::*;

    fn scene() -> Scene {
        let source = Source::new(1.2, [0.0; 2], Beam::Energy(30.0));
        Scene::new(source, Detector::new(1.8, [4, 2], [150e-6, 100e-6]))
    }

    /// Vectors of a view of the scene, mm.
    fn vectors(scene: &Scene) -> [f64; 12] {
        let view = scene.view(0);
        let all = [view.source, view.detector, view.column, view.row];
        let mut row = [0.0; 12];
        row.iter_mut().zip(all.as_flattened()).for_each(|(to, from)| *to = 1e3 * from);
        row
    }

    #[test]
    fn vectors_of_a_motion_are_that_motion() {
        let mut scene = scene();
        let wanted = Motion::about([0.2, -0.3, 1.0], 0.7)
            .unwrap()
            .then(&Motion::translation([1e-3, 2e-3, -3e-3]));
        scene.scan.motions = vec![wanted];
        let found = motion(&scene, &vectors(&scene)).unwrap();
        for point in [[0.0; 3], [5e-3, 0.0, 0.0], [0.0, 4e-3, 0.0], [1e-3, 1e-3, 5e-3]] {
            let [a, b] = [found.point(point), wanted.point(point)];
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14), "{a:?} for {b:?}");
        }
    }

    #[test]
    fn vectors_of_another_set_up_are_refused_with_what_differs() {
        let scene = scene();
        let good = vectors(&scene);
        assert!(motion(&scene, &good).is_ok());
        let refused = |at: usize, by: f64, word: &str| {
            let mut row = good;
            row[at] += by;
            let error = motion(&scene, &row).unwrap_err().join("; ");
            assert!(error.contains(word), "{word}: {error}");
        };
        refused(1, 2e-6, "detector.distance");
        refused(0, 2e-6, "off the foot of the source");
        refused(5, 2e-6, "off the foot of the source");
        refused(6, 2e-6, "detector.pitch");
        refused(11, 2e-6, "rows");
        refused(8, 3e-7, "right angles");
    }

    /// A detector of the other handedness, by its rows or by its columns.
    #[test]
    fn mirrored_detectors_are_refused_by_their_name() {
        let mut scene = scene();
        for angle in [0.0, 0.7, 3.0] {
            scene.scan.motions = vec![Motion::about([0.0, 0.0, 1.0], angle).unwrap()];
            for (numbers, word) in [(9..12, "rows that run up"), (6..9, "columns from right")] {
                let mut row = vectors(&scene);
                row[numbers].iter_mut().for_each(|number| *number = -*number);
                let [found, allowed] = motion(&scene, &row).unwrap_err();
                assert!(found.contains(word) && allowed.contains("negate"), "{found}; {allowed}");
            }
        }
    }
}
