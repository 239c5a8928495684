//! Images, volumes and pages of a run are compared with the run where they are read, and removed where it is
//! replaced.

use super::assert_says;
use crate::support::program::{Workplace, beamlet, ended, stderr};
use std::fs::{self, File};
use std::path::Path;
use std::time::{Duration, SystemTime};

/// A rod in 12 views of 5 steps.
const SCENE: &str = concat!(
    include_str!("../../support/paper.toml"),
    r#"pixels = [16, 2]
[sampling]
tolerance = 1e-2
angle_tolerance = "1 urad"
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 5 }
angles = { from = "0 deg", to = "360 deg", count = 12 }

[[object]]
name = "rod"
shape = { cylinder = { radius = "0.6 mm", height = "5 mm" } }
material = "polyethylene"
"#
);

#[track_caller]
fn ends(place: &Workplace, line: &str, code: i32) -> String {
    ends_in(&place.path(""), line, code)
}

#[track_caller]
fn ends_in(folder: &Path, line: &str, code: i32) -> String {
    let output = beamlet(folder).args(line.split_whitespace()).output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{line}: {}", stderr(&output));
    stderr(&output)
}

/// The command between the marks of an error, as words for the program.
fn remedy(message: &str) -> &str {
    let command = message.split('`').nth(1).unwrap_or_else(|| panic!("no command: {message}"));
    command.strip_prefix("beamlet ").unwrap_or_else(|| panic!("no command: {message}"))
}

/// Commands that read the images of `run`, with their codes for an error.
const READERS: [(&str, i32); 6] = [
    ("reconstruct run -o out -q", 1),
    ("view run -o out", 1),
    ("view run/retrieved -o out", 1),
    ("report run -o out.html", 1),
    ("convert run --to astra -o out -q", 1),
    ("compare run run", 2),
];

#[test]
fn a_run_that_is_replaced_loses_its_images_and_its_page() {
    let place = Workplace::new(SCENE);
    let at = |name: &str| place.path("run").join(name);
    ended(&place.simulate(&["--format", "npy"]), 0);
    ends(&place, "retrieve run -q", 0);
    ends(&place, "reconstruct run -o volume -q --quantity mu --format npy", 0);
    ends(&place, "report run -q", 0);
    ends(&place, "view volume -o slices", 0);
    fs::write(at("retrieved/notes.txt"), "mine").unwrap();
    ended(&place.simulate(&["--overwrite", "--set", "object.rod.material=aluminium"]), 0);
    // Files of others stay.
    let left: Vec<_> =
        fs::read_dir(at("retrieved")).unwrap().map(|it| it.unwrap().file_name()).collect();
    assert_eq!(left, ["notes.txt"]);
    assert!(!at("report.html").exists());
    fs::remove_dir_all(at("retrieved")).unwrap();
    for reader in ["view volume -o slices --overwrite", "report volume -o volume.html"] {
        let message = ends(&place, reader, 1);
        assert_says(&message, &["volume: is out of date: run/progress.log has changed since"]);
        let command = "reconstruct run -o volume -q --quantity mu --format npy --overwrite";
        assert_eq!(remedy(&message), command);
    }
    let start = "reconstruct run -o other -q --quantity mu --method cgls --start volume";
    assert_says(&ends(&place, start, 1), &["volume: is out of date"]);
    ends(&place, "reconstruct run -o volume -q --quantity mu --format npy --overwrite", 0);
    ends(&place, "view volume -o slices --overwrite", 0);
    // A page that beamlet did not write.
    fs::write(at("report.html"), "mine").unwrap();
    ended(&place.simulate(&["--overwrite"]), 0);
    assert_eq!(fs::read_to_string(at("report.html")).unwrap(), "mine");
    assert!(!at("retrieved").exists());
}

