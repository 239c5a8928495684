//! Bodies in contact: faces that coincide are one interface, and plates face to face one block.

use super::{Bench, exact, scene};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, body, cuboid};
use crate::support::{CARBON, WATER, Worst, backends};
use beamlet::Backend;
use beamlet::internals::interface::FLAG_REFLECTED;
use beamlet::internals::trace::Ray;
use beamlet::scene::{MaterialSpec, RandomRays, Scheme, Transport};

/// Mu and delta of the block below: less than those of the carbon around it, which reflects rays
/// within 0.85 mrad.
const LIGHT: [f64; 2] = [20.0, 1e-7];

/// Two halves of a block, their faces `gap` apart and turned by half a milliradian against the
/// beam.
fn halves(gap: f64, turned_around: bool) -> Vec<Body> {
    let half = |side: f64| {
        let mesh = cuboid([1e-3, 8e-3, 2e-3]).moved([side * 0.5e-3 + side * 0.5 * gap, 0.0, 0.0]);
        // Not rounded: at 5 mm f32 is 0.5 nm.
        body(mesh.turned([0.0, 0.0, 1.0], 5e-4), LIGHT[0], LIGHT[1])
    };
    let mut both = vec![half(-1.0), half(1.0)];
    if turned_around {
        both.reverse();
    }
    both
}

/// Rays that cross the gap near the middle of the block.
pub(crate) fn grazing_rays() -> Vec<Ray> {
    let at = |k: i32| 0.4e-6 * (f64::from(k) / 20.0);
    let ray =
        |k: i32| Ray { x: at(k) as f32, z: 0.3e-3, slope_x: 0.0, slope_z: 0.0, pose: 0, key: 0 };
    (-20..=20).map(ray).collect()
}

#[test]
fn gap_of_two_nanometres_changes_nothing_and_one_of_a_hundred_reflects() {
    let bench = Bench::new();
    let rays = grazing_rays();
    let in_carbon = |bodies: &[Body]| {
        let mut scene = scene(bodies, Transport::Exact);
        let carbon = MaterialSpec::Constants { mu: CARBON[0], delta: CARBON[1] };
        scene.materials.insert("around".to_owned(), carbon);
        scene.surroundings = "around".to_owned();
        scene
    };
    for backend in backends() {
        let whole =
            body(cuboid([2e-3, 8e-3, 2e-3]).turned([0.0, 0.0, 1.0], 5e-4), LIGHT[0], LIGHT[1]);
        let solid = exact(&bench, backend, &in_carbon(&[whole]), &rays);
        let mut worst = Worst::new("slope behind halves that touch, rad", 1e-13);
        let mut depth = Worst::new("depth of halves that touch", 1e-6);
        for gap in [-1e-6, -2e-9, 0.0, 2e-9] {
            for turned in [false, true] {
                let halved = exact(&bench, backend, &in_carbon(&halves(gap, turned)), &rays);
                for (ray, (one, two)) in rays.iter().zip(solid.iter().zip(&halved)) {
                    let place = || format!("{backend}, gap {gap}, {turned}, {ray:?}");
                    assert_eq!(two.flags & FLAG_REFLECTED, 0, "{}", place());
                    worst.take(f64::from(one.slope_x - two.slope_x), place);
                    depth.take(f64::from(one.optical_depth - two.optical_depth), place);
                }
            }
        }
        worst.holds();
        depth.holds();
        for turned in [false, true] {
            let apart = exact(&bench, backend, &in_carbon(&halves(1e-7, turned)), &rays);
            let reflected = apart.iter().filter(|it| it.flags & FLAG_REFLECTED != 0).count();
            assert_eq!(reflected, rays.len(), "{backend}, {turned}");
        }
    }
    bench.end();
}

