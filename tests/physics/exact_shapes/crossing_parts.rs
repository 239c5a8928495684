//! Remainders of exact shapes that others cross: surroundings, overlaps.

use super::solids::{Kind, Solid, cylinder, sphere};
use super::{direction, scene};
use crate::reference::surfaces::Random;
use crate::reference::vector::{scaled, unit};
use crate::support::{CARBON, WATER};
use beamlet::geometry;
use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Instances, Object, Transport};

fn objects(solids: &[Solid]) -> Vec<Object> {
    solids.iter().enumerate().map(|(k, it)| it.object(&format!("{k}"), "")).collect()
}

fn load(solids: &[Solid]) -> geometry::Sample {
    let constants: Vec<[f64; 2]> = (0..solids.len()).map(|k| [CARBON, WATER][k % 2]).collect();
    let scene = scene(objects(solids), &constants, Transport::Auto);
    geometry::load(&scene).expect("a sample")
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

/// Balls that touch do not overlap, although their facets may cross; balls 5 nm closer do.
#[test]
fn balls_that_touch_do_not_overlap() {
    let (own, other) = (1e-3, 0.7e-3);
    for direction in [[1.0, 0.0, 0.0], [0.3, -1.0, 0.2], [0.5, 0.4, 2.0], [-1.0, 1.0, 1.0]] {
        for (closer, want) in [(0.0, &[][..]), (5e-9, &[[0, 1]][..])] {
            let at = scaled(unit(direction), own + other - closer);
            let solids = [Solid::new(sphere(own)), Solid::new(sphere(other)).at(at)];
            let scene = scene(objects(&solids), &[CARBON, WATER], Transport::Auto);
            let (sample, _) = load_lenient(&scene).expect("a sample");
            assert_eq!(sample.overlaps, want, "{direction:?} {closer}");
        }
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
