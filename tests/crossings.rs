//! Crossings of single rays in order, which pictures of the sample are made of.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod support;

use beamlet::Backend;
use beamlet::scene::Scene;
use beamlet::trace::{MetSurface, Ray};

const BOXES: &str = r#"
source = { distance = "1 m", spot = "0 um", energy = "30 keV" }
detector = { distance = "2 m", pixels = [8, 8], pitch = "1 mm" }

[[object]]
name = "outer"
material = "water"
shape = { box = { size = ["4 mm", "6 mm", "4 mm"] } }

[[object]]
name = "inner"
material = "gold"
shape = { sphere = { radius = "1 mm", sides = 256 } }
"#;

fn parallel(x: f32, z: f32) -> Ray {
    Ray { x, z, slope_x: 0.0, slope_z: 0.0, view: 0 }
}

fn crossings(rays: &[Ray], most: u32) -> Vec<Vec<MetSurface>> {
    let scene = Scene::from_toml(BOXES, ".").unwrap();
    let engine = support::engine(Backend::Bvh);
    let simulation = engine.prepare(&scene).unwrap();
    let mut all = Vec::new();
    simulation
        .crossings(rays, most, |ray, met| {
            assert_eq!(ray, all.len(), "rays come in order");
            all.push(met.to_vec());
        })
        .unwrap();
    all
}

#[test]
fn crossings_come_front_to_back_with_place_object_and_normal() {
    let x = 0.3e-3_f32;
    let found = crossings(&[parallel(x, 0.1e-3), parallel(1.5e-3, 0.0), parallel(3e-3, 0.0)], 16);
    let words = |met: &MetSurface| (met.object, met.entering);
    assert_eq!(found[0].iter().map(words).collect::<Vec<_>>(), [(0, 1), (1, 1), (1, 0), (0, 0)]);
    assert_eq!(found[1].iter().map(words).collect::<Vec<_>>(), [(0, 1), (0, 0)]);
    assert!(found[2].is_empty(), "beside the sample");

    let mut place = support::Worst::new("place of a crossing, m", 2e-7);
    let mut normal = support::Worst::new("normal of a crossing", 0.02);
    // Half a facet's height of a sphere of 256 sides (7.5e-8 m) and f32 of mm (1e-10 m).
    let depth = (1e-3_f64.powi(2) - f64::from(x).powi(2) - 0.1e-3_f64.powi(2)).sqrt();
    for (met, (y, outward)) in found[0].iter().zip([
        (-3e-3, [0.0, -1.0, 0.0]),
        (-depth, [0.3, -depth * 1e3, 0.1]),
        (depth, [0.3, depth * 1e3, 0.1]),
        (3e-3, [0.0, 1.0, 0.0]),
    ]) {
        let at = met.y;
        place.take(f64::from(at) - y, || format!("y = {at}"));
        // A facet of 1/256 of the circumference is turned by up to 0.0123 from the sphere.
        let found = met.normal;
        for axis in 0..3 {
            normal.take(f64::from(found[axis]) - outward[axis], || format!("{found:?}"));
        }
    }
}

#[test]
fn no_more_crossings_are_given_than_asked_for_and_many_rays_go_in_batches() {
    let rays: Vec<Ray> =
        (0..60_000_u16).map(|i| parallel((f32::from(i % 100) - 50.0) * 1e-5, 0.0)).collect();
    let found = crossings(&rays, 3);
    assert_eq!(found.len(), rays.len());
    // Every hundredth ray is the same one, whatever batch it is in.
    for (i, met) in found.iter().enumerate() {
        assert_eq!(met, &found[i % 100], "ray {i}");
        assert_eq!(met.len(), 3, "ray {i}: of four crossings the first three");
    }
}
