//! A device that fails at any call: the error says what and what to do, what is committed
//! stays whole, and the run goes on to the same bits. And a memory limit changes no bit.

use crate::support::files;
use beamlet::geometry::{self, ObjectSummary};
use beamlet::internals::gpu::FaultAnswer::{
    self, DeviceLost, OutOfDeviceMemory, OutOfHostMemory, Timeout,
};
use beamlet::internals::gpu::{Fault, FaultyCall};
use beamlet::scene::Scene;
use beamlet::stack::{Format, RunDirectory};
use beamlet::{Backend, Control, Engine, EngineOptions, Error, RunRecord, internals::memory};
use std::fs;
use std::path::Path;

const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [12, 6]
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 3 }
angles = { from = "0 deg", to = "360 deg", count = 3 }

[[object]]
name = "rod"
shape = { cylinder = { radius = "0.4 mm", height = "0.5 mm", sides = 64 } }
material = "plastic"

[materials.plastic]
mu = "0.25 /cm"
delta = 2.4e-7
"#
);

/// Keys that end the scene with few lines and rays in a view.
const FEW_RAYS: &str = "[sampling]\ntolerance = 1e-2\nangle_tolerance = \"1 urad\"\n";

/// A temporary directory and the scene in it.
fn workplace() -> (tempfile::TempDir, Scene) {
    workplace_with("")
}

/// The same; `more`: keys that end the scene.
fn workplace_with(more: &str) -> (tempfile::TempDir, Scene) {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("scene.toml");
    fs::write(&path, [SCENE, more].concat()).unwrap();
    let scene = Scene::load(&path).unwrap();
    (place, scene)
}

fn run(scene: &Scene, sink: &mut RunDirectory, faults: &[Fault]) -> Result<RunRecord, Error> {
    let engine = Engine::open(
        &EngineOptions::default()
            .with_backend(Backend::Bvh)
            // Two bands.
            .with_band_rows(3)
            .with_validation(std::env::var_os("BEAMLET_VALIDATION").is_some())
            .with_faults(faults.to_vec()),
    )?;
    let skip = sink.committed().to_vec();
    let done = engine.run(scene, sink, Control::default().with_skip(skip));
    assert_eq!(engine.validation_messages(), 0);
    done
}

/// Asserts that the error is the one for this answer, with advice.
#[track_caller]
fn assert_tells(error: &Error, fault: Fault) {
    let text = error.to_string();
    let wanted = match fault.answer {
        DeviceLost => "the device was lost; ",
        Timeout => "not finished after",
        OutOfDeviceMemory => "the device has no memory left: lower the memory limit",
        OutOfHostMemory => "the host has no memory left: lower the memory limit",
    };
    assert!(text.contains(wanted), "{fault:?}: {text}");
    let memory = matches!(fault.answer, OutOfDeviceMemory | OutOfHostMemory);
    match error {
        Error::Memory { .. } => assert!(memory, "{fault:?}: {text}"),
        Error::Device { .. } => assert!(!memory, "{fault:?}: {text}"),
        _ => panic!("{fault:?}: {text}"),
    }
}

/// How many faults came before anything was written, before a view was committed, and after.
#[derive(Debug, Default)]
struct Stages {
    nothing: usize,
    no_view: usize,
    views: usize,
}

impl Stages {
    /// Lets one call of a run fail, and goes on with the run; `false` where there is no such call.
    fn fail(&mut self, [place, whole]: [&Path; 2], scene: &Scene, fault: Fault) -> bool {
        let path = place.join(fault.number.to_string());
        let mut sink = RunDirectory::create(&path, Format::Npy, false).unwrap();
        let Err(error) = run(scene, &mut sink, &[fault]) else { return false };
        drop(sink);
        assert_tells(&error, fault);
        let mut sink = if path.join("run.json").exists() {
            let log = fs::read_to_string(path.join("progress.log")).unwrap();
            let sink = RunDirectory::resume(&path, scene).unwrap();
            assert_eq!(sink.committed().len(), log.lines().count(), "{fault:?}: {log}");
            *(if log.is_empty() { &mut self.no_view } else { &mut self.views }) += 1;
            sink
        } else {
            assert!(!path.exists(), "{fault:?}: written without a run.json");
            self.nothing += 1;
            RunDirectory::create(&path, Format::Npy, false).unwrap()
        };
        run(scene, &mut sink, &[]).unwrap();
        assert!(files::of_run(&path) == files::of_run(whole), "{fault:?}: other bits");
        true
    }
}

/// Lets the calls of one kind fail at their 1st, 4th, 16th, ... and last time, with each answer in
/// turn. Of submissions and waits, which are many and alike, it is one of the last eighth. `more`: keys that
/// end the scene.
fn fail_at_every_stage(call: FaultyCall, answers: &[FaultAnswer], more: &str) -> Stages {
    let (place, scene) = workplace_with(more);
    let whole = place.path().join("whole");
    run(&scene, &mut RunDirectory::create(&whole, Format::Npy, false).unwrap(), &[]).unwrap();
    let mut stages = Stages::default();
    let mut answers = answers.iter().cycle();
    let mut fails = |number: u64| {
        let fault = Fault { call, number, answer: *answers.next().unwrap() };
        stages.fail([place.path(), &whole], &scene, fault)
    };
    let (mut last, mut beyond) = (0, 1);
    while fails(beyond) {
        assert!(beyond < 1 << 32, "{call:?} has no end");
        (last, beyond) = (beyond, 4 * beyond);
    }
    let alike = matches!(call, FaultyCall::Submit | FaultyCall::Wait);
    let near = |last: u64| if alike { 1 + last / 8 } else { 1 };
    while beyond - last > near(last) {
        let middle = u64::midpoint(last, beyond);
        *(if fails(middle) { &mut last } else { &mut beyond }) = middle;
    }
    assert!(last > 0, "{call:?} fails never");
    stages
}

