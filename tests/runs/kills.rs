//! The real program, killed before each of its renames and before many of its removals, and run again with
//! `--overwrite`: the command recognises everything that a kill leaves, and ends.
#![cfg(all(feature = "cli", target_os = "linux"))]
#![allow(clippy::print_stdout, reason = "measured figures are printed")]
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use crate::support::gate::preloaded;
use crate::support::program::{Workplace, beamlet, done, stderr};
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
static void count(const char *kind) {
    const char *wanted = getenv("KILL_KIND"), *at = getenv("KILL_AT");
    if (!wanted || !at || strcmp(kind, wanted)) return;
    if (__atomic_add_fetch(&calls, 1, __ATOMIC_RELAXED) == (unsigned)atoi(at))
        for (;;) kill(getpid(), SIGKILL);
}
#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
int rename(const char *from, const char *to) { count("rename"); return REAL(rename)(from, to); }
int linkat(int a, const char *from, int b, const char *to, int how) {
    count("rename");
    return REAL(linkat)(a, from, b, to, how);
}
int unlink(const char *path) { count("removal"); return REAL(unlink)(path); }
int rmdir(const char *path) { count("removal"); return REAL(rmdir)(path); }
"#;

/// Gold masks, a rod in 3 views, and a spectrum from a file.
const SCENE: &str = r#"
[source]
distance = "1.21 m"
spot = "30 um"
spectrum = "spectrum.csv"

[detector]
distance = "1.8 m"
pixels = [24, 4]
pitch = "150 um"

[sample_mask]
distance = "1.2 m"
transmission = 0.0
projected_aperture = "30 um"

[detector_mask]
transmission = 0.0
projected_aperture = "30 um"

[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 5 }
angles = { from = "0 deg", to = "360 deg", count = 3 }

[[object]]
name = "rod"
shape = { cylinder = { radius = "0.4 mm", height = "5 mm" } }
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
    // Each rename; removals farther and farther apart, since there are many and all are alike.
    let next = |at: u32| if kind == "rename" { at + 1 } else { at + 1 + at / 2 };
    let (mut at, mut killed) = (1, 0);
    loop {
        let mut command = beamlet(place.path(""));
        command.args(line.split_whitespace()).env("LD_PRELOAD", library);
        // Mesa renames files of its own.
        command.env("MESA_SHADER_CACHE_DISABLE", "true");
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

/// Kills a command where nothing is yet, and where its files are replaced.
#[track_caller]
fn survives(place: &Workplace, library: &Path, line: &str) -> [u32; 3] {
    [
        kills(place, library, line, "rename"),
        kills(place, library, line, "rename"),
        kills(place, library, line, "removal"),
    ]
}

#[test]
fn commands_that_are_killed_at_any_rename_replace_what_is_left() {
    let place = workplace();
    let library = preloaded("kill", KILL);
    let here = place.path("");
    let mut total = 0;
    let region = "--region rod=cylinder:0mm,0mm,0.2mm";
    for (line, renames) in [
        ("simulate scene.toml -o run -q --keep-moments --overwrite", 8),
        ("illuminate run -o again -q --format npy --overwrite", 4),
        ("retrieve run -q --format npy --correct dose --overwrite", 4),
        (
            &format!(
                "reconstruct run -o volume -q --method cgls --truth {region} --format mhd --overwrite"
            ),
            6,
        ),
        ("convert run --to astra -o astra -q --overwrite", 3),
        ("report run -q --overwrite", 1),
        ("view run -o pictures -q --overwrite", 2),
        ("view volume -o slices -q --overwrite", 2),
        ("example cylinder -o example --overwrite", 1),
        ("mesh scene.toml -o rod.stl -q --overwrite", 1),
        ("spectrum spectrum.csv --plot spectrum.svg --overwrite", 1),
        ("check scene.toml -q --plot curve.svg --overwrite", 1),
        ("man -o pages --overwrite", 2),
    ] {
        let [first, again, removals] = survives(&place, &library, line);
        println!("measured {first} and {again} kills at renames, {removals} at removals: {line}");
        assert!(first >= renames && again >= renames, "{first} and {again} kills of {line}");
        total += first + again + removals;
    }
    // Whole, and of one another.
    done(&here, "check run");
    done(&here, "compare again again");
    done(&here, "report volume");
    // A new run removes what was made of the one before, also where it is killed meanwhile.
    let line = "simulate scene.toml -o run -q --set object.rod.material=aluminium --overwrite";
    total += kills(&place, &library, line, "removal");
    assert!(!place.path("run/retrieved").exists() && !place.path("run/report.html").exists());
    println!("measured {total} kills");
}

#[test]
fn shards_and_joins_that_are_killed_at_any_rename_go_on() {
    let place = workplace();
    let library = preloaded("kill", KILL);
    for (line, renames) in [
        ("plan scene.toml --shards 2 -o run -q --no-device", 3),
        ("simulate run/scene.toml --shard 0/2 -o run -q", 3),
        ("simulate run/scene.toml --shard 1/2 -o run -q", 3),
    ] {
        assert!(kills(&place, &library, line, "rename") >= renames, "{line}");
    }
    assert!(kills(&place, &library, "join run -q", "rename") >= 3);
    done(&place.path(""), "check run");
}
