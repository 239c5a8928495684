//! The real program, ended at random moments or with a full disk: every view that
//! progress.log names is whole, nothing else counts, and `--resume` ends with the same bits.
//! `BEAMLET_KILLS` in the environment is the number of kills of each kind of run (docs/developers/reliability.md).
#![cfg(all(feature = "cli", unix))]

#[cfg(target_os = "linux")]
use crate::support::gate::{Gate, Held};
use crate::support::program::{beamlet, ended, workplace};
use beamlet::scene::{Exposure, Scene};
use beamlet::stack::RunDirectory;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [8, 2]
[sampling]
tolerance = 1e-2
angle_tolerance = "1 urad"
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 2 }
angles = { from = "0 deg", to = "360 deg", count = 60 }

"#,
    include_str!("../support/rod.toml")
);

/// Views of the scene, the flat included.
const VIEWS: usize = 61;

fn simulate(place: &Path, run: &str, more: &[&str]) -> Command {
    let mut command = beamlet(place);
    command.args(["simulate", "scene.toml", "-q", "--backend", "bvh", "-o", run]).args(more);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Views whose lines in progress.log are whole.
fn committed_lines(run: &Path) -> usize {
    let Ok(text) = fs::read_to_string(run.join("progress.log")) else { return 0 };
    let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    whole.filter(|line| !line.starts_with("counts/") && !line.contains("/rows/")).count()
}

/// Asserts that every view in progress.log has its checksum; tells which.
#[track_caller]
fn assert_whole(place: &Path, run: &str) -> Vec<Exposure> {
    let path = place.join(run);
    if !path.join("run.json").exists() {
        assert_eq!(committed_lines(&path), 0, "views without a run");
        return Vec::new();
    }
    let scene = Scene::load(place.join("scene.toml")).unwrap();
    let resumed = RunDirectory::resume(&path, &scene).unwrap();
    assert_eq!(
        resumed.committed().len(),
        committed_lines(&path),
        "a view differs from the committed one"
    );
    resumed.committed().to_vec()
}

/// Keys of run.json that depend on when and how a run was made.
const OF_THIS_TIME: [&str; 7] =
    ["began", "written", "duration_s", "commands", "seconds", "resumed_views", "parts"];

/// Files of a run, by name: every file byte by byte, but for the order of lines of progress.log
/// and for times and rates in run.json. All of its `views` have to verify.
fn contents(place: &Path, run: &str, views: usize) -> BTreeMap<PathBuf, Vec<u8>> {
    assert_eq!(assert_whole(place, run).len(), views);
    let root = place.join(run);
    let mut found = BTreeMap::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(&root).unwrap().to_path_buf();
            let mut bytes = fs::read(&path).unwrap();
            if name == Path::new("progress.log") {
                let mut lines: Vec<_> = bytes.split(|byte| *byte == b'\n').collect();
                lines.sort();
                bytes = lines.join(&b'\n');
            } else if name == Path::new("run.json") {
                let mut record: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
                for key in OF_THIS_TIME {
                    record.as_object_mut().unwrap().remove(key);
                }
                bytes = record.to_string().into_bytes();
            }
            found.insert(name, bytes);
        }
    }
    found
}

#[track_caller]
pub(crate) fn assert_same(place: &Path, views: usize) {
    let [run, whole] = ["run", "whole"].map(|run| contents(place, run, views));
    assert!(run.keys().eq(whole.keys()), "{:?}\n{:?}", run.keys(), whole.keys());
    for (name, bytes) in &run {
        assert!(*bytes == whole[name], "{} differs", name.display());
    }
}

/// Random numbers that are the same on every machine (splitmix64).
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % limit
    }
}

