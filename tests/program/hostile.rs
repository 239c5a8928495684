//! Bad input to the program: each is refused with a message that names the place, and nothing
//! is written.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fs;
use std::path::Path;
use std::process::Command;

const SCENE: &str = r#"[source]
distance = "1.21 m"
spot = ["30 um", "26 um"]
energy = "30 keV"

[detector]
distance = "1.8 m"
pixels = [16, 4]
pitch = "150 um"

[sample_mask]
distance = "1.2 m"
material = "gold"
thickness = "225 um"
aperture = "20 um"

[detector_mask]
material = "gold"
thickness = "225 um"
projected_aperture = "30 um"

[sampling]
rays = [10, 1]
seed = 1

[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 3 }
angles = ["0 deg", "90 deg"]

[materials.resin]
formula = "C2H4O"
density = "1.1 g/cm3"

[[object]]
name = "part"
mesh = "part.stl"
unit = "mm"
material = "resin"
position = ["0 mm", "0 mm", "0 mm"]
"#;

/// A cube of 0.4 mm around the origin: corners, then triangles.
pub(super) fn cube() -> (Vec<[f32; 3]>, Vec<[usize; 3]>) {
    let side = |bit: usize, corner: usize| if corner >> bit & 1 == 1 { 0.2 } else { -0.2 };
    let corners = (0..8).map(|corner| [side(0, corner), side(1, corner), side(2, corner)]);
    let faces =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let halves = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    (corners.collect(), halves.collect())
}

pub(super) fn stl() -> Vec<u8> {
    let (corners, triangles) = cube();
    let mut bytes = vec![b' '; 80];
    bytes.extend(u32::try_from(triangles.len()).unwrap().to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flat_map(|c| corners[*c]).flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

/// All files below a directory, with their lengths.
fn files(directory: &Path) -> Vec<(String, u64)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(directory).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        match entry.file_type().unwrap().is_dir() {
            true => {
                found.push((format!("{name}/"), 0));
                let below = files(&entry.path());
                found
                    .extend(below.into_iter().map(|(path, size)| (format!("{name}/{path}"), size)));
            }
            false => found.push((name, entry.metadata().unwrap().len())),
        }
    }
    found.sort();
    found
}

/// A directory with scene and mesh in it, and the command line.
pub(super) struct Workplace {
    pub(super) directory: tempfile::TempDir,
    scene: &'static str,
    output: &'static str,
}

impl Workplace {
    pub(super) fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        fs::write(directory.path().join("scene.toml"), SCENE).unwrap();
        fs::write(directory.path().join("part.stl"), stl()).unwrap();
        Self { directory, scene: "scene.toml", output: "run" }
    }

    pub(super) fn file(self, name: &str, contents: impl AsRef<[u8]>) -> Self {
        fs::write(self.directory.path().join(name), contents).unwrap();
        self
    }

    /// The scene with a piece of text exchanged.
    pub(super) fn with(self, from: &str, to: &str) -> Self {
        assert!(SCENE.contains(from), "{from}");
        self.file("scene.toml", SCENE.replacen(from, to, 1))
    }

    /// The scene with another mesh.
    pub(super) fn mesh(self, name: &str, contents: impl AsRef<[u8]>) -> Self {
        self.with("part.stl", name).file(name, contents)
    }

    /// `simulate` fails, says every one of the words, and writes nothing; `check` fails too.
    #[track_caller]
    pub(super) fn refused(&self, words: &[&str]) {
        let place = self.directory.path();
        let before = files(place);
        let mut checks = vec![vec!["simulate", self.scene, "-o", self.output, "-q"]];
        if self.output == "run" {
            checks.push(vec!["check", self.scene, "--json"]);
        }
        for arguments in checks {
            let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
            command.current_dir(place).env_remove("RUST_LOG").args(&arguments);
            let output = command.output().unwrap();
            let message = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
            assert!(message.starts_with("error: "), "{arguments:?}: {message}");
            for word in words {
                assert!(message.contains(word), "{arguments:?}: no {word:?} in: {message}");
            }
            assert_eq!(files(place), before, "{arguments:?}");
        }
    }
}

/// Cases of (what stands in the scene, what stands there instead, what the message says).
#[track_caller]
fn scenes(cases: &[(&str, &str, &[&str])]) {
    for (from, to, words) in cases {
        let words = [&["scene.toml:"], *words].concat();
        Workplace::new().with(from, to).refused(&words);
    }
}

