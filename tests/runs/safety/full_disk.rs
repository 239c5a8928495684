//! Every writer reports a write that fails, up to the last, and leaves what was there.

use super::{beamlet, contents, simulate, workplace};
use crate::support::program::ended;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output};

/// KiB that hold whatever is written here.
const ROOM: u64 = 1 << 20;

/// Runs as on a disk that is full once a file has so many KiB: further writes fail.
fn with_full_disk(place: &Path, kib: u64, line: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_beamlet");
    let script = format!("ulimit -f {kib}; exec '{program}' {line}");
    let mut command = Command::new("bash");
    // Memory of CPU devices is in files, too, which the limit ends.
    without_driver(&mut command);
    command.args(["-c", &script]).current_dir(place).output().unwrap()
}

/// Takes the drivers away: a page has no picture of the sample, and a check no estimate.
fn without_driver(command: &mut Command) {
    command.env("VK_DRIVER_FILES", "/dev/null").env("VK_ICD_FILENAMES", "/dev/null");
}

/// Bytes of the largest file at or below a path.
fn largest(path: &Path) -> u64 {
    match path.is_dir() {
        true => contents(path).values().map(|bytes| bytes.len() as u64).max().unwrap(),
        false => fs::metadata(path).unwrap().len(),
    }
}

#[test]
fn a_full_disk_is_an_error_of_every_writer_up_to_the_last_byte() {
    let place = workplace();
    let at = |name: &str| place.path().join(name);
    simulate(place.path(), "");
    let pixels: Vec<u8> = (0..24_576_u32).map(|i| u8::try_from(i * 7919 % 251).unwrap()).collect();
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (1, 128, 192), }";
    let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    npy.extend(format!("{header:<117}\n").bytes());
    npy.extend(&pixels);
    fs::write(at("a.npy"), &npy).unwrap();
    npy.splice(128.., pixels.iter().rev().copied());
    fs::write(at("b.npy"), &npy).unwrap();
    let compare = "compare a.npy b.npy --tolerance 1e9 --difference out --format";
    for (line, code) in [
        (&*format!("{compare} tiff"), 2),
        (&format!("{compare} npy"), 2),
        (&format!("{compare} exr"), 2),
        ("spectrum --anode W --kvp 60kV --plot out.svg --overwrite", 1),
        ("spectrum --anode W --kvp 60kV --plot out.png --overwrite", 1),
        ("report run -o out.html --overwrite", 1),
        ("example cylinder -o out --overwrite", 1),
    ] {
        let out = ["out", "out.svg", "out.png", "out.html"];
        let out = out
            .map(at)
            .into_iter()
            .find(|path| {
                line.contains(path.file_name().unwrap().to_str().unwrap())
                    && (path.extension().is_some() || !line.contains("out."))
            })
            .unwrap();
        ended(&with_full_disk(place.path(), ROOM, line), 0);
        let whole = contents(place.path());
        let kib = largest(&out).div_ceil(1024);
        // Images of differences are not replaced.
        if line.starts_with("compare") {
            fs::remove_dir_all(&out).unwrap();
        }
        let before = contents(place.path());
        // Around the buffers' ends, and the last write in any case.
        for room in (0..kib).rev().step_by(usize::try_from(kib / 12 + 1).unwrap()).chain([kib - 1])
        {
            let output = with_full_disk(place.path(), room, line);
            let message = ended(&output, code);
            assert!(message.contains("cannot be written"), "{line}: {message}");
            assert_eq!(contents(place.path()), before, "{line} with {room} KiB");
        }
        ended(&with_full_disk(place.path(), kib, line), 0);
        assert_eq!(contents(place.path()).len(), whole.len());
        if out.is_dir() {
            fs::remove_dir_all(&out).unwrap();
        }
    }
}

#[test]
fn devices_are_written_to_and_not_replaced() {
    let place = workplace();
    simulate(place.path(), "");
    symlink("/dev/full", place.path().join("page.html")).unwrap();
    let report = |to: &str| {
        let mut command = beamlet(place.path(), &format!("report run -o {to} --overwrite"));
        without_driver(&mut command);
        command.output().unwrap()
    };
    let message = ended(&report("page.html"), 1);
    assert!(message.contains("page.html: cannot be written"), "{message}");
    let output = report("/dev/stdout");
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout.starts_with(b"<!"), "the page itself");
    assert!(place.path().join("page.html").is_symlink());
    assert!(Path::new("/dev/full").exists());
}

#[test]
fn results_that_stdout_does_not_take_are_an_error() {
    let place = workplace();
    simulate(place.path(), "");
    for line in [
        "check scene.toml --json",
        "compare run run --json",
        "devices --json",
        "example",
        "material --json",
        "material gold --energy 30keV",
        "spectrum --anode W --kvp 60kV --json",
        "retrieve run --json -q",
        "report run",
        "view run -o pictures",
        "simulate scene.toml -o run --resume",
    ] {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let mut command = beamlet(place.path(), line);
        if line.starts_with("check") || line.starts_with("report") {
            without_driver(&mut command);
        }
        let output = command.stdout(full).output().unwrap();
        // 1 is an answer of `compare`.
        let code = if line.starts_with("compare") { 2 } else { 1 };
        let message = ended(&output, code);
        assert!(message.contains("stdout cannot be written"), "{line}: {message}");
    }
}
