//! Gaps between exact shapes, instances and meshes, against pairs whose distance is known by how they
//! were placed, and against all pairs.

use beamlet::geometry::{Contact, ContactKind};
use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Instances, Object, Shape};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::set_up::{at, block, cube, scene, shape};

fn contacts(objects: Vec<Object>) -> Vec<Contact> {
    let (sample, refusals) = load_lenient(&scene(objects)).unwrap();
    assert!(refusals.is_empty(), "{refusals:?}");
    sample.contacts
}

/// Objects, width and number of pairs of gaps.
fn gaps(contacts: &[Contact]) -> Vec<([u32; 2], f64, u64)> {
    let gap = |it: &Contact| match it.kind {
        ContactKind::Gap { width } => (it.objects, width, it.pairs),
        _ => panic!("{it:?}"),
    };
    contacts.iter().map(gap).collect()
}

fn sphere(radius: f64) -> Shape {
    Shape::Sphere { radius, sides: None }
}

fn cylinder(radius: f64, height: f64) -> Shape {
    Shape::Cylinder { radius, height, sides: None }
}

/// A point of the surface of a shape that a plane touches there, and the normal.
fn touched(shape: &Shape, [u, v, w]: [f64; 3]) -> [DVec3; 2] {
    let (sin, cos) = (std::f64::consts::TAU * u).sin_cos();
    let height = 2.0 * v - 1.0;
    let across = (1.0 - height * height).sqrt();
    let onto_sphere = DVec3::new(across * cos, across * sin, height);
    let side = |radius: f64, upper: f64, length: f64| {
        let slope = (radius - upper) / length;
        let at = radius + (upper - radius) * v;
        let place = DVec3::new(at * cos, at * sin, (v - 0.5) * length);
        [place, DVec3::new(cos, sin, slope).normalize()]
    };
    match *shape {
        Shape::Sphere { radius, .. } => [radius * onto_sphere, onto_sphere],
        Shape::Ellipsoid { semi_axes, .. } => {
            let axes = DVec3::from_array(semi_axes);
            [axes * onto_sphere, (onto_sphere / axes).normalize()]
        }
        Shape::Tube { outer, height, .. } if w < 0.5 => side(outer, outer, height),
        Shape::Tube { outer, inner, height, .. } => {
            let across = inner + (outer - inner) * v;
            [DVec3::new(across * cos, across * sin, 0.5 * height), DVec3::Z]
        }
        Shape::Cylinder { radius, height, .. } if w < 0.5 => side(radius, radius, height),
        Shape::Cylinder { radius, height, .. } => {
            [DVec3::new(radius * v * cos, radius * v * sin, 0.5 * height), DVec3::Z]
        }
        Shape::Cone { radius, top_radius, height, .. } if w < 0.7 => {
            side(radius, top_radius, height)
        }
        Shape::Cone { radius, height, .. } => {
            [DVec3::new(radius * v * cos, radius * v * sin, -0.5 * height), -DVec3::Z]
        }
        Shape::Box { size } => {
            let at = DVec3::new(u - 0.5, v - 0.5, 0.5) * DVec3::from_array(size);
            // A corner of it, or a point of a face.
            if w < 0.3 {
                [0.5 * DVec3::from_array(size), DVec3::ONE.normalize()]
            } else {
                [at, DVec3::Z]
            }
        }
        _ => unreachable!(),
    }
}

fn any_shape() -> impl Strategy<Value = Shape> {
    let size = || 10e-6..100e-6;
    prop_oneof![
        size().prop_map(sphere),
        [size(), size(), size()].prop_map(|semi_axes| Shape::Ellipsoid { semi_axes, sides: None }),
        (size(), size()).prop_map(|(radius, height)| cylinder(radius, height)),
        (size(), 0.0..1.0, size()).prop_map(|(radius, share, height)| Shape::Cone {
            radius,
            top_radius: share * radius,
            height,
            sides: None
        }),
        [size(), size(), size()].prop_map(|size| Shape::Box { size }),
        (size(), 0.1..0.95, size()).prop_map(|(outer, share, height)| Shape::Tube {
            outer,
            inner: share * outer,
            height,
            sides: None
        }),
    ]
}

