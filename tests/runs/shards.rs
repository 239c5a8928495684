//! Runs in shards: the bits of one run in each format, with counts and moments, also where shards and
//! the join are ended at random moments; and refusals of shards that do not belong together.

#![allow(clippy::print_stdout, reason = "measured figures are printed")]
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use super::crash::{Dice, assert_same, end, kills};
#[cfg(target_os = "linux")]
use crate::support::gate::{Gate, Held};
use crate::support::program::{Workplace, ended};
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Stdio};

/// A scan of 11 views with counts.
pub(crate) const SCENE: &str = concat!(
    include_str!("../support/masks.toml"),
    r#"
[detector]
distance = "1.8 m"
pixels = [8, 3]
pitch = "150 um"
photons = 1000

[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 3 }
angles = { from = "0 deg", to = "360 deg", count = 11 }

"#,
    include_str!("../support/rod.toml")
);

/// Views of the scene, the flat and the dark frames included.
const VIEWS: usize = 13;

/// A workplace with a plan of the run `run`.
fn planned(shards: u32, more: &[&str]) -> Workplace {
    let place = Workplace::new(SCENE);
    let shards = shards.to_string();
    let mut words =
        vec!["plan", "scene.toml", "--backend", "bvh", "-o", "run", "--shards", &shards];
    words.extend(more);
    ended(&place.beamlet(&words), 0);
    place
}

/// Words that make a shard by the scene of the plan.
fn words(shard: &str) -> [&str; 7] {
    ["simulate", "run/scene.toml", "-q", "-o", "run", "--shard", shard]
}

#[track_caller]
fn make(place: &Workplace, shards: &[&str]) {
    for shard in shards {
        ended(&place.beamlet(&words(shard)), 0);
    }
}

#[track_caller]
pub(crate) fn refused(place: &Workplace, words: &[&str], expected: &[&str]) {
    let output = place.beamlet(words);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{words:?} succeeded");
    for part in expected {
        assert!(message.contains(part), "{words:?}: {part:?} is not in\n{message}");
    }
}

fn of_one_run(place: &Workplace, more: &[&str]) {
    let mut words = vec!["simulate", "scene.toml", "-q", "--backend", "bvh", "-o", "whole"];
    words.extend(more);
    ended(&place.beamlet(&words), 0);
}

#[test]
fn shards_in_any_order_have_the_bits_of_one_run_in_every_format() {
    for options in [vec!["--format", "exr"], vec!["--format", "npy"], vec!["--format", "tiff"]] {
        let place = planned(4, &options);
        make(&place, &["2/4", "0/4", "3/4"]);
        let listed = place.beamlet(&["join", "run", "--status"]);
        let listed = String::from_utf8(listed.stdout).unwrap();
        assert!(listed.contains("shard 1/4  waiting      0 of 3 views"), "{listed}");
        assert!(listed.contains("3 of 4 shards are done"), "{listed}");
        // By the scene that was planned, too.
        let by_scene = ["simulate", "scene.toml", "-q", "-o", "run", "--shard", "1/4"];
        ended(&place.beamlet(&by_scene), 0);
        make(&place, &["2/4"]);
        ended(&place.beamlet(&["join", "run"]), 0);
        of_one_run(&place, &options);
        assert_same(&place.path(""), VIEWS);
        for left in ["plan.json", "device.json", "shards"] {
            assert!(!place.path("run").join(left).exists(), "{left} is left");
        }
        // A second array and a second join find nothing to do.
        make(&place, &["0/4", "3/4"]);
        let again = place.beamlet(&["join", "run"]);
        assert!(String::from_utf8_lossy(&again.stdout).contains("joined already"));
        ended(&place.beamlet(&["check", "run"]), 0);
    }
}

#[test]
fn shards_of_waves_have_the_bits_of_one_run() {
    let place = Workplace::new(&format!("{SCENE}\n[sampling]\ntransport = \"wave\"\n"));
    let options = ["--format", "npy"];
    let words = ["plan", "scene.toml", "--backend", "bvh", "-o", "run", "--shards", "3"];
    ended(&place.beamlet(&[&words[..], &options].concat()), 0);
    make(&place, &["1/3", "0/3", "2/3"]);
    ended(&place.beamlet(&["join", "run"]), 0);
    of_one_run(&place, &options);
    assert_same(&place.path(""), VIEWS);
}

#[test]
fn a_single_shard_and_one_shard_a_view_are_joined() {
    for shards in [1, 11] {
        let place = planned(shards, &["--format", "npy"]);
        for index in 0..shards {
            make(&place, &[&format!("{index}/{shards}")]);
        }
        // Fewer files than shards and stacks have together.
        let join = format!(
            "for fd in /proc/self/fd/*; do fd=${{fd##*/}}; [ \"$fd\" -le 2 ] || eval \"exec $fd>&-\"; done; \
             ulimit -n 18; exec '{}' join run",
            env!("CARGO_BIN_EXE_beamlet")
        );
        let mut few_files = Command::new("bash");
        ended(&few_files.args(["-c", &join]).current_dir(place.path("")).output().unwrap(), 0);
        of_one_run(&place, &["--format", "npy"]);
        assert_same(&place.path(""), VIEWS);
    }
}

