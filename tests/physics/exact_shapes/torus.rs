//! Facets of a torus without `sides` against closed forms of the exact torus.

use super::scene;
use crate::assemblies::Bench;
use crate::reference::surfaces::Random;
use crate::support::{CARBON, Worst, backends};
use crate::transport::ray;
use beamlet::internals::trace::Ray;
use beamlet::scene::{Object, Shape, Transport};

const RING: f64 = 0.25e-3;
const TUBE: f64 = 0.08e-3;
/// Distance of facets from the surface, m (docs/scene.md).
const ERROR: f64 = 1e-8;
/// Error of a path of 0.4 mm in f32, m: 6e-8 of the place of each crossing.
const ROUNDING: f64 = 1e-10;

/// Path of a ray along y at (x, z) through a torus around z, its slopes over delta, and the cosines of
/// incidence at the outer and inner side of the tube.
fn exact(x: f64, z: f64) -> (f64, [f64; 2], Vec<f64>) {
    // The section at z is the annulus of the radii RING ± half.
    let half = (TUBE * TUBE - z * z).sqrt();
    let (mut path, mut slope, mut cosines) = (0.0, [0.0; 2], Vec::new());
    for side in [1.0, -1.0] {
        let radius = RING + side * half;
        if x.abs() >= radius {
            continue;
        }
        let root = (radius * radius - x * x).sqrt();
        path += side * 2.0 * root;
        slope[0] += side * 2.0 * x / root;
        slope[1] += 2.0 * (z / half) * radius / root;
        cosines.push(half / TUBE * root / radius);
    }
    (path, slope, cosines)
}

/// A facet crosses the surface within ERROR: a path changes by ERROR over the cosine of incidence at each of
/// its ends. Facets lean by up to half a step of either circle, a: the slope of a surface across a ray changes
/// by a/cos².
#[test]
fn rays_through_a_torus_match_closed_forms_within_its_facets() {
    let bench = Bench::new();
    let object =
        Object::new("torus", Shape::Torus { radius: RING, tube_radius: TUBE, sides: None }, "");
    let scene = scene(vec![object], &[CARBON], Transport::FirstOrder);
    // Half a step of the ring and of the tube.
    let lean = (2.4 * ERROR / (RING + TUBE)).sqrt() + (0.6 * ERROR / TUBE).sqrt();
    let mut random = Random::new(17);
    let one = |_| {
        let x = random.between(-RING - TUBE, RING + TUBE);
        ray(x, random.between(-0.95 * TUBE, 0.95 * TUBE), [0.0; 2], 0)
    };
    let rays: Vec<Ray> = (0..4000).map(one).collect();
    let mut path = Worst::new("path through a torus over what its facets allow", 1.0);
    let mut slope = Worst::new("deflection by a torus over what its facets allow", 1.0);
    let (mut squares, mut taken) = (0.0, 0);
    for backend in backends() {
        let results = bench.tracer(backend, &scene).trace(&rays).expect("results");
        for (ray, result) in rays.iter().zip(&results) {
            let (want, slopes, cosines) = exact(f64::from(ray.x), f64::from(ray.z));
            if cosines.is_empty() || cosines.iter().any(|cosine| *cosine < 0.3) {
                continue;
            }
            let place = || format!("{backend}, {ray:?}");
            assert_eq!(result.crossings as usize, 2 * cosines.len(), "{}", place());
            let room: f64 = cosines.iter().map(|it| 2.0 * ERROR / (it - lean)).sum();
            let off = f64::from(result.optical_depth) / CARBON[0] - want;
            path.take(off / (room + ROUNDING + 3e-7 * want), place);
            let room: f64 = cosines.iter().map(|it| 2.0 * lean / (it - lean).powi(2)).sum();
            for (got, want) in [result.slope_x, result.slope_z].into_iter().zip(slopes) {
                let off = f64::from(got) / CARBON[1] - want;
                slope.take(off / room, place);
                squares += off * off;
            }
            taken += 1;
        }
    }
    println!("measured {taken} rays, slope {:.1e} of delta", (squares / f64::from(taken)).sqrt());
    assert!(taken > 1000);
    path.holds();
    slope.holds();
    bench.end();
}
