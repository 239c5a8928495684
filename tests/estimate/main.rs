//! The estimate of a run's rays, from a sparse look at its scene, against the run.
//!
//! A program of its own: a look lasts a second, and sees less where other tests take its time.

use beamlet_reference as reference;
#[path = "../support/mod.rs"]
mod support;

use beamlet::check::Check;
use beamlet::scene::{KernelFile, RandomRays, Scatter, Scene, Scheme};
use beamlet::stack::ArraySink;
use beamlet::{Backend, Control, RunRecord};
use reference::scenes;
use reference::silhouettes::{bumpy, fibres};
use reference::stack::Setup;
use reference::surfaces::{Body, Mesh, body, cylinder};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use support::{CARBON, Checked, Worst, engine};

const OFFSETS: [f64; 3] = [-15e-6, 0.0, 15e-6];

/// An estimate looks at as much as it can in a second: one beside another sees less.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn carbon(mesh: Mesh) -> Body {
    body(mesh.rounded(), CARBON[0], CARBON[1])
}

fn ran(engine: &Checked, scene: &Scene) -> RunRecord {
    engine.run(scene, &mut ArraySink::new(), Control::default()).expect("a run")
}

/// The estimate may be wrong by a factor of 2.5: it looks at a part of the patches, and those with a silhouette or corners
/// differ by as much.
fn compare(name: &'static str, scene: &Scene) {
    let _alone = alone();
    let engine = engine(Backend::Bvh);
    let report = Check::of(scene).with_engine(&engine).run().expect("a report");
    let estimate = report.work.estimate.expect("an estimate");
    let tally = ran(&engine, scene).tally;
    let views = scene.scan.angles.len() as f64;
    let mut worst = Worst::new(name, f64::log2(2.5));
    let mut take = |what: &str, told: f64, true_count: u64| {
        // Meshes may need no ray.
        worst.take((told.max(1.0) / true_count.max(1) as f64).log2(), || {
            format!("{what}: {told} of {true_count}")
        });
    };
    take("rays", estimate.rays, tally.rays);
    take("rays of a view", estimate.rays_per_view * views, tally.rays);
    take("lines", estimate.lines, tally.lines);
    assert!(estimate.patches_sampled > 0.0 && estimate.seconds > 0.0, "{estimate:?}");
    worst.holds();
}

#[test]
fn rays_of_a_bumpy_ball_are_estimated_within_the_factor() {
    let ball = carbon(bumpy(1.5e-3, 4).moved([0.1e-3, 0.0, 0.2e-3]));
    let setup = Setup::paper([48, 48]);
    compare("estimate, ball (factor, as its logarithm)", &scenes::scene(&setup, &[ball], &OFFSETS));
}

/// The measured error of an estimate, of some patches, is that of a run whose every patch is audited, within three of the
/// standard errors of both.
#[test]
fn the_error_of_sampling_is_that_of_a_run() {
    let _alone = alone();
    let ball = carbon(bumpy(1.5e-3, 4).moved([0.1e-3, 0.0, 0.2e-3]));
    let mut scene = scenes::scene(&Setup::paper([48, 24]), &[ball], &[-20e-6, 0.0, 9e-6]);
    scene.sampling.tolerance = Some(3e-3);
    scene.sampling.audit = 1.0;
    let engine = engine(Backend::Bvh);
    let want = ran(&engine, &scene).sampling_error.expect("a measured error").all;
    let report = Check::of(&scene).with_engine(&engine).run().expect("a report");
    let estimate = report.work.estimate.expect("an estimate");
    let got = estimate.sampling_error.expect("a measured error");
    println!("measured audit of an estimate: {got:?} for {want:?}");
    // Four blocks of two patches where patches are slow, up to eight blocks of eight.
    assert!(got.patches >= 8 && got.patches <= 64, "{got:?}");
    let both = got.standard_error.hypot(want.standard_error);
    assert!(want.rms > 1e-5 && (got.rms - want.rms).abs() < 3.0 * both, "{got:?} for {want:?}");
}

#[test]
fn rays_of_views_that_differ_are_estimated_within_the_factor() {
    // A bundle seen from many sides, and a tall cylinder that is alike in all of them.
    let bodies = [
        carbon(fibres(60, 2.5e-6, 16).moved([0.4e-3, 0.0, 0.0])),
        carbon(cylinder(0.2e-3, 6e-3, 64, 0.3).moved([-0.5e-3, 0.0, 0.0])),
    ];
    let mut scene = scenes::scene(&Setup::paper([16, 6]), &bodies, &OFFSETS);
    scene.scan.angles = (0..5).map(|view| 0.3 * f64::from(view)).collect();
    scene.sampling.tolerance = Some(1e-3);
    compare("estimate, five views (factor, as its logarithm)", &scene);
}