#[test]
fn shards_and_joins_that_are_ended_at_random_moments_go_on_to_the_same_bytes() {
    let mut dice = Dice(21);
    let (mut killed, mut whole) = (0, 0);
    for options in [["--format", "npy"], ["--format", "exr"], ["--format", "tiff"]] {
        let place = planned(3, &options);
        of_one_run(&place, &options);
        let goal = killed + kills().div_ceil(3);
        while killed < goal {
            if !place.path("run").exists() {
                let words =
                    ["plan", "scene.toml", "--backend", "bvh", "-o", "run", "--shards", "3"];
                ended(&place.beamlet(&[&words[..], &options].concat()), 0);
            }
            let turn = dice.below(5);
            let shard = format!("{}/3", turn % 3);
            let words = match turn {
                4 => vec!["join", "run", "-q"],
                _ => words(&shard).to_vec(),
            };
            let mut command = crate::support::program::beamlet(place.path(""));
            command.args(&words).stdout(Stdio::piped()).stderr(Stdio::piped());
            let child = command.spawn().unwrap();
            let log = place.path("run").join(format!("shards/000{}", turn % 3));
            let output = end(child, &log, 0, dice.below(700), "-KILL");
            let message = String::from_utf8_lossy(&output.stderr);
            match (output.status.code(), output.status.signal()) {
                (None, Some(9)) => killed += 1,
                (Some(0), _) => {}
                (Some(1), _) if message.contains("shards are missing") => {}
                _ => panic!("{words:?}: {:?}: {message}", output.status),
            }
            if !place.path("run/plan.json").exists() {
                assert_same(&place.path(""), VIEWS);
                fs::remove_dir_all(place.path("run")).unwrap();
                whole += 1;
            }
        }
        if place.path("run").exists() {
            for shard in ["0/3", "1/3", "2/3"] {
                ended(&place.beamlet(&words(shard)), 0);
            }
            ended(&place.beamlet(&["join", "run"]), 0);
            assert_same(&place.path(""), VIEWS);
            whole += 1;
        }
    }
    println!("measured {killed} kills of shards and joins: {whole} runs with the same bytes");
}

#[test]
fn whole_run_commands_refuse_shards_that_are_not_joined() {
    let place = planned(2, &[]);
    make(&place, &["0/2"]);
    let remedy = ["not joined", "beamlet join run"];
    for words in [
        vec!["check", "run"],
        vec!["retrieve", "run"],
        vec!["report", "run"],
        vec!["view", "run", "-o", "pictures"],
        vec!["compare", "run", "run"],
        vec!["simulate", "scene.toml", "-o", "run"],
        vec!["simulate", "scene.toml", "-o", "run", "--resume"],
        vec!["simulate", "scene.toml", "-o", "run", "--overwrite"],
    ] {
        refused(&place, &words, &remedy);
    }
    let shard = ["check", "run/shards/0000"];
    refused(&place, &shard, &["holds shard 0/2 of a run", "beamlet join run"]);
    refused(&place, &["plan", "scene.toml", "--shards", "2", "-o", "run"], &["holds the plan"]);
    let missing = ["1 of 2 shards are missing (1 not begun): 1", "--shard 1/2 -o run"];
    refused(&place, &["join", "run"], &missing);
}

#[test]
fn shards_that_do_not_belong_to_the_plan_are_refused() {
    let place = planned(3, &[]);
    refused(&place, &words("3/3"), &["0 to 2 of 3 shards"]);
    refused(&place, &words("0/4"), &["planned in 3 shards, not in 4"]);
    refused(&place, &words("a"), &["K/N"]);
    let other = [&words("0/3")[..], &["--set", "source.energy=31 keV"]].concat();
    refused(&place, &other, &["another scene", "source.energy"]);
    let none = ["simulate", "scene.toml", "-o", "none", "--shard", "0/3"];
    refused(&place, &none, &["none", "not a planned run", "beamlet plan"]);
    let many = ["plan", "scene.toml", "--shards", "12", "-o", "many"];
    refused(&place, &many, &["1 to 11, the number of views"]);
    refused(&place, &["join", "scene.toml"], &["not a planned run"]);
    // Of another plan.
    let place_of_other = planned(3, &["--format", "npy"]);
    make(&place_of_other, &["1/3"]);
    make(&place, &["0/3", "2/3"]);
    let there = place.path("run/shards/0001");
    fs::rename(place_of_other.path("run/shards/0001"), &there).unwrap();
    refused(&place, &["join", "run"], &["shards/0001", "another plan"]);
    fs::remove_dir_all(&there).unwrap();
    fs::rename(place.path("run/shards/0002"), &there).unwrap();
    make(&place, &["2/3"]);
    refused(&place, &["join", "run"], &["shards/0001", "it is shard 2/3, here is shard 1/3"]);
    refused(&place, &words("1/3"), &["shards/0001", "shard 2/3"]);
    // Of a plan of the same shape.
    let other = ["--set", "source.energy=31 keV"];
    let place_of_other = planned(3, &other);
    make(&place_of_other, &["1/3"]);
    fs::remove_dir_all(&there).unwrap();
    fs::rename(place_of_other.path("run/shards/0001"), &there).unwrap();
    let named = ["shards/0001", "another plan: its scene differs"];
    refused(&place, &["join", "run"], &named);
    refused(&place, &["join", "run", "--status"], &named);
    refused(&place, &words("1/3"), &named);
    // A scene that changed since.
    let scene = place.path("run/scene.toml");
    let text = fs::read_to_string(&scene).unwrap();
    fs::write(&scene, text.replace("30 keV", "31 keV")).unwrap();
    refused(&place, &words("0/3"), &["run/scene.toml", "changed since the run was planned"]);
    refused(&place, &["join", "run"], &["changed since the run was planned"]);
}

