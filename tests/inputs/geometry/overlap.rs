//! Objects that overlap, touch and coincide: the one listed later wins.

use beamlet::geometry::{Sample, load};
use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Object, Shape};

use super::set_up::{Arrays, at, block, close, cube, is_closed, scene, shape};

fn volumes(sample: &Sample) -> Vec<f64> {
    sample.objects.iter().map(|object| object.volume).collect()
}

fn outsides(sample: &Sample, object: u32) -> Vec<Option<u32>> {
    let of_object = sample.components.iter().filter(|part| part.object == object);
    of_object.map(|part| part.outside).collect()
}

/// The same rotation of everything, in an awkward direction.
fn turned(objects: Vec<Object>) -> Vec<Object> {
    let turn = |mut object: Object| {
        // Objects are turned about the origin: the place is turned by hand.
        let (axis, angle) = ([1.0_f64, 2.0, 3.0].map(|it| it / 14.0_f64.sqrt()), 0.7_f64);
        let p = object.placement.position;
        let dot = axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2];
        let cross = [
            axis[1] * p[2] - axis[2] * p[1],
            axis[2] * p[0] - axis[0] * p[2],
            axis[0] * p[1] - axis[1] * p[0],
        ];
        let (sin, cos) = angle.sin_cos();
        let position = [0, 1, 2].map(|k| p[k] * cos + cross[k] * sin + axis[k] * dot * (1.0 - cos));
        object.placement.rotate = vec![(axis, angle)];
        object.placement.position = position;
        object
    };
    objects.into_iter().map(turn).collect()
}

#[test]
fn volumes_covered_by_later_objects_are_cut_away() {
    for (what, b, shared) in [
        ("a corner", at(cube("b", 4e-3), [1e-3, 1.1e-3, 1.2e-3]), 3e-3 * 2.9e-3 * 2.8e-3),
        // No corner of either is in the other.
        ("a needle through a face", block("b", [1e-4, 1e-4, 20e-3], [0.0; 3]), 1e-8 * 4e-3),
        ("faces side by side", at(cube("b", 4e-3), [4e-3, 0.0, 0.0]), 0.0),
        ("a small face on a big one", at(cube("b", 1e-3), [2.5e-3, 0.0, 0.0]), 0.0),
        ("a face within the container", at(cube("b", 1e-3), [1.5e-3, 0.0, 0.0]), 1e-9),
        ("edge to edge", at(cube("b", 4e-3), [4e-3, 4e-3, 0.0]), 0.0),
        ("corner to corner", at(cube("b", 4e-3), [4e-3, 4e-3, 4e-3]), 0.0),
        ("half a nanometre apart", at(cube("b", 4e-3), [4e-3 + 0.5e-9, 0.0, 0.0]), 0.0),
        ("half a nanometre deep", at(cube("b", 4e-3), [4e-3 - 0.5e-9, 0.0, 0.0]), 8e-15),
        ("the same surface twice", cube("b", 4e-3), 64e-9),
        ("a plate through it", block("b", [9e-3, 9e-3, 1e-3], [0.0; 3]), 16e-9),
    ] {
        for objects in [vec![cube("a", 4e-3), b.clone()], turned(vec![cube("a", 4e-3), b])] {
            let sample = load(&scene(objects)).unwrap();
            assert_eq!(sample.objects[0].cut_by, [1], "{what}");
            assert!(sample.objects[1].cut_by.is_empty(), "{what}");
            let left = sample.objects[0].volume;
            assert!((left - (64e-9 - shared)).abs() < 1e-19, "{what}: {left:e}");
            assert!(is_closed(&sample), "{what}");
            assert!(sample.components.iter().all(|it| it.outside.is_none()), "{what}");
        }
    }
}