fn placed(name: &str, of: &Shape, turns: &[DQuat], position: DVec3) -> Object {
    let mut object = at(shape(name, of.clone()), position.to_array());
    let turn = |turn: &DQuat| {
        let (axis, angle) = turn.to_axis_angle();
        (axis.to_array(), angle)
    };
    object.placement.rotate = turns.iter().map(turn).collect();
    object
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 512, rng_seed: RngSeed::Fixed(3), ..ProptestConfig::default() })]

    /// Two shapes whose points of contact with two parallel planes lie opposite each other: their
    /// distance is that of the planes.
    #[test]
    fn gap_between_two_shapes_is_the_distance_of_separating_planes(
        shapes in [any_shape(), any_shape()],
        at in prop::array::uniform2([0.0..1.0, 0.02..0.98, 0.0..1.0]),
        spin in 0.0..6.0,
        turn in [-1.0..1.0, -1.0..1.0, -1.0..1.0],
        width in (2e-9_f64.ln()..3e-6_f64.ln()).prop_map(f64::exp),
    ) {
        let [first, second] = [0, 1].map(|k| touched(&shapes[k], at[k]));
        let facing = DQuat::from_axis_angle(first[1], spin) * DQuat::from_rotation_arc(second[1], -first[1]);
        let all = DQuat::from_scaled_axis(3.0 * DVec3::from_array(turn));
        let position = all * (first[0] + width * first[1] - facing * second[0]);
        let objects = vec![
            placed("a", &shapes[0], &[all], DVec3::ZERO),
            placed("b", &shapes[1], &[facing, all], position),
        ];
        let found = gaps(&contacts(objects));
        if width > 1e-6 {
            prop_assert!(found.is_empty(), "{found:?}");
        } else {
            prop_assert_eq!(found.len(), 1);
            let off = (found[0].1 - width).abs();
            prop_assert!(found[0].0 == [0, 1] && found[0].2 == 1);
            prop_assert!(off < 1e-3 * width + 2e-11, "{:e} for {width:e}", found[0].1);
        }
    }
}

/// Numbers from 0 to 1, the same at every run.
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Spheres that do not meet: middles and radii, m.
fn loose_spheres(count: usize, size: f64) -> Vec<(DVec3, f64)> {
    let mut draws = Draws(11);
    let mut all: Vec<(DVec3, f64)> = Vec::new();
    while all.len() < count {
        let at = size * DVec3::new(draws.next(), draws.next(), draws.next());
        let radius = 5e-6 * (0.6 + draws.next());
        let free = |it: &(DVec3, f64)| it.0.distance(at) - it.1 - radius > 3e-9;
        if all.iter().all(free) {
            all.push((at, radius));
        }
    }
    all
}

/// Least gap and how many are under a micrometre, of all pairs that a condition lets through.
fn all_pairs(gap: impl Fn(usize, usize) -> Option<f64>, count: usize) -> (f64, u64) {
    let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
    pairs
        .filter_map(|(a, b)| gap(a, b).filter(|it| *it <= 1e-6))
        .fold((f64::INFINITY, 0), |all, it| (all.0.min(it), all.1 + 1))
}

fn close(found: &([u32; 2], f64, u64), objects: [u32; 2], want: (f64, u64)) {
    let near = (found.1 - want.0).abs() < 0.01 * want.0;
    assert!(found.0 == objects && near && found.2 == want.1, "{found:?}: {objects:?}, {want:?}");
}

/// Objects of one shape each, which stand where files say.
fn instanced(objects: Vec<(Object, String)>) -> Vec<Contact> {
    let directory = tempfile::tempdir().unwrap();
    let mut scene = scene(Vec::new());
    scene.directory = directory.path().to_owned();
    for (mut object, rows) in objects {
        let name = format!("{}.csv", object.name);
        std::fs::write(directory.path().join(&name), rows).unwrap();
        object.instances = Some(Instances::File(name.into()));
        scene.objects.push(object);
    }
    let (sample, refusals) = load_lenient(&scene).unwrap();
    assert!(refusals.is_empty(), "{refusals:?}");
    sample.contacts
}

#[test]
fn gaps_of_spheres_match_all_pairs() {
    let spheres = loose_spheres(3000, 170e-6);
    let gap =
        |a: usize, b: usize| spheres[a].0.distance(spheres[b].0) - spheres[a].1 - spheres[b].1;
    let rows = |which: usize| {
        let of = spheres.iter().enumerate().filter(|it| it.0 % 2 == which);
        of.fold("x_m,y_m,z_m,scale\n".to_owned(), |text, (_, (at, radius))| {
            format!("{text}{:e},{:e},{:e},{:e}\n", at.x, at.y, at.z, radius / 1e-6)
        })
    };
    let found = instanced(vec![
        (shape("even", sphere(1e-6)), rows(0)),
        (shape("odd", sphere(1e-6)), rows(1)),
    ]);
    let found = gaps(&found);
    let of = |first: usize, second: usize| {
        let is_of = move |a: usize, b: usize| {
            [a % 2, b % 2] == [first, second] || [b % 2, a % 2] == [first, second]
        };
        all_pairs(|a, b| is_of(a, b).then(|| gap(a, b)), spheres.len())
    };
    assert_eq!(found.len(), 3);
    close(&found[0], [0, 0], of(0, 0));
    close(&found[1], [0, 1], of(0, 1));
    close(&found[2], [1, 1], of(1, 1));
    assert!(found.iter().all(|it| it.2 > 50), "{found:?}");
}