#[test]
fn a_view_that_changed_is_named_and_its_shard_makes_it_again() {
    let place = planned(2, &["--format", "npy"]);
    make(&place, &["0/2", "1/2"]);
    let path = place.path("run/shards/0001/sample.npy");
    let mut bytes = fs::read(&path).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&path, bytes).unwrap();
    let named =
        ["shards/0001", "sample/10 does not have the checksum of its shard", "--shard 1/2 -o run"];
    refused(&place, &["join", "run"], &named);
    refused(&place, &["check", "run"], &["not joined"]);
    let output = place.beamlet(&words("1/2"));
    assert!(ended(&output, 0).contains("sample/10"));
    ended(&place.beamlet(&["join", "run"]), 0);
    of_one_run(&place, &["--format", "npy"]);
    assert_same(&place.path(""), VIEWS);
}

/// Writes another driver into a record.
fn change_driver(path: &Path) {
    let text = fs::read_to_string(path).unwrap();
    let mut record: serde_json::Value = serde_json::from_str(&text).unwrap();
    record["driver"] = "another driver 1.0".into();
    fs::write(path, record.to_string()).unwrap();
}

#[test]
fn shards_of_different_drivers_are_refused_unless_allowed() {
    let place = planned(2, &[]);
    make(&place, &["0/2", "1/2"]);
    change_driver(&place.path("run/shards/0001/run.json"));
    refused(&place, &["join", "run"], &["driver another driver 1.0", "--allow-mixed"]);
    ended(&place.beamlet(&["join", "run", "--allow-mixed", "-q"]), 0);
    let place = planned(2, &[]);
    change_driver(&place.path("run/device.json"));
    refused(&place, &words("0/2"), &["driver another driver 1.0", "--allow-mixed"]);
    ended(&place.beamlet(&[&words("0/2")[..], &["--allow-mixed"]].concat()), 0);
}

#[test]
fn the_first_shard_settles_the_device_of_a_plan_without_one() {
    let place = Workplace::new(SCENE);
    let plan = ["plan", "scene.toml", "--no-device", "--shards", "2", "-o", "run"];
    ended(&place.beamlet(&plan), 0);
    assert!(!place.path("run/device.json").exists());
    ended(&place.beamlet(&[&words("1/2")[..], &["--backend", "bvh"]].concat()), 0);
    let settled = fs::read_to_string(place.path("run/device.json")).unwrap();
    assert!(settled.contains("\"bvh\""), "{settled}");
    let other = [&words("0/2")[..], &["--backend", "ray-query"]].concat();
    refused(&place, &other, &["backend bvh, now ray-query"]);
    make(&place, &["0/2"]);
    ended(&place.beamlet(&["join", "run", "-q"]), 0);
    of_one_run(&place, &[]);
    assert_same(&place.path(""), VIEWS);
}

#[test]
#[cfg(target_os = "linux")]
fn one_process_at_a_time_makes_a_shard_and_its_state_is_listed() {
    let place = planned(2, &[]);
    let states = || -> serde_json::Value {
        let output = place.beamlet(&["join", "run", "--status", "--json"]);
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let mut command = crate::support::program::beamlet(place.path(""));
    command.args(words("0/2"));
    let first = Held::at(Gate::Synced("0000/progress.log", "sample/0 "), command);
    assert_eq!(states()[0]["state"], "running");
    refused(&place, &words("0/2"), &["another beamlet process is using this run"]);
    refused(&place, &["join", "run"], &["1 running"]);
    assert_eq!(first.kill().status.signal(), Some(9));
    assert_eq!(states()[0]["state"], "dead");
    assert_eq!(states()[1]["state"], "waiting");
}