#[test]
fn objects_without_contact_keep_every_bit() {
    let apart = || {
        vec![cube("box", 8e-3), at(cube("core", 2e-3), [1e-3; 3]), at(cube("far", 1e-3), [9e-3; 3])]
    };
    let alone = load(&scene(apart())).unwrap();
    let mut more = apart();
    more.push(at(cube("touching", 1e-3), [10e-3, 9e-3, 9e-3]));
    let sample = load(&scene(more)).unwrap();
    let count = alone.objects[..2].iter().map(|object| object.triangles).sum::<usize>();
    assert_eq!(sample.triangles[..count], alone.triangles[..count]);
    assert_eq!(sample.vertices[..16], alone.vertices[..16]);
    assert_eq!(sample.components[..2], alone.components[..2]);
    assert_eq!(sample.objects[2].cut_by, [3]);
}

#[test]
fn three_that_share_a_corner_are_cut_in_their_order() {
    // Unit cubes of 2 mm, each moved by 1 mm along one axis more.
    let place = |k: usize| [0, 1, 2].map(|axis| if axis < k { 1e-3 } else { 0.0 });
    let objects = || (0..3).map(|k| at(cube(&format!("{k}"), 2e-3), place(k))).collect::<Vec<_>>();
    for objects in [objects(), turned(objects())] {
        let sample = load(&scene(objects)).unwrap();
        // 0 loses half of it to 1; of the rest a quarter is in 2's y, none in its x.
        let want = [4e-9, 4e-9, 8e-9];
        for (got, want) in volumes(&sample).iter().zip(want) {
            assert!(close(*got, want, 1e-10), "{:?}", volumes(&sample));
        }
        assert_eq!(sample.objects[0].cut_by, [1, 2]);
        assert!(is_closed(&sample));
    }
}

#[test]
fn content_of_a_container_is_cut_out_of_it_only_where_both_are_crossed() {
    // A bar crosses the wall of the box, and one ball in it; another ball stands free.
    let ball = |name: &str, x: f64| {
        at(shape(name, Shape::Sphere { radius: 1e-3, sides: Some(24) }), [x, 0.0, 0.0])
    };
    let objects = vec![
        cube("box", 10e-3),
        ball("crossed", 2e-3),
        ball("free", -3e-3),
        block("bar", [6e-3, 0.5e-3, 0.5e-3], [5e-3, 0.0, 0.0]),
    ];
    let sample = load(&scene(objects)).unwrap();
    assert_eq!(sample.objects[0].cut_by, [1, 3]);
    assert_eq!(sample.objects[1].cut_by, [3]);
    assert!(outsides(&sample, 1).iter().all(Option::is_none), "it stands in a bore of the box");
    assert_eq!(outsides(&sample, 2), [Some(0)]);
    assert_eq!(outsides(&sample, 3), [None]);
    assert!(is_closed(&sample));
}

#[test]
fn bar_within_a_container_cuts_its_content_and_not_the_container() {
    let objects = vec![
        cube("box", 10e-3),
        at(cube("core", 2e-3), [0.0; 3]),
        block("bar", [6e-3, 0.5e-3, 0.5e-3], [0.0; 3]),
    ];
    let sample = load(&scene(objects)).unwrap();
    assert!(sample.objects[0].cut_by.is_empty());
    assert_eq!(sample.objects[1].cut_by, [2]);
    assert!(close(sample.objects[1].volume, 8e-9 - 0.25e-6 * 2e-3, 1e-10));
    assert_eq!((outsides(&sample, 1), outsides(&sample, 2)), (vec![Some(0)], vec![Some(0)]));
}

#[test]
fn voids_and_parts_of_one_object_keep_their_meaning() {
    // A hollow cube, and a part apart from it; a plug goes through the wall into the void.
    let hollow = Arrays::cube(8e-3)
        .and(Arrays::cube(6e-3).turned())
        .and(Arrays::cube(1e-3).moved([9e-3, 0.0, 0.0]));
    let plug = block("plug", [1e-3, 1e-3, 2e-3], [0.0, 0.0, 3e-3]);
    let sample = load(&scene(vec![hollow.object("hollow"), plug])).unwrap();
    assert!(close(sample.objects[0].volume, 512e-9 - 216e-9 + 1e-9 - 1e-9, 1e-10));
    // The part that nothing meets comes first, as it was.
    assert!(close(sample.components[0].volume, 1e-9, 1e-12));
    // The bore joins the void and the outside to one surface.
    assert_eq!(sample.components.iter().filter(|it| it.object == 0).count(), 2);
    assert!(is_closed(&sample));
}

