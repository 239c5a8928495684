//! The real program, killed before each of its renames and before many of its removals, and run again with
//! `--overwrite`: the command recognises everything that a kill leaves, and ends.
#![cfg(all(feature = "cli", target_os = "linux"))]

use crate::support::gate::preloaded;
use crate::support::program::{Workplace, beamlet, done, stderr};
use crate::support::{amount, everything, sample};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;

/// Kills the process before its call number `KILL_AT` of the kind `KILL_KIND`.
const KILL: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
static unsigned calls;
static void count(const char *kind, const char *path) {
    const char *wanted = getenv("KILL_KIND"), *at = getenv("KILL_AT");
    /* Mesa renames and removes files of its own. */
    if (!wanted || !at || strcmp(kind, wanted) || strstr(path, "mesa_shader_cache")) return;
    if (__atomic_add_fetch(&calls, 1, __ATOMIC_RELAXED) == (unsigned)atoi(at))
        for (;;) kill(getpid(), SIGKILL);
}
#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
int rename(const char *from, const char *to) { count("rename", to); return REAL(rename)(from, to); }
int linkat(int a, const char *from, int b, const char *to, int how) {
    count("rename", to);
    return REAL(linkat)(a, from, b, to, how);
}
int unlink(const char *path) { count("removal", path); return REAL(unlink)(path); }
int rmdir(const char *path) { count("removal", path); return REAL(rmdir)(path); }
"#;

/// Gold masks, a rod in 3 views, and a spectrum from a file.
const SCENE: &str = r#"
source = { distance = "1.21 m", spot = "30 um", spectrum = "spectrum.csv" }
detector = { distance = "1.8 m", pixels = [24, 4], pitch = "150 um" }
sample_mask = { distance = "1.2 m", transmission = 0.0, projected_aperture = "30 um" }
detector_mask = { transmission = 0.0, projected_aperture = "30 um" }
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 5 }
angles = { from = "0 deg", to = "360 deg", count = 3 }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.4 mm", height = "5 mm", sides = 16 } }
material = "water"
"#;

fn workplace() -> Workplace {
    let place = Workplace::new(SCENE);
    std::fs::write(place.path("spectrum.csv"), "energy_keV,weight\n30,1\n40,0.5\n").unwrap();
    place
}

/// Runs a command again and again, killed at calls further and further on, until it ends: number of kills.
#[track_caller]
fn kills(place: &Workplace, library: &Path, line: &str, kind: &str) -> u32 {
    // Farther and farther apart; with `BEAMLET_ALL` each rename but of frames, of which there are many, all alike.
    let is_each = everything() && kind == "rename" && !line.contains("exr");
    let next = |at: u32| if is_each { at + 1 } else { 4 * at - 1 };
    let (mut at, mut killed) = (1, 0);
    loop {
        let mut command = beamlet(place.path(""));
        command.args(line.split_whitespace()).env("LD_PRELOAD", library);
        let output =
            command.env("KILL_KIND", kind).env("KILL_AT", at.to_string()).output().unwrap();
        match (output.status.code(), output.status.signal()) {
            (Some(0), _) => return killed,
            (None, Some(9)) => killed += 1,
            _ => panic!("{line}: before {kind} {at}: {}", stderr(&output)),
        }
        at = next(at);
    }
}

/// Commands that write folders, and the renames of each at least.
const FOLDERS: [(&str, u32); 5] = [
    ("simulate scene.toml -o run -q --format npy --overwrite", 3),
    ("simulate scene.toml -o again -q --format exr --overwrite", 3),
    ("retrieve run -q --format npy --correct dose --overwrite", 4),
    (
        "reconstruct run -o volume -q --quantity mu --method cgls --truth --format mhd --overwrite",
        6,
    ),
    ("convert run --to astra -o astra -q --overwrite", 3),
];

/// Commands that write files.
const FILES: [&str; 6] = [
    "report run --overwrite",
    "view run -o pictures --show curve --overwrite",
    "example cylinder -o example --overwrite",
    "mesh scene.toml -o rod.stl --overwrite",
    "spectrum spectrum.csv --plot spectrum.svg --overwrite",
    "check scene.toml --plot curve.svg --overwrite",
];

#[test]
fn commands_that_are_killed_at_any_rename_replace_what_is_left() {
    let place = workplace();
    let library = preloaded("kill", KILL);
    let here = place.path("");
    let mut total = 0;
    for (number, (line, renames)) in FOLDERS.into_iter().enumerate() {
        // A run where nothing is yet, of arrays or with `BEAMLET_ALL`; then where files are replaced.
        match number == 0 || (everything() && line.starts_with("simulate")) {
            true => total += kills(&place, &library, line, "rename"),
            false => drop(done(&here, line)),
        }
        // Before removals every other command; each with `BEAMLET_ALL`.
        for kind in sample(vec!["rename", "removal"], 2 - number % 2) {
            let killed = kills(&place, &library, line, kind);
            println!("measured {killed} kills before a {kind}: {line}");
            let least = if kind == "rename" { amount(2, renames) } else { 0 };
            assert!(killed >= least, "{killed} kills of {line}");
            total += killed;
        }
    }
    // All of them are written by the same function.
    for line in sample(FILES.to_vec(), 3) {
        let killed = kills(&place, &library, line, "rename");
        assert!(killed > 0, "{line}");
        total += killed;
    }
    // Whole, and of one another.
    done(&here, "check run");
    done(&here, "compare again again");
    done(&here, "view volume -o slices");
    // A new run removes what was made of the one before, also where it is killed meanwhile.
    let line = "simulate scene.toml -o run -q --set object.rod.material=aluminium --overwrite";
    total += kills(&place, &library, line, "removal");
    assert!(!place.path("run/retrieved").exists() && !place.path("run/report.html").exists());
    println!("measured {total} kills");
}

#[test]
fn parts_and_joins_that_are_killed_at_any_rename_go_on() {
    let place = workplace();
    let library = preloaded("kill", KILL);
    for views in ["0..1", "1..3"] {
        let line = format!("simulate scene.toml --views {views} -o {views} -q --overwrite");
        assert!(kills(&place, &library, &line, "rename") >= amount(2, 3), "{line}");
    }
    assert!(kills(&place, &library, "join 0..1 1..3 -o run -q", "rename") >= amount(2, 3));
    done(&place.path(""), "check run");
}
