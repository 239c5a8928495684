//! Runs that keep moments go on as they began, and lose none.

use super::{SCENE, assert_says};
use crate::support::files;
use crate::support::program::{Workplace, ended};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// A run as if it had been interrupted after some views.
fn interrupted(place: &Workplace, more: &[&str], lost: &[&str]) {
    ended(&place.simulate(more), 0);
    let log = String::from_utf8(place.bytes("progress.log")).unwrap();
    let is_lost = |line: &&str| lost.iter().any(|view| line.starts_with(&format!("{view} ")));
    let head: String = log.split_inclusive('\n').filter(|line| !is_lost(line)).collect();
    place.write("progress.log", head.as_bytes());
    let run = String::from_utf8(place.bytes("run.json")).unwrap();
    place.write("run.json", run.replace("\"done\"", "\"running\"").as_bytes());
}

/// Frames and moments of the run, by name.
fn contents(place: &Workplace) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut contents = files::of_run(&place.path("run"));
    contents.remove(Path::new("progress.log"));
    contents
}

#[test]
fn a_run_that_keeps_moments_goes_on_keeping_them_without_being_told() {
    let place = Workplace::new(SCENE);
    interrupted(&place, &["--keep-moments"], &["sample/2", "sample/3"]);
    let whole = contents(&place);
    for view in [2, 3] {
        fs::remove_file(place.path(&format!("run/moments/view_000{view}.bin"))).unwrap();
    }
    assert_eq!(ended(&place.simulate(&["--resume"]), 0), "");
    assert_eq!(contents(&place), whole);
}

#[test]
fn a_run_without_moments_is_not_gone_on_with_keeping_them() {
    let place = Workplace::new(SCENE);
    interrupted(&place, &[], &["sample/3"]);
    let before = contents(&place);
    for _ in 0..2 {
        let message = ended(&place.simulate(&["--resume", "--keep-moments"]), 2);
        assert_says(&message, &["without --keep-moments", "\"keep_moments\": false"]);
        assert_eq!(contents(&place), before);
        // The same of a run that is complete.
        ended(&place.simulate(&["--resume"]), 0);
    }
}

#[test]
fn moments_that_a_complete_run_lost_are_made_again_and_named() {
    let place = Workplace::new(SCENE);
    ended(&place.simulate(&["--keep-moments"]), 0);
    let whole = contents(&place);
    let moments = |view: u32| format!("moments/view_000{view}.bin");
    fs::remove_file(place.path("run").join(moments(1))).unwrap();
    let mut damaged = place.bytes(&moments(2));
    damaged[100] ^= 4;
    place.write(&moments(2), &damaged);
    let message = ended(&place.simulate(&["--resume"]), 0);
    assert_says(&message, &["view_0001.bin", "sample/1", "view_0002.bin", "sample/2"]);
    assert!(!message.contains("sample/0") && !message.contains("sample/3"), "{message}");
    assert_eq!(contents(&place), whole);
    let done = place.simulate(&["--resume", "--keep-moments"]);
    assert_eq!(ended(&done, 0), "");
    assert_eq!(contents(&place), whole);
}

#[test]
fn moments_of_which_not_even_the_beginning_is_left_are_made_again() {
    let place = Workplace::new(SCENE);
    ended(&place.simulate(&["--keep-moments"]), 0);
    let whole = contents(&place);
    place.write("moments/view_0001.bin", &[0; 4096]);
    // The frames of this view are lost with them.
    place.write("moments/view_0002.bin", b"lost");
    place.write("sample/view_0002/step_000.exr", b"lost");
    let message = ended(&place.simulate(&["--resume"]), 0);
    assert_says(&message, &["view_0001.bin", "sample/1", "sample/2"]);
    assert_eq!(contents(&place), whole);
}

#[test]
fn frames_stay_where_their_moments_alone_are_lost_until_they_are_made_again() {
    let place = Workplace::new(SCENE);
    interrupted(&place, &["--keep-moments"], &[]);
    let frame = "sample/view_0001/step_000.exr";
    let whole = place.bytes(frame);
    fs::remove_file(place.path("run/moments/view_0001.bin")).unwrap();
    // What stands in the way of the moments ends the run before its view is made.
    fs::create_dir(place.path("run/moments/view_0001.partial")).unwrap();
    ended(&place.simulate(&["--resume"]), 1);
    assert_eq!(place.bytes(frame), whole);
}
