//! Runs whose directory, or a part of it, is moved, replaced or removed while they go on.

use super::{beamlet, contents, ends, workplace};
use crate::support::gate::{Gate, Held};
use crate::support::program::ended;
use beamlet::scene::Scene;
use beamlet::stack::RunDirectory;
use std::fs;
use std::path::Path;

/// Views of the run.
const VIEWS: usize = 12;
const ANGLES: &str = "scan.angles={from=\"0deg\",to=\"360deg\",count=12}";
const SIMULATE: &str = "simulate scene.toml -q --backend bvh -o run --set ";

/// Lines of the log of a run.
fn lines(run: &Path) -> usize {
    fs::read(run.join("progress.log"))
        .map_or(0, |text| text.iter().filter(|byte| **byte == b'\n').count())
}

/// Begins a run, holds it while it commits its third view and does this, and returns its stderr at its end
/// with code 1.
#[track_caller]
fn disturbed(place: &Path, more: &str, disturb: impl FnOnce()) -> String {
    let command = beamlet(place, &format!("{SIMULATE}{ANGLES} {more}"));
    let held = Held::at(Gate::Synced("run/progress.log", "sample/2 "), command);
    disturb();
    ended(&held.ends(), 1)
}

/// Asserts that all views in the log of a run are whole; their number.
fn whole(place: &Path, run: &str) -> usize {
    let scene = Scene::load_with(place.join("scene.toml"), &[ANGLES.to_owned()]).unwrap();
    let resumed = RunDirectory::resume(place.join(run), &scene).unwrap();
    assert_eq!(resumed.problems(), [""; 0]);
    resumed.committed().len()
}

const COUNTS: &str = "--set detector.photons=1000";

#[test]
fn a_run_that_is_moved_ends_with_both_paths_and_can_be_resumed() {
    for more in [
        "--format exr".to_owned(),
        "--format npy".to_owned(),
        "--format tiff".to_owned(),
        format!("--format exr {COUNTS}"),
    ] {
        let place = workplace();
        let real = place.path().canonicalize().unwrap();
        let (run, moved) = (real.join("run"), real.join("moved"));
        let message = disturbed(&real, &more, || fs::rename(&run, &moved).unwrap());
        let here = ["progress.log", "scene.toml"];
        assert!(
            here.iter().any(|name| {
                message.starts_with(&format!("error: run/{name}: was moved"))
                    && message.contains(&format!("to {}", moved.join(name).display()))
            }),
            "{more}: {message}"
        );
        assert!(message.contains("nothing is in its place"), "{more}: {message}");
        assert!(!run.exists(), "{more}: something was written at the path");
        let committed = lines(&moved);
        assert!(committed < VIEWS, "{more}: {committed} lines");
        // Once for each kind of file.
        if !more.contains(COUNTS) {
            assert_eq!(whole(&real, "moved"), committed, "{more}");
        }
    }
}

#[test]
fn a_run_that_was_moved_goes_on_where_it_is() {
    let place = workplace();
    let at = |name: &str| place.path().join(name);
    disturbed(place.path(), "", || fs::rename(at("run"), at("moved")).unwrap());
    let simulate = SIMULATE.replace("-o run", "-o moved");
    ends(place.path(), &format!("{simulate}{ANGLES} --resume"), 0);
    ends(place.path(), "check moved", 0);
    assert_eq!(whole(place.path(), "moved"), VIEWS + 1);
}

#[test]
fn a_folder_in_place_of_a_run_that_is_moved_stays_as_it_is() {
    for format in ["exr", "npy"] {
        let place = workplace();
        let at = |name: &str| place.path().join(name);
        let replace = || {
            fs::create_dir(at("other")).unwrap();
            // As if another run stood there.
            for name in ["progress.log", "run.json", "scene.toml", "flat.npy", "sample.npy"] {
                fs::copy(at("run").join(name), at("other").join(name))
                    .or_else(|_| fs::write(at("other").join(name), "theirs").map(|()| 0))
                    .unwrap();
            }
            fs::rename(at("run"), at("moved")).unwrap();
            fs::rename(at("other"), at("run")).unwrap();
            contents(&at("run"))
        };
        let mut before = None;
        let more = format!("--format {format}");
        let message = disturbed(place.path(), &more, || before = Some(replace()));
        assert!(message.contains("another file is in its place"), "{format}: {message}");
        assert_eq!(Some(contents(&at("run"))), before, "{format}");
    }
}

#[test]
fn a_run_that_is_removed_ends_with_an_error_and_is_not_begun_anew() {
    for format in ["exr", "npy"] {
        let place = workplace();
        let at = |name: &str| place.path().join(name);
        let message = disturbed(place.path(), &format!("--format {format}"), || {
            fs::rename(at("run"), at("waste")).unwrap();
            fs::remove_dir_all(at("waste")).unwrap();
        });
        assert!(message.starts_with("error: run/progress.log: was "), "{format}: {message}");
        assert!(!at("run").exists(), "{format}");
    }
}

#[test]
fn a_part_of_a_run_that_is_moved_is_named_and_made_again() {
    for (more, part, named) in [
        ("--format exr", "sample", "run/sample/view_0000"),
        ("--format exr", "flat/step_002.exr", "run/flat/step_002.exr"),
        ("--format npy", "sample.npy", "run/sample.npy"),
        ("--format tiff", "flat.tif", "run/flat.tif"),
    ] {
        let place = workplace();
        let at = |name: &str| place.path().join(name);
        let part = at("run").join(part);
        let message = disturbed(place.path(), more, || fs::rename(&part, at("part")).unwrap());
        let moved = format!("error: {named}: was ");
        assert!(message.starts_with(&moved), "{more} {}: {message}", part.display());
        assert!(message.contains("moved"), "{message}");
        ends(place.path(), &format!("{SIMULATE}{ANGLES} --resume"), 0);
        assert_eq!(whole(place.path(), "run"), VIEWS + 1);
    }
}
