//! A run directory: one writer, no links, no files of others, no claims without end.

use super::{beamlet, contents, ends, simulate, workplace};
#[cfg(target_os = "linux")]
use crate::support::gate::{Gate, Held, preloaded, signal, until_handled};
use crate::support::program::ended;
use std::fs;
use std::os::unix::fs::symlink;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
#[cfg(target_os = "linux")]
use std::time::{Duration, Instant};

#[test]
#[cfg(target_os = "linux")]
fn of_two_that_overwrite_one_run_at_once_only_one_does() {
    let place = workplace();
    simulate(place.path(), "");
    let line = "simulate scene.toml -q --backend bvh -o run --overwrite";
    // The first clears the log of the earlier run.
    let first = Held::at(Gate::Synced("run/progress.log", ""), beamlet(place.path(), line));
    let before = contents(place.path());
    let message = ends(place.path(), line, 1);
    assert!(message.contains("another beamlet process is using this run"), "{message}");
    assert_eq!(contents(place.path()), before);
    ended(&first.ends(), 0);
    ends(place.path(), "simulate scene.toml -q -o run --resume", 0);
    ends(place.path(), "report run", 0);
}

#[test]
fn links_inside_a_run_are_named_and_not_followed() {
    for (format, names) in [
        (
            "exr",
            [
                "progress.log",
                "run.json",
                "flat",
                "sample",
                "sample/view_0001",
                "sample/view_0001/step_002.exr",
                "scene.toml.new",
                "run.json.new",
                "partial",
                "retrieved",
            ]
            .as_slice(),
        ),
        ("npy", &["flat.npy", "sample.npy"]),
    ] {
        let place = workplace();
        simulate(place.path(), &format!("--format {format}"));
        let at = |name: &str| place.path().join(name);
        for name in names {
            let path = at("run").join(name);
            if !path.exists() {
                fs::write(&path, "precious").unwrap();
            }
            fs::rename(&path, at("elsewhere")).unwrap();
            symlink(at("elsewhere"), &path).unwrap();
            let before = contents(place.path());
            for how in ["--overwrite", "--resume"] {
                let line = format!("simulate scene.toml -q --backend bvh -o run {how}");
                let message = ends(place.path(), &line, 1);
                let named = message.contains(&format!("run/{name}: is a link"));
                assert!(named, "{how}: {name}: {message}");
                assert_eq!(contents(place.path()), before, "{how}: {name}");
            }
            fs::remove_file(&path).unwrap();
            fs::rename(at("elsewhere"), &path).unwrap();
            if name.ends_with(".new") || ["partial", "retrieved"].contains(name) {
                fs::remove_file(&path).unwrap();
            }
        }
        ends(place.path(), "simulate scene.toml -q -o run --resume", 0);
    }
}

#[test]
fn pipes_in_place_of_files_of_a_run_are_named_and_not_waited_for() {
    for (format, names) in [
        (
            "exr",
            [
                "progress.log",
                "flat/step_000.exr",
                "sample/view_0001/step_002.exr",
                "scene.toml.new",
            ]
            .as_slice(),
        ),
        ("npy", &["flat.npy", "sample.npy", "scene.toml"]),
    ] {
        let place = workplace();
        simulate(place.path(), &format!("--format {format}"));
        for name in names {
            let path = place.path().join("run").join(name);
            let before = fs::read(&path).ok();
            let _ = fs::remove_file(&path);
            assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
            for how in ["--overwrite", "--resume"] {
                let line = format!("simulate scene.toml -q --backend bvh -o run {how}");
                let message = ends(place.path(), &line, 1);
                assert!(message.contains(&format!("run/{name}: is neither")), "{how}: {message}");
            }
            // What a crash left in the making is nothing of the run.
            if !name.ends_with(".new") {
                let message = ends(place.path(), "check run", 1);
                assert!(message.contains(&format!("run/{name}")), "check: {message}");
            }
            fs::remove_file(&path).unwrap();
            before.map_or(Ok(()), |bytes| fs::write(&path, bytes)).unwrap();
        }
        ends(place.path(), "check run", 0);
    }
}

