//! Inputs without end, or larger than memory: refused by their kind or length, or read in parts.
#![cfg(all(feature = "cli", unix))]

#[cfg(target_os = "linux")]
use crate::support::gate::{Gate, Held};
use crate::support::program;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output};
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, colortype::Gray8};

const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [8, 2]
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.1 mm", height = "0.2 mm", sides = 16 } }
material = "plastic"

[materials.plastic]
formula = "CH2"
density = "0.95 g/cm3"
"#
);

fn workplace() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("scene.toml"), SCENE).unwrap();
    let object = SCENE.find("[[object]]").unwrap();
    let shape = SCENE.find("shape =").unwrap()..SCENE.find("material = \"plastic\"").unwrap();
    assert!(object < shape.start);
    let meshed = [&SCENE[..shape.start], "mesh = \"MESH\"\nunit = \"mm\"\n", &SCENE[shape.end..]];
    fs::write(directory.path().join("mesh.toml"), meshed.concat()).unwrap();
    directory
}

/// Runs with 4 GiB of address space.
fn beamlet(place: &Path, words: &[&str]) -> Output {
    within(4 << 20, place, words)
}

/// Runs with so many KiB of address space, and is ended after a minute of processor time, or after ten
/// minutes without any.
fn within(kib: u32, place: &Path, words: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_beamlet");
    let mut command = Command::new("bash");
    let script = &format!("ulimit -v {kib} -t 60; exec timeout 600 \"$@\"");
    command.args(["-c", script, "bash", program]).args(words);
    // Threads take address space: as many everywhere.
    command.env("RAYON_NUM_THREADS", "2").env("MALLOC_ARENA_MAX", "2");
    command.current_dir(place).env_remove("RUST_LOG").output().unwrap()
}

#[track_caller]
fn ends(place: &Path, words: &[&str], codes: &[i32]) -> String {
    let output = beamlet(place, words);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    let code = output.status.code();
    assert!(code.is_some_and(|code| codes.contains(&code)), "{words:?}: {code:?}: {message}");
    message
}

/// Commands that read the file NAME, which ends as they need it.
fn readers() -> Vec<(&'static str, Vec<String>)> {
    let words = |text: &str| text.split('|').map(str::to_owned).collect::<Vec<_>>();
    vec![
        ("a.toml", words("check|NAME")),
        ("a.json", words("check|NAME")),
        ("a.stl", words("check|mesh.toml|--set|object[0].mesh=NAME")),
        ("a.obj", words("check|mesh.toml|--set|object[0].mesh=NAME")),
        (
            "a.csv",
            words(
                "check|scene.toml|--set|source={distance=\"1.21 m\",spot=\"0 m\",spectrum=\"NAME\"}",
            ),
        ),
        ("b.csv", words("spectrum|NAME")),
        ("c.csv", words("check|scene.toml|--set|materials.plastic={table=\"NAME\"}")),
        ("d.csv", words("check|scene.toml|--set|source.spot={profile=\"NAME\"}")),
        ("a.png", words("check|scene.toml|--set|source.spot={image=\"NAME\",pixel=\"1 um\"}")),
        ("a.npy", words("compare|NAME|NAME")),
        ("a.tif", words("compare|NAME|NAME")),
        ("a.exr", words("compare|NAME|NAME")),
    ]
}

#[test]
fn what_is_no_regular_file_is_refused_by_its_kind() {
    let place = workplace();
    for (name, words) in readers() {
        let words: Vec<String> = words.iter().map(|word| word.replace("NAME", name)).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let path = place.path().join(name);
        assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
        let message = ends(place.path(), &words, &[1, 2]);
        assert!(message.contains("it is a pipe; allowed: a regular file"), "{name}: {message}");
        fs::remove_file(&path).unwrap();
        symlink("/dev/zero", &path).unwrap();
        let message = ends(place.path(), &words, &[1, 2]);
        assert!(message.contains("it is a character device"), "{name}: {message}");
        // Regular by its kind, of no length, and without an end.
        fs::remove_file(&path).unwrap();
        symlink("/proc/self/pagemap", &path).unwrap();
        let message = ends(place.path(), &words, &[1, 2]);
        assert!(message.contains(name), "{name}: {message}");
    }
}

