//! The counts of a resumed run are those of all its views.

use super::SCENE;
use crate::support::program::{Workplace, ended};

/// The tally of the run.
fn tally(place: &Workplace) -> serde_json::Value {
    let run: serde_json::Value = serde_json::from_slice(&place.bytes("run.json")).unwrap();
    run["tally"].clone()
}

/// Takes the lines of some views out of the log, as if the run had been interrupted.
fn interrupt(place: &Workplace, lost: &[&str]) {
    let log = String::from_utf8(place.bytes("progress.log")).unwrap();
    let is_lost = |line: &&str| lost.iter().any(|view| line.starts_with(&format!("{view} ")));
    let head: String = log.split_inclusive('\n').filter(|line| !is_lost(line)).collect();
    place.write("progress.log", head.as_bytes());
    let run = String::from_utf8(place.bytes("run.json")).unwrap();
    place.write("run.json", run.replace("\"done\"", "\"running\"").as_bytes());
}

#[test]
fn a_resumed_run_counts_all_its_views() {
    let photons = "pitch = \"150 um\"\nphotons = 1e6\nbit_depth = 8\n";
    let place = Workplace::new(&SCENE.replace("pitch = \"150 um\"\n", photons));
    ended(&place.simulate(&[]), 0);
    let whole = tally(&place);
    assert!(whole["lines"].as_u64() > Some(20) && whole["saturated"].as_u64() > Some(10));
    for lost in [&["sample/0", "sample/2"][..], &["flat", "dark", "sample/3"]] {
        interrupt(&place, lost);
        ended(&place.simulate(&["--resume"]), 0);
        assert_eq!(tally(&place), whole, "without {lost:?}");
    }
}

#[test]
fn a_complete_run_that_is_mended_keeps_its_tally() {
    let place = Workplace::new(SCENE);
    ended(&place.simulate(&["--format", "npy"]), 0);
    let whole = tally(&place);
    let sample = place.bytes("sample.npy");
    place.write("sample.npy", &[&sample[..], b"more"].concat());
    ended(&place.simulate(&["--resume"]), 0);
    assert_eq!(tally(&place), whole);
}