#[test]
fn void_of_a_later_object_shows_the_earlier_one_in_it() {
    let hollow = Arrays::cube(4e-3).and(Arrays::cube(0.5e-3).turned()).object("hollow");
    let ball = |sides| shape("ball", Shape::Sphere { radius: 1e-3, sides });
    for inner in [cube("cube", 1e-3), ball(Some(64)), ball(None)] {
        let sample = load(&scene(vec![inner, hollow.clone()])).unwrap();
        let [inner, hollow] = &sample.objects[..] else { panic!("two objects") };
        assert!(close(inner.volume, 0.125e-9, 1e-9), "{}: {:e}", inner.name, inner.volume);
        assert_eq!(inner.cut_by, [1]);
        assert!(close(hollow.volume, 64e-9 - 0.125e-9, 1e-9));
        assert_eq!(outsides(&sample, 0), [None]);
        assert_eq!(outsides(&sample, 1), [None, None]);
        assert!(is_closed(&sample));
    }
    // A later object in the void is in the earlier one.
    let core = cube("core", 0.2e-3);
    let sample = load(&scene(vec![cube("cube", 1e-3), hollow, core])).unwrap();
    assert_eq!(outsides(&sample, 2), [Some(0)]);
    assert!(close(sample.objects[0].volume, 0.125e-9, 1e-9));
}

#[test]
fn accepted_open_mesh_is_cut_with_its_holes_closed() {
    // A triangle of a face, a whole face, and all around one corner: flat patches make the cube, or
    // leave the corner out.
    let whole = Arrays::cube(2e-3);
    let corner = whole.1[0][0];
    let side = |it: [u32; 3], y: f64| it.iter().all(|k| (whole.0[*k as usize][1] - y).abs() < 1e-9);
    let without = |gone: &dyn Fn(usize, [u32; 3]) -> bool| {
        let kept = (0..).zip(&whole.1).filter(|(k, it)| !gone(*k, **it)).map(|it| *it.1);
        Arrays(whole.0.clone(), kept.collect())
    };
    let last = whole.1.len() - 1;
    for (what, open, holes) in [
        ("a triangle", without(&|k, _| k == last), 1),
        ("two opposite faces", without(&|_, it| side(it, 1e-3) || side(it, -1e-3)), 2),
        ("a corner", without(&|_, it| it.contains(&corner)), 1),
    ] {
        for (first, at_x) in [(true, 1.5e-3), (false, 1.5e-3), (false, -1.5e-3)] {
            let mut open = at(open.clone().object("open"), [at_x, 0.0, 0.0]);
            open.allow_defects = true;
            let solid = cube("solid", 2e-3);
            let objects = if first { vec![open, solid] } else { vec![solid, open] };
            let sample = load(&scene(objects)).unwrap();
            let cut = &sample.objects[0];
            assert_eq!(cut.cut_by, [1], "{what}");
            if what != "a corner" {
                assert!(close(cut.volume, 6e-9, 1e-9), "{what}: {:e}", cut.volume);
            }
            let warned = &sample.objects[usize::from(!first)].warnings;
            let words = format!("{holes} holes in it");
            assert!(warned.iter().any(|it| it.contains(&words)), "{what}: {warned:?}");
            if first {
                assert!(is_closed(&sample), "{what}");
            }
        }
    }
}

