//! Crossings of single rays in order, which pictures of the sample are made of.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![expect(clippy::cast_possible_truncation, reason = "rays are rounded to f32 as the engine's are")]

use crate::reference::rays::{Order, Sample};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Mesh, Random, body, prism};
use crate::support::{Worst, engine, sample};
use beamlet::Backend;
use beamlet::scene::Scene;
use beamlet::{Ray, SurfaceCrossing};

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
    Ray::new(0, [x, z], [0.0; 2])
}

fn crossings(rays: &[Ray], most: u32) -> Vec<Vec<SurfaceCrossing>> {
    let scene = Scene::from_toml(BOXES, ".").unwrap();
    let engine = engine(Backend::Bvh);
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
    let words = |met: &SurfaceCrossing| (met.object, u32::from(met.entering));
    assert_eq!(found[0].iter().map(words).collect::<Vec<_>>(), [(0, 1), (1, 1), (1, 0), (0, 0)]);
    assert_eq!(found[1].iter().map(words).collect::<Vec<_>>(), [(0, 1), (0, 0)]);
    assert!(found[2].is_empty(), "beside the sample");

    let mut place = Worst::new("place of a crossing, m", 2e-7);
    let mut normal = Worst::new("normal of a crossing", 0.02);
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
    place.holds();
    normal.holds();
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

/// The mesh with the corners of every triangle named from another one of them on.
fn renamed(mut mesh: Mesh, by: usize) -> Mesh {
    mesh.triangles.iter_mut().for_each(|t| t.rotate_left(by));
    mesh
}

#[test]
fn y_is_that_of_the_plane_on_long_facets_that_lean_towards_the_beam() {
    const SOURCE: f64 = 1.21;
    // f32 holds coordinates of 10 mm to 5e-10 m, and a normal times 10 mm as well.
    let mut worst = Worst::new("y of a crossing times the cosine of incidence, m", 4e-9);
    let engine = engine(Backend::Bvh);
    let mut random = Random::new(21);
    for tilt in sample((0..40).collect(), 4) {
        // 1,000 facets 25 um wide and 20 mm long.
        let turned = |by: usize| {
            let angles = [0.035 * f64::from(tilt), 0.5 * f64::from(tilt)];
            let mesh = renamed(prism(4e-3, 20e-3, 1000, 0.3), by);
            mesh.turned([1.0, 0.0, 0.0], angles[0]).turned([0.0, 1.0, 0.0], angles[1]).rounded()
        };
        let rays: Vec<Ray> = (0..400)
            .map(|_| {
                let mut at = || random.between(-5e-3, 5e-3);
                let (x, z) = (at(), at());
                let slope = [x / SOURCE, z / SOURCE].map(|s| s as f32);
                Ray::new(0, [x as f32, z as f32], slope)
            })
            .collect();
        for by in [0, 1] {
            let bodies = [body(turned(by), 50.0, 4.6e-7)];
            let truth = Sample::new(&bodies, SOURCE, 0.0);
            let mut setup = Setup::paper([16, 16]);
            (setup.sample_mask, setup.detector_mask) = (None, None);
            let simulation = engine.prepare(&scenes::scene(&setup, &bodies, &[0.0])).unwrap();
            let compare = |ray: usize, met: &[SurfaceCrossing]| {
                let [[x, z], slope] = [rays[ray].point, rays[ray].slope];
                let slope = slope.map(f64::from);
                let from =
                    [f64::from(x) - SOURCE * slope[0], -SOURCE, f64::from(z) - SOURCE * slope[1]];
                let want = truth.trace(from, [slope[0], 1.0, slope[1]], 0.59, Order::First);
                assert_eq!(met.len(), want.crossings, "tilt {tilt}, {:?}", rays[ray]);
                for (met, (_, y)) in met.iter().zip(&want.met) {
                    let normal = met.normal.map(f64::from);
                    let along = normal[0] * slope[0] + normal[1] + normal[2] * slope[1];
                    worst.take((f64::from(met.y) - y) * along, || format!("tilt {tilt}, {met:?}"));
                }
            };
            simulation.crossings(&rays, 8, compare).unwrap();
        }
    }
    worst.holds();
}