#[test]
fn keys_and_units_that_are_wrong_are_shown_where_they_stand() {
    scenes(&[
        ("pitch", "pich", &[":9:1: detector.pich: found an unknown key", "`pitch`"]),
        ("[scan]", "[scans]", &[":26:2: scans: found an unknown key", "`scan`"]),
        ("\"30 keV\"", "30", &[":4:10: source.energy", "30, without a unit", "keV"]),
        ("\"30 keV\"", "\"30\"", &[":4:10: source.energy", "keV"]),
        ("\"30 keV\"", "\"30 mm\"", &[":4:10: source.energy", "mm", "keV"]),
        ("\"1.8 m\"", "\"1.8 metres\"", &[":7:12: detector.distance", "metres"]),
        ("\"1.8 m\"", "true", &[":7:12: detector.distance: found true", "allowed:"]),
        ("unit = \"mm\"\n", "", &[": object[0].unit", "the key is missing", "mm"]),
        ("unit = \"mm\"", "unit = \"furlong\"", &[":37:8: object[0].unit", "furlong"]),
        ("energy = \"30 keV\"\n", "", &[": source.energy", "the key is missing"]),
        ("mesh = \"part.stl\"\n", "", &[": object[0].mesh", "the key is missing"]),
        ("\"1.1 g/cm3\"", "\"1.1 g\"", &["materials.resin.density", "g/cm3"]),
        (
            "unit = \"mm\"",
            "unit = \"mm\"\nallow_defects = 1",
            &["object[0].allow_defects", "true or false"],
        ),
    ]);
}

#[test]
fn values_out_of_range_are_refused_with_the_range() {
    scenes(&[
        (
            "thickness = \"225 um\"",
            "thickness = \"-5 um\"",
            &["sample_mask.thickness", "-5", "> 0"],
        ),
        ("\"150 um\"", "\"0 um\"", &["detector.pitch", "> 0"]),
        ("\"150 um\"", "\"nan um\"", &["detector.pitch", "nan"]),
        ("\"150 um\"", "\"1e999 um\"", &["detector.pitch"]),
        ("[16, 4]", "[16, 0]", &["detector.pixels[1]", "found the number 0", "from 1 to 65536"]),
        ("[16, 4]", "[16, 99999999999999999999]", &["detector.pixels[1]", "from 1 to 65536"]),
        ("[16, 4]", "[16, -1]", &["detector.pixels[1]", "found the number -1"]),
        ("[16, 4]", "[16]", &["detector.pixels", "a list of length 1"]),
        ("[16, 4]", "[16.5, 4]", &["detector.pixels[0]", "16.5"]),
        ("count = 3", "count = 4294967297", &["scan.mask_offsets.count", "4294967297"]),
        ("count = 3", "count = 0", &["scan.mask_offsets.count", "found the number 0"]),
        ("rays = [10, 1]", "rays = [10, 2000000000]", &["sampling.rays[1]", "from 1 to 1000000"]),
        (
            "rays = [10, 1]",
            "cells = 1000\nrows = 1000",
            &["sampling.cells", "1000000 in 1000 rows", "up to 10000"],
        ),
        (
            "rays = [10, 1]",
            "rays = [65536, 65536]",
            &["sampling.rays", "4294967296 in a pixel", "up to 400000"],
        ),
        ("rays = [10, 1]", "rows = 1001", &["sampling.rows", "from 1 to 1000"]),
        ("seed = 1", "seed = -1", &["sampling.seed", "18446744073709551615"]),
        ("seed = 1", "seed = 18446744073709551616", &["sampling.seed"]),
        ("seed = 1", "seed = 1e400", &["sampling.seed"]),
        ("[\"0 deg\", \"90 deg\"]", "[]", &["scan.angles", "a list of length 0"]),
    ]);
}

#[test]
fn more_apertures_than_can_be_summed_are_refused() {
    let tiny = "aperture = \"1 pm\"\nperiod = \"2 pm\"";
    scenes(&[
        (
            "aperture = \"20 um\"",
            tiny,
            &["sample_mask.period: found 0.002 nm", "at least 100 nm, 1000 apertures in a pixel"],
        ),
        (
            "projected_aperture = \"30 um\"",
            tiny,
            &["detector_mask.period: found 0.002 nm", "1000 apertures in a pixel"],
        ),
        ("-25 um", "-1e9 m", &["scan.mask_offsets: found", "1e9 periods of the sample mask"]),
    ]);
}

#[test]
fn stacks_too_big_to_count_are_refused() {
    let scene =
        SCENE.replace("[16, 4]", "[65536, 65536]").replace("count = 3", "count = 100000").replace(
            "[\"0 deg\", \"90 deg\"]",
            "{ from = \"0 deg\", to = \"1 deg\", count = 10000000 }",
        );
    Workplace::new().file("scene.toml", scene).refused(&["scene.toml:", "scan", "2^62 bytes"]);
}

