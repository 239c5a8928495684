//! Remainders of exact shapes that others cross: volumes, surroundings, contacts.

use super::solids::{Kind, Solid, cylinder, sphere};
use super::{direction, scene};
use crate::reference::surfaces::Random;
use crate::reference::vector::{scaled, unit};
use crate::support::{CARBON, WATER};
use beamlet::geometry;
use beamlet::geometry::ContactKind;
use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Instances, Object, Transport};
use std::f64::consts::PI;

fn objects(solids: &[Solid]) -> Vec<Object> {
    solids.iter().enumerate().map(|(k, it)| it.object(&format!("{k}"), "")).collect()
}

fn load(solids: &[Solid]) -> geometry::Sample {
    let constants: Vec<[f64; 2]> = (0..solids.len()).map(|k| [CARBON, WATER][k % 2]).collect();
    let scene = scene(objects(solids), &constants, Transport::Auto);
    geometry::load(&scene).expect("a sample")
}

/// Balls halved by the face of a rod: within 0.3 % of their volume.
#[test]
fn volumes_lost_to_many_shapes_are_those_of_closed_forms() {
    let radius = 0.2e-3;
    let ball = |k: usize| {
        let (sin, cos) = (f64::from(k as u32) * PI / 4.0).sin_cos();
        Solid::new(sphere(radius)).at([1e-3 * cos, 1e-3 * sin, 1.5e-3])
    };
    let mut solids = vec![Solid::new(cylinder(2e-3, 3e-3))];
    solids.extend((0..8).map(ball));
    let half = 2.0 / 3.0 * PI * radius.powi(3);
    let lost = 4.0 * PI * 1e-6 * 3e-3 - load(&solids).objects[0].volume;
    assert!((lost / (8.0 * half) - 1.0).abs() < 3e-3, "{lost} {}", 8.0 * half);
    // A shape that others take whole has no volume, to rounding.
    let whole = [cylinder(1e-3, 2e-3), cylinder(1.5e-3, 2e-3), cylinder(1.2e-3, 2e-3)];
    let left = load(&whole.map(Solid::new)).objects[0].volume;
    assert!(left.abs() < 1e-12 * PI * 1e-9, "{left}");
}

/// Facets of shapes that cross, in water: water is around them.
#[test]
fn facets_of_shapes_that_cross_keep_what_surrounds_them() {
    let sample = load(&[
        Solid::new(cylinder(5e-3, 10e-3)),
        Solid::new(cylinder(1e-3, 2e-3)),
        Solid::new(cylinder(0.5e-3, 3e-3)),
    ]);
    let meshes = sample.as_meshes();
    let mut seen = [0; 3];
    for component in &meshes.triangle_component {
        let component = &meshes.components[*component as usize];
        seen[component.object as usize] += 1;
        let around = if component.object == 0 { None } else { Some(0) };
        assert_eq!(component.outside, around, "{component:?}");
    }
    assert!(seen.iter().all(|it| *it > 0), "{seen:?}");
}

/// Balls that touch have a contact without area, and no gap, although facets lie apart.
#[test]
fn balls_that_touch_have_no_gap() {
    let (own, other) = (1e-3, 0.7e-3);
    for direction in [[1.0, 0.0, 0.0], [0.3, -1.0, 0.2], [0.5, 0.4, 2.0], [-1.0, 1.0, 1.0]] {
        let direction = unit(direction);
        let solids =
            [Solid::new(sphere(own)), Solid::new(sphere(other)).at(scaled(direction, own + other))];
        let scene = scene(objects(&solids), &[CARBON, WATER], Transport::Auto);
        let (sample, _) = load_lenient(&scene).expect("a sample");
        let [contact] = &sample.contacts[..] else { panic!("{:?}", sample.contacts) };
        let ContactKind::Touch { area } = contact.kind else { panic!("{contact:?}") };
        // Facets within 80 nm touch within some 20 um of the point.
        let off = [0, 1, 2].map(|k| contact.place[k] - own * direction[k]);
        let off = off.iter().map(|it| it * it).sum::<f64>().sqrt();
        assert!(area < PI * 4e-10 && off < 2e-5, "{contact:?}");
    }
}

/// The box around the box of a turned shape reaches out of a ball that the shape nearly fills.
#[test]
fn turned_shapes_lie_in_balls_that_they_nearly_fill() {
    let directory = tempfile::tempdir().expect("a folder");
    let mut random = Random::new(311);
    let mut table = String::from("x_um,y_um,z_um,axis_x,axis_y,axis_z,angle_deg\n");
    for k in 0..64_u32 {
        let [x, y, z] = direction(&mut random);
        let (column, row) = (4000 * (k % 8), 4000 * (k / 8));
        let angle = random.between(0.0, 180.0);
        table += &format!("{column},0,{row},{x},{y},{z},{angle}\n");
    }
    let path = directory.path().join("places.csv");
    std::fs::write(&path, table).expect("a file");
    let fill = |solid: Solid| {
        let mut object = solid.object("0", "");
        object.instances = Some(Instances::File(path.clone()));
        object
    };
    // The edges of the caps are at 0.99 of the radius of the ball.
    let prism = Kind::Prism { radius: 0.7e-3, half: 0.7e-3, sides: 12 };
    for inner in [cylinder(0.7e-3, 1.4e-3), prism] {
        let load = |solids: [Kind; 2]| {
            let objects = solids.map(|kind| fill(Solid::new(kind))).to_vec();
            let scene = scene(objects, &[CARBON, WATER], Transport::Auto);
            geometry::load(&scene).expect("a sample")
        };
        let nested = load([sphere(1e-3), inner]);
        let outside = nested.components.iter().filter(|it| it.object == 1).map(|it| it.outside);
        assert_eq!(outside.collect::<Vec<_>>(), vec![Some(0); 64], "{inner:?}");
        let covered = load([inner, sphere(1e-3)]);
        assert!(covered.components.iter().all(|it| it.object == 1), "{inner:?}");
    }
}