#[test]
fn images_of_a_part_of_a_run_are_refused_once_it_went_on() {
    let place = Workplace::new(SCENE);
    ended(&place.simulate(&[]), 0);
    let log = String::from_utf8(place.bytes("progress.log")).unwrap();
    let lines: Vec<&str> = log.split_inclusive('\n').collect();
    assert_eq!(lines.len(), 13);
    place.write("progress.log", lines[..10].concat().as_bytes());
    ends(&place, "retrieve run -q", 0);
    ends(&place, "retrieve run -q -o images", 0);
    ends(&place, "reconstruct run -o volume -q --quantity mu", 0);
    ended(&place.simulate(&["--resume"]), 0);
    for (reader, code) in READERS {
        let message = ends(&place, reader, code);
        assert_says(
            &message,
            &["run/retrieved: is out of date: run/progress.log has changed since"],
        );
        assert_eq!(remedy(&message), "retrieve run -q --overwrite", "{reader}");
    }
    let message = ends(&place, "view images -o out", 1);
    assert_eq!(remedy(&message), "retrieve run -q -o images --overwrite");
    let message = ends(&place, "view volume -o out", 1);
    assert_eq!(remedy(&message), "reconstruct run -o volume -q --quantity mu --overwrite");
    ends(&place, "retrieve run -q --overwrite", 0);
    // One that reads the images, and one that reads the run as well.
    for (reader, _) in [READERS[0], READERS[5]] {
        ends(&place, reader, 0);
    }
}

#[test]
fn images_are_found_to_be_of_their_run_wherever_both_are() {
    let place = Workplace::new(SCENE);
    let at = |name: &str| place.path(name);
    ended(&place.simulate(&[]), 0);
    ends(&place, "retrieve run -q", 0);
    ends(&place, "retrieve run -q -o images", 0);
    // From elsewhere, beside a run of the same name.
    fs::create_dir(at("elsewhere")).unwrap();
    ends(&place, "simulate scene.toml -o elsewhere/run -q --set object.rod.material=water", 0);
    for line in ["view ../run -o out", "view ../images -o out --overwrite"] {
        ends_in(&at("elsewhere"), line, 0);
    }
    // Images of one run in another.
    fs::create_dir(at("elsewhere/run/retrieved")).unwrap();
    for entry in fs::read_dir(at("run/retrieved")).unwrap().map(|entry| entry.unwrap()) {
        if entry.path().is_file() {
            let to = at("elsewhere/run/retrieved").join(entry.file_name());
            fs::copy(entry.path(), to).unwrap();
        } else {
            fs::rename(entry.path(), at("elsewhere/run/retrieved").join(entry.file_name()))
                .unwrap();
        }
    }
    let message = ends(&place, "view elsewhere/run -o out", 1);
    assert_says(&message, &["elsewhere/run/progress.log has changed since"]);
    fs::remove_dir_all(at("run/retrieved")).unwrap();
    fs::rename(at("elsewhere/run/retrieved"), at("run/retrieved")).unwrap();
    fs::remove_dir_all(at("elsewhere/run")).unwrap();
    // Both moved together, and the run under another name.
    fs::create_dir(at("moved")).unwrap();
    for name in ["run", "images"] {
        fs::rename(at(name), at("moved").join(name)).unwrap();
    }
    ends(&place, "view moved/images -o first", 0);
    fs::rename(at("moved/run"), at("moved/other")).unwrap();
    ends(&place, "view moved/other -o second", 0);
    // Without their run images are used as they are.
    ends(&place, "view moved/images -o third", 0);
}

#[test]
fn images_of_measured_stacks_are_refused_once_a_stack_changed() {
    let place = Workplace::new(SCENE);
    ended(&place.simulate(&["--format", "npy"]), 0);
    let line =
        "retrieve --flat run/flat.npy --sample run/sample.npy --geometry scene.toml -o images -q";
    ends(&place, line, 0);
    let read = |out: &str, code| {
        ends(&place, &format!("reconstruct images -o {out} -q --quantity mu"), code)
    };
    read("first", 0);
    // Another time and the same values.
    let flat = File::options().write(true).open(place.path("run/flat.npy")).unwrap();
    flat.set_modified(SystemTime::now() + Duration::from_secs(9)).unwrap();
    read("second", 0);
    let mut bytes = place.bytes("flat.npy");
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    place.write("flat.npy", &bytes);
    let message = read("third", 1);
    assert_says(&message, &["images: is out of date: run/flat.npy has changed since"]);
    assert_eq!(remedy(&message), format!("{line} --overwrite"));
    assert_says(&ends(&place, "view second -o out", 1), &["second: is out of date"]);
}
