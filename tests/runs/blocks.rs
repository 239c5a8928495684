//! Views that are committed by blocks of rows: killed within a view, a run goes on behind its last
//! block to the same bytes; blocks that changed are made again.

#![allow(clippy::print_stdout, reason = "measured figures are printed")]
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use super::big_input::watched;
use super::crash::{assert_same, end_again_and_again};
use crate::support::engine;
use crate::support::gate::{Gate, Held};
use crate::support::program::{Workplace, beamlet, ended};
use beamlet::ndarray::Array2;
use beamlet::scene::Scene;
use beamlet::stack::{Format, RunDirectory};
use beamlet::{Backend, Blocks, Cancel, Control, Progress};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const SCENE: &str = concat!(
    include_str!("../support/masks.toml"),
    r#"
[detector]
distance = "1.8 m"
pixels = [48, 60]
pitch = "150 um"
photons = 1000

[sampling]
tolerance = 1e-5

[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 5 }
angles = ["0 deg", "40 deg"]

"#,
    include_str!("../support/rod.toml")
);

/// Views of the scene, the flat and the dark frames included.
const VIEWS: usize = 4;
/// Rows of a block.
const ROWS: &str = "4";

fn simulate(place: &Workplace, more: &[&str]) -> Command {
    let mut command = beamlet(place.path(""));
    command.args(["simulate", "scene.toml", "-q", "--backend", "bvh"]).args(more);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn log_of(run: &Path) -> String {
    fs::read_to_string(run.join("progress.log")).unwrap_or_default()
}

/// A run that was killed when the view `sample/1` had two blocks; the lines of its log.
fn killed(options: &[&str]) -> (Workplace, String) {
    let place = Workplace::new(SCENE);
    let more = [&["--block-rows", ROWS][..], options].concat();
    ended(&simulate(&place, &[&more[..], &["-o", "whole"]].concat()).output().unwrap(), 0);
    let command = simulate(&place, &[&more[..], &["-o", "run"]].concat());
    Held::at(Gate::Synced("run/progress.log", "\nsample/1/rows/4-8 "), command).kill();
    let log = log_of(&place.path("run"));
    assert!(!log.contains("\nsample/1 "), "the view was whole before it was killed: {log}");
    (place, log)
}

fn resume(place: &Workplace) {
    ended(&simulate(place, &["--resume", "-o", "run"]).output().unwrap(), 0);
    assert_same(&place.path(""), VIEWS);
    assert!(!place.path("run/partial").exists() && !place.path("run/counts/partial").exists());
}

/// Changes a byte of a file, `from_end` before its end.
fn damage(path: &Path, from_end: usize) {
    let mut bytes = fs::read(path).unwrap();
    let at = bytes.len() - from_end;
    bytes[at] ^= 1;
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_run_killed_within_a_view_goes_on_behind_its_last_block() {
    for options in [
        vec!["--format", "exr", "--keep-moments"],
        vec!["--format", "npy", "--keep-moments"],
        vec!["--format", "tiff"],
    ] {
        let (place, before) = killed(&options);
        let whole = before.rfind('\n').unwrap() + 1;
        resume(&place);
        let [run, uninterrupted] = ["run", "whole"].map(|run| log_of(&place.path(run)));
        // Nothing that was committed is made again, and blocks have the same lines.
        assert!(run.starts_with(&before[..whole]), "{options:?}: lines were made again");
        assert!(run == uninterrupted, "{options:?}: lines of progress.log differ");
        let record = fs::read_to_string(place.path("run/run.json")).unwrap();
        assert!(record.contains("\"block_rows\": 4"), "{record}");
    }
}

#[test]
fn blocks_that_changed_are_made_again() {
    let spool = |place: &Workplace| place.path("run/partial/spool.f32");
    let array = |place: &Workplace| place.path("run/sample.npy");
    let counts = |place: &Workplace| place.path("run/counts/sample.npy");
    let moments = |place: &Workplace| place.path("run/moments/view_0001.partial");
    type Place<'a> = &'a dyn Fn(&Workplace) -> PathBuf;
    // The first rows of the last step of the last view are 60 rows of 48 pixels before the end.
    let first_rows = 4 * 60 * 48;
    let cases: [(&[&str], Place<'_>, Option<usize>); 5] = [
        (&["--format", "npy"], &array, Some(first_rows)),
        (&["--format", "npy"], &counts, Some(first_rows)),
        (&["--format", "exr"], &spool, None),
        (&["--format", "exr", "--keep-moments"], &moments, None),
        (&["--format", "exr", "--keep-moments"], &moments, Some(1)),
    ];
    for (options, file, from_end) in cases {
        let (place, _) = killed(options);
        let path = file(&place);
        match from_end {
            // Of moments the last byte may lie behind the last block.
            Some(from_end) => damage(&path, from_end),
            None => fs::write(&path, &fs::read(&path).unwrap()[..1000]).unwrap(),
        }
        resume(&place);
    }
}

#[test]
fn runs_by_blocks_that_are_ended_at_random_moments_go_on_to_the_same_bytes() {
    for (seed, options) in [
        (31, &["--format", "npy", "--block-rows", ROWS][..]),
        (32, &["--format", "exr", "--block-rows", ROWS, "--keep-moments"]),
        (33, &["--format", "tiff", "--block-rows", ROWS]),
    ] {
        end_again_and_again(SCENE, options, VIEWS, seed);
    }
}

/// Rows that are done and rows in all agree at the end of a run that goes on within a view. Blur of the light
/// makes two rows of light and more of a pixel row, and margins beside the detector.
#[test]
fn progress_of_a_run_that_goes_on_within_a_view_ends_at_all_rows() {
    let coarse = SCENE.replace("tolerance = 1e-5", "tolerance = 1e-2");
    let blur = "\n[detector.blur]\nkernel = \"point.npy\"\npixel = \"50 um\"\n";
    let place = Workplace::new(&(coarse + blur));
    ndarray_npy::write_npy(place.path("point.npy"), &Array2::from_elem((3, 3), 1.0_f32)).unwrap();
    let scene = Scene::load(place.path("scene.toml")).unwrap();
    let (engine, run) = (engine(Backend::Bvh), place.path("run"));
    let cancel = Cancel::default();
    let mut stop = |_: Progress| {
        if log_of(&run).contains("\nsample/0/rows/4-8 ") {
            cancel.cancel();
        }
    };
    let control = Control::default().with_blocks(Blocks::Rows(4)).with_cancel(cancel.clone());
    let mut directory = RunDirectory::create(&run, Format::Npy, false).unwrap();
    let ended = engine.run(&scene, &mut directory, control.with_progress(&mut stop));
    assert!(matches!(ended, Err(beamlet::Error::Interrupted)), "{ended:?}");
    drop(directory);
    let mut directory = RunDirectory::resume(&run, &scene).unwrap();
    assert!(directory.begun_view().is_some(), "{}", log_of(&run));
    let mut last = [0; 2];
    let mut report = |progress: Progress| {
        if let Progress::Views(now) = progress {
            last = [now.rows_done, now.rows_total];
        }
    };
    let control = Control::default().going_on(&directory).with_progress(&mut report);
    engine.run(&scene, &mut directory, control).unwrap();
    // More than the 60 pixel rows of each of two views.
    assert!(last[0] == last[1] && last[1] > 2 * 60, "{last:?}");
}

#[test]
fn blocks_change_no_value() {
    let place = Workplace::new(SCENE);
    let of = |rows: &str, run: &str| {
        let words = ["--format", "npy", "--block-rows", rows, "-o", run];
        ended(&simulate(&place, &words).output().unwrap(), 0);
        ["flat.npy", "sample.npy", "counts/sample.npy"]
            .map(|name| fs::read(place.path(run).join(name)).unwrap())
    };
    let whole = of("60", "whole");
    assert!(!log_of(&place.path("whole")).contains("/rows/"));
    for rows in ["1", "7", "59"] {
        assert!(of(rows, &format!("by_{rows}")) == whole, "blocks of {rows} rows");
    }
}

/// Runs of 2,000 and of 200 views have the same peak within 4 MiB: angles, log and record of a view
/// take about a kilobyte.
#[test]
#[ignore = "a minute: in .ci/long"]
fn memory_is_flat_over_two_thousand_views() {
    let peak = |views: u32| {
        let place = Workplace::new(&SCENE.replace("pixels = [48, 60]", "pixels = [48, 8]"));
        let angles =
            format!("scan.angles={{ from = \"0 deg\", to = \"360 deg\", count = {views} }}");
        let words = ["--set", &angles, "--set", "sampling.tolerance=1e-3", "--format", "npy"];
        let words = [&words[..], &["--block-rows", ROWS]].concat();
        let (peak, message, ended) = watched(&place.path(""), &words);
        assert!(ended.success(), "{message}");
        peak
    };
    let [few, many] = [200, 2000].map(peak);
    println!("measured peaks of 200 and 2,000 views: {few} and {many} bytes");
    assert!(many < few + (4 << 20), "{few} and {many} bytes");
}
