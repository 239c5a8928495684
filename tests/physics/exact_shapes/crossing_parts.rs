//! Remainders of exact shapes that others cross: volumes, surroundings, contacts.

use super::scene;
use super::solids::{Solid, cylinder, sphere};
use crate::reference::vector::{scaled, unit};
use crate::support::{CARBON, WATER};
use beamlet::geometry;
use beamlet::geometry::ContactKind;
use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Object, Transport};
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