/// Sends a signal once `views` more are committed and some milliseconds have gone. The moment is one of
/// many that a machine may take: no test depends on it.
pub(crate) fn end(
    mut child: Child,
    log: &Path,
    views: usize,
    milliseconds: u64,
    signal: &str,
) -> Output {
    let before = committed_lines(log);
    while committed_lines(log) < before + views {
        if child.try_wait().unwrap().is_some() {
            return child.wait_with_output().unwrap();
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(Duration::from_millis(milliseconds));
    // The child is ours and was not waited for: the number is its own.
    // The shell's own: a bare machine has no program of that name. It may be over already.
    let kill = format!("kill {signal} {}", child.id());
    Command::new("sh").args(["-c", &kill]).stderr(Stdio::null()).status().unwrap();
    child.wait_with_output().unwrap()
}

/// Kills of each kind of run: 250 by `.ci/long kills`.
pub(crate) fn kills() -> u32 {
    std::env::var("BEAMLET_KILLS").map_or(2, |text| text.parse().unwrap())
}

/// Ends runs at random moments and resumes them, until enough were killed.
pub(crate) fn end_again_and_again(scene: &str, arguments: &[&str], views: usize, seed: u64) {
    let place = workplace(SCENE);
    fs::write(place.path().join("scene.toml"), scene).unwrap();
    ended(&simulate(place.path(), "whole", arguments).output().unwrap(), 0);
    let run = place.path().join("run");
    // Nothing but --resume: format and moments follow the run.
    let go_on = || match run.join("run.json").exists() {
        true => simulate(place.path(), "run", &["--resume"]),
        false => simulate(place.path(), "run", arguments),
    };
    let mut dice = Dice(seed);
    let (mut killed, mut whole) = (0, 0);
    while killed < kills() {
        let signal = if dice.below(4) == 0 { "-INT" } else { "-KILL" };
        // Half of them while the program starts, the rest while it writes.
        let (views_more, milliseconds) = match dice.below(2) {
            0 => (0, dice.below(400)),
            _ => (1 + usize::try_from(dice.below(4)).unwrap(), dice.below(20)),
        };
        let output = end(go_on().spawn().unwrap(), &run, views_more, milliseconds, signal);
        let message = String::from_utf8_lossy(&output.stderr);
        match (output.status.code(), output.status.signal()) {
            (None, Some(9)) => killed += 1,
            (Some(0), _) => {
                assert_same(place.path(), views);
                fs::remove_dir_all(&run).unwrap();
                whole += 1;
            }
            // Before it listens, an interrupt ends the program as it does any other.
            (Some(130) | None, _) if signal == "-INT" => {}
            _ => panic!("{signal} after {killed} kills: {:?}: {message}", output.status),
        }
        let _ = assert_whole(place.path(), "run");
    }
    ended(&go_on().output().unwrap(), 0);
    assert_same(place.path(), views);
    assert!(!run.join("partial").exists());
    whole += 1;
    println!("measured {killed} kills of {arguments:?}: {whole} runs with the same bytes");
}

/// The scene with counts.
fn with_counts() -> String {
    SCENE.replace("pitch = \"150 um\"\n", "pitch = \"150 um\"\nphotons = 1000\n")
}

#[test]
fn a_run_of_exr_frames_that_is_ended_at_random_moments_goes_on_to_the_same_bytes() {
    end_again_and_again(SCENE, &["--format", "exr"], VIEWS, 11);
}

#[test]
fn a_run_of_npy_arrays_that_is_ended_at_random_moments_goes_on_to_the_same_bytes() {
    end_again_and_again(SCENE, &["--format", "npy"], VIEWS, 12);
}

#[test]
fn a_run_with_counts_that_is_ended_at_random_moments_goes_on_to_the_same_bytes() {
    end_again_and_again(&with_counts(), &["--format", "npy"], VIEWS + 1, 13);
}

/// Most of a file on the full disk, in KiB: enough for what a CPU device keeps in files of its
/// own (its memory is one), too little for sample.npy of [`LARGE`].
const FULL: u32 = 56 << 10;
/// Detector of a scene with 60 MiB of stacks.
const LARGE: &str = "pixels = [256, 512]";

/// Runs with a limit of `kib` KiB for each file, as on a full disk: further writes fail. With this limit of
/// memory one view is in work at a time, and the files of the device are small.
fn with_full_disk(place: &Path, kib: u32, more: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_beamlet");
    let script = format!(
        "ulimit -f {kib}; exec '{program}' simulate scene.toml -q --backend bvh --memory-limit 300MiB \
         -o run {more}"
    );
    Command::new("bash").args(["-c", &script]).current_dir(place).output().unwrap()
}

/// As [`workplace`], with a larger detector.
fn large_workplace() -> tempfile::TempDir {
    workplace(&SCENE.replace("pixels = [8, 2]", LARGE))
}

#[test]
#[cfg(target_os = "linux")]
fn a_disk_that_fills_up_is_named_and_leaves_committed_views() {
    let place = large_workplace();
    let npy = ["--format", "npy"];
    // It begins with room for the whole array, as a disk that others fill up later.
    let mut command = beamlet(place.path());
    command.args(["simulate", "scene.toml", "--backend", "bvh", "-o", "run"]).args(npy);
    let mut begun = Held::at(Gate::Synced("run/progress.log", "sample/0 "), command);
    begun.interrupt();
    ended(&begun.ends(), 130);
    let before = assert_whole(place.path(), "run").len();
    let output = with_full_disk(place.path(), FULL, "--resume");
    ended(&output, 1);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("run/sample.npy: cannot be written: "), "{message}");
    let committed = assert_whole(place.path(), "run").len();
    assert!((before + 1..VIEWS).contains(&committed), "{committed} of {before} views: {message}");
    ended(&simulate(place.path(), "run", &["--resume"]).output().unwrap(), 0);
    ended(&simulate(place.path(), "whole", &npy).output().unwrap(), 0);
    assert_same(place.path(), VIEWS);
}

#[test]
fn a_disk_without_room_for_the_arrays_is_named_and_nothing_counts() {
    let place = large_workplace();
    let output = with_full_disk(place.path(), FULL, "--format npy");
    ended(&output, 1);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("run/sample.npy: cannot be created: "), "{message}");
    assert_eq!(committed_lines(&place.path().join("run")), 0);
}

/// A CPU device (llvmpipe) keeps its memory in a file and overlooks that it does not grow.
#[test]
fn a_limit_of_file_sizes_that_keeps_memory_of_the_device_short_is_an_error() {
    let place = workplace(SCENE);
    for kib in [0, 1 << 10, 20 << 10] {
        let output = with_full_disk(place.path(), kib, "");
        let message = ended(&output, 1);
        let named = ["limit of file sizes (ulimit -f)", "File too large"];
        assert!(message.starts_with("error: "), "{kib} KiB: {message}");
        assert!(named.iter().any(|words| message.contains(words)), "{kib} KiB: {message}");
    }
}
