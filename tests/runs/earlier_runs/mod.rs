//! Runs of earlier versions: every verb of the program reads them.
//!
//! `format_0` was written before run.json had a `format_version`: 2 views of 3 steps of 8 x 4
//! pixels, with moments.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use crate::support::program::run;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A folder with a copy of the run in `run` and its scene.
fn place() -> TempDir {
    let place = tempfile::tempdir().unwrap();
    let run = place.path().join("run");
    fs::create_dir_all(run.join("moments")).unwrap();
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/runs/earlier_runs/format_0");
    let files =
        ["flat.npy", "sample.npy", "progress.log", "run.json", "scene.toml"].map(str::to_owned);
    let moments = [0, 1].map(|view| format!("moments/view_{view:04}.bin"));
    for name in files.iter().chain(&moments) {
        fs::copy(from.join(name), run.join(name)).unwrap();
    }
    fs::copy(from.join("scene.toml"), place.path().join("scene.toml")).unwrap();
    place
}

/// Ends with 0.
fn passes(place: &TempDir, line: &str) {
    let output = run(place, line);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{line}: {stderr}");
}

fn run_json(place: &TempDir) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(place.path().join("run/run.json")).unwrap()).unwrap()
}

fn write_run_json(place: &TempDir, value: &serde_json::Value) {
    fs::write(place.path().join("run/run.json"), value.to_string()).unwrap();
}

#[test]
fn a_run_without_a_format_version_is_read_by_every_verb() {
    let place = place();
    assert!(run_json(&place).get("format_version").is_none());
    passes(&place, "check run");
    passes(&place, "retrieve run --method three-step");
    passes(&place, "view run -o pictures");
    passes(&place, "report run");
    passes(&place, "illuminate run --scene scene.toml -o again --format npy");
    passes(&place, "compare run again --tolerance 1e-5");
    assert!(place.path().join("pictures").read_dir().unwrap().count() > 3);
    assert!(place.path().join("run/report.html").exists());
}

#[test]
fn a_run_without_a_format_version_is_resumed() {
    let place = place();
    let log = place.path().join("run/progress.log");
    let lines = fs::read_to_string(&log).unwrap();
    let whole = fs::read(place.path().join("run/sample.npy")).unwrap();
    let kept: Vec<&str> = lines.lines().filter(|line| !line.starts_with("sample/1 ")).collect();
    fs::write(&log, kept.join("\n") + "\n").unwrap();
    fs::remove_file(place.path().join("run/moments/view_0001.bin")).unwrap();
    let mut json = run_json(&place);
    json["state"] = "running".into();
    write_run_json(&place, &json);
    passes(&place, "simulate scene.toml -o run --resume --allow-mixed");
    passes(&place, "check run");
    let json = run_json(&place);
    assert_eq!((&json["state"], &json["resumed_views"]), (&"done".into(), &2.into()));
    assert_eq!(json["format_version"], 1);
    let again = fs::read(place.path().join("run/sample.npy")).unwrap();
    assert_eq!(again[..again.len() - 384], whole[..whole.len() - 384]);
}

#[test]
fn a_run_of_a_later_format_is_refused_with_its_number() {
    let place = place();
    let mut json = run_json(&place);
    json["format_version"] = 7.into();
    // A later format may have other keys.
    json.as_object_mut().unwrap().remove("extent");
    write_run_json(&place, &json);
    for line in [
        "check run",
        "retrieve run --method three-step",
        "view run -o pictures",
        "report run",
        "illuminate run --scene scene.toml -o again",
        "compare run run",
        "simulate scene.toml -o run --resume --allow-mixed",
    ] {
        let output = run(&place, line);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_ne!(output.status.code(), Some(0), "{line}");
        assert!(stderr.contains("has the format_version 7"), "{line}: {stderr}");
    }
}