#[test]
fn mesh_that_crosses_itself_and_is_accepted_is_cut_all_the_same() {
    let crossing = Arrays::cube(2e-3).and(Arrays::cube(2e-3).moved([1e-3, 0.3e-3, 0.2e-3]));
    let mut crossing = crossing.object("crossing");
    crossing.allow_defects = true;
    let slab = block("slab", [9e-3, 9e-3, 9e-3], [0.0, 0.0, 4.5e-3]);
    let sample = load(&scene(vec![crossing, slab])).unwrap();
    assert_eq!(sample.objects[0].cut_by, [1]);
    let below = 4e-9 + 4.0e-6 * 0.8e-3 - 1e-3 * 1.7e-3 * 0.8e-3;
    assert!(close(sample.objects[0].volume, below, 1e-9), "{:e}", sample.objects[0].volume);
}

#[test]
fn hundred_plates_face_to_face_fill_their_stack() {
    let plate = |k: i32| {
        block(&format!("{k}"), [3e-3, 2e-3, 4e-5], [0.0, 0.0, 4e-5 * (f64::from(k) - 49.5)])
    };
    for objects in [(0..100).map(plate).collect(), turned((0..100).map(plate).collect())] {
        let sample = load(&scene(objects)).unwrap();
        assert!(close(volumes(&sample).iter().sum(), 24e-9, 1e-9));
        assert!(volumes(&sample).iter().all(|volume| close(*volume, 0.24e-9, 1e-6)));
        assert!(is_closed(&sample));
    }
}

#[test]
fn objects_that_overlap_are_reported_and_objects_that_touch_are_not() {
    let bore = |phase: f64| {
        let mut prism = shape("x", Shape::Prism { radius: 2.5e-3, height: 2e-3, sides: 64 });
        prism.placement.rotate = vec![([0.0, 0.0, 1.0], phase)];
        prism
    };
    let step = std::f64::consts::TAU / 64.0;
    let bar = block("b", [1e-3, 1e-3, 6e-3], [0.0; 3]);
    let beside = |x: f64, z: f64| vec![cube("a", 4e-3), at(cube("b", 2e-3), [x, 0.0, z])];
    for (what, objects, overlap) in [
        ("overlap", beside(2.7e-3, 0.0), true),
        ("overlap of 10 nm, sides flush", beside(3e-3 - 10e-9, 1e-3), true),
        ("bar through a plate", vec![block("a", [4e-3, 4e-3, 1e-3], [0.0; 3]), bar], true),
        ("covered", vec![cube("a", 1e-3), cube("b", 4e-3)], true),
        ("half a step apart", vec![bore(0.0), bore(step / 2.0)], true),
        ("face on face", beside(3e-3, 1.5e-3), false),
        ("corner on corner", vec![cube("a", 2e-3), at(cube("b", 2e-3), [2e-3; 3])], false),
        ("gap of half a micrometre", beside(3e-3 + 0.5e-6, 0.0), false),
        ("nested", vec![cube("a", 4e-3), cube("b", 2e-3)], false),
    ] {
        let (sample, refusals) = load_lenient(&scene(objects)).unwrap();
        assert!(refusals.is_empty(), "{refusals:?}");
        let want: &[[u32; 2]] = if overlap { &[[0, 1]] } else { &[] };
        assert_eq!(sample.overlaps, want, "{what}");
    }
}

#[test]
fn cuts_have_the_same_bits_every_time() {
    let objects = || -> Vec<Object> {
        let one = |k: i32| {
            let x = 0.7e-3 * f64::from(k % 4);
            at(
                shape(&format!("{k}"), Shape::Sphere { radius: 1e-3, sides: Some(20) }),
                [x, 0.3e-3 * f64::from(k), 0.0],
            )
        };
        (0..8).map(one).collect()
    };
    let first = load(&scene(objects())).unwrap();
    for _ in 0..5 {
        let again = load(&scene(objects())).unwrap();
        assert_eq!(again.vertices, first.vertices);
        assert_eq!(again.triangles, first.triangles);
        assert_eq!(again.components, first.components);
    }
}
