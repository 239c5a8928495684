//! Exit codes are answers, whether or not anybody reads stdout.

use crate::support::program::{beamlet, ended, run, stderr, workplace};
use ndarray::Array3;
use ndarray_npy::write_npy;
use std::fs::{self, OpenOptions};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

const SCENE: &str = r#"
source = { distance = "1 m", spot = "0 um", energy = "30 keV" }
detector = { distance = "2 m", pixels = [4, 2], pitch = "100 um" }
"#;

/// One triangle: an open mesh, which `check` refuses.
const OPEN: &str =
    "[[object]]\nname = \"part\"\nmesh = \"open.obj\"\nunit = \"mm\"\nmaterial = \"water\"\n";

/// Runs the words of `line` with this stdout; `ignored`: as a shell that ignores SIGPIPE.
fn run_with(place: &Path, line: &str, stdout: Stdio, ignored: bool) -> Output {
    let mut command = beamlet(place);
    if ignored {
        let line = format!("trap '' PIPE; exec {} {line}", env!("CARGO_BIN_EXE_beamlet"));
        command = Command::new("sh");
        command.current_dir(place).env_remove("RUST_LOG").args(["-c", &line]);
    } else {
        command.args(line.split_whitespace());
    }
    command.stdout(stdout).output().unwrap()
}

/// Stdout that nobody reads.
fn closed() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

/// Stacks that differ, a run, the same run with a damaged frame, and scenes.
fn place() -> TempDir {
    let place = workplace(SCENE);
    let at = |name: &str| place.path().join(name);
    write_npy(at("a.npy"), &Array3::<f32>::zeros((2, 3, 4))).unwrap();
    write_npy(at("b.npy"), &Array3::<f32>::ones((2, 3, 4))).unwrap();
    fs::write(at("open.toml"), format!("{SCENE}{OPEN}")).unwrap();
    fs::write(at("open.obj"), "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n").unwrap();
    for run_directory in ["run", "damaged"] {
        let line = format!("simulate scene.toml -o {run_directory} -q --format npy --backend bvh");
        ended(&run(place.path(), &line), 0);
    }
    let mut flat = fs::read(at("damaged/flat.npy")).unwrap();
    let last = flat.len() - 1;
    flat[last] ^= 1;
    fs::write(at("damaged/flat.npy"), flat).unwrap();
    place
}

#[test]
#[cfg(unix)]
fn exit_codes_do_not_depend_on_a_closed_pipe() {
    let place = place();
    for (line, code) in [
        ("compare a.npy a.npy", 0),
        ("compare a.npy b.npy", 1),
        ("compare a.npy b.npy --json", 1),
        ("compare a.npy b.npy --tolerance 2", 0),
        ("compare a.npy gone.npy", 2),
        ("check run", 0),
        ("check damaged", 1),
        ("check damaged --json", 1),
        ("check scene.toml --no-estimate", 0),
        ("check open.toml --no-estimate", 1),
        ("check gone.toml", 1),
        ("material water --energy 30keV", 0),
        ("material gone --energy 30keV", 1),
        ("spectrum open.toml", 2),
        ("retrieve run", 1),
        ("--help", 0),
        ("check", 2),
    ] {
        let read = run(place.path(), line);
        assert_eq!(read.status.code(), Some(code), "{line}, read: {}", stderr(&read));
        for ignored in [false, true] {
            let unread = run_with(place.path(), line, closed(), ignored);
            let what = format!("{line}, SIGPIPE ignored: {ignored}");
            assert_eq!(unread.status.code(), Some(code), "{what}: {}", stderr(&unread));
            assert_eq!(stderr(&unread), stderr(&read), "{what}");
        }
    }
}

#[test]
#[cfg(target_os = "linux")]
fn compare_without_room_for_its_answer_is_trouble_and_no_answer() {
    let place = place();
    let full = || OpenOptions::new().write(true).open("/dev/full").unwrap().into();
    for (line, code) in
        [("compare a.npy a.npy", 2), ("compare a.npy b.npy", 2), ("check damaged", 1)]
    {
        let output = run_with(place.path(), line, full(), false);
        assert_eq!(output.status.code(), Some(code), "{line}: {}", stderr(&output));
        assert!(stderr(&output).contains("stdout cannot be written"), "{}", stderr(&output));
    }
    let output = run(place.path(), "compare a.npy b.npy -o a.npy/pictures");
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}
