//! The same scene gives the same bits, however it is cut into bands, batches, threads and views.

use super::{apertures, kinds, unresolved};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{body, cuboid, cylinder, star};
use crate::support::cuts::{Cut, bands, batches, no_bit_changes};
use crate::support::{CARBON, WATER, amount, backends, engine, everything};
use beamlet::Backend;
use beamlet::internals::trace::{Ray, RayResult, moments, trace};
use beamlet::scene::{RandomRays, Scene, Scheme, Transport};
use beamlet::stack::Stacks;

/// A rough ball, a slab at grazing incidence and a tilted rod, in two views: silhouettes along
/// and across rows, total reflection, light that lands rows and columns away.
fn scene(scheme: Scheme) -> Scene {
    let setup = Setup::paper([12, 5]);
    let rod = cylinder(0.1e-3, 0.9e-3, 24, 0.2).turned([1.0, 0.3, 0.0], 0.7);
    let bodies = [
        body(star(0.15e-3, 0.25e-3, 2, 3).moved([-0.4e-3, 0.0, 0.1e-3]), CARBON[0], CARBON[1]),
        body(cuboid([0.2e-3, 1.5e-3, 0.5e-3]).turned([1.0, 0.0, 1.0], 4e-4), WATER[0], 2e-6),
        body(rod.moved([0.4e-3, 0.0, 0.0]), WATER[0], 3e-5),
    ];
    let mut scene = scenes::scene(&setup, &bodies, &[-20e-6, 0.0, 9e-6]);
    scene.scan.angles = vec![0.0, 1.5];
    scene.sampling.scheme = scheme;
    scene.sampling.rays = RandomRays::Count(360);
    scene.sampling.audit = 0.1;
    // Enough refinement for every branch, few enough rays for many runs.
    scene.sampling.tolerance = Some(3e-4);
    scene
}

fn at(tolerance: f64, mut scene: Scene) -> Scene {
    scene.sampling.tolerance = Some(tolerance);
    scene
}

/// Scenes of lines and of random rays, each with the ways in which it is cut.
fn scenes() -> Vec<(&'static str, Scene, Vec<Cut>)> {
    // Groups of patches with too little room begin anew as halves.
    let little = |mebibytes: u64| Cut { memory: Some(mebibytes << 20), ..Cut::default() };
    // All at once; with `BEAMLET_ALL` each by itself as well.
    let every = amount(
        vec![Cut { batch: Some(257), threads: Some(7), ..bands(1) }],
        vec![
            Cut { threads: Some(1), ..bands(1) },
            Cut { batch: Some(4096), threads: Some(7), ..bands(3) },
            batches(257),
        ],
    );
    let both = |batch: u32| vec![Cut { batch: Some(batch), ..bands(1) }];
    let all = |more: &[Cut]| [&every[..], more].concat();
    let spectrum = |scene: Scene| at(amount(1e-3, 3e-4), scene);
    let fibres =
        |roughness: f64, tolerance| at(tolerance, kinds::few_pixels(unresolved::fibres(roughness)));
    let [holes, tube] = apertures::cut_scenes();
    let mut scenes = vec![
        ("cells", scene(Scheme::Cells), all(&[little(188)])),
        ("random rays", scene(Scheme::Random), every),
        // Cells of a spectrum are made in an order that depends on their number at a time.
        (
            "shapes in a tube",
            spectrum(kinds::few_pixels(kinds::with_tube(kinds::shapes()))),
            both(257),
        ),
        (
            "a grazed slab in a tube",
            spectrum(kinds::few_rows(kinds::grazed())),
            amount(vec![little(300)], [both(257), vec![little(300)]].concat()),
        ),
        ("holes", at(2e-3, holes), both(257)),
        (
            "squares, a tube",
            at(2e-3, tube),
            vec![Cut { batch: Some(257), threads: Some(1), ..bands(1) }],
        ),
        // The number of rays of a patch does not depend on bands or batches.
        ("rough fibres", fibres(2e-3, amount(4e-3, 1e-3)), both(257)),
    ];
    if everything() {
        scenes.push(("fibres", fibres(0.0, 4e-3), both(4099)));
    }
    scenes
}

#[test]
fn bands_batches_memory_and_threads_change_no_bit() {
    for (name, scene, cuts) in scenes() {
        let tally = no_bit_changes(name, &scene, &cuts).record.tally;
        let mixed = ["cells", "random rays"].contains(&name);
        assert!(!mixed || (tally.exact > 0 && tally.reflected > 0), "{name}: {tally:?}");
    }
}

fn simulated(scene: &Scene) -> Stacks {
    engine(Backend::Bvh).simulate(scene).expect("a stack")
}