#[test]
fn rays_of_a_radiograph_are_estimated_within_the_factor() {
    let mut setup = Setup::paper([32, 32]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    let ball = carbon(bumpy(1.2e-3, 4));
    compare(
        "estimate, no masks (factor, as its logarithm)",
        &scenes::scene(&setup, &[ball], &[0.0]),
    );
}

#[test]
fn random_rays_are_counted_exactly() {
    let ball = carbon(bumpy(1.0e-3, 3));
    let mut scene = scenes::scene(&Setup::paper([32, 16]), &[ball], &OFFSETS);
    (scene.sampling.scheme, scene.sampling.rays) = (Scheme::Random, RandomRays::Grid([20, 2]));
    let report = Check::of(&scene).with_engine(&engine(Backend::Bvh)).run().expect("a report");
    let estimate = report.work.estimate.expect("an estimate");
    assert!((estimate.rays - 32.0 * 16.0 * 40.0).abs() < 0.5, "{estimate:?}");
}

/// Light of all steps was summed to time it: minutes.
#[test]
fn a_hundred_thousand_mask_steps_are_estimated_from_some_of_them() {
    let ball = carbon(bumpy(1.0e-3, 3));
    let offsets = |count: u32| -> Vec<f64> {
        (0..count).map(|i| 50e-6 * (f64::from(i) / f64::from(count) - 0.5)).collect()
    };
    let setup = Setup::paper([16, 4]);
    let _alone = alone();
    let engine = engine(Backend::Bvh);
    let told = |count| {
        let scene = scenes::scene(&setup, std::slice::from_ref(&ball), &offsets(count));
        let begin = Instant::now();
        let report = Check::of(&scene).with_engine(&engine).run().expect("a report");
        let estimate = report.work.estimate.expect("an estimate");
        (estimate.seconds, begin.elapsed().as_secs_f64())
    };
    told(100);
    let (some, all) = (told(1000), told(100_000));
    let grown = all.0 / some.0;
    assert!(grown > 10.0 && all.0 > 2.0 * all.1, "{some:?} {all:?}");
}

#[test]
fn patches_full_of_silhouettes_are_in_the_memory_that_is_told() {
    let _alone = alone();
    // A star: every second corner lies near the axis, and caps are fans about it.
    let n = 1002_u32;
    let corner = |k: u32| {
        let (sine, cosine) = (std::f64::consts::TAU * f64::from(k) / f64::from(n)).sin_cos();
        let radius = if k.is_multiple_of(2) { 1.2e-3 } else { 0.2e-3 };
        [radius * cosine, radius * sine]
    };
    let mut teeth = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for z in [-1e-3, 1e-3] {
        teeth.vertices.extend((0..n).map(corner).map(|[x, y]| [x, y, z]));
    }
    teeth.vertices.extend([[0.0, 0.0, -1e-3], [0.0, 0.0, 1e-3]]);
    for i in 0..n {
        let j = (i + 1) % n;
        let side = [[i, j, n + j], [i, n + j, n + i]];
        teeth.triangles.extend(side.into_iter().chain([[2 * n, j, i], [2 * n + 1, n + i, n + j]]));
    }
    let teeth = carbon(teeth);
    let scene = scenes::scene(&Setup::paper([16, 4]), &[teeth], &[0.0]);
    let blind = Check::of(&scene).run().expect("a report").work.memory;
    let told =
        Check::of(&scene).with_engine(&engine(Backend::Bvh)).run().expect("a report").work.memory;
    assert_eq!(told.rays_at_once, blind.rays_at_once);
    assert!(told.peak_bytes > blind.peak_bytes + (1 << 20), "{told:?} {blind:?}");
    // Patches that wait for one another bound it.
    assert!(told.peak_bytes < 2 << 30, "{told:?}");
}

#[test]
fn what_a_detector_spreads_is_in_the_time_and_the_memory_that_are_told() {
    let _alone = alone();
    let place = tempfile::tempdir().expect("a directory");
    let path = place.path().join("veil.npy");
    let veil = ndarray::Array2::from_elem((301, 301), 1.0_f64);
    ndarray_npy::write_npy(&path, &veil).expect("a kernel");
    let setup = Setup::paper([256, 256]);
    let offsets: Vec<f64> = (0..100).map(|i| f64::from(i) * 1e-6).collect();
    let mut scene = scenes::scene(&setup, &[], &offsets);
    let engine = engine(Backend::Bvh);
    let told = |scene: &Scene| Check::of(scene).with_engine(&engine).run().expect("a report").work;
    let sharp = told(&scene);
    let kernel = KernelFile::new(path, setup.pitch);
    scene.detector.scatter = Some(Scatter::Kernel { kernel, fraction: 0.1 });
    let veiled = told(&scene);
    let seconds =
        |work: &beamlet::check::Work| work.estimate.as_ref().expect("an estimate").seconds;
    // Ninety times as long when this was written.
    assert!(seconds(&veiled) > 3.0 * seconds(&sharp), "{veiled:?} {sharp:?}");
    assert!(veiled.memory.peak_bytes > sharp.memory.peak_bytes + (32 << 20), "{veiled:?}");
}

#[test]
fn scenes_without_a_sample_or_a_device_have_no_rays_or_no_estimate() {
    let empty = scenes::scene(&Setup::paper([16, 8]), &[], &OFFSETS);
    let report = Check::of(&empty).with_engine(&engine(Backend::Bvh)).run().expect("a report");
    assert!(report.work.estimate.is_some_and(|estimate| estimate.rays == 0.0));
    let report = Check::of(&empty).run().expect("a report");
    assert!(report.work.estimate.is_none() && report.work.no_estimate.is_some());
}
