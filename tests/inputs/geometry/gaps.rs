//! Shapes on either side of a plane, apart or not, by how they were placed.

use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Object, Shape};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::set_up::{at, scene, shape};

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

/// Cases of a property; all with `BEAMLET_ALL`, as `.ci/long` has it.
fn cases() -> u32 {
    if std::env::var_os("BEAMLET_ALL").is_some() { 512 } else { 48 }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: cases(), rng_seed: RngSeed::Fixed(3), ..ProptestConfig::default() })]

    /// Two shapes whose points of contact with two parallel planes lie opposite each other: they are apart
    /// if the planes are, and overlap if each reaches through the plane of the other. Beside a box exact
    /// shapes have facets up to 10 nm inside their surface, and the tip of a corner is thinner than deep:
    /// the overlap is 30 nm deeper.
    #[test]
    fn shapes_overlap_if_no_plane_separates_them(
        shapes in [any_shape(), any_shape()],
        at in prop::array::uniform2([0.0..1.0, 0.02..0.98, 0.0..1.0]),
        spin in 0.0..6.0,
        turn in [-1.0..1.0, -1.0..1.0, -1.0..1.0],
        width in (4e-9_f64.ln()..1e-6_f64.ln()).prop_map(f64::exp),
    ) {
        let [first, second] = [0, 1].map(|k| touched(&shapes[k], at[k]));
        let facing = DQuat::from_axis_angle(first[1], spin) * DQuat::from_rotation_arc(second[1], -first[1]);
        let all = DQuat::from_scaled_axis(3.0 * DVec3::from_array(turn));
        let deeper = if shapes.iter().any(|it| matches!(it, Shape::Box { .. })) { 30e-9 } else { 0.0 };
        for (width, want) in [(width, &[][..]), (-width - deeper, &[[0, 1]][..])] {
            let position = all * (first[0] + width * first[1] - facing * second[0]);
            let objects = vec![
                placed("a", &shapes[0], &[all], DVec3::ZERO),
                placed("b", &shapes[1], &[facing, all], position),
            ];
            let (sample, refusals) = load_lenient(&scene(objects)).unwrap();
            prop_assert!(refusals.is_empty(), "{:?}", refusals);
            prop_assert_eq!(sample.objects[0].cut_by.is_empty(), want.is_empty());
            prop_assert_eq!(&sample.overlaps[..], want);
        }
    }
}
