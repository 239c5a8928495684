//! Samples written as mesh files, and masks as meshes: read again, they are what they were.

use std::path::Path;

use beamlet::geometry::{NamedMesh, Sample, load, write_meshes};
use beamlet::scene::{MaskBody, Mesh, Object, Scene, Shape};
use beamlet::{MaskMeshOptions, MaskPlace, mask_meshes};

use super::set_up::{at, close, cube, object, scene, shape};

/// Sample of a file, read by the engine.
fn read(directory: &Path, name: &str, group: Option<&str>) -> Sample {
    let mesh = Mesh::File { path: name.into(), unit: Some(1e-3), group: group.map(str::to_owned) };
    let mut scene = scene(vec![object("read", mesh)]);
    scene.directory = directory.into();
    load(&scene).unwrap()
}

fn meshes_of(objects: Vec<Object>, error: f64) -> Vec<NamedMesh> {
    load(&scene(objects)).unwrap().meshes(error).unwrap()
}

#[test]
fn every_format_holds_the_objects_where_they_stand() {
    let directory = tempfile::tempdir().unwrap();
    let mut block = at(cube("block", 2e-3), [1e-3, -1e-3, 0.5e-3]);
    block.placement.rotate = vec![([0.0, 0.0, 1.0], 0.3)];
    let ball = Shape::Sphere { radius: 1e-3, sides: Some(32) };
    let ball = at(shape("ball", ball), [-4e-3, 0.0, 0.0]);
    let meshes = meshes_of(vec![block, ball], 1e-6);
    assert_eq!(meshes.iter().map(|it| it.name.as_str()).collect::<Vec<_>>(), ["block", "ball"]);
    for (name, exact) in [("a.obj", 1e-15), ("a.ply", 1e-15), ("a.stl", 1e-9)] {
        write_meshes(&directory.path().join(name), &meshes, 1e-3).unwrap();
        let all = read(directory.path(), name, None);
        let volume = meshes.iter().map(NamedMesh::volume).sum::<f64>();
        assert!(close(all.objects[0].volume, volume, 1e-6), "{name}");
        // Vertices are those that were written: the nearest is within rounding.
        for vertex in meshes.iter().flat_map(|it| &it.vertices) {
            let off = |found: &[f64; 3]| {
                (0..3).map(|axis| (found[axis] - vertex[axis]).abs()).fold(0.0, f64::max)
            };
            let nearest = all.vertices.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(nearest <= exact, "{name}: {nearest:e}");
        }
    }
    let ball = read(directory.path(), "a.obj", Some("ball"));
    assert!(close(ball.objects[0].volume, meshes[1].volume(), 1e-9));
}

/// Distance of a point to a surface.
type Distance<'a> = &'a dyn Fn([f64; 3]) -> f64;

#[test]
fn facets_of_exact_shapes_are_within_the_error_of_their_surface() {
    let error = 2e-6;
    let sphere = Shape::Sphere { radius: 1.5e-3, sides: None };
    let cylinder = Shape::Cylinder { radius: 1e-3, height: 3e-3, sides: None };
    // Distance to the surface, from the definition of each.
    let round = |p: [f64; 3]| (p[0].hypot(p[1]).hypot(p[2]) - 1.5e-3).abs();
    let upright = |p: [f64; 3]| (p[0].hypot(p[1]) - 1e-3).max(p[2].abs() - 1.5e-3).abs();
    let tube = Shape::Tube { outer: 1e-3, inner: 0.6e-3, height: 3e-3, sides: None };
    let hollow = |p: [f64; 3]| {
        let across = p[0].hypot(p[1]);
        (across - 1e-3).max(0.6e-3 - across).max(p[2].abs() - 1.5e-3).abs()
    };
    let cases: [(Shape, Distance<'_>); 3] =
        [(sphere, &round), (cylinder, &upright), (tube, &hollow)];
    for (of, distance) in cases {
        let mut object = shape("exact", of);
        object.placement.scale = 2.0;
        let [mesh] = &meshes_of(vec![object], error)[..] else { panic!("one object") };
        let mut worst = 0.0_f64;
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|it| mesh.vertices[it as usize]);
            assert!(distance(a.map(|it| it / 2.0)) < 1e-12);
            // The middle of a facet, and those of its edges, are farthest off.
            for weights in [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]] {
                let sum: f64 = weights.iter().sum();
                let point = [0, 1, 2].map(|axis| {
                    (weights[0] * a[axis] + weights[1] * b[axis] + weights[2] * c[axis]) / sum / 2.0
                });
                worst = worst.max(2.0 * distance(point));
            }
        }
        assert!(worst <= error, "{worst:e}");
        assert!(worst > 0.1 * error, "finer than asked for: {worst:e}");
    }
    let told = load(&scene(vec![shape("exact", Shape::Sphere { radius: 1e-3, sides: None })]))
        .unwrap()
        .meshes(1e-12)
        .unwrap_err()
        .to_string();
    assert!(told.contains("error") && told.contains("or more"), "{told}");
}

