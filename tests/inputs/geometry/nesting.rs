//! Objects in objects: what surrounds what.

use beamlet::geometry::load;
use beamlet::scene::Shape;
use proptest::prelude::*;

use super::set_up::{Arrays, at, close, cube, scene, shape};

fn sphere(name: &str, radius: f64) -> beamlet::scene::Object {
    shape(name, Shape::Sphere { radius, sides: Some(40) })
}

/// A body in the bore of a tube, exact or of facets, is inside the body around the tube, not inside the tube.
#[test]
fn a_bore_is_no_part_of_its_tube() {
    for sides in [None, Some(48)] {
        let tube = Shape::Tube { outer: 1.3e-3, inner: 0.8e-3, height: 2e-3, sides };
        let ball = |name: &str, radius: f64, x: f64| {
            at(shape(name, Shape::Sphere { radius, sides }), [x, 0.0, 0.0])
        };
        let wire = shape("wire", Shape::Cylinder { radius: 0.2e-3, height: 4e-3, sides });
        let objects = vec![
            cube("box", 8e-3),
            shape("tube", tube),
            wire,
            ball("in the wall", 0.1e-3, 1.05e-3),
            ball("in the bore", 0.1e-3, 0.5e-3),
        ];
        let sample = load(&scene(objects)).unwrap();
        let outside: Vec<Option<u32>> = sample.components.iter().map(|it| it.outside).collect();
        assert_eq!(outside, [None, Some(0), Some(0), Some(1), Some(0)], "{sides:?}");
    }
}

#[test]
fn contained_object_listed_later_stands_in_its_container() {
    let sample = load(&scene(vec![
        cube("box", 8e-3),
        sphere("ball", 3e-3),
        cube("core", 2e-3),
        at(cube("apart", 1e-3), [20e-3, 0.0, 0.0]),
    ]))
    .unwrap();
    let outside: Vec<Option<u32>> = sample.components.iter().map(|part| part.outside).collect();
    assert_eq!(outside, [None, Some(0), Some(1), None]);
    assert_eq!(sample.objects[2].inside, [Some(1)]);
    assert_eq!(sample.objects[3].inside, [None]);
    let objects: Vec<u32> = sample.components.iter().map(|part| part.object).collect();
    assert_eq!(objects, [0, 1, 2, 3]);
}

#[test]
fn object_in_the_void_of_another_stands_in_what_is_around_that() {
    let hollow = Arrays::cube(8e-3).and(Arrays::cube(6e-3).turned()).object("hollow");
    let sample = load(&scene(vec![cube("bath", 10e-3), hollow, cube("core", 2e-3)])).unwrap();
    let outside: Vec<Option<u32>> = sample.components.iter().map(|part| part.outside).collect();
    assert_eq!(outside, [None, Some(0), Some(0), Some(0)]);
    assert!(close(sample.objects[1].volume, 512e-9 - 216e-9, 1e-12));
}

#[test]
fn parts_of_one_object_may_stand_in_different_objects() {
    let parts = Arrays::cube(1e-3).and(Arrays::cube(1e-3).moved([9e-3, 0.0, 0.0]));
    let sample = load(&scene(vec![cube("box", 8e-3), parts.object("two")])).unwrap();
    assert_eq!(sample.objects[1].inside, [Some(0), None]);
}

#[test]
fn container_listed_last_covers_its_content() {
    let sample = load(&scene(vec![cube("core", 2e-3), cube("box", 8e-3)])).unwrap();
    let core = &sample.objects[0];
    assert_eq!((core.triangles, core.volume, &core.cut_by[..]), (0, 0.0, &[1][..]));
    assert!(core.warnings.iter().any(|text| text.contains("covered completely")), "{core:?}");
    assert_eq!(sample.components.len(), 1);
    assert!(close(sample.objects[1].volume, 512e-9, 1e-12));
}

#[test]
fn a_gap_of_ten_nanometres_is_a_gap() {
    for b in [
        at(cube("b", 4e-3), [4e-3 + 1e-8, 0.0, 0.0]),
        cube("b", 4e-3 - 2e-8),
        at(cube("b", 4e-3), [4e-3, 4e-3 + 1e-8, 4e-3]),
    ] {
        let _ = load(&scene(vec![cube("a", 4e-3), b])).unwrap();
    }
}

#[test]
fn coating_of_a_micrometre_sample_is_not_mistaken_for_contact() {
    let _ = load(&scene(vec![sphere("shell", 1.01e-6), sphere("ball", 1.00e-6)])).unwrap();
}

#[test]
fn boxes_that_overlap_do_not_make_objects_meet() {
    let ring = Arrays::cube(8e-3).and(Arrays::cube(6e-3).turned()).object("hollow");
    let mut turned = cube("turned", 3e-3);
    turned.placement.rotate = vec![([1.0, 2.0, 3.0], 0.7)];
    let corner = at(sphere("corner", 0.3e-3), [2.6e-3, 2.6e-3, 2.6e-3]);
    let sample = load(&scene(vec![ring, turned, corner])).unwrap();
    assert!(sample.components.iter().all(|part| part.outside.is_none()));
}

#[test]
fn grid_aligned_points_are_told_inside_from_outside() {
    // The start of the search is a corner: on a grid its rays meet edges and corners.
    for (position, inside) in [
        ([0.0, 0.0, 0.0], Some(0)),
        ([1e-3, 1e-3, 1e-3], Some(0)),
        ([-1e-3, 1e-3, 0.0], Some(0)),
        ([4e-3, 4e-3, 0.0], None),
        ([0.0, 0.0, 5e-3], None),
    ] {
        let core = at(cube("core", 1e-3), position);
        let sample = load(&scene(vec![cube("box", 8e-3 - 4e-3), core])).unwrap();
        assert_eq!(sample.components[1].outside, inside, "{position:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// A small turned cube near a big one: by the distance of its middle from the surface of
    /// the big one it is surely inside, surely outside, or surely across.
    #[test]
    fn turned_cube_is_inside_outside_or_across_as_its_distance_says(
        middle in prop::array::uniform3(-1.6e-3..1.6e-3_f64),
        axis in prop::array::uniform3(0.1..1.0_f64),
        angle in 0.0..6.0_f64,
    ) {
        let mut small = at(cube("small", 0.4e-3), middle);
        small.placement.rotate = vec![(axis, angle)];
        let (inscribed, circumscribed) = (0.2e-3, 0.2e-3 * 3.0_f64.sqrt());
        let beyond = middle.map(|x| (x.abs() - 1e-3).max(0.0));
        let outside = beyond.iter().map(|x| x * x).sum::<f64>().sqrt();
        let depth = middle.iter().map(|x| 1e-3 - x.abs()).fold(f64::INFINITY, f64::min);
        let found = load(&scene(vec![cube("big", 2e-3), small]));
        if depth > circumscribed {
            prop_assert_eq!(found.unwrap().components[1].outside, Some(0));
        } else if outside > circumscribed {
            prop_assert_eq!(found.unwrap().components[1].outside, None);
        } else if outside < inscribed && depth < inscribed {
            let sample = found.unwrap();
            prop_assert_eq!(&sample.objects[0].cut_by[..], &[1][..]);
            let least = 8e-9 - 0.064e-9;
            prop_assert!((least..8e-9 - 1e-15).contains(&sample.objects[0].volume));
        }
    }
}