#[test]
fn things_out_of_order_along_the_axis_are_refused() {
    scenes(&[
        ("\"20 um\"", "\"101 um\"", &["sample_mask.aperture", "101 um", "no more than the period"]),
        (
            "\"1.8 m\"",
            "\"1.1 m\"",
            &["detector.distance: found 1.1 m", "more than source.distance"],
        ),
        ("\"1.2 m\"", "\"1.3 m\"", &["sample_mask.distance: found 1.3 m", "rotation centre"]),
        (
            "thickness = \"225 um\"",
            "thickness = \"30 mm\"",
            &["sample_mask.distance", "bars between the source and"],
        ),
        (
            "[detector_mask]",
            "[detector_mask]\ndistance = \"1.9 m\"",
            &["detector_mask.distance: found 1.9 m"],
        ),
        (
            "[detector_mask]",
            "[detector_mask]\ndistance = \"1 m\"",
            &["detector_mask.distance: found 1 m"],
        ),
        (
            "[\"0 mm\", \"0 mm\", \"0 mm\"]",
            "[\"0 mm\", \"-10 mm\", \"0 mm\"]",
            &[":34:1: object[0]", "\"part\"", "sample mask", "at angle 0.000 deg"],
        ),
        (
            "[\"0 mm\", \"0 mm\", \"0 mm\"]",
            "[\"10 mm\", \"0 mm\", \"0 mm\"]",
            &["object[0]", "at angle 90.000 deg", "sample mask"],
        ),
    ]);
}

#[test]
fn materials_that_are_none_are_refused_where_they_are_named() {
    scenes(&[
        ("\"C2H4O\"", "\"C2H4o\"", &[":30:", "materials.resin", "C2H4o", "H2O"]),
        ("\"C2H4O\"", "\"Xy2\"", &["materials.resin", "Xy2"]),
        ("\"C2H4O\"", "\"C2(H4\"", &["materials.resin", "C2(H4"]),
        ("\"C2H4O\"", "\"\"", &["materials.resin.formula"]),
        ("\"C2H4O\"", "\"C-2\"", &["materials.resin", "C-2"]),
        ("\"C2H4O\"", "\"C1e999\"", &["materials.resin", "C1e999"]),
        ("\"C2H4O\"", "\"C0\"", &["materials.resin", "C0"]),
        (
            "material = \"resin\"",
            "material = \"resine\"",
            &["object[0].material", "\"resine\"", "\"resin\"?"],
        ),
        (
            "material = \"gold\"",
            "material = \"gould\"",
            &[":13:12: sample_mask.material", "\"gould\"", "\"gold\"?"],
        ),
        ("\"1.1 g/cm3\"", "\"0 g/cm3\"", &["materials.resin.density", "> 0"]),
        (
            "formula = \"C2H4O\"\ndensity = \"1.1 g/cm3\"",
            "mu = \"-1 /m\"\ndelta = 1e-7",
            &["materials.resin.mu", ">= 0"],
        ),
        ("\"30 keV\"", "\"2 MeV\"", &[":4:10: source.energy", "2000 keV", "range of the tables"]),
        ("\"30 keV\"", "\"1 eV\"", &[":4:10: source.energy", "range of the tables"]),
        ("\"30 keV\"", "\"-30 keV\"", &[":4:10: source.energy", "> 0"]),
    ]);
}

#[test]
fn spectra_are_refused_by_line_before_a_run_begins() {
    let energy = "energy = \"30 keV\"";
    for (text, words) in [
        ("", &["tube.csv:1:1: spectrum: found no rows"][..]),
        ("20,1\n10,1\n", &["tube.csv:2:1: energy_keV: found 10", "ascending"]),
        ("10,1\n20,-1\n", &["tube.csv:2:4: weight: found -1", "0 or more"]),
        ("10,1\n20,nan\n", &["tube.csv:2:4: weight: found nan"]),
        ("30,1\n900,1\n", &["scene.toml:4:", "source.spectrum: found 900 keV", "0.1 keV to 800"]),
    ] {
        let place = Workplace::new().with(energy, "spectrum = \"tube.csv\"");
        place.file("tube.csv", text).refused(words);
    }
    let numbers = "mu = \"20 /m\"\ndelta = 1e-7";
    let scene = SCENE.replacen(energy, "spectrum = \"tube.csv\"", 1);
    let scene = scene.replacen("formula = \"C2H4O\"\ndensity = \"1.1 g/cm3\"", numbers, 1);
    let place = Workplace::new().file("scene.toml", scene);
    place.file("tube.csv", "20,1\n30,1\n").refused(&["materials.resin", "one energy only"]);
}