/// The set-up of the tests, with a mask of gold displaced by 3 um.
fn masked(columns: u32) -> Scene {
    let mut scene = scene(Vec::new());
    scene.detector.pixels = [columns, 4];
    scene.sample_mask.as_mut().unwrap().offset = 3e-6;
    scene
}

#[test]
fn bars_stand_between_the_apertures_of_the_mask() {
    for columns in [8, 9] {
        let scene = masked(columns);
        let options = MaskMeshOptions::default();
        let [bars] = &mask_meshes(&scene, MaskPlace::Sample, &options).unwrap()[..] else {
            panic!("bars alone")
        };
        let mut edges: Vec<f64> = bars.vertices.iter().map(|[x, ..]| *x).collect();
        edges.sort_by(f64::total_cmp);
        edges.dedup();
        // Period 100 um, apertures of 20 um, one for each column of pixels and more on either side.
        let pairs: Vec<[f64; 2]> = edges.chunks(2).map(|it| [it[0], it[1]]).collect();
        assert!(pairs.len() > columns as usize + 1, "{}", pairs.len());
        for pair in &pairs {
            assert!(close(pair[1] - pair[0], 80e-6, 1e-9));
        }
        for (a, b) in pairs.iter().zip(&pairs[1..]) {
            assert!(close(b[0] - a[1], 20e-6, 1e-9));
            // Apertures lie before the middles of pixels, 3 um off.
            let at = (0.5 * (b[0] + a[1]) - 3e-6) / 100e-6 + f64::from(columns) / 2.0 - 0.5;
            assert!((at - at.round()).abs() < 1e-6, "{at}");
        }
        let reach = edges[edges.len() - 1].min(-edges[0]);
        assert!(reach > 0.5 * f64::from(columns) * 100e-6 + 3e-6);
        assert!(bars.vertices.iter().all(|[_, y, _]| close(y.abs(), 112.5e-6, 1e-9)));
    }
}

#[test]
fn bars_frame_and_substrate_are_closed_and_touch() {
    let directory = tempfile::tempdir().unwrap();
    let scene = masked(8);
    let options = MaskMeshOptions::default()
        .with_size([1e-3, 0.5e-3])
        .with_frame(0.3e-3)
        .with_substrate(0.1e-3);
    let meshes = mask_meshes(&scene, MaskPlace::Sample, &options).unwrap();
    write_meshes(&directory.path().join("mask.obj"), &meshes, 1e-3).unwrap();
    let parts = ["bars", "frame", "substrate"].map(|group| {
        let sample = read(directory.path(), "mask.obj", Some(group));
        // Nothing is open, inside out or doubled.
        assert!(sample.objects[0].warnings.is_empty(), "{:?}", sample.objects[0].warnings);
        sample.objects[0].clone()
    });
    let count = meshes[0].triangles.len() / 12;
    let [width, height, depth] = [100e-6 * count as f64 - 20e-6, 0.5e-3, 225e-6];
    assert!(close(parts[0].volume, count as f64 * 80e-6 * height * depth, 1e-6));
    let outer = [width + 0.6e-3, height + 0.6e-3];
    assert!(close(parts[1].volume, (outer[0] * outer[1] - width * height) * depth, 1e-6));
    assert!(close(parts[2].volume, outer[0] * outer[1] * 0.1e-3, 1e-6));
    assert!(close(parts[0].bounds[1][1], parts[2].bounds[0][1], 1e-6));
    assert!(close(parts[0].bounds[1][2], 0.25e-3, 1e-6));
    // All three in one scene: they touch and keep their volumes.
    let part = |group: &str| {
        let (path, unit) = ("mask.obj".into(), Some(1e-3));
        object(group, Mesh::File { path, unit, group: Some(group.into()) })
    };
    let mut all = super::set_up::scene(["bars", "frame", "substrate"].map(part).into());
    all.directory = directory.path().into();
    let sample = load(&all).unwrap();
    for (object, alone) in sample.objects.iter().zip(&parts) {
        assert!(close(object.volume, alone.volume, 1e-6), "{}", object.name);
    }
}

#[test]
fn what_is_no_mask_of_bars_is_refused() {
    let told = |scene: &Scene, place, options: &MaskMeshOptions| {
        mask_meshes(scene, place, options).unwrap_err().to_string()
    };
    let plain = MaskMeshOptions::default();
    let mut without = masked(8);
    without.detector_mask = None;
    assert!(told(&without, MaskPlace::Detector, &plain).contains("detector_mask"));
    let mut sheet = masked(8);
    sheet.sample_mask.as_mut().unwrap().body = MaskBody::Sheet { transmission: 0.0 };
    assert!(told(&sheet, MaskPlace::Sample, &plain).contains("sample_mask.transmission"));
    let mut open = masked(8);
    open.sample_mask.as_mut().unwrap().aperture = 100e-6;
    assert!(told(&open, MaskPlace::Sample, &plain).contains("sample_mask.aperture"));
    for options in [
        plain.clone().with_frame(0.0),
        plain.clone().with_substrate(f64::NAN),
        plain.clone().with_size([-1.0, 1.0]),
        plain.clone().with_size([1e6, 1.0]),
    ] {
        assert!(told(&masked(8), MaskPlace::Sample, &options).contains("allowed"), "{options:?}");
    }
}
