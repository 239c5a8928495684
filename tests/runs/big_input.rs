//! Large inputs with the real program: they run within the memory that `check` tells.
//!
//! The largest sizes are ignored by default: some minutes. All of them:
//! `cargo test --release --test runs -- big_input:: --include-ignored --nocapture --test-threads 1`
//!
//! Measured is the peak resident set of the process, which on a CPU device holds the device's
//! memory too; on other devices there is nothing to compare.
#![cfg(all(feature = "cli", target_os = "linux"))]

use beamlet::internals::gpu::{Device, DeviceKind, DeviceOptions};
use std::fs::{self, File};
use std::io::{BufWriter, Read, Write};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// `check` and the peak may differ by this share.
const TOLERANCE: f64 = 0.2;

const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [64, 8]
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 3 }

[[object]]
name = "ball"
material = "plastic"
OBJECT

[materials.plastic]
mu = "0.25 /cm"
delta = 2.4e-7
"#
);

/// Writes a sphere of `meridians` x half as many circles of latitude as binary STL; tells the
/// number of triangles. Radius 4.
fn sphere(path: &Path, meridians: u32) -> u32 {
    let rings = meridians / 2;
    let count = 2 * meridians * (rings - 1);
    let mut out = BufWriter::new(File::create(path).unwrap());
    out.write_all(&[0; 80]).unwrap();
    out.write_all(&count.to_le_bytes()).unwrap();
    let point = |ring: u32, meridian: u32| {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        let around = std::f64::consts::TAU * f64::from(meridian % meridians) / f64::from(meridians);
        let radius = if ring == 0 || ring == rings { 0.0 } else { polar.sin() };
        [radius * around.cos(), radius * around.sin(), polar.cos()].map(|x| single(4.0 * x))
    };
    let mut facet = |corners: [[f32; 3]; 3]| {
        out.write_all(&[0; 12]).unwrap();
        corners.as_flattened().iter().for_each(|x| out.write_all(&x.to_le_bytes()).unwrap());
        out.write_all(&[0; 2]).unwrap();
    };
    for ring in 0..rings {
        for at in 0..meridians {
            let [a, b] = [point(ring, at), point(ring, at + 1)];
            let [c, d] = [point(ring + 1, at), point(ring + 1, at + 1)];
            if ring > 0 {
                facet([a, c, b]);
            }
            if ring + 1 < rings {
                facet([b, c, d]);
            }
        }
    }
    out.flush().unwrap();
    count
}

fn single(value: f64) -> f32 {
    value as f32
}

fn beamlet(place: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
    // The validation layer takes memory of its own.
    command.current_dir(place).env_remove("VK_INSTANCE_LAYERS");
    command
}

/// Peak resident set of a run, in bytes.
fn peak_of(place: &Path, arguments: &[&str]) -> u64 {
    let (peak, message, ended) = watched(place, arguments);
    assert!(ended.success(), "{arguments:?}: {message}");
    peak
}

