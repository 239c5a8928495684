//! The ends of what a scene may ask for, and what may happen beside a run, with the real program:
//! done with rays in balance, or refused with a reason.
#![cfg(all(feature = "cli", target_os = "linux"))]

mod beside;
mod memory;
mod progress;
mod sizes;
mod spectra;

use crate::support::program::{self, Workplace, ended};
use crate::support::sample;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const SCENE: &str = concat!(
    include_str!("../../support/paper.toml"),
    r#"pixels = [64, 8]
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 5 }

[[object]]
name = "part"
shape = { cylinder = { radius = "0.4 mm", height = "1 mm", sides = 64 } }
material = "water"
"#
);

fn workplace() -> Workplace {
    Workplace::new(SCENE)
}

/// Simulates into `run` with these `--set`, on a backend.
fn simulate(place: &Workplace, backend: &str, sets: &[&str]) -> Output {
    let _ = fs::remove_dir_all(place.path("run"));
    let begin = ["simulate", "scene.toml", "-o", "run", "-q", "--format", "npy", "--backend"];
    let sets = sets.iter().flat_map(|set| ["--set", set]);
    place.beamlet(&begin.into_iter().chain([backend]).chain(sets).collect::<Vec<_>>())
}

/// A run is done: rays in balance, values that are light. With `BEAMLET_ALL` on both backends.
#[track_caller]
fn is_balanced(place: &Workplace, sets: &[&str]) {
    for backend in sample(vec!["bvh", "ray-query"], 2) {
        let output = simulate(place, backend, sets);
        assert_eq!(ended(&output, 0), "", "{sets:?}");
        let tally = &json(&place.path("run/run.json"))["tally"];
        for count in ["unbalanced", "unordered", "dropped", "not_finite", "landed_off"] {
            assert_eq!(tally[count], 0, "{sets:?} {backend}: {tally}");
        }
        let values = npy(&place.path("run/sample.npy"));
        assert!(values.iter().all(|value| (0.0..=1.1).contains(value)), "{sets:?}");
    }
}

/// A run is refused with all of these words, and nothing is written.
#[track_caller]
fn is_refused(place: &Workplace, sets: &[&str], words: &[&str]) {
    let message = ended(&simulate(place, "bvh", sets), 1);
    assert!(message.starts_with("error: "), "{sets:?}: {message}");
    for word in words {
        assert!(message.contains(word), "{sets:?}: no {word:?} in: {message}");
    }
    assert!(!place.path("run").exists(), "{sets:?}");
}

fn beamlet(place: &Path, words: &[&str]) -> Command {
    let mut command = program::beamlet(place);
    command.args(words);
    command
}

/// Exit code, and what stands on stderr.
fn code_and_stderr(output: &Output) -> (Option<i32>, String) {
    (output.status.code(), program::stderr(output))
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Values of an array that beamlet wrote.
fn npy(path: &Path) -> Vec<f32> {
    let bytes = fs::read(path).unwrap();
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[header..].as_chunks().0.iter().map(|four| f32::from_le_bytes(*four)).collect()
}
