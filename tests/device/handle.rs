//! Clones of an engine: shared by threads, closed by the last user, and beside another engine.

use crate::support;
use beamlet::scene::Scene;
use beamlet::stack::{ArraySink, Stacks};
use beamlet::{Backend, Control, Engine, EngineOptions, Simulation, Traffic};

const ROD: &str = r#"
source = { distance = "1.2 m", spot = "30 um", energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [12, 4], pitch = "150 um" }
sample_mask = { distance = "1.1 m", transmission = 0.0, projected_aperture = "30 um" }
detector_mask = { transmission = 0.0, projected_aperture = "30 um" }
scan = { mask_offsets = ["-10 um", "0 um", "10 um"], angles = ["0 deg", "20 deg"] }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.4 mm", height = "3 mm" } }
material = "nylon-66"
rotate = [{ axis = [0, 1, 0], angle = "20 deg" }]
"#;

fn options() -> EngineOptions {
    EngineOptions::default().with_backend(Backend::Bvh)
}

fn open() -> Engine {
    Engine::open(&options()).expect("a Vulkan device")
}

fn rod() -> Scene {
    Scene::from_toml(ROD, ".").expect("a scene")
}

fn bits(stacks: &Stacks) -> Vec<u32> {
    stacks.flat.iter().chain(&stacks.sample).map(|value| value.to_bits()).collect()
}

fn expected() -> Vec<u32> {
    bits(&support::engine(Backend::Bvh).simulate(&rod()).expect("stacks"))
}

fn run(simulation: &Simulation) -> Vec<u32> {
    let mut sink = ArraySink::new();
    simulation.run(&mut sink, Control::default()).expect("a run");
    bits(&sink.into_stacks().expect("stacks"))
}

#[test]
fn one_engine_in_four_threads_gives_the_same_bits() {
    let engine = open();
    let threads: Vec<_> = (0..4)
        .map(|_| {
            let engine = engine.clone();
            std::thread::spawn(move || bits(&engine.simulate(&rod()).expect("stacks")))
        })
        .collect();
    let expected = expected();
    for thread in threads {
        assert!(thread.join().expect("no panic") == expected);
    }
    assert!(engine.close(), "nobody uses the device any more");
}

#[test]
fn two_engines_on_one_device_give_the_same_bits_side_by_side() {
    let [first, second] = [open(), open()];
    let other = std::thread::spawn(move || bits(&second.simulate(&rod()).expect("stacks")));
    let expected = expected();
    assert!(bits(&first.simulate(&rod()).expect("stacks")) == expected);
    assert!(other.join().expect("no panic") == expected);
}

#[test]
fn a_simulation_outlives_every_handle_of_its_engine() {
    let engine = open();
    let clone = engine.clone();
    let simulation = engine.prepare(&rod()).expect("a simulation");
    drop(clone);
    assert!(!engine.close(), "the simulation still uses the device");
    assert!(run(&simulation) == expected());
    // Another thread may be its last owner.
    std::thread::spawn(move || drop(simulation)).join().expect("no panic");
}

#[test]
fn dropping_an_engine_while_a_clone_runs_leaves_the_run_whole() {
    let engine = open();
    let clone = engine.clone();
    let (begun, begins) = std::sync::mpsc::channel();
    let thread = std::thread::spawn(move || {
        let simulation = clone.prepare(&rod()).expect("a simulation");
        begun.send(()).expect("a listener");
        run(&simulation)
    });
    begins.recv().expect("a run");
    drop(engine);
    assert!(thread.join().expect("no panic") == expected());
}

/// On a CPU device mapped memory is reached directly; staging copies by submissions of their own, as a
/// device with memory of its own does, and is the same work else.
#[test]
fn staging_changes_no_bit_and_no_kernel() {
    let [mapped, staged] = [false, true].map(|staging| {
        let engine = Engine::open(&options().with_profile(true).with_staging(staging)).unwrap();
        let stacks = engine.simulate(&rod()).unwrap();
        (bits(&stacks), engine.profile())
    });
    assert_eq!(mapped.0, staged.0);
    // Dispatches are smaller on a machine that is busy.
    let kernels =
        |profile: &beamlet::Profile| -> Vec<String> { profile.kernels.keys().cloned().collect() };
    assert_eq!(kernels(&mapped.1), kernels(&staged.1));
    assert!(!mapped.1.kernels.is_empty());
    let [mapped, staged] = [mapped.1.traffic, staged.1.traffic];
    assert_eq!(mapped.bytes_to_device, staged.bytes_to_device);
    assert_eq!(mapped.bytes_to_host, staged.bytes_to_host);
    assert!(staged.submissions >= mapped.submissions && staged.buffers >= mapped.buffers);
}

/// Work of views of a rod, all under one angle, where all memory is reached by staging.
fn traffic(engine: &Engine, views: usize) -> Traffic {
    let angles = vec!["\"20 deg\""; views].join(", ");
    let text = ROD.replace("[\"0 deg\", \"20 deg\"]", &format!("[{angles}]"));
    let scene = Scene::from_toml(&text, ".").expect("a scene");
    let before = engine.profile().traffic;
    engine.simulate(&scene).expect("stacks");
    engine.profile().traffic.since(before)
}

/// Views that are alike make no buffer after the first of them, also where all memory is reached by staging:
/// transfers share their buffers with one another, and most of them the submission of a dispatch.
#[test]
fn a_later_view_makes_no_buffer() {
    let engine =
        Engine::open(&options().with_profile(true).with_staging(true)).expect("a Vulkan device");
    // A round of rays for each level of heights and of pieces near rims (100 on a quiet device), and the light of cells.
    let each = |_| {
        let [two, five] = [2, 5].map(|views| traffic(&engine, views));
        // The first run makes buffers for transfers.
        assert!(five.buffers <= two.buffers, "{two:?} {five:?}");
        five.submissions.saturating_sub(two.submissions) / 3
    };
    // Where other programs slow the device, work is given to it in smaller parts: three attempts.
    let is_few = |submissions: u64| 0 < submissions && submissions <= 120;
    assert!((0..3).map(each).any(is_few), "more submissions of a view than it has rounds");
}

/// A fork has no threads, and the device of its parent: it gets an error and ends; the parent goes on.
#[cfg(unix)]
#[test]
fn a_fork_is_refused_by_the_engine_of_its_parent() {
    let engine = Engine::open(&options()).expect("a Vulkan device");
    let before = bits(&engine.simulate(&rod()).expect("stacks"));
    // SAFETY: the child calls the engine alone, which refuses it before it takes a lock of another thread, and ends without the destructors of the parent.
    let child = unsafe { libc::fork() };
    if child == 0 {
        let refused = |error: beamlet::Error| error.to_string().contains("is a fork of process");
        let by_parent = engine.simulate(&rod()).err().is_some_and(refused);
        let by_new = Engine::open(&options()).err().is_some_and(refused);
        let is_open = engine.close();
        // SAFETY: ends the child.
        unsafe { libc::_exit(i32::from(!(by_parent && by_new && is_open))) };
    }
    let mut status = 0;
    // SAFETY: the child of this process.
    let ended = unsafe { libc::waitpid(child, &raw mut status, 0) };
    assert!(
        ended == child && libc::WIFEXITED(status) && libc::WEXITSTATUS(status) == 0,
        "{status}"
    );
    assert_eq!(bits(&engine.simulate(&rod()).expect("stacks")), before);
}
