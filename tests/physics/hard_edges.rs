//! Light of a point, whose edges are hard, and behind steep facets: against sums of straight rays in f64, Snell's law to
//! first order.
//!
//! The limit is 3 tolerances of 1e-5 and what the sums leave at edges, 5e-6: rays are 0.8 nm apart.

use crate::reference::masks::Bars;
use crate::reference::rays::{Order, Sample};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, body, cuboid, extruded};
use crate::support::{Worst, engine};
use beamlet::Backend;
use beamlet::scene::{Scene, Shape, Transport};
use rayon::prelude::*;

const LIMIT: f64 = 3.5e-5;
/// Rays of a pixel.
const RAYS: u32 = 200_000;
const OFFSETS: [f64; 3] = [-31e-6, 0.0, 12e-6];

/// Three pixels, the source at 1.2 m, no masks.
fn without_masks(spot: f64) -> Setup {
    let mut setup = Setup::paper([3, 1]);
    (setup.source_distance, setup.spot) = (1.2, [spot; 2]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    setup
}

/// The same between opaque sheets with slits.
fn between_masks(spot: f64) -> Setup {
    let mut setup = without_masks(spot);
    let bars = Bars::Sheet { transmission: 0.0 };
    setup.sample_mask = Some(setup.mask(1.15, 40e-6, bars));
    setup.detector_mask = Some(setup.mask(1.8, 60e-6, bars));
    setup
}

/// Light by step and column of rays from the centre of the source. `through`: optical depth and displacement on the
/// detector, m, of the ray to a place on the detector, m.
fn light(setup: &Setup, through: impl Fn(f64) -> [f64; 2] + Sync) -> Vec<[f64; 3]> {
    let [pitch, far] = [setup.pitch[0], setup.detector_distance];
    let first = -2.5 * pitch;
    let ray = |number: u32| {
        let x = first + pitch * (f64::from(number) + 0.5) / f64::from(RAYS);
        let slope = [x / far, 0.0];
        let [depth, moved] = through(x);
        let column = [0, 1, 2].map(|at| ((x + moved) / pitch + 1.5 - f64::from(at)).floor() == 0.0);
        let behind = setup.detector_mask.map_or(1.0, |it| it.transmission(x + moved, slope));
        let light = (-depth).exp() * behind / f64::from(RAYS);
        let open = |offset: f64| {
            setup
                .sample_mask
                .map_or(1.0, |it| it.moved(offset).transmission(slope[0] * it.distance, slope))
        };
        OFFSETS.map(|offset| column.map(|is_own| if is_own { light * open(offset) } else { 0.0 }))
    };
    let add = |mut sum: Vec<[f64; 3]>, light: [[f64; 3]; 3]| {
        sum.iter_mut().flatten().zip(light.iter().flatten()).for_each(|(sum, it)| *sum += it);
        sum
    };
    let chunk = |first: u32| (first..first + RAYS / 8).map(ray).fold(vec![[0.0; 3]; 3], add);
    let chunks: Vec<_> = (0..40).into_par_iter().map(|at| chunk(at * (RAYS / 8))).collect();
    let join = |sum: Vec<[f64; 3]>, it: Vec<[f64; 3]>| add(sum, [it[0], it[1], it[2]]);
    chunks.into_iter().fold(vec![[0.0; 3]; 3], join)
}

/// Compares the light of a scene, at each step of a setup with masks, with that of rays.
fn compare(
    worst: &mut Worst,
    name: &str,
    setup: &Setup,
    mut scene: Scene,
    through: impl Fn(f64) -> [f64; 2] + Sync,
) {
    scene.sampling.transport = Transport::FirstOrder;
    scene.sampling.tolerance = Some(1e-5);
    let got = engine(Backend::Bvh).simulate(&scene).expect("a stack").sample;
    let want = light(setup, through);
    for step in 0..scene.scan.mask_offsets.len() {
        let number = if setup.sample_mask.is_some() { step } else { 1 };
        for column in 0..3 {
            let (got, want) = (f64::from(got[[0, step, 0, column]]), want[number][column]);
            worst
                .take(got - want, || format!("{name}, step {step}, column {column}: {got} {want}"));
        }
    }
}

fn scene_of(setup: &Setup, bodies: &[Body]) -> Scene {
    scenes::scene(setup, bodies, if setup.sample_mask.is_some() { &OFFSETS } else { &[0.0] })
}

fn compare_meshes(worst: &mut Worst, name: &str, setup: &Setup, bodies: &[Body]) {
    let sample = Sample::new(bodies, setup.source_distance, 0.0);
    compare(worst, name, setup, scene_of(setup, bodies), |x| {
        let ray = setup.trace(&sample, [0.0; 2], [x, 0.0], Order::First);
        [ray.optical_depth, ray.displacement[0]]
    });
}

/// An upright tube, m, of these constants.
struct Tube {
    place: [f64; 2],
    radii: [f64; 2],
    mu: f64,
    delta: f64,
}

impl Tube {
    /// Depth and displacement of the ray to x on the detector.
    fn through(&self, setup: &Setup, x: f64) -> [f64; 2] {
        let far = setup.detector_distance;
        let (slope, [aside, behind]) = (x / far, self.place);
        let axis = setup.source_distance + behind;
        let root = slope.hypot(1.0);
        let off = (slope * axis - aside) / root;
        let middle = (slope * aside + axis) / (root * root);
        let mut sums = [0.0; 2];
        for (radius, sign) in self.radii.into_iter().zip([1.0, -1.0]) {
            let half = (radius * radius - off * off).max(0.0).sqrt();
            if half <= 0.0 {
                continue;
            }
            sums[0] += sign * self.mu * 2.0 * half;
            for (y, way) in [(middle - half / root, sign), (middle + half / root, -sign)] {
                let normal = [(slope * y - aside) / radius, (y - axis) / radius];
                let along = (normal[0] * slope + normal[1]) / root;
                let [vx, vy] = [slope / root - normal[0] / along, 1.0 / root - normal[1] / along];
                sums[1] += way * self.delta * (vx - vy * slope) * root * (far - y);
            }
        }
        sums
    }
}

/// Behind the bore of a tube is a caustic: cells land within less than a nanometre.
#[test]
fn light_of_a_point_behind_tubes_lands_where_its_rays_do() {
    let mut worst = Worst::new("hard edges, tubes", LIMIT);
    let tube = |x: f64, y: f64, outer: f64, inner: f64, mu: f64, delta: f64| Tube {
        place: [x * 1e-6, y * 1e-6],
        radii: [outer * 1e-6, inner * 1e-6],
        mu,
        delta,
    };
    for tube in [
        tube(77.772, 268.452, 100.0, 87.549, 7074.82, 5.463_624_646e-6),
        tube(-94.0, 0.0, 106.79, 42.75, 3000.0, 2e-7),
        tube(-72.0, 0.0, 115.48, 59.52, 3000.0, 1e-6),
    ] {
        for setup in [without_masks(0.0), between_masks(0.0)] {
            let mut scene = scene_of(&setup, &[body(cuboid([1e-3; 3]), tube.mu, tube.delta)]);
            let [outer, inner] = tube.radii;
            let shape = Shape::Tube { outer, inner, height: 2e-3, sides: None };
            scene.objects[0].geometry = shape.into();
            scene.objects[0].placement.position = [tube.place[0], tube.place[1], 0.0];
            let name = format!("{:?}, masks {}", tube.radii, setup.sample_mask.is_some());
            compare(&mut worst, &name, &setup, scene, |x| tube.through(&setup, x));
        }
    }
    worst.holds();
}

/// Their sides are nearly along the beam: cells of a nanometre. A spot of a nanometre blurs nothing.
#[test]
fn light_of_a_point_beside_steep_sides_lands_where_its_rays_do() {
    let mut worst = Worst::new("hard edges, sides along the beam", LIMIT);
    let section = [[-45e-6, 0.0], [45e-6, 0.0], [45e-6, 0.2e-3]];
    let wedge = body(extruded(&section, 1.5e-3), 1.3e5, 1e-8);
    let slab = cuboid([150e-6, 2e-3, 3e-3]).moved([-84.2e-6, 0.0, 0.0]);
    let tilted = cuboid([60e-6, 3e-3, 3e-3]).turned([0.0, 0.0, 1.0], 3e-4).rounded();
    for bodies in [[wedge], [body(slab, 6400.0, 1e-7)], [body(tilted, 2000.0, 1e-6)]] {
        for spot in [0.0, 1e-9] {
            for setup in [without_masks(spot), between_masks(spot)] {
                let name = format!("{} 1/m, {spot} m", bodies[0].mu);
                compare_meshes(&mut worst, &name, &setup, &bodies);
            }
        }
    }
    worst.holds();
}

/// Facets over which the depth changes by 65 to 2,600: all light is that of their thin ends. A spot of a micrometre blurs
/// no edge of a pixel.
#[test]
fn thin_ends_of_steep_facets_have_their_light() {
    let mut worst = Worst::new("hard edges, steep facets", LIMIT);
    for length in [0.5e-3, 3e-3, 20e-3] {
        let section = [[-45e-6, 0.0], [45e-6, 0.0], [45e-6, length]];
        let bodies = [body(extruded(&section, 1.5e-3), 1.3e5, 1e-12)];
        for spot in [0.0, 1e-6] {
            compare_meshes(
                &mut worst,
                &format!("{length} m, {spot} m"),
                &without_masks(spot),
                &bodies,
            );
        }
    }
    worst.holds();
}