#[test]
fn gaps_of_tilted_fibres_match_all_pairs() {
    let mut draws = Draws(5);
    let mut axes: Vec<[f64; 2]> = Vec::new();
    while axes.len() < 600 {
        let at = [200e-6 * draws.next(), 200e-6 * draws.next()];
        if axes.iter().all(|it| (it[0] - at[0]).hypot(it[1] - at[1]) > 6.003e-6) {
            axes.push(at);
        }
    }
    let rows = axes
        .iter()
        .fold("x_m,y_m,z_m\n".to_owned(), |text, [x, y]| format!("{text}{x:e},{y:e},0\n"));
    for sides in [None, Some(16)] {
        // Corners of a prism of the same section stand 0.04 um off.
        let radius = if sides.is_none() { 3e-6 } else { 2.95e-6 };
        let of = Shape::Cylinder { radius, height: 3e-3, sides };
        let mut fibres = shape("fibres", of);
        fibres.placement.rotate = vec![([1.0, 0.3, 0.1], 0.8)];
        let found = gaps(&instanced(vec![(fibres, rows.clone())]));
        let gap = |a: usize, b: usize| {
            Some((axes[a][0] - axes[b][0]).hypot(axes[a][1] - axes[b][1]) - 2.0 * radius)
        };
        let want = all_pairs(gap, axes.len());
        assert_eq!(found.len(), 1);
        if sides.is_none() {
            close(&found[0], [0, 0], want);
        } else {
            // Facets stand up to 0.06 um off the cylinder on either side.
            assert!((found[0].1 - want.0).abs() < 0.12e-6, "{found:?}: {want:?}");
            assert!(found[0].2 > want.1 / 2 && found[0].2 < 2 * want.1, "{found:?}: {want:?}");
        }
    }
}

#[test]
fn gaps_of_cubes_match_all_pairs() {
    let mut draws = Draws(7);
    let mut cubes: Vec<DVec3> = Vec::new();
    let gap = |a: DVec3, b: DVec3| ((a - b).abs() - 1e-5).max(DVec3::ZERO).length();
    while cubes.len() < 1500 {
        let at = 200e-6 * DVec3::new(draws.next(), draws.next(), draws.next());
        if cubes.iter().all(|it| gap(*it, at) > 3e-9) {
            cubes.push(at);
        }
    }
    let want = all_pairs(|a, b| Some(gap(cubes[a], cubes[b])), cubes.len());
    // All together: edges and faces along the axes, and not.
    for turn in [DQuat::IDENTITY, DQuat::from_xyzw(0.3, -0.5, 0.2, 0.8).normalize()] {
        let header = "x_m,y_m,z_m,qw,qx,qy,qz\n".to_owned();
        let rows = cubes.iter().fold(header, |text, at| {
            let (at, q) = (turn * *at, turn);
            format!("{text}{:e},{:e},{:e},{},{},{},{}\n", at.x, at.y, at.z, q.w, q.x, q.y, q.z)
        });
        let found = gaps(&instanced(vec![(cube("cubes", 1e-5), rows)]));
        assert_eq!(found.len(), 1);
        // Corners of the mesh are rounded to f32.
        assert!((found[0].1 - want.0).abs() < 1e-11 && found[0].2 == want.1, "{found:?}: {want:?}");
    }
}

