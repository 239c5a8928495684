//! The software BVH and the driver's ray query give the same stacks and results.

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Random, body, cuboid, star};
use crate::support::{CARBON, WATER, Worst, backends, engine, engine_with};
use beamlet::internals::backend::choose;
use beamlet::internals::interface::{FLAG_EXACT, FLAG_UNBALANCED};
use beamlet::internals::trace::{Ray, trace};
use beamlet::scene::{MaterialSpec, Object, Scene, Shape, Transport};
use beamlet::stack::Stacks;
use beamlet::{Backend, DeviceKind, EngineOptions, SearchCounts};
use std::sync::atomic::{AtomicBool, Ordering};

/// Open beam. Sums of a ray run in the order of its candidates, which differs between backends:
/// 1e-7 of a depth or a displacement.
const SAME_LIGHT: f64 = 1e-6;

/// True if this device has both backends; without them a test has nothing to compare, and says so.
#[allow(clippy::print_stderr, reason = "what is left out is told")]
fn both(what: &str) -> bool {
    let both = backends().len() == 2;
    if !both {
        eprintln!("{what}: left out, the device has no ray query");
    }
    both
}

/// The stacks of every backend of this device.
fn stacks(scene: &Scene) -> Vec<Stacks> {
    let all: Vec<Stacks> =
        backends().into_iter().map(|b| engine(b).simulate(scene).expect("a stack")).collect();
    for (stacks, backend) in all.iter().zip(backends()) {
        assert_eq!(stacks.record.backend, backend);
        let tally = stacks.record.tally;
        assert_eq!((tally.unbalanced, tally.dropped, tally.not_finite), (0, 0, 0), "{tally:?}");
    }
    all
}

fn compare(what: &'static str, scene: &Scene) {
    let all = stacks(scene);
    assert!(all[0].sample.iter().zip(&all[0].flat).any(|(a, b)| (a - b).abs() > 1e-3));
    if !both(what) {
        return;
    }
    let mut worst = Worst::new(what, SAME_LIGHT);
    for (place, &got) in all[1].sample.indexed_iter() {
        worst.take(f64::from(got - all[0].sample[place]), || format!("{place:?}"));
    }
    // Without a sample there is nothing to search: the same bits.
    assert!(all[1].flat.iter().zip(&all[0].flat).all(|(a, b)| a.to_bits() == b.to_bits()));
    worst.holds();
}

/// A sphere of about `sides`^2 triangles in a small image.
fn ball(sides: u32) -> Scene {
    let mut scene = scenes::scene(&Setup::paper([10, 2]), &[], &[-12e-6, 0.0, 12e-6]);
    scene
        .materials
        .insert("carbon".into(), MaterialSpec::Constants { mu: CARBON[0], delta: CARBON[1] });
    let sphere = Shape::Sphere { radius: 0.4e-3, sides: Some(sides) };
    scene.objects.push(Object::new("ball", sphere, "carbon"));
    scene
}

fn triangles(scene: &Scene) -> usize {
    beamlet::geometry::load(scene).expect("a sample").triangles.len()
}

#[test]
fn stacks_of_100_thousand_triangles_are_the_same() {
    let scene = ball(320);
    let count = triangles(&scene);
    assert!((90_000..200_000).contains(&count), "{count}");
    compare("backends, 100,000 triangles", &scene);
}

#[test]
fn stacks_of_a_million_triangles_are_the_same() {
    let mut scene = ball(1010);
    // Each facet has a result of its own: a wider tolerance keeps the number of rays down.
    scene.sampling.tolerance = Some(1e-2);
    scene.detector.pixels = [10, 1];
    let count = triangles(&scene);
    assert!((900_000..2_000_000).contains(&count), "{count}");
    compare("backends, 1,000,000 triangles", &scene);
}

#[test]
fn stacks_with_rays_traced_in_order_are_the_same() {
    let setup = Setup::paper([16, 1]);
    let slab = cuboid([0.8e-3, 8e-3, 2e-3]).turned([0.0, 0.0, 1.0], 0.4e-3);
    let rough = star(0.2e-3, 0.3e-3, 2, 3).moved([-0.85e-3, 0.0, 0.0]);
    let bodies =
        [body(slab.rounded(), CARBON[0], CARBON[1]), body(rough.rounded(), WATER[0], WATER[1])];
    let scene = scenes::scene(&setup, &bodies, &[-12e-6, 0.0, 12e-6]);
    compare("backends, total reflection and a rough ball", &scene);
}

