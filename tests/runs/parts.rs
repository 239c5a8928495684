//! Parts of a run: the bits of one run in each format, with counts, also where parts and the join are
//! ended at random moments; and refusals of parts that do not belong together.

use super::crash::{Dice, assert_same, end, kills};
use crate::support::program::{Workplace, ended};
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Stdio};

/// A scan of 11 views with counts.
const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [8, 3]
photons = 1000
[sampling]
tolerance = 1e-2
angle_tolerance = "1 urad"
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 3 }
angles = { from = "0 deg", to = "360 deg", count = 11 }

"#,
    include_str!("../support/rod.toml")
);

/// Views of the scene, the flat and the dark frames included.
const VIEWS: usize = 13;

/// Makes parts with these views and options, each in a folder of the name of its views.
#[track_caller]
fn make(place: &Workplace, parts: &[&str], more: &[&str]) {
    for views in parts {
        let words =
            ["simulate", "scene.toml", "-q", "--backend", "bvh", "--views", views, "-o", views];
        ended(&place.beamlet(&[&words[..], more].concat()), 0);
    }
}

/// Words that join parts to `run`.
fn join<'a>(parts: &[&'a str]) -> Vec<&'a str> {
    [&["join"][..], parts, &["-q", "-o", "run"]].concat()
}

#[track_caller]
fn refused(place: &Workplace, words: &[&str], expected: &[&str]) {
    let output = place.beamlet(words);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{words:?} succeeded");
    for part in expected {
        assert!(message.contains(part), "{words:?}: {part:?} is not in\n{message}");
    }
}

fn of_one_run(place: &Workplace, more: &[&str]) {
    let words = ["simulate", "scene.toml", "-q", "--backend", "bvh", "-o", "whole"];
    ended(&place.beamlet(&[&words[..], more].concat()), 0);
}

#[test]
fn parts_in_any_order_have_the_bits_of_one_run_in_every_format() {
    let waves = &SCENE.replace("[sampling]", "[sampling]\ntransport = \"wave\"");
    for (scene, format) in [(SCENE, "exr"), (SCENE, "tiff"), (waves, "npy")] {
        let place = Workplace::new(scene);
        let options = ["--format", format];
        make(&place, &["4..9", "0..4"], &options);
        refused(&place, &join(&["0..4", "4..9"]), &["no part with the views 9..11", "0..11 once"]);
        assert!(!place.path("run").exists());
        make(&place, &["9..11"], &options);
        ended(&place.beamlet(&join(&["9..11", "0..4", "4..9"])), 0);
        of_one_run(&place, &options);
        assert_same(&place.path(""), VIEWS);
        if format != "exr" {
            continue;
        }
        // A second join, and a part that is complete, have nothing to do.
        ended(&place.beamlet(&join(&["9..11", "0..4", "4..9"])), 0);
        make(&place, &["4..9"], &["--resume"]);
        assert_same(&place.path(""), VIEWS);
        ended(&place.beamlet(&["check", "run"]), 0);
    }
}

#[test]
fn a_single_part_and_one_part_a_view_are_joined() {
    let each: Vec<String> = (0..11).map(|view| format!("{view}..{}", view + 1)).collect();
    let place = Workplace::new(SCENE);
    of_one_run(&place, &["--format", "npy"]);
    for parts in [vec!["0..11"], each.iter().map(String::as_str).collect()] {
        make(&place, &parts, &["--format", "npy"]);
        // Fewer files than parts and stacks have together.
        let script = format!(
            "for fd in /proc/self/fd/*; do fd=${{fd##*/}}; [ \"$fd\" -le 2 ] || eval \"exec $fd>&-\"; done; \
             ulimit -n 18; exec '{}' join *..* -o run",
            env!("CARGO_BIN_EXE_beamlet")
        );
        let mut few_files = Command::new("bash");
        ended(&few_files.args(["-c", &script]).current_dir(place.path("")).output().unwrap(), 0);
        assert_same(&place.path(""), VIEWS);
        parts.iter().chain(&["run"]).for_each(|it| fs::remove_dir_all(place.path(it)).unwrap());
    }
}

#[test]
fn parts_and_joins_that_are_ended_at_random_moments_go_on_to_the_same_bytes() {
    let mut dice = Dice(21);
    let (mut killed, mut whole) = (0, 0);
    let parts = ["0..4", "4..7", "7..11"];
    // Every format where `BEAMLET_KILLS` is set.
    let formats = match std::env::var_os("BEAMLET_KILLS") {
        Some(_) => vec!["npy", "exr", "tiff"],
        None => vec!["exr"],
    };
    let each = kills().div_ceil(u32::try_from(formats.len()).unwrap());
    for format in formats {
        let place = Workplace::new(SCENE);
        of_one_run(&place, &["--format", format]);
        let goal = killed + each;
        while killed < goal {
            let turn = usize::try_from(dice.below(5)).unwrap();
            let part = parts[turn % 3];
            let mut words = vec!["simulate", "scene.toml", "-q", "--backend", "bvh", "-o", part];
            match turn {
                4 => words = join(&parts),
                _ if place.path(part).join("run.json").exists() => words.push("--resume"),
                _ => words.extend(["--views", part, "--format", format]),
            }
            let mut command = crate::support::program::beamlet(place.path(""));
            command.args(&words).stdout(Stdio::piped()).stderr(Stdio::piped());
            let log = place.path(if turn == 4 { "run" } else { part });
            let output = end(command.spawn().unwrap(), &log, 0, dice.below(700), "-KILL");
            let message = String::from_utf8_lossy(&output.stderr);
            match (output.status.code(), output.status.signal()) {
                (None, Some(9)) => killed += 1,
                (Some(0), _) if turn == 4 => {
                    assert_same(&place.path(""), VIEWS);
                    let folders = parts.iter().chain(&["run"]);
                    folders.for_each(|it| fs::remove_dir_all(place.path(it)).unwrap());
                    whole += 1;
                }
                (Some(0), _) => {}
                (Some(1), _)
                    if ["exposures", "is no part", "does not exist"]
                        .iter()
                        .any(|words| message.contains(words)) => {}
                _ => panic!("{words:?}: {:?}: {message}", output.status),
            }
        }
        for part in parts {
            let more = match place.path(part).join("run.json").exists() {
                true => vec!["--resume"],
                false => vec!["--format", format],
            };
            make(&place, &[part], &more);
        }
        ended(&place.beamlet(&join(&parts)), 0);
        assert_same(&place.path(""), VIEWS);
        whole += 1;
    }
    println!("measured {killed} kills of parts and joins: {whole} runs with the same bytes");
}