#[test]
fn a_sparse_file_of_20_gb_is_refused_by_its_length_or_its_first_bytes() {
    let place = workplace();
    for (name, words) in readers() {
        let words: Vec<String> = words.iter().map(|word| word.replace("NAME", name)).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let path = place.path().join(name);
        File::create(&path).unwrap().set_len(20_000_000_000).unwrap();
        let message = ends(place.path(), &words, &[1, 2]);
        // Refused, not tried until memory ends.
        assert!(message.contains(name) && !message.contains("memory"), "{name}: {message}");
        fs::remove_file(&path).unwrap();
    }
}

/// Found by fuzzing: the time to read such a header doubles with each bracket.
#[test]
fn brackets_within_brackets_do_not_take_for_ever() {
    let place = workplace();
    let header = "{".repeat(118);
    let bytes = [b"\x93NUMPY\x01\x00\x76\x00", header.as_bytes()].concat();
    fs::write(place.path().join("a.npy"), bytes).unwrap();
    let spot = "source.spot={image=\"a.npy\",pixel=\"1 um\"}";
    for words in [&["compare", "a.npy", "a.npy"][..], &["check", "scene.toml", "--set", spot]] {
        let message = ends(place.path(), words, &[1, 2]);
        assert!(message.contains("brackets within one another"), "{message}");
    }
}

/// Writes a.npy: the header of an array and as many bytes behind it, of which none is on the
/// disk.
fn sparse_frame(place: &Path, kind: &str, [rows, columns]: [u32; 2], bytes: u64) {
    let header =
        format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    let mut start = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    start.extend(format!("{header:<117}\n").bytes());
    let mut file = File::create(place.join("a.npy")).unwrap();
    file.write_all(&start).unwrap();
    file.set_len(start.len() as u64 + bytes).unwrap();
}

#[test]
fn frames_larger_than_memory_are_compared_in_bands() {
    let place = workplace();
    // Of 1 GiB, two frames of 32-bit numbers would take 1.07.
    sparse_frame(place.path(), "|u1", [12_000; 2], 12_000 * 12_000);
    let output = within(1 << 20, place.path(), &["compare", "a.npy", "a.npy"]);
    program::ended(&output, 0);
}

/// Rows are counted, and an interrupt ends the comparison between two parts.
#[test]
#[cfg(target_os = "linux")]
fn a_comparison_shows_its_progress_and_ends_when_it_is_interrupted() {
    let place = workplace();
    sparse_frame(place.path(), "<f4", [10_000; 2], 4 * 10_000 * 10_000);
    let mut command = program::beamlet(place.path());
    command.args(["compare", "a.npy", "a.npy"]).env("BEAMLET_PROGRESS_SECONDS", "0.05");
    let mut compared = Held::at(Gate::Read("a.npy", 100 << 20), command);
    compared.lines("of 10000", 1);
    compared.interrupt();
    let said = program::ended(&compared.ends(), 130);
    assert!(said.contains("interrupted") && !said.contains("row 10000"), "{said}");
}

#[test]
fn a_frame_that_claims_40_gb_is_refused_by_the_length_of_its_file() {
    let place = workplace();
    sparse_frame(place.path(), "<f4", [100_000; 2], 0);
    let message = ends(place.path(), &["compare", "a.npy", "a.npy"], &[2]);
    assert!(message.contains("a.npy: is cut short: 128 bytes"), "{message}");
    assert!(message.contains("40000000128"), "{message}");
}

/// Rows are read whole.
#[test]
fn a_row_of_a_thousand_million_values_is_refused() {
    let place = workplace();
    sparse_frame(place.path(), "<f4", [1, 1_000_000_000], 4_000_000_000);
    let message = ends(place.path(), &["compare", "a.npy", "a.npy"], &[2]);
    let problem = "has frames of 1 rows and 1000000000 columns; allowed: up to 65536 each";
    assert!(message.contains(problem), "{message}");
}