#[test]
fn a_run_may_itself_be_a_link_and_files_of_others_in_it_stay() {
    let place = workplace();
    let at = |name: &str| place.path().join(name);
    fs::create_dir(at("scratch")).unwrap();
    symlink("scratch", at("run")).unwrap();
    simulate(place.path(), "");
    let others = [
        "run/sample/view_0001/notes.txt",
        "run/sample/view_0009/step_000.exr",
        "run/flat/step_0001.exr",
        "run/scene.txt",
    ];
    for other in others {
        fs::create_dir_all(at(other).parent().unwrap()).unwrap();
        fs::write(at(other), "mine").unwrap();
    }
    simulate(place.path(), "--overwrite");
    for other in others {
        assert_eq!(fs::read_to_string(at(other)).unwrap(), "mine", "{other}");
    }
    assert!(at("run").is_symlink() && at("scratch/run.json").exists());
}

/// Runs the words of `line` with a limit of ten seconds of processor time, which no load of the machine
/// uses up.
fn within_ten_seconds(place: &Path, line: &str) -> Output {
    let script = format!("ulimit -t 10; exec '{}' {line}", env!("CARGO_BIN_EXE_beamlet"));
    Command::new("bash").args(["-c", &script]).current_dir(place).output().unwrap()
}

#[test]
fn a_run_that_claims_more_than_a_scene_may_ask_for_is_refused_at_once() {
    let place = workplace();
    simulate(place.path(), "");
    let path = place.path().join("run/run.json");
    let text = fs::read_to_string(&path).unwrap();
    for (claim, problem) in [
        ("\"views\": 4000000000", "4000000000 views; allowed: 1 to 10000000"),
        ("\"views\": 0", "0 views; allowed: 1"),
        ("\"views\": 9999999", "claims StackShape"),
    ] {
        fs::write(&path, text.replace("\"views\": 3", claim)).unwrap();
        let before = contents(place.path());
        for (line, code) in [
            ("retrieve run -q", 1),
            ("report run", 1),
            ("view run -o pictures", 1),
            ("compare run run", 2),
            ("simulate scene.toml -q -o run --overwrite", 1),
        ] {
            let overwrites = line.ends_with("--overwrite");
            // A run that may be is replaced, whatever it claims.
            if overwrites && problem.starts_with("claims") {
                continue;
            }
            let message = ended(&within_ten_seconds(place.path(), line), code);
            assert!(message.contains("run/run.json: "), "{line}: {message}");
            assert!(overwrites || message.contains(problem), "{line}: {message}");
            assert_eq!(contents(place.path()), before, "{line}");
        }
    }
    ends(place.path(), "simulate scene.toml -q -o run --overwrite", 0);
}

/// Makes every pause of the C library a tenth as long.
#[cfg(target_os = "linux")]
const PAUSES: &str = r#"
#define _GNU_SOURCE
#include <errno.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
static struct timespec tenth(const struct timespec *pause) {
    long long nanoseconds = (pause->tv_sec * 1000000000LL + pause->tv_nsec) / 10;
    struct timespec found = {nanoseconds / 1000000000, nanoseconds % 1000000000};
    return found;
}
int nanosleep(const struct timespec *pause, struct timespec *left) {
    struct timespec shorter = tenth(pause);
    return syscall(SYS_nanosleep, &shorter, left);
}
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *pause, struct timespec *left) {
    struct timespec shorter = flags & TIMER_ABSTIME ? *pause : tenth(pause);
    return syscall(SYS_clock_nanosleep, clock, flags, &shorter, left) ? errno : 0;
}
"#;

#[test]
#[cfg(target_os = "linux")]
fn a_termination_signal_ends_the_program_whatever_hangs() {
    let place = workplace();
    // The loader of drivers waits for a manifest that never comes.
    let pipe = place.path().join("driver.json");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut command = beamlet(place.path(), "simulate scene.toml -o run");
    command.env("VK_DRIVER_FILES", &pipe).env("VK_ICD_FILENAMES", &pipe);
    command.env("LD_PRELOAD", preloaded("pauses", PAUSES));
    let mut child = command.stderr(Stdio::null()).spawn().unwrap();
    until_handled(&mut child, 15);
    signal(&child, "-TERM");
    // It ends after ten seconds, which are one here. Minutes are no measure: they end a test that would wait for ever.
    let since = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if since.elapsed() > Duration::from_secs(600) {
            child.kill().unwrap();
            panic!("it does not end: {:?}", child.wait());
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    // Where libraries hang as the process exits it is aborted.
    let ended = status.code() == Some(130) || status.signal() == Some(6);
    assert!(ended, "{status:?}");
}