#[test]
fn commands_of_whole_runs_refuse_parts() {
    let place = Workplace::new(SCENE);
    make(&place, &["0..5"], &[]);
    for words in [
        vec!["check", "0..5"],
        vec!["retrieve", "0..5"],
        vec!["report", "0..5"],
        vec!["view", "0..5", "-o", "pictures"],
        vec!["compare", "0..5", "0..5"],
    ] {
        refused(&place, &words, &["holds views 0..5 of a run", "beamlet join"]);
    }
}

/// Writes another driver into the record of a part.
fn change_driver(place: &Workplace, part: &str) {
    let path = place.path(part).join("run.json");
    let mut record: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    record["driver"] = "another driver 1.0".into();
    fs::write(path, record.to_string()).unwrap();
}

#[test]
fn parts_that_do_not_belong_together_are_refused() {
    let place = Workplace::new(SCENE);
    make(&place, &["0..4", "4..11", "3..11"], &[]);
    of_one_run(&place, &[]);
    let simulate = ["simulate", "scene.toml", "-o", "0..4"];
    for (words, expected) in [
        (vec!["--views", "0..12"], vec!["0..12", "0..11 at most"]),
        (vec!["--views", "4..4"], vec!["A..B"]),
        (vec!["--views", "0..5", "--resume"], vec!["0..4", "--views 0..5"]),
    ] {
        refused(&place, &[&simulate[..], &words].concat(), &expected);
    }
    for (parts, expected) in [
        (vec!["0..4"], vec!["no part with the views 4..11"]),
        (vec!["4..11"], vec!["no part with the views 0..4"]),
        (vec!["0..4", "3..11"], vec!["3..11: has the views 3..4", "0..4 has them, too"]),
        (vec!["0..4", "4..11", "4..11"], vec!["has the views 4..11"]),
        (vec!["0..4", "whole"], vec!["whole: holds a whole run"]),
        (vec!["0..4", "none"], vec!["none: does not exist"]),
        (vec!["0..4", "scene.toml"], vec!["scene.toml: is a file"]),
    ] {
        refused(&place, &join(&parts), &expected);
    }
    // A place that is taken: by one of the parts, by a run of another scene, by files of others.
    refused(&place, &["join", "0..4", "4..11", "-o", "0..4"], &["holds views 0..4 of a run"]);
    let others = [("energy", "--set"), ("npy", "--format")];
    for (folder, option) in others {
        let value = if option == "--set" { "source.energy=31 keV" } else { "npy" };
        let words = ["simulate", "scene.toml", "-q", "--backend", "bvh", "--views", "4..11"];
        ended(&place.beamlet(&[&words[..], &["-o", folder, option, value]].concat()), 0);
    }
    refused(&place, &join(&["0..4", "energy"]), &["energy: is of another scene", "source.energy"]);
    refused(&place, &join(&["0..4", "npy"]), &["npy: has the format npy, 0..4 exr"]);
    change_driver(&place, "4..11");
    let mixed = ["4..11: is of driver another driver 1.0", "--allow-mixed"];
    refused(&place, &join(&["0..4", "4..11"]), &mixed);
    assert!(!place.path("run").exists());
    ended(&place.beamlet(&[&join(&["0..4", "4..11"])[..], &["--allow-mixed"]].concat()), 0);
}

#[test]
fn a_view_that_changed_is_named_and_its_part_makes_it_again() {
    let place = Workplace::new(SCENE);
    let options = ["--format", "npy"];
    make(&place, &["0..5", "5..11"], &options);
    let path = place.path("5..11/sample.npy");
    let mut bytes = fs::read(&path).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&path, bytes).unwrap();
    let named = ["5..11: sample/10 does not have the checksum", "--resume -o 5..11"];
    refused(&place, &join(&["0..5", "5..11"]), &named);
    let output = place.beamlet(&["simulate", "5..11/scene.toml", "--resume", "-o", "5..11", "-q"]);
    assert!(ended(&output, 0).contains("sample/10"));
    ended(&place.beamlet(&join(&["0..5", "5..11"])), 0);
    of_one_run(&place, &options);
    assert_same(&place.path(""), VIEWS);
}
