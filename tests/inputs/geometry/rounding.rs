//! Corners that differ by rounding, and parts far from the origin of their file.

use super::set_up::{Arrays, close, is_closed};
use beamlet::geometry::{NamedMesh, Sample};
use beamlet::scene::Shape;

/// An L-shaped prism of 6e-9 m3, each triangle with corners of its own, `at` from the origin along x. Each
/// coordinate becomes `changed(coordinate, number)`.
fn bracket(at: f64, changed: impl Fn(f64, usize) -> f64) -> Arrays {
    let outline = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
    let corner = |k: usize| [outline[k % 6][0], outline[k % 6][1], if k < 6 { 0.0 } else { 1.5 }];
    let mut triangles: Vec<[usize; 3]> = Vec::new();
    for k in 1..5 {
        triangles.extend([[k + 1, k, 0], [6, k + 6, k + 7]]);
    }
    for k in 0..6 {
        let next = (k + 1) % 6;
        triangles.extend([[k, next, next + 6], [k, next + 6, k + 6]]);
    }
    let corners = triangles.as_flattened().iter().map(|k| corner(*k));
    let mut all: Vec<[f64; 3]> =
        corners.map(|[x, y, z]| [x + at, y, z].map(|it| it * 1e-3)).collect();
    for (number, value) in all.as_flattened_mut().iter_mut().enumerate() {
        *value = changed(*value, number);
    }
    let count = u32::try_from(all.len()).unwrap();
    Arrays(all, (0..count).step_by(3).map(|k| [k, k + 1, k + 2]).collect())
}

fn single(value: f64) -> f32 {
    value as f32
}

/// A different number from 0 to `below` for each number.
fn draw(number: usize, below: usize) -> usize {
    (number * 7919 + number / 7) % 104_729 % below
}

fn joined(sample: &Sample, volume: f64) -> &str {
    assert!(close(sample.objects[0].volume, volume, 1e-5), "{:e}", sample.objects[0].volume);
    assert!(is_closed(sample));
    assert_eq!(sample.components.len(), 1);
    let warnings = &sample.objects[0].warnings;
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    &warnings[0]
}

fn sorted(mut all: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    all.sort_by(|a, b| a.partial_cmp(b).unwrap());
    all
}

#[test]
fn corners_within_rounding_are_joined_with_the_distance() {
    // Zeros of a CAD program, and numbers of 32 bits at 100 mm that differ by one unit of the last place.
    let zeros = bracket(0.0, |it, number| match it == 0.0 {
        true => [0.0, 2.7e-19, -6.1e-20][draw(number, 3)],
        false => it,
    });
    let sample = zeros.load().unwrap();
    let warning = joined(&sample, 6e-9);
    assert!(
        warning.contains("corners up to ") && warning.contains("apart were joined"),
        "{warning}"
    );
    let last = bracket(100.0, |it, number| {
        let up = number % 3 == 0 && draw(number, 2) == 1;
        f64::from(if up { single(it).next_up() } else { single(it) })
    });
    let sample = last.load().unwrap();
    // 2^-27 m.
    assert!(
        joined(&sample, 6e-9).contains("up to 7.5 nm apart"),
        "{:?}",
        sample.objects[0].warnings
    );
}

#[test]
fn joining_ends_at_four_units_of_the_last_place() {
    // Numbers of 64 bits, 3 mm across: 2^-32 m.
    let step = f64::exp2(-32.0);
    for (units, apart) in [(1.0, None), (2.3, None), (2.4, Some("0.97 nm")), (20.0, Some("8.1 nm"))]
    {
        // In each triangle of its own, along three axes.
        let mesh =
            bracket(0.0, |it, number| it + 1e-4 / 3.0 + step * units * ((number / 9) % 2) as f64);
        let mut backwards = mesh.clone();
        backwards.1.reverse();
        match (mesh.load(), apart) {
            (Ok(sample), None) => {
                joined(&sample, 6e-9);
                // In any order of the triangles.
                assert_eq!(sorted(sample.vertices), sorted(backwards.load().unwrap().vertices));
            }
            (Err(error), Some(apart)) => {
                let text = error.to_string();
                let words = format!("its nearest corners without an edge {apart} apart");
                assert!(text.contains("not closed") && text.contains(&words), "{text}");
                // The gaps are too narrow for any of the trial rays.
                let offer = "allow_defects = true (4096 trial rays found no wrong path)";
                assert!(text.contains(offer), "{text}");
            }
            (other, _) => panic!("{units}: {:?}", other.map(|_| ())),
        }
    }
}

#[test]
fn sound_mesh_keeps_its_corners_to_the_bit() {
    // Two parts with corners of finer numbers less than four units of the last place apart.
    let cube = Arrays::cube(2e-3).moved([1e-3 / 3.0; 3]);
    let pair = cube.clone().and(cube.moved([2e-3 + 6e-10, 0.0, 0.0]));
    let sample = pair.clone().load().unwrap();
    assert_eq!(sorted(sample.vertices), sorted(pair.0));
    assert!(sample.objects[0].warnings.is_empty());
}

#[test]
fn part_far_from_the_origin_keeps_its_volume() {
    let ball = Arrays::of(Shape::Sphere { radius: 1e-3, sides: Some(96) });
    let volume = ball.clone().load().unwrap().objects[0].volume;
    for (away, lost) in [(1.0, false), (100.0, true), (1e3, true), (5e3, true)] {
        let far = ball.clone().moved([away, 0.37 * away, 0.11 * away]);
        for center in [false, true] {
            let mut object = far.clone().object("ball");
            object.placement.center = center;
            let sample = beamlet::geometry::load(&super::set_up::scene(vec![object])).unwrap();
            // The numbers of 64 bits resolve 1e-12 m there.
            assert!(close(sample.objects[0].volume, volume, 1e-8), "{away}, {center}");
            let mesh = NamedMesh::new("ball", sample.vertices.clone(), sample.triangles.clone());
            assert!(close(mesh.volume(), volume, 1e-8), "{away}: {:e}", mesh.volume());
            assert_eq!(sample.triangles.len(), far.1.len());
            let warnings = &sample.objects[0].warnings;
            let warned = warnings.iter().any(|it| it.starts_with("digits are lost: 2 mm across"));
            assert_eq!((warned, warnings.len()), (lost && !center, usize::from(lost && !center)));
        }
    }
    // Numbers of 32 bits are rounded already in the file.
    let mut rounded = ball.moved([100.0, 0.0, 0.0]);
    rounded.0.as_flattened_mut().iter_mut().for_each(|it| *it = f64::from(single(*it)));
    let mut object = rounded.object("ball");
    object.placement.center = true;
    object.allow_defects = true;
    let sample = beamlet::geometry::load(&super::set_up::scene(vec![object])).unwrap();
    let warnings = &sample.objects[0].warnings;
    assert!(
        warnings.iter().any(|it| it.contains("numbers in the file are 32-bit")),
        "{warnings:?}"
    );
}