#[test]
fn tables_of_constants_are_refused_by_line() {
    let table = "formula = \"C2H4O\"\ndensity = \"1.1 g/cm3\"";
    for (text, words) in [
        (
            "energy_keV,mu_per_cm,delta\n20,0.3,5e-7\n10,0.5,2e-6\n",
            &["resin.csv:3:1: energy_keV: found 10", "ascending"][..],
        ),
        ("energy_keV,mu_per_cm\n20,0.3\n", &["resin.csv:1:1: delta", "energy_keV,mu_per_cm,delta"]),
        ("energy_keV,mu_per_cm,delta\n20,0.3\n", &["resin.csv:2:", "delta: found nothing"]),
        (
            "energy_keV,mu_per_cm,delta\n20,x,1e-7\n",
            &["resin.csv:2:4: mu_per_cm: found x", "above 0"],
        ),
        ("energy_keV,mu_per_cm,delta\n20,nan,1e-7\n", &["mu_per_cm: found nan"]),
        ("energy_keV,mu_per_cm,delta\n", &["resin.csv:1", "no rows"]),
        ("", &["resin.csv:1", "no rows"]),
        (
            "energy_keV,mu_per_cm,delta\n10,0.3,1e-7\n20,0.3,1e-7\n",
            &["scene.toml:4:10: source.energy", "10 keV to 20 keV"],
        ),
    ] {
        let place = Workplace::new().with(table, "table = \"resin.csv\"");
        place.file("resin.csv", text).refused(words);
    }
    let place = Workplace::new().with(table, "table = \"resin.csv\"");
    place.refused(&["resin.csv", "cannot read the material table"]);
    place.file("resin.csv", b"energy_keV,\xff\xfe").refused(&["resin.csv", "UTF-8"]);
}

#[test]
fn syntax_of_toml_and_json_is_shown_where_it_breaks() {
    scenes(&[
        ("[source]", "[source", &["scene.toml:1:", "syntax: found", "valid TOML"]),
        ("pixels = [16, 4]", "pixels = [16, 4", &["scene.toml:", "valid TOML"]),
        ("seed = 1", "seed = 1\nseed = 2", &["scene.toml:25:1", "valid TOML"]),
    ]);
    for (text, words) in [
        ("{ \"source\": { ", &["scene.json:1:", "syntax: found EOF", "valid JSON"][..]),
        ("{ \"source\": 1, }", &["scene.json:1:", "trailing comma"]),
        ("", &["scene.json:1:", "valid JSON"]),
        ("[]", &["scene.json:1:1: scene: found a list of length 0", "a table"]),
        ("{}", &["scene.json:1:1: source", "the key is missing"]),
        ("{ \"source\": null }", &["source: found null"]),
        ("{ \"a\": 1, \"a\": 1 }", &["scene.json:1:11: a: found the key a second time"]),
    ] {
        let mut place = Workplace::new().file("scene.json", text);
        place.scene = "scene.json";
        place.refused(words);
    }
    let mut place = Workplace::new().file("bytes.toml", b"\xff\xfe\x00");
    place.scene = "bytes.toml";
    place.refused(&["bytes.toml: cannot read the scene", "UTF-8"]);
}

#[test]
fn paths_that_cannot_be_read_or_written_are_named() {
    let mut place = Workplace::new();
    place.scene = "nowhere.toml";
    place.refused(&["nowhere.toml: cannot read the scene"]);
    place.scene = ".";
    place.refused(&[".: the scene file must end in .toml or .json"]);
    fs::create_dir(place.directory.path().join("folder.toml")).unwrap();
    place.scene = "folder.toml";
    place.refused(&["folder.toml: cannot read the scene", "directory"]);
    place.scene = "scene.toml";
    // A file in the way, as the run directory and as a folder above it.
    place.output = "part.stl";
    place.refused(&["part.stl", "is not a directory"]);
    place.output = "part.stl/run";
    place.refused(&["part.stl", "is not a directory"]);
    place.output = "/proc/run";
    if cfg!(target_os = "linux") {
        place.refused(&["/proc/run"]);
    }
}

#[cfg(unix)]
#[test]
fn files_without_permission_are_named() {
    use std::os::unix::fs::PermissionsExt;
    let place = Workplace::new();
    let path = place.directory.path().join("part.stl");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o000)).unwrap();
    // The superuser may read everything.
    if fs::read(&path).is_err() {
        place.refused(&["part.stl: cannot read the mesh", "ermission"]);
    }
}

#[test]
fn scene_without_objects_is_the_flat_twice() {
    let place = Workplace::new();
    let scene = &SCENE[..SCENE.find("[[object]]").unwrap()];
    let place = place.file("scene.toml", scene);
    let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
    command.current_dir(place.directory.path());
    command.args(["simulate", "scene.toml", "-o", "run", "-q", "--format", "npy"]);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(place.directory.path().join("run/sample.npy").exists());
}