#[test]
fn random_rays_see_touching_plates_as_the_one_block() {
    let engine = crate::support::engine(Backend::Bvh);
    for transport in [Transport::FirstOrder, Transport::Exact] {
        let stack = |bodies: &[Body]| {
            let mut scene = scenes::scene(&Setup::paper([16, 8]), bodies, &[0.0, 1e-5]);
            scene.sampling.scheme = Scheme::Random;
            scene.sampling.rays = RandomRays::Grid([200, 1]);
            scene.sampling.transport = transport;
            let stacks = engine.simulate(&scene).expect("a stack");
            let tally = &stacks.record.tally;
            assert_eq!([tally.unbalanced, tally.unordered, tally.not_finite], [0; 3]);
            stacks.sample
        };
        let block = cuboid([3e-3, 4e-3, 2e-3]).turned([0.3, 0.2, 1.0], 0.4).rounded();
        let one = stack(&[body(block, CARBON[0], CARBON[1])]);
        let many = stack(&plates(20, 0.4, |_| CARBON));
        // One ray beside an edge in f32 is 1/200 of a pixel; most pixels have none.
        let differ = one.iter().zip(&many).filter(|(a, b)| (*a - *b).abs() > 1e-6).count();
        let worst = one.iter().zip(&many).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("measured {transport:?}: {differ} of {} differ, by {worst:e}", one.len());
        assert!(differ * 50 < one.len() && worst < 2e-3, "{differ} differ, by {worst:e}");
    }
}

/// Plates face to face, one on the other.
fn plates(count: u32, turn: f64, of: impl Fn(u32) -> [f64; 2]) -> Vec<Body> {
    let thickness = 4e-3 / f64::from(count);
    let plate = |k: u32| {
        let y = (f64::from(k) + 0.5) * thickness - 2e-3;
        let mesh = cuboid([3e-3, thickness, 2e-3]).moved([0.0, y, 0.0]);
        let [mu, delta] = of(k);
        body(mesh.turned([0.3, 0.2, 1.0], turn).rounded(), mu, delta)
    };
    (0..count).map(plate).collect()
}

#[test]
fn hundred_plates_face_to_face_are_the_one_block() {
    let engine = crate::support::engine(Backend::Bvh);
    let everything = crate::support::everything();
    // Edges of the block that is turned are seen about 6 columns from the axis.
    let setup = Setup::paper(if everything { [32, 16] } else { [16, 1] });
    let offsets = [-2e-5, 1e-5];
    for turn in crate::support::sample(vec![0.4, 0.0], 2) {
        let stack = |bodies: &[Body], tolerance: f64| {
            let mut scene = scenes::scene(&setup, bodies, &offsets);
            if !everything {
                scene.sampling.tolerance = Some(tolerance);
            }
            let stacks = engine.simulate(&scene).expect("a stack");
            let tally = &stacks.record.tally;
            assert_eq!(
                [tally.unbalanced, tally.unordered, tally.dropped, tally.not_finite],
                [0; 4]
            );
            stacks.sample
        };
        let block = body(
            cuboid([3e-3, 4e-3, 2e-3]).turned([0.3, 0.2, 1.0], turn).rounded(),
            CARBON[0],
            CARBON[1],
        );
        // Two runs are off by the tolerance each.
        let one = stack(&[block], 2e-4);
        let many = stack(&plates(100, turn, |_| CARBON), 2e-4);
        let two = stack(&plates(2, turn, |_| CARBON), 2e-4);
        let mut worst = Worst::new("plates against the block, of open beam", 5e-4);
        for ((place, one), (many, two)) in one.indexed_iter().zip(many.iter().zip(&two)) {
            worst.take(f64::from(one - many), || format!("100 plates, turn {turn}, {place:?}"));
            worst.take(f64::from(one - two), || format!("2 plates, turn {turn}, {place:?}"));
        }
        worst.holds();
        // The tally alone counts here.
        let mixed = plates(if everything { 100 } else { 20 }, turn, |k| {
            if k % 2 == 0 { CARBON } else { WATER }
        });
        let _ = stack(&mixed, 1e-3);
    }
}