#[test]
fn gaps_are_listed_between_shapes_instances_and_meshes() {
    let gap = 0.4e-6;
    // A ball in the bore of a tube, one above a mesh, and a fibre beside that.
    let tube = Shape::Tube { outer: 1.3e-3, inner: 0.7e-3, height: 0.6e-3, sides: None };
    let mesh = at(shape("mesh", Shape::Sphere { radius: 2e-4, sides: Some(12) }), [3e-3, 0.0, 0.0]);
    let top = {
        let (sample, _) = load_lenient(&scene(vec![mesh.clone()])).unwrap();
        sample.vertices.iter().map(|it| it[2]).fold(0.0, f64::max)
    };
    let found = contacts(vec![
        shape("tube", tube),
        shape("ball", sphere(0.7e-3 - gap)),
        mesh,
        at(shape("above", sphere(1e-4)), [3e-3, 0.0, top + 1e-4 + gap]),
        block("plate", [1e-3, 1e-3, 1e-4], [0.0, 0.0, 0.3e-3 + 0.5e-4 + 0.7e-3]),
    ]);
    let found = gaps(&found);
    assert_eq!(found.len(), 2, "{found:?}");
    close(&found[0], [0, 1], (gap, 1));
    assert!(found[1].0 == [2, 3] && (found[1].1 - gap).abs() < 1e-9, "{found:?}");
    // In its container, next to the wall, there is no gap; next to another in there, there is.
    let found = contacts(vec![
        cube("block", 1e-3),
        shape("bore", cylinder(2e-4, 0.8e-3)),
        at(shape("pin", cylinder(1e-4, 0.7e-3)), [1e-4 - gap, 0.0, 0.0]),
        at(shape("ball", sphere(5e-5)), [-0.5e-4 - gap - gap, 0.0, 0.0]),
    ]);
    let found = gaps(&found);
    assert_eq!(found.len(), 1, "{found:?}");
    close(&found[0], [2, 3], (gap, 1));
}

#[test]
fn what_lies_in_the_bore_of_a_tube_is_a_gap_away_from_its_wall() {
    let gap = 0.4e-6;
    let tube = |outer, inner, height| Shape::Tube { outer, inner, height, sides: None };
    let tilted = |mut object: Object| {
        object.placement.rotate = vec![([1.0, 0.3, 0.0], 0.4)];
        object
    };
    // A wire longer than the tube, beside its axis; a disc; a tube; a fine ball as a mesh; nothing where
    // they stand in the mouth.
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 0.3, 0.0).normalize(), 0.4);
    let beside =
        |object: Object, own: [f64; 3]| at(tilted(object), (turn * DVec3::from(own)).to_array());
    let inside = [
        beside(shape("wire", cylinder(1e-4, 9e-3)), [0.4e-3 - gap, 0.0, 0.0]),
        beside(shape("disc", cylinder(0.5e-3 - gap, 1e-4)), [0.0; 3]),
        beside(shape("tube", tube(0.5e-3 - gap, 1e-4, 1e-3)), [0.0; 3]),
        beside(shape("long tube", tube(0.5e-3 - gap, 1e-4, 7e-3)), [0.0; 3]),
        beside(
            shape("rod", Shape::Prism { radius: 0.5e-3 - gap, height: 1e-3, sides: 6 }),
            [0.0; 3],
        ),
    ];
    for body in inside {
        let name = body.name.clone();
        for swapped in [false, true] {
            let outer = tilted(shape("outer", tube(1e-3, 0.5e-3, 5e-3)));
            let mut both = vec![outer, body.clone()];
            if swapped {
                both.reverse();
            }
            let found = gaps(&contacts(both));
            assert_eq!(found.len(), 1, "{name}: {found:?}");
            assert!(found[0].0 == [0, 1] && (found[0].1 - gap).abs() < 2e-9, "{name}: {found:?}");
        }
    }
    // Above the mouth of the bore, as near to the plane of its end as the gap: its edge is farther away.
    let plug = at(shape("plug", cylinder(0.3e-3, 1e-3)), [0.0, 0.0, 2.5e-3 + 0.5e-3 + gap]);
    let found = contacts(vec![shape("outer", tube(1e-3, 0.5e-3, 5e-3)), plug]);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn covered_shapes_are_listed_with_what_they_share() {
    let rows = "x_mm,y_mm,z_mm\n0,0,0\n0.3,0.1,0.2\n";
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("at.csv"), rows).unwrap();
    let volume = 2.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-12;
    for (cover, depth) in [
        (shape("cover", sphere(1e-3)), 0.9e-3),
        (shape("cover", cylinder(2e-3, 2e-3)), 1e-3),
        (shape("cover", Shape::Ellipsoid { semi_axes: [2e-3, 1e-3, 3e-3], sides: None }), 1e-3),
        (cube("cover", 4e-3), 2e-3),
    ] {
        let mut covered = shape("covered", sphere(1e-4));
        covered.instances = Some(Instances::File("at.csv".into()));
        let mut scene = scene(vec![covered, cover]);
        scene.directory = directory.path().to_owned();
        let (sample, _) = load_lenient(&scene).unwrap();
        let [Contact { objects: [0, 1], kind: ContactKind::Overlap { volume: v, depth: d }, .. }] =
            sample.contacts[..]
        else {
            panic!("{:?}", sample.contacts)
        };
        assert!((v / volume - 1.0).abs() < 1e-9 && (d / depth - 1.0).abs() < 0.05, "{v:e}, {d:e}");
        assert_eq!(sample.contacts[0].pairs, 2);
    }
}