#[test]
fn results_are_the_same_ray_by_ray() {
    let mut setup = Setup::paper([16, 16]);
    setup.sample_mask = None;
    let bodies = [
        body(star(0.8e-3, 1.5e-3, 4, 21).rounded(), CARBON[0], CARBON[1]),
        body(star(0.2e-3, 0.5e-3, 3, 22).rounded(), WATER[0], WATER[1]),
    ];
    let mut random = Random::new(31);
    let rays: Vec<Ray> = (0..40_000_u32)
        .map(|i| {
            let (x, z) = (random.between(-1.4e-3, 1.4e-3), random.between(-1.4e-3, 1.4e-3));
            let [sx, sz] = [x / 1.21, z / 1.21];
            Ray {
                x: x as f32,
                z: z as f32,
                slope_x: sx as f32,
                slope_z: sz as f32,
                pose: i % 3,
                key: 0,
            }
        })
        .collect();
    if !both("results, ray by ray") {
        return;
    }
    // Different orders of the terms of a sum: a few roundings of its largest.
    let mut depth = Worst::new("backends, optical depth", 1e-7);
    let mut shift = Worst::new("backends, displacement (m)", 1e-10);
    let mut moved = 0;
    for transport in [Transport::FirstOrder, Transport::Auto] {
        let mut scene = scenes::scene(&setup, &bodies, &[0.0]);
        scene.scan.angles = vec![0.0, 0.7, 2.0];
        scene.sampling.transport = transport;
        let results: Vec<_> = backends()
            .into_iter()
            .map(|b| trace(&engine(b).prepare(&scene).expect("a sample"), &rays).expect("results"))
            .collect();
        for other in &results[1..] {
            for ((ray, a), b) in rays.iter().zip(&results[0]).zip(other) {
                assert_eq!(a.signature, b.signature, "{ray:?}");
                assert_eq!(a.crossings, b.crossings, "{ray:?}");
                assert_eq!(a.flags & FLAG_UNBALANCED, 0);
                assert_eq!(a.flags, b.flags, "{ray:?}");
                if a.flags & FLAG_EXACT != 0 {
                    moved += 1;
                }
                depth.take(f64::from(a.optical_depth - b.optical_depth), || format!("{ray:?}"));
                shift.take(f64::from(a.displacement_x - b.displacement_x), || format!("{ray:?}"));
                shift.take(f64::from(a.displacement_z - b.displacement_z), || format!("{ray:?}"));
            }
        }
        assert!(transport == Transport::FirstOrder || moved > 40);
    }
    depth.holds();
    shift.holds();
}

#[test]
fn backend_not_asked_for_is_chosen_by_kind_leaves_and_crossings() {
    let of = |kind, leaves, crossings| choose(kind, SearchCounts::new(leaves, crossings)).0;
    for kind in [DeviceKind::Discrete, DeviceKind::Integrated, DeviceKind::Virtual] {
        assert_eq!(of(kind, 100_000, 1.3), Backend::RayQuery);
        assert_eq!(of(kind, 65, 32.0), Backend::RayQuery);
        assert_eq!(of(kind, 64, 1.3), Backend::Bvh);
        assert_eq!(of(kind, 100_000, 32.1), Backend::Bvh);
    }
    for leaves in [1, 500, 1_000_000] {
        assert_eq!(of(DeviceKind::Cpu, leaves, 1.3), Backend::Bvh);
    }
}

#[test]
fn backend_choice_does_not_depend_on_load() {
    let mut scene = ball(64);
    scene.sampling.tolerance = Some(1e-2);
    let record = || engine_with(EngineOptions::default()).simulate(&scene).expect("a stack").record;
    let quiet = record();
    assert!(!quiet.backend_reason.is_empty());
    let engine = engine_with(EngineOptions::default());
    let is_counted = engine.description().kind != DeviceKind::Cpu && engine.description().ray_query;
    assert_eq!(quiet.search.is_some(), is_counted);
    let counts = || engine.prepare(&scene).expect("a simulation").search_counts().expect("counts");
    let alone = counts();
    assert!(quiet.search.is_none_or(|it| it == alone));
    // A ball alone: rays through its shadow, a square about it, cross it twice or not at all. The
    // disc has pi / 4 of the square; of 16 places some are at its corners.
    assert_eq!(alone.leaves as usize, triangles(&scene));
    assert!((0.8..=2.0).contains(&alone.crossings_per_ray), "{alone:?}");
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let busy = record();
        let beside = counts();
        done.store(true, Ordering::Relaxed);
        assert_eq!(beside, alone);
        assert_eq!((busy.backend, busy.search), (quiet.backend, quiet.search));
    });
}
