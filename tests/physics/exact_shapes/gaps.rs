//! Gaps between exact shapes: what is thinner than X-rays tunnel through changes nothing, and a wide
//! one of a denser medium reflects.

use super::solids::{Kind, Solid, cylinder};
use super::{rays_around, scene};
use crate::assemblies::{Bench, exact, grazing_rays};
use crate::reference::surfaces::Random;
use crate::support::{CARBON, Worst, backends};
use beamlet::geometry;
use beamlet::internals::interface::{FLAG_REFLECTED, RayResult};
use beamlet::scene::{Instances, MaterialSpec, Scene, Transport};
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

/// Mu and delta of the bodies: less than those of the carbon between and around them, which reflects
/// rays within 0.85 mrad.
const LIGHT: [f64; 2] = [20.0, 1e-7];
/// Lean of surfaces against the beam, rad.
const LEAN: f64 = 5e-4;

fn in_carbon(solids: &[(Solid, [f64; 2])]) -> Scene {
    let object = |(k, it): (usize, &(Solid, [f64; 2]))| it.0.object(&format!("{k}"), "");
    let constants: Vec<[f64; 2]> = solids.iter().map(|it| it.1).collect();
    let objects = solids.iter().enumerate().map(object).collect();
    let mut scene = scene(objects, &constants, Transport::Exact);
    let [mu, delta] = CARBON;
    scene.materials.insert("around".to_owned(), MaterialSpec::Constants { mu, delta });
    scene.surroundings = "around".to_owned();
    scene
}

/// Along x, and leaning against the beam.
fn across(kind: Kind) -> Solid {
    Solid::new(kind).turned([0.0, 1.0, 0.0], FRAC_PI_2).turned([0.0, 0.0, 1.0], LEAN)
}

/// Two bodies of 1 mm along x, faces of them a gap apart.
fn faces(kinds: [Kind; 2], gap: f64, turned_around: bool) -> Vec<(Solid, [f64; 2])> {
    let off = 0.5e-3 + 0.5 * gap;
    let half = |kind: Kind, side: f64| {
        let at = [side * off * LEAN.cos(), side * off * LEAN.sin(), 0.0];
        (across(kind).at(at), LIGHT)
    };
    let mut both = vec![half(kinds[0], -1.0), half(kinds[1], 1.0)];
    if turned_around {
        both.reverse();
    }
    both
}

fn reflected(results: &[RayResult]) -> usize {
    results.iter().filter(|it| it.flags & FLAG_REFLECTED != 0).count()
}

#[test]
fn gap_of_two_nanometres_between_exact_shapes_changes_nothing_and_one_of_a_hundred_reflects() {
    let bench = Bench::new();
    let rays = grazing_rays();
    let disc = cylinder(4e-3, 1e-3);
    for backend in backends() {
        let whole = in_carbon(&[(across(cylinder(4e-3, 2e-3)), LIGHT)]);
        let solid = exact(&bench, backend, &whole, &rays);
        let mut slope = Worst::new("slope behind exact shapes that touch, rad", 1e-13);
        let mut depth = Worst::new("depth of exact shapes that touch", 1e-6);
        for turned in [false, true] {
            let pair = |kinds, gap| in_carbon(&faces(kinds, gap, turned));
            for gap in [2e-9, 4e-9] {
                let close = exact(&bench, backend, &pair([disc; 2], gap), &rays);
                for (ray, (one, two)) in rays.iter().zip(solid.iter().zip(&close)) {
                    let place = || format!("{backend}, gap {gap}, {turned}, {ray:?}");
                    slope.take(f64::from(one.slope_x - two.slope_x), place);
                    slope.take(f64::from(one.slope_z - two.slope_z), place);
                    depth.take(f64::from(one.optical_depth - two.optical_depth), place);
                    assert_eq!([one.crossings, two.crossings], [2, 4], "{}", place());
                }
            }
            // The base of a cone, and a box of facets.
            let cone = Kind::Cone { bottom: 4e-3, top: 3e-3, half: 0.5e-3 };
            for kind in [disc, cone, Kind::Box([6e-3, 7e-3, 1e-3])] {
                for (gap, want) in [(2e-9, 0), (1e-7, rays.len())] {
                    let met = exact(&bench, backend, &pair([disc, kind], gap), &rays);
                    assert_eq!(reflected(&met), want, "{backend}, {turned}, {gap}, {kind:?}");
                }
            }
        }
        slope.holds();
        depth.holds();
    }
    bench.end();
}

/// The scene with the places of its first object, m along its own z.
fn with_places(mut scene: Scene, directory: &Path, places: &[f64]) -> Scene {
    let path = directory.join(format!("{}.csv", places.len()));
    let rows: String = places.iter().map(|z| format!("0,0,{z:e}\n")).collect();
    std::fs::write(&path, format!("x_m,y_m,z_m\n{rows}")).expect("a file");
    scene.objects[0].instances = Some(Instances::File(path));
    scene
}

#[test]
fn instances_that_touch_are_the_one_solid() {
    let bench = Bench::new();
    let directory = tempfile::tempdir().expect("a directory");
    let mut random = Random::new(8);
    for count in [2_u32, 20] {
        let height = 2e-3 / f64::from(count);
        let places: Vec<f64> = (0..count).map(|k| (f64::from(k) + 0.5) * height - 1e-3).collect();
        let whole = in_carbon(&[(across(cylinder(4e-3, 2e-3)), LIGHT)]);
        let one = in_carbon(&[(across(cylinder(4e-3, height)), LIGHT)]);
        let many = with_places(one, directory.path(), &places);
        let sample = geometry::load(&many).expect("a sample");
        assert!(sample.triangles.is_empty() && sample.objects[0].warnings.is_empty());
        let mut rays = grazing_rays();
        rays.extend(rays_around(&across(cylinder(4e-3, 2e-3)), 400, 0.0, &mut random));
        for backend in backends() {
            for transport in [Transport::Exact, Transport::FirstOrder] {
                let [solid, stack] = [&whole, &many].map(|scene| {
                    let mut scene = scene.clone();
                    scene.sampling.transport = transport;
                    match transport {
                        Transport::Exact => exact(&bench, backend, &scene, &rays),
                        _ => bench.tracer(backend, &scene).trace(&rays).expect("results"),
                    }
                });
                let mut slope = Worst::new("slope behind instances that touch, of its room", 1.0);
                let mut depth = Worst::new("depth of instances that touch", 2e-6);
                for (ray, (one, two)) in rays.iter().zip(solid.iter().zip(&stack)) {
                    let place = || format!("{backend}, {count}, {transport:?}, {ray:?}, {two:?}");
                    assert_eq!(
                        one.flags & FLAG_REFLECTED,
                        two.flags & FLAG_REFLECTED,
                        "{}",
                        place()
                    );
                    // f32 in another order, also near silhouettes; to first order two large changes
                    // at the faces cancel.
                    let cancels = if transport == Transport::Exact { 1e-12 } else { 1e-11 };
                    let room = cancels + 1e-5 * f64::from(one.slope_x.hypot(one.slope_z));
                    slope.take(f64::from(one.slope_x - two.slope_x) / room, place);
                    slope.take(f64::from(one.slope_z - two.slope_z) / room, place);
                    depth.take(f64::from(one.optical_depth - two.optical_depth), place);
                }
                slope.holds();
                depth.holds();
            }
        }
    }
    bench.end();
}