#[test]
fn engine_that_served_other_scenes_gives_the_same_bits() {
    let scene = &at(1e-3, scene(Scheme::Cells));
    for backend in backends() {
        let engine = engine(backend);
        let first = engine.simulate(scene).expect("a stack").sample;
        // Batches have grown by now, buffers are used anew.
        let mut other = scene.clone();
        other.scan.mask_offsets.push(15e-6);
        other.objects.pop();
        engine.simulate(&other).expect("a stack");
        assert_eq!(first, engine.simulate(scene).expect("a stack").sample, "after another scene");
    }
}

#[test]
fn cells_of_a_view_do_not_depend_on_other_views() {
    let scene = scene(Scheme::Cells);
    let all = simulated(&scene);
    for view in 0..2 {
        let mut alone = scene.clone();
        alone.scan.angles = vec![scene.scan.angles[view]];
        let alone = simulated(&alone);
        for ((_, step, row, column), got) in alone.sample.indexed_iter() {
            let want = all.sample[[view, step, row, column]];
            assert_eq!(got.to_bits(), want.to_bits(), "view {view}, {step}, {column}, {row}");
        }
    }
}

#[test]
fn random_rays_serve_every_step_alike() {
    // A step alone sees the very rays that it sees among others.
    let scene = scene(Scheme::Random);
    let all = simulated(&scene);
    let mut alone = scene.clone();
    alone.scan.mask_offsets = vec![scene.scan.mask_offsets[1]];
    let alone = simulated(&alone);
    for ((view, _, row, column), got) in alone.sample.indexed_iter() {
        assert_eq!(got.to_bits(), all.sample[[view, 1, row, column]].to_bits());
    }
}

/// A result as bits.
fn bits(result: &RayResult) -> [u32; 11] {
    bytemuck::cast(*result)
}

#[test]
fn result_of_a_ray_does_not_depend_on_its_company_or_on_who_asks_for_moments() {
    // Rods with materials of their own around one another: runs of crossings end in
    // the midst of a walk. With 3 materials sums stay in registers, with 7 they do not.
    for count in [2_u32, 6] {
        let rods: Vec<_> = (0..count)
            .map(|i| {
                let k = f64::from(i);
                let rod = cylinder(0.5e-3 - 0.07e-3 * k, 1e-3 - 0.1e-3 * k, 24, 0.1 * k);
                body(rod.turned([1.0, 0.2, 0.0], 0.3).rounded(), 40.0 + 9.0 * k, (4.0 + k) * 1e-7)
            })
            .collect();
        let mut scene = scenes::scene(&Setup::paper([12, 5]), &rods, &[0.0]);
        scene.scan.angles = vec![0.0, 1.5, 0.4];
        scene.sampling.transport = Transport::FirstOrder;
        // Tiles of 4 x 4 rays of one view.
        let number = 48_u16 * 48 * 3;
        let rays: Vec<Ray> = (0..number)
            .map(|i| {
                let (within, tile) = (i % 16, i / 16);
                let at = |k: u16| 2.5e-5 * (f32::from(k) - 23.5);
                let (x, z) = (at(tile % 12 * 4 + within % 4), at(tile / 12 % 12 * 4 + within / 4));
                Ray {
                    x,
                    z,
                    slope_x: x / 1.21,
                    slope_z: z / 1.21,
                    pose: (tile / 144).into(),
                    key: 0,
                }
            })
            .collect();
        for backend in backends() {
            let engine = engine(backend);
            let simulation = engine.prepare(&scene).expect("a sample");
            let results = trace(&simulation, &rays).expect("results");
            let met = results.iter().filter(|result| result.crossings > 2).count();
            assert!(met * 4 > results.len(), "{met} of {} rays", results.len());
            let (with_moments, _) = moments(&simulation, &rays).expect("results");
            // Neighbours far apart, and of all views.
            let apart: Vec<usize> = (0..rays.len()).map(|i| i * 2_503 % rays.len()).collect();
            let shuffled: Vec<Ray> = apart.iter().map(|&i| rays[i]).collect();
            let shuffled = trace(&simulation, &shuffled).expect("results");
            for (i, result) in results.iter().enumerate() {
                assert_eq!(
                    bits(result),
                    bits(&with_moments[i]),
                    "moments asked for: {:?}",
                    rays[i]
                );
            }
            for (&i, result) in apart.iter().zip(&shuffled) {
                assert_eq!(bits(result), bits(&results[i]), "other company: {:?}", rays[i]);
            }
            for i in (0..rays.len()).step_by(601) {
                let alone = trace(&simulation, &rays[i..=i]).expect("a result");
                assert_eq!(bits(&alone[0]), bits(&results[i]), "alone: {:?}", rays[i]);
            }
        }
    }
}