#[test]
fn memory_that_runs_out_is_told_and_leaves_committed_views() {
    let answers = [OutOfDeviceMemory, OutOfHostMemory];
    let stages = fail_at_every_stage(FaultyCall::Allocate, &answers, FEW_RAYS);
    // All memory of the device is there before the first view is committed.
    assert!(stages.nothing > 0 && stages.no_view > 0 && stages.views == 0, "{stages:?}");
}

#[test]
fn a_kernel_that_cannot_be_made_is_told_and_leaves_committed_views() {
    // The last kernel, "illuminate far", is made where light first needs it: after a view here.
    let answers = [OutOfHostMemory, OutOfDeviceMemory];
    let stages = fail_at_every_stage(FaultyCall::MakeKernel, &answers, "");
    assert!(stages.nothing > 0 && stages.views > 0, "{stages:?}");
}

#[test]
fn work_that_is_refused_leaves_committed_views() {
    let answers = [DeviceLost, OutOfDeviceMemory, OutOfHostMemory];
    let stages = fail_at_every_stage(FaultyCall::Submit, &answers, FEW_RAYS);
    assert!(stages.views > 0, "{stages:?}");
}

#[test]
fn a_device_that_is_lost_or_hangs_leaves_committed_views() {
    let answers = [Timeout, DeviceLost, OutOfHostMemory];
    let stages = fail_at_every_stage(FaultyCall::Wait, &answers, FEW_RAYS);
    assert!(stages.views > 0, "{stages:?}");
}

#[test]
fn a_memory_limit_changes_bands_and_groups_but_no_bit() {
    let (_place, scene) = workplace();
    let stacks = |limit: Option<u64>| {
        let engine = Engine::open(
            &EngineOptions::default().with_backend(Backend::Bvh).with_memory_limit(limit),
        )
        .unwrap();
        let simulation = engine.prepare(&scene).unwrap();
        (*simulation.memory(), engine.simulate(&scene).unwrap())
    };
    let (free, expected) = stacks(None);
    assert_eq!(free.band_rows, 6);
    let tight = smallest_limit(&scene);
    let (limited, found) = stacks(Some(tight));
    assert!(limited.band_rows == 1 && limited.rays_at_once < free.rays_at_once, "{limited:?}");
    assert!(limited.peak_bytes <= tight);
    assert!(found.flat == expected.flat && found.sample == expected.sample);
}

/// The smallest limit that a run accepts.
fn smallest_limit(scene: &Scene) -> u64 {
    let objects = geometry::load(scene).unwrap().objects;
    let (mut refused, mut accepted) = (0, 1 << 40);
    while accepted - refused > 1 {
        let middle = u64::midpoint(refused, accepted);
        match memory::estimate(scene, &objects, Some(middle), None) {
            Ok(_) => accepted = middle,
            Err(_) => refused = middle,
        }
    }
    accepted
}

/// Summary of a rod of this number of triangles, for the estimate.
fn rod(triangles: usize) -> [ObjectSummary; 1] {
    let (_place, scene) = workplace();
    let mut rod = geometry::load(&scene).unwrap().objects.remove(0);
    rod.triangles = triangles;
    [rod]
}

#[test]
fn a_limit_below_one_row_is_refused_with_what_to_change() {
    let (_place, mut scene) = workplace();
    let error = memory::estimate(&scene, &rod(252), Some(1 << 20), None).unwrap_err();
    let Error::Memory { needed, available, .. } = &error else { panic!("{error}") };
    assert!(*needed > 1 << 20 && *available == Some(1 << 20), "{error}");
    assert!(error.to_string().contains("raise the memory limit"), "{error}");
    scene.detector.pixels = [1 << 20, 4];
    scene.scan.mask_offsets = vec![0.0; 1000];
    let error = memory::estimate(&scene, &rod(252), Some(2 << 30), None).unwrap_err().to_string();
    assert!(error.contains("fewer columns or mask steps"), "{error}");
    let error =
        memory::estimate(&scene, &rod(1 << 30), Some(2 << 30), None).unwrap_err().to_string();
    assert!(error.contains("simplify the meshes"), "{error}");
}

#[test]
fn what_is_estimated_grows_with_triangles_pixels_and_steps() {
    let (_place, scene) = workplace();
    let peak = |scene: &Scene, triangles: usize| {
        memory::estimate(scene, &rod(triangles), None, None).unwrap().peak_bytes
    };
    assert!(peak(&scene, 2_000_000) > peak(&scene, 1_000_000) + (100 << 20));
    let mut large = scene.clone();
    large.detector.pixels = [4096, 4096];
    assert!(peak(&large, 252) > peak(&scene, 252) + (500 << 20));
    let mut many = large.clone();
    many.scan.mask_offsets = vec![0.0; 1000];
    // Bands stay within 1 GiB, whatever the number of steps.
    assert!(peak(&many, 252) < peak(&large, 252) + (1 << 30));
}
