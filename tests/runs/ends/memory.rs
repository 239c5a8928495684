//! Address space that ends: an error that says what for, and never the end of the program.
//!
//! A driver (llvmpipe) that has less than it needs to begin with ends the program: so much is asked
//! for before one is opened.

use super::progress::{boxes, corner, triangles};
use super::{code_and_stderr, npy, workplace};
use crate::support::program::Workplace;
use crate::support::{amount, everything, sample};
use std::fs;
use std::process::Command;

/// Runs with so many MiB of address space: done, or an error; whether it was done.
#[track_caller]
fn within(place: &Workplace, mebibytes: u64, words: &[&str]) -> bool {
    let script = format!("ulimit -v {}; exec timeout 300 \"$@\"", mebibytes << 10);
    let mut command = Command::new("bash");
    command.args(["-c", &script, "bash", env!("CARGO_BIN_EXE_beamlet")]).args(words);
    command.current_dir(place.path("")).env_remove("RUST_LOG");
    // Threads take address space: as many everywhere.
    command.env("RAYON_NUM_THREADS", "2").env("LP_NUM_THREADS", "2").env("MALLOC_ARENA_MAX", "2");
    let (code, message) = code_and_stderr(&command.output().unwrap());
    let refused = code == Some(1) || code == Some(2);
    let told = message.contains("MiB") || message.contains("memory");
    let shown = format!("{mebibytes} MiB, {words:?}: {code:?}: {message}");
    assert!(code == Some(0) || (refused && message.contains("error: ") && told), "{shown}");
    code == Some(0)
}

/// With little memory (the first limit) it is refused, with enough (the last) it is done. Of the limits
/// between, which are in any order, every fifth one is taken; all of them with `BEAMLET_ALL`.
#[track_caller]
fn sweep(place: &Workplace, limits: &[u64], words: &[&str]) {
    let [between @ .., most] = limits else { panic!("{words:?} without a limit") };
    let limits: Vec<u64> = sample(between.to_vec(), 5).chain([*most]).collect();
    let done: Vec<bool> = limits
        .iter()
        .map(|limit| {
            let _ = fs::remove_dir_all(place.path("out"));
            within(place, *limit, words)
        })
        .collect();
    assert!(!done[0] && done[done.len() - 1], "{words:?}: {limits:?} {done:?}");
}

const RUN: [&str; 5] = ["simulate", "scene.toml", "-o", "out", "-q"];

#[test]
#[ignore = "gigabytes of memory and of frames"]
fn large_frames() {
    let frame = ["--backend", "bvh", "--format", "npy", "--set", "detector.pixels=[4096,4096]"];
    sweep(&workplace(), &[1300, 1600, 3200], &[&RUN[..], &frame].concat());
}

#[test]
#[ignore = "gigabytes of memory and of frames"]
fn many_mask_steps() {
    let steps = "scan.mask_offsets={ from = \"-25 um\", to = \"25 um\", count = 50000 }";
    let steps = ["--set", steps, "--set", "detector.pixels=[256,16]", "--format", "npy"];
    let words = [&RUN[..], &["--backend", "bvh"], &steps].concat();
    sweep(&workplace(), &[1300, 1600, 3200], &words);
}

#[test]
fn many_triangles() {
    let place = workplace();
    let sides = amount(800, 1600);
    let sphere = &format!("object.part.shape={{sphere={{radius=\"0.4 mm\",sides={sides}}}}}");
    let limits = [60, 80, 110, 200, 300, 150, 400, 500, 700, 1500];
    let check = ["check", "scene.toml", "--set", sphere];
    sweep(&place, &limits, &[&check[..], &["--no-estimate"]].concat());
    // With the device that the estimate takes.
    for limit in sample(vec![1300, 1600, 2500], 2) {
        within(&place, limit, &check);
    }
    // The same in a file of text, and with `BEAMLET_ALL` in a binary one.
    let mut text = String::new();
    let parts: u16 = amount(10_000, 30_000);
    for part in 0..parts {
        for at in 0..8 {
            let [x, y, z] = corner(part, at);
            text += &format!("v {x} {y} {z}\n");
        }
        for triangle in triangles() {
            let [a, b, c] = triangle.map(|it| u32::from(part) * 8 + 1 + u32::from(it));
            text += &format!("f {a} {b} {c}\n");
        }
    }
    fs::write(place.path("many.obj"), text).unwrap();
    fs::write(place.path("many.stl"), boxes(parts)).unwrap();
    for name in sample(vec!["many.obj", "many.stl"], 2) {
        let mesh = format!("object.part.mesh={name}");
        let unit = "object.part.unit=1 um";
        let sets = ["check", "scene.toml", "--no-estimate", "--set", &mesh, "--set", unit];
        sweep(&place, &[60, 80, 150, 200, 300, 110, 400, 500, 1500], &sets);
    }
}

#[test]
fn pictures_of_a_scene() {
    let place = workplace();
    let limits = [36, 40, 60, 80, 100, 150, 200, 300, 350, 400, 450, 500, 600, 800, 1500];
    sweep(&place, &limits, &["view", "scene.toml", "-o", "out"]);
    if everything() {
        // A million triangles, of which the plane of the set-up cuts few.
        let sphere = "object.part.shape={sphere={radius=\"0.4 mm\",sides=1000}}";
        let limits = [60, 200, 400, 500, 600, 700, 800, 1000, 1300, 2500];
        sweep(&place, &limits, &["view", "scene.toml", "-o", "out", "--set", sphere]);
    }
}

#[test]
fn drivers_that_have_too_little_to_begin_with() {
    let place = workplace();
    let small = ["--set", "detector.pixels=[16,4]", "--backend", "bvh"];
    for limit in sample(vec![100, 200, 300, 350, 400, 450, 500, 550], 3) {
        let _ = fs::remove_dir_all(place.path("out"));
        within(&place, limit, &[&RUN[..], &small].concat());
        within(&place, limit, &["devices"]);
    }
}

#[test]
fn stacks_that_are_read() {
    let place = workplace();
    let side = amount(300, 600);
    let pixels = &format!("detector.pixels=[{side},{side}]");
    let small = ["--format", "npy", "--set", pixels, "--backend", "bvh"];
    let (code, message) =
        code_and_stderr(&place.beamlet(&[&RUN[..3], &["run", "-q"], &small].concat()));
    assert_eq!(code, Some(0), "{message}");
    assert_eq!(npy(&place.path("run/flat.npy")).len(), 5 * side * side);
    // One frame of 100 or 200 MB.
    let columns = amount(25_000, 50_000);
    let mut wide = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    let dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': (1000, {columns}), }}");
    wide.extend(format!("{dict:<117}\n").bytes());
    fs::write(place.path("wide.npy"), wide).unwrap();
    let file = fs::File::options().write(true).open(place.path("wide.npy")).unwrap();
    file.set_len(128 + 4000 * columns).unwrap();
    let limits = [40, 60, 200, 300, 500, 100, 1500];
    sweep(&place, &limits, &["compare", "wide.npy", "wide.npy", "--difference", "out"]);
    for limit in sample(vec![40, 60, 100, 200, 400, 800], 3) {
        within(&place, limit, &["check", "run"]);
        within(&place, limit, &["compare", "run", "run"]);
    }
    // The page and pictures.
    let limits = [36, 40, 60, 80, 100, 150, 200, 300, 400, 600, 1500];
    sweep(&place, &limits, &["report", "run", "-o", "page.html", "--overwrite"]);
    sweep(&place, &limits, &["view", "run", "-o", "pictures", "--overwrite"]);
}
