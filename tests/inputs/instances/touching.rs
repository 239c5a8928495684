//! Instances of one object that touch or overlap are one solid.

use super::*;
use crate::geometry::set_up::is_closed;
use beamlet::geometry::{self, Sample};
use std::f64::consts::PI;
use std::fmt::Write as _;

/// The sample of a shape at places in micrometres.
fn sample_of(shape: &str, places: &[[f64; 3]]) -> Sample {
    let directory = tempfile::tempdir().unwrap();
    let mut text = "x_um,y_um,z_um\n".to_owned();
    for [x, y, z] in places {
        writeln!(text, "{x},{y},{z}").unwrap();
    }
    std::fs::write(directory.path().join("places.csv"), text).unwrap();
    let scene = scene_in(directory.path(), shape, "\"places.csv\"").unwrap();
    let (checked, refusals) = beamlet::internals::geometry::load_lenient(&scene).unwrap();
    assert!(refusals.is_empty() && checked.overlaps.is_empty(), "{:?}", checked.overlaps);
    geometry::load(&scene).unwrap()
}

fn close(found: f64, want: f64, share: f64) {
    assert!((found - want).abs() <= share * want, "{found:e}, not {want:e}");
}

#[test]
fn touching_boxes_are_the_one_box() {
    let mut places = Vec::new();
    for x in 0..6 {
        for y in 0..5 {
            for z in 0..4 {
                places.push([x, y, z].map(|it| 10.1 * f64::from(it) - 20.3));
            }
        }
    }
    let shape = "{ box = { size = [\"10.1 um\", \"10.1 um\", \"10.1 um\"] } }";
    let sample = sample_of(shape, &places);
    assert_eq!(sample.components.len(), 1);
    close(sample.objects[0].volume, 120.0 * 10.1e-6_f64.powi(3), 1e-9);
    // No face is left inside.
    let area: f64 = sample.components.iter().map(|it| it.area).sum();
    close(area, 2.0 * (30.0 + 24.0 + 20.0) * 10.1e-6_f64.powi(2), 1e-9);
    assert!(is_closed(&sample));
}

#[test]
fn overlapping_instances_have_the_volume_of_their_union() {
    // Two balls whose centres are as far apart as their radius, and one twice in the same place.
    let places = [[0.0; 3], [10.0, 0.0, 0.0], [50.0; 3], [50.0; 3]];
    let whole = 4.0 / 3.0 * PI * 1e-15;
    let shared = PI * 1e-15 * (4.0 + 1.0) * (2.0 - 1.0) * (2.0 - 1.0) / 12.0;
    let sample = sample_of("{ sphere = { radius = \"10 um\" } }", &places);
    // Exact shapes that cross count whole.
    close(sample.objects[0].volume, 4.0 * whole, 1e-12);
    assert!(sample.triangles.is_empty() && sample.objects[0].warnings.is_empty());
    // As meshes they are united, exact ones too.
    let meshes = sample.meshes(10e-9).unwrap();
    close(meshes[0].volume(), 3.0 * whole - shared, 3.0 * 10e-9 / 10e-6);
    // Facets of 128 sides leave out about 8e-4 of a ball.
    let sample = sample_of("{ sphere = { radius = \"10 um\", sides = 128 } }", &places);
    close(sample.objects[0].volume, 3.0 * whole - shared, 2e-3);
    assert_eq!(sample.components.len(), 2);
    assert!(is_closed(&sample));
    assert!(sample.objects[0].warnings.iter().any(|it| it.contains("overlap")));
}

#[test]
fn balls_that_touch_stay_exact() {
    // Densest packing of balls, each of which touches twelve.
    let (edge, mut places) = (20.0, Vec::new());
    for x in -4..5 {
        for y in -4..5 {
            for z in -4..5 {
                if (x + y + z) % 2 == 0 {
                    places.push([x, y, z].map(|it| f64::from(it) * edge / f64::sqrt(2.0) + 0.3));
                }
            }
        }
    }
    let sample = sample_of("{ sphere = { radius = \"10 um\" } }", &places);
    assert!(sample.triangles.is_empty() && sample.objects[0].warnings.is_empty());
    assert_eq!(sample.objects[0].instances, places.len());
    close(sample.objects[0].volume, places.len() as f64 * 4.0 / 3.0 * PI * 1e-15, 1e-12);
}

#[test]
fn instances_in_others_change_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let text = "x_um,y_um,z_um,scale\n0,0,0,1\n2,1,0,0.3\n100,0,0,1\n";
    std::fs::write(directory.path().join("places.csv"), text).unwrap();
    for shape in ["sphere = { radius = \"10 um\" }", "sphere = { radius = \"10 um\", sides = 32 }"]
    {
        let scene =
            scene_in(directory.path(), &format!("{{ {shape} }}"), "\"places.csv\"").unwrap();
        let sample = geometry::load(&scene).unwrap();
        let one = sample.components.iter().map(|it| it.volume).fold(0.0, f64::max);
        close(sample.objects[0].volume, 2.0 * one, 1e-12);
        assert_eq!(sample.objects[0].instances, 2);
        assert!(
            sample.objects[0]
                .warnings
                .iter()
                .any(|it| it.contains("lie inside others and are ignored"))
        );
    }
}