/// Runs a scene: its peak resident set in bytes, its standard error, and its exit status.
pub(super) fn watched(place: &Path, arguments: &[&str]) -> (u64, String, ExitStatus) {
    let mut command = beamlet(place);
    command.args(["simulate", "scene.toml", "-o", "run", "-q"]);
    if arguments.contains(&VIEWS) {
        // Tens of thousands of files would measure the file system.
        command.args(["--format", "npy"]);
    }
    let mut child =
        command.args(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        // The kernel keeps the peak; the last look before the end has it.
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kibibytes = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        peak = kibibytes.map_or(peak, |kibibytes: u64| kibibytes << 10);
        if let Some(ended) = child.try_wait().unwrap() {
            let mut message = String::new();
            child.stderr.take().unwrap().read_to_string(&mut message).unwrap();
            return (peak, message, ended);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// True if host and device are one process: what is estimated and limited is its resident set.
pub(super) fn is_one_process() -> bool {
    let device = Device::open(&DeviceOptions::default()).unwrap();
    device.description().kind == DeviceKind::Cpu
}

/// Memory that `check --json` reports for the work.
pub(super) fn check(place: &Path, arguments: &[&str]) -> serde_json::Value {
    let output = beamlet(place)
        .args(["check", "scene.toml", "--json", "--no-estimate"])
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    report["work"]["memory"].clone()
}

/// Runs a scene and compares its peak with what `check` tells.
#[track_caller]
fn compare(name: &str, place: &Path, object: &str, arguments: &[&str]) {
    fs::write(place.join("scene.toml"), SCENE.replace("OBJECT", object)).unwrap();
    let told = check(place, arguments);
    let estimate = told["peak_bytes"].as_f64().unwrap();
    let began = Instant::now();
    let peak = peak_of(place, arguments) as f64;
    let mib = f64::from(1 << 20);
    println!(
        "{name}: check {:.0} MiB, measured {:.0} MiB ({:+.1} %), {} rows in a band, {:.1} s",
        estimate / mib,
        peak / mib,
        100.0 * (peak / estimate - 1.0),
        told["band_rows"],
        began.elapsed().as_secs_f64()
    );
    if arguments.contains(&"--memory-limit") {
        assert!(peak <= estimate, "{name}: more than the limit: {told}");
    }
    if is_one_process() {
        assert!((peak / estimate - 1.0).abs() < TOLERANCE, "{name}: {told}");
    }
}

const SHAPE: &str = r#"shape = { sphere = { radius = "4 mm", sides = 64 } }"#;

fn mesh(meridians: u32) {
    let place = tempfile::tempdir().unwrap();
    let triangles = sphere(&place.path().join("ball.stl"), meridians);
    let object = "mesh = \"ball.stl\"\nunit = \"mm\"";
    compare(&format!("{triangles} triangles"), place.path(), object, &[]);
}

#[test]
fn half_a_million_triangles_take_what_check_tells() {
    mesh(710);
}

#[test]
#[ignore = "a minute"]
fn three_million_triangles_take_what_check_tells() {
    mesh(1734);
}

#[test]
#[ignore = "minutes"]
fn ten_million_triangles_take_what_check_tells() {
    mesh(3164);
}

#[test]
fn a_million_pixels_take_what_check_tells() {
    frame("1024");
}

#[test]
#[ignore = "minutes"]
fn sixteen_million_pixels_in_one_band_take_what_check_tells() {
    frame("4096");
}

#[test]
#[ignore = "minutes"]
fn sixteen_million_pixels_fit_in_a_limit() {
    let place = tempfile::tempdir().unwrap();
    let sets = ["--set", "detector.pixels=[4096,4096]", "--memory-limit", "500 MiB"];
    compare("4096 x 4096 x 3 within 500 MiB", place.path(), &small_rod(), &sets);
}

/// A rod that few beamlets meet.
fn small_rod() -> String {
    r#"shape = { cylinder = { radius = "0.4 mm", height = "1 mm", sides = 64 } }"#.into()
}

fn frame(side: &str) {
    let place = tempfile::tempdir().unwrap();
    let set = format!("detector.pixels=[{side},{side}]");
    compare(&format!("{side} x {side} x 3"), place.path(), &small_rod(), &["--set", &set]);
}

#[test]
fn a_thousand_mask_steps_take_what_check_tells() {
    let place = tempfile::tempdir().unwrap();
    let steps = "scan.mask_offsets={ from = \"-50 um\", to = \"50 um\", count = 1000 }";
    let sets = ["--set", steps, "--set", "detector.pixels=[64,16]"];
    compare("1000 steps of 64 x 16", place.path(), SHAPE, &sets);
}

const VIEWS: &str = "scan.angles={ from = \"0 deg\", to = \"360 deg\", count = 10000 }";

#[test]
#[ignore = "minutes"]
fn ten_thousand_views_take_what_check_tells() {
    let place = tempfile::tempdir().unwrap();
    let sets = ["--set", VIEWS, "--set", "detector.pixels=[8,2]"];
    compare("10000 views of 8 x 2", place.path(), &small_rod(), &sets);
}

/// Runs of 2,000 and of 200 views have the same peak within 4 MiB: angles, log and record of a view
/// take about a kilobyte.
#[test]
#[ignore = "a minute: in .ci/long"]
fn memory_is_flat_over_two_thousand_views() {
    let peak = |views: u32| {
        let place = tempfile::tempdir().unwrap();
        let scene = SCENE.replace("OBJECT", &small_rod());
        fs::write(place.path().join("scene.toml"), scene).unwrap();
        let angles =
            format!("scan.angles={{ from = \"0 deg\", to = \"360 deg\", count = {views} }}");
        let words = ["--set", &angles, "--set", "sampling.tolerance=1e-3", "--format", "npy"];
        let (peak, message, ended) = watched(place.path(), &words);
        assert!(ended.success(), "{message}");
        peak
    };
    let [few, many] = [200, 2000].map(peak);
    println!("measured peaks of 200 and 2,000 views: {few} and {many} bytes");
    assert!(many < few + (4 << 20), "{few} and {many} bytes");
}