#[test]
fn a_face_of_millions_of_corners_is_refused() {
    let place = workplace();
    let mesh = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {}\n", "1 2 3 ".repeat(2_000_000));
    fs::write(place.path().join("many.obj"), mesh).unwrap();
    let text = fs::read_to_string(place.path().join("mesh.toml")).unwrap();
    fs::write(place.path().join("mesh.toml"), text.replace("MESH", "many.obj")).unwrap();
    let message = ends(place.path(), &["check", "mesh.toml", "--no-estimate"], &[1]);
    assert!(message.contains("a face has more than 1000000 corners"), "{message}");
    assert!(message.contains("line 4") && message.len() < 400, "{message}");
}

#[test]
fn a_number_of_a_million_digits_is_shown_by_its_beginning() {
    let place = workplace();
    fs::write(place.path().join("long.txt"), format!("30 {}\n", "1".repeat(1_000_000))).unwrap();
    let spectrum = ["--set", "source={distance=\"1.21 m\",spot=\"1 um\",spectrum=\"long.txt\"}"];
    let words = ["check", "scene.toml", spectrum[0], spectrum[1]];
    let message = ends(place.path(), &words, &[1]);
    assert!(message.contains("long.txt:1:4: weight: found 1111"), "{message}");
    assert!(message.contains("(1000000 characters)") && message.len() < 400, "{message}");
}

#[test]
fn a_frame_that_grows_a_thousandfold_is_refused() {
    let place = workplace();
    let side = 17_000_u32;
    let out = BufWriter::new(File::create(place.path().join("bomb.tif")).unwrap());
    let compression = Compression::Deflate(DeflateLevel::Fast);
    let mut encoder = TiffEncoder::new(out).unwrap().with_compression(compression);
    let mut image = encoder.new_image::<Gray8>(side, side).unwrap();
    image.rows_per_strip(side).unwrap();
    image.write_data(&vec![0; (side * side) as usize]).unwrap();
    drop(encoder);
    let message = ends(place.path(), &["compare", "bomb.tif", "bomb.tif"], &[2]);
    assert!(message.contains("bomb.tif: claims 17000 rows"), "{message}");
}

#[test]
fn a_spectrum_of_a_million_rows_is_read_and_of_one_more_refused() {
    let place = workplace();
    let mut out = BufWriter::new(File::create(place.path().join("long.csv")).unwrap());
    for row in 0..1_000_000 {
        writeln!(out, "{:.6},{}", 10.0 + f64::from(row) * 5e-5, 1 + row % 7).unwrap();
    }
    out.flush().unwrap();
    let output = beamlet(place.path(), &["spectrum", "long.csv", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let photons = told["before"]["photons"].as_f64().unwrap();
    let mean = told["before"]["mean_energy_kev"].as_f64().unwrap();
    assert!((photons - 3_999_997.0).abs() < 10.0, "{photons}");
    assert!((mean - 35.0).abs() < 1e-3, "{mean}");
    let mut out = File::options().append(true).open(place.path().join("long.csv")).unwrap();
    out.write_all(b"61,1\n").unwrap();
    let message = ends(place.path(), &["spectrum", "long.csv"], &[1]);
    assert!(message.contains("long.csv:1000001:") && message.contains("a million"), "{message}");
}

#[test]
fn a_spot_wider_than_the_field_of_view_is_refused_with_that_width() {
    let place = workplace();
    for spot in ["\"1 m\"", "[\"0 m\", \"1.3 mm\"]", "{ fwhm = \"1 m\", points = [8, 1] }"] {
        let set = format!("source.spot={spot}");
        let message = ends(place.path(), &["check", "scene.toml", "--set", &set], &[1]);
        assert!(message.contains("source.spot") && message.contains("1.2 mm"), "{message}");
    }
    ends(place.path(), &["check", "scene.toml", "--set", "source.spot=1.2 mm"], &[0]);
}
