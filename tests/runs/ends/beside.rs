//! What happens beside a run: clocks that jump, folders that cannot be closed,
//! numbers of threads, and readers.

use super::{SCENE, beamlet, code_and_stderr};
use crate::support::gate::{Gate, Held, preloaded};
use crate::support::program::{Workplace, ended};
use std::fs;
use std::path::Path;

const VIEWS: &str = "scan.angles={ from = \"0 deg\", to = \"90 deg\", count = 8 }";

/// Takes the place of the clocks of the C library: the time of day jumps to and fro by years, and
/// clocks that never go back jump ahead by an hour at a time.
const CLOCKS: &str = r#"
#define _GNU_SOURCE
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static unsigned calls;
static long ahead;
int clock_gettime(clockid_t clock, struct timespec *now) {
    long failed = syscall(SYS_clock_gettime, clock, now);
    unsigned call = __atomic_add_fetch(&calls, 1, __ATOMIC_RELAXED);
    if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)
        now->tv_sec += (long)(call * 2654435761u % 2000000000u) - 1000000000;
    else if (clock == CLOCK_MONOTONIC || clock == CLOCK_BOOTTIME || clock == CLOCK_MONOTONIC_COARSE)
        now->tv_sec += call % 16 ? __atomic_load_n(&ahead, __ATOMIC_RELAXED)
                                 : __atomic_add_fetch(&ahead, 3600, __ATOMIC_RELAXED);
    return failed;
}
int gettimeofday(struct timeval *now, void *zone) {
    struct timespec found;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &found);
    now->tv_sec = found.tv_sec;
    now->tv_usec = found.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *to) {
    struct timespec found;
    clock_gettime(CLOCK_REALTIME, &found);
    if (to) *to = found.tv_sec;
    return found.tv_sec;
}
"#;

/// Closes folders and reports that it failed.
const FOLDERS: &str = r#"
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>
int close(int file) {
    struct stat found;
    int folder = !fstat(file, &found) && S_ISDIR(found.st_mode);
    int failed = syscall(SYS_close, file);
    if (!folder) return failed;
    errno = EIO;
    return -1;
}
int closedir(DIR *folder) {
    int (*real)(DIR *) = (int (*)(DIR *))dlsym(RTLD_NEXT, "closedir");
    real(folder);
    errno = EIO;
    return -1;
}
"#;

/// A detector of few pixels and few rays: the program starts many times.
fn small_workplace() -> Workplace {
    let sampling = "[sampling]\ntolerance = 1e-2\nangle_tolerance = \"1 urad\"\n[scan]";
    Workplace::new(&SCENE.replace("[64, 8]", "[16, 4]").replace("[scan]", sampling))
}

/// Files of a run that are the same whenever it is made, with their bytes.
fn contents(run: &Path) -> Vec<(String, Vec<u8>)> {
    let names = ["scene.toml", "progress.log", "flat.npy", "sample.npy"];
    names.map(|name| (name.to_owned(), fs::read(run.join(name)).unwrap())).into()
}

fn words(to: &str) -> Vec<&str> {
    let begin = ["simulate", "scene.toml", "-o", to, "--format", "npy", "--backend", "bvh"];
    begin.into_iter().chain(["--set", VIEWS]).collect()
}

#[test]
fn clocks_that_jump_change_nothing() {
    let place = small_workplace();
    let clocks = preloaded("clocks", CLOCKS);
    let left_alone = place.beamlet(&words("alone"));
    assert_eq!(left_alone.status.code(), Some(0), "{left_alone:?}");
    let mut jumped = beamlet(&place.path(""), &words("jumped"));
    let jumped = jumped.env("LD_PRELOAD", &clocks).output().unwrap();
    let (code, message) = code_and_stderr(&jumped);
    assert_eq!(code, Some(0), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    assert!(contents(&place.path("jumped")) == contents(&place.path("alone")));
    // The clocks did jump: hours in a run of seconds.
    let record = super::json(&place.path("jumped/run.json"));
    assert!(record["seconds"]["total"].as_f64().unwrap() > 3600.0, "{record}");
    let mut checked = beamlet(&place.path(""), &["check", "jumped"]);
    let checked = checked.env("LD_PRELOAD", &clocks).output().unwrap();
    assert_eq!(checked.status.code(), Some(0), "{checked:?}");
}

#[test]
fn folders_whose_closing_fails_are_read_all_the_same() {
    let place = small_workplace();
    let folders = preloaded("folders", FOLDERS);
    let simulate = ["simulate", "scene.toml", "-o", "run", "-q"];
    let commands: [&[&str]; 8] = [
        &simulate,
        &[&simulate[..], &["--overwrite"]].concat(),
        &["simulate", "scene.toml", "-o", "run", "-q", "--resume"],
        &["check", "run"],
        &["retrieve", "run", "-q"],
        &["retrieve", "run", "-q", "--overwrite"],
        &["report", "run"],
        &["compare", "run/sample", "run/sample"],
    ];
    for command in commands {
        let mut beamlet = beamlet(&place.path(""), command);
        ended(&beamlet.env("LD_PRELOAD", &folders).output().unwrap(), 0);
    }
}

#[test]
fn more_threads_than_are_allowed_are_a_warning() {
    let place = small_workplace();
    ended(&place.beamlet(&["simulate", "scene.toml", "-o", "run", "-q", "--backend", "bvh"]), 0);
    let mut command = beamlet(&place.path(""), &["retrieve", "run"]);
    let message = ended(&command.env("RAYON_NUM_THREADS", "999999").output().unwrap(), 0);
    assert!(message.contains("RAYON_NUM_THREADS is 999999; 1024 threads are started"), "{message}");
}

#[test]
fn readers_of_a_run_in_the_making_get_an_answer_and_do_not_disturb_it() {
    let place = small_workplace();
    assert_eq!(place.beamlet(&words("alone")).status.code(), Some(0));
    let commands: [&[&str]; 5] = [
        &["check", "run"],
        &["compare", "run", "run"],
        &["retrieve", "run", "-o", "images", "--overwrite", "-q"],
        &["view", "run", "-o", "pictures", "--overwrite"],
        &["report", "run", "-o", "report.html", "--overwrite"],
    ];
    // The names of the commands that get a result; the others get an error.
    let answered = || -> Vec<&str> {
        let is_answered = |command: &&[&str]| {
            let (code, message) = code_and_stderr(&place.beamlet(command));
            let refused = matches!(code, Some(1 | 2)) && message.contains("error: ");
            // What differs is an answer of `compare`: a run and itself never do.
            assert!(code == Some(0) || refused, "{command:?}: {code:?}: {message}");
            assert!(!message.contains("panicked"), "{command:?}: {message}");
            code == Some(0)
        };
        commands.into_iter().filter(is_answered).map(|command| command[0]).collect()
    };
    let running = beamlet(&place.path(""), &words("run"));
    let running = Held::at(Gate::Synced("run/progress.log", "sample/3 "), running);
    assert_eq!(answered(), ["compare", "retrieve", "view", "report"]);
    ended(&running.ends(), 0);
    assert_eq!(place.beamlet(commands[0]).status.code(), Some(0), "the check of a whole run");
    assert!(contents(&place.path("run")) == contents(&place.path("alone")));
}
