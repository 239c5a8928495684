//! The program as a user meets it: real binary, temporary directories, exit codes.

#[cfg(target_os = "linux")]
use crate::support::gate::{Gate, Held};
use crate::support::program::{beamlet, ended, run, stderr, workplace};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const SCENE: &str = r#"
source = { distance = "1.21 m", spot = ["30 um", "26 um"], energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [16, 4], pitch = "150 um" }
sample_mask = { distance = "1.2 m", material = "gold", thickness = "225 um", projected_aperture = "30 um" }
detector_mask = { material = "gold", thickness = "225 um", projected_aperture = "30 um" }
materials.carbon = { formula = "C", density = "2.0 g/cm3" }
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 3 }
angles = { from = "0 deg", to = "360 deg", count = 2 }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.4 mm", height = "16 mm", sides = 64 } }
material = "carbon"
"#;

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn help_and_version_go_to_stdout_with_examples() {
    let place = workplace(SCENE);
    for (line, wanted) in [
        ("--version", env!("CARGO_PKG_VERSION")),
        ("simulate --help", "--resume"),
        ("--help", "130"),
    ] {
        let output = run(place.path(), line);
        ended(&output, 0);
        assert!(stdout(&output).contains(wanted), "{line}");
    }
}

#[test]
fn check_tells_geometry_materials_objects_and_work() {
    let place = workplace(SCENE);
    let output = run(place.path(), "check scene.toml");
    ended(&output, 0);
    let text = stdout(&output);
    for wanted in ["mask magnification    1.5\n", "lever arm", "carbon", "gold", "rod", "rays"] {
        assert!(text.contains(wanted), "{wanted}: {text}");
    }
    let mut command = beamlet(place.path());
    command.args(["check", "scene.toml", "--json", "--set", "source.energy=40 keV"]);
    command.args(["--set", "materials.carbon.density=1.9 g/cm3"]);
    let output = command.output().unwrap();
    ended(&output, 0);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["setup"]["energy"], 40.0);
    assert_eq!(report["setup"]["extent"]["steps"], 3);
    assert_eq!(report["work"]["output_bytes"], 3 * 3 * 16 * 4 * 4);
    assert_eq!(report["materials"][1]["shadows_builtin"], true);
    assert_eq!(names(place.path()), ["scene.toml"]);
}

#[test]
fn a_memory_limit_that_is_too_small_is_refused_and_check_tells_what_fits() {
    let place = workplace(SCENE);
    let output = run(place.path(), "check scene.toml --json --memory-limit 1GiB");
    ended(&output, 0);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let memory = &report["work"]["memory"];
    assert_eq!(memory["band_rows"], 4);
    assert!(memory["peak_bytes"].as_u64().unwrap() < 1 << 30, "{memory}");
}

#[test]
fn examples_are_listed_and_written_and_pass_their_own_check() {
    let place = workplace(SCENE);
    let output = run(place.path(), "example");
    ended(&output, 0);
    for name in ["paper", "bracket", "cylinders", "tomography", "coded", "lab", "synchrotron"] {
        assert!(stdout(&output).contains(name));
        let write = format!("example {name} -o {name}");
        ended(&run(place.path(), &write), 0);
        ended(&run(place.path(), &format!("check {name}/scene.toml --no-estimate")), 0);
        let scene = place.path().join(name).join("scene.toml");
        fs::write(&scene, "mine").unwrap();
        ended(&run(place.path(), &write), 1);
        assert_eq!(fs::read_to_string(&scene).unwrap(), "mine");
        ended(&run(place.path(), &format!("{write} --overwrite")), 0);
        assert_ne!(fs::read_to_string(&scene).unwrap(), "mine");
    }
}

#[test]
fn devices_are_listed_for_people_and_programs() {
    let place = workplace(SCENE);
    let output = run(place.path(), "devices --json");
    ended(&output, 0);
    let devices: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let name = devices[0]["name"].as_str().unwrap();
    assert!(stdout(&run(place.path(), "devices")).contains(name));
}

#[test]
fn a_small_scene_is_simulated_once_and_not_overwritten_unasked() {
    let place = workplace(SCENE);
    let output = run(place.path(), "simulate scene.toml -o run");
    ended(&output, 0);
    let text = stdout(&output);
    assert!(text.contains("run ") && text.contains("2 x 3 steps of 16 x 4 pixels"), "{text}");
    let path = place.path().join("run");
    assert_eq!(
        names(&path),
        ["flat", "geometry.json", "progress.log", "run.json", "sample", "scene.toml"]
    );
    assert_eq!(names(&path.join("sample/view_0001")).len(), 3);
    let record: serde_json::Value =
        serde_json::from_slice(&fs::read(path.join("run.json")).unwrap()).unwrap();
    assert_eq!(record["state"], "done");

    let output = run(place.path(), "simulate scene.toml -o run");
    ended(&output, 1);
    assert!(stderr(&output).contains("holds a run already"));
    ended(&run(place.path(), "simulate scene.toml -o run --overwrite -q --format npy"), 0);
    assert_eq!(
        names(&path),
        ["flat.npy", "geometry.json", "progress.log", "run.json", "sample.npy", "scene.toml"]
    );
    let output = run(place.path(), "simulate scene.toml -o run --resume");
    ended(&output, 0);
    assert!(stdout(&output).contains("complete already"));
}

#[test]
fn the_resolved_scene_of_a_run_gives_the_same_bits() {
    let place = workplace(SCENE);
    let mut command = beamlet(place.path());
    command.args(["simulate", "scene.toml", "-o", "one", "--format", "npy"]);
    command.args(["--backend", "bvh", "--set", "detector.pixels=[8, 3]"]);
    ended(&command.output().unwrap(), 0);
    let line = "simulate one/scene.toml -o two --format npy --backend bvh";
    ended(&run(place.path(), line), 0);
    for name in ["flat.npy", "sample.npy"] {
        let bytes = |run: &str| fs::read(place.path().join(run).join(name)).unwrap();
        assert!(bytes("one") == bytes("two"), "{name}");
    }
}

/// Simulates 12 views into a folder.
#[cfg(target_os = "linux")]
fn twelve_views(place: &Path, run: &str) -> Command {
    let mut command = beamlet(place);
    command.args(["simulate", "scene.toml", "-o", run, "--format", "npy", "--backend", "bvh"]);
    command.args(["--set", "scan.angles={ from = \"0 deg\", to = \"360 deg\", count = 12 }"]);
    command
}

#[test]
#[cfg(target_os = "linux")]
fn an_interrupted_run_names_the_command_that_resumes_it_to_the_same_bits() {
    let place = workplace(SCENE);
    let gate = Gate::Synced("run/progress.log", "flat");
    let mut begun = Held::at(gate, twelve_views(place.path(), "run"));
    begun.interrupt();
    let message = ended(&begun.ends(), 130);
    let resume = message.lines().find_map(|line| line.strip_prefix("to resume: beamlet ")).unwrap();
    let command = format!("{} {resume}", env!("CARGO_BIN_EXE_beamlet"));
    let resumed =
        Command::new("sh").args(["-c", &command]).current_dir(place.path()).output().unwrap();
    ended(&resumed, 0);

    ended(&twelve_views(place.path(), "whole").output().unwrap(), 0);
    for name in ["flat.npy", "sample.npy"] {
        let bytes = |run: &str| fs::read(place.path().join(run).join(name)).unwrap();
        assert!(bytes("run") == bytes("whole"), "{name}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn an_overwriting_run_interrupted_before_it_writes_names_the_command_that_starts_it_again() {
    let place = workplace(SCENE);
    ended(&run(place.path(), "simulate scene.toml -o run --backend bvh -q"), 0);
    let recorded = || fs::read(place.path().join("run/run.json")).unwrap();
    let before = recorded();
    ended(&run(place.path(), "mesh scene.toml -o rod.stl"), 0);
    let mut command = beamlet(place.path());
    command.args(["simulate", "scene.toml", "-o", "run", "--format", "npy", "--backend", "bvh"]);
    let mesh = "--overwrite --set object.rod.mesh=rod.stl --set object.rod.unit=mm";
    command.args(mesh.split(' '));
    // Meshes are read before a run writes anything.
    let mut begun = Held::at(Gate::Read("rod.stl", 0), command);
    begun.interrupt();
    let message = ended(&begun.ends(), 130);
    let begin = "nothing was written; to start again: beamlet ";
    let again = message.lines().find_map(|line| line.strip_prefix(begin)).expect(&message);
    assert!(!again.contains("--resume"), "the earlier run is another one: {again}");
    assert!(before == recorded(), "the earlier run stays");
    let command = format!("{} {again}", env!("CARGO_BIN_EXE_beamlet"));
    let output =
        Command::new("sh").args(["-c", &command]).current_dir(place.path()).output().unwrap();
    ended(&output, 0);
    assert!(place.path().join("run/flat.npy").is_file() && before != recorded(), "{again}");
}

#[test]
fn the_work_of_the_device_is_shown_and_recorded() {
    let place = workplace(SCENE);
    let words = ["simulate", "scene.toml", "-o", "run", "-q", "--profile"];
    let output = beamlet(place.path()).args(words).output().unwrap();
    ended(&output, 0);
    let table = stderr(&output);
    for word in
        ["submissions", "before the views", "first view", "2 later views", "in all", "illuminate"]
    {
        assert!(table.contains(word), "{word}: {table}");
    }
    let run: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(place.path().join("run/run.json")).unwrap())
            .unwrap();
    let profile = &run["profile"];
    let sum = |key: &str| {
        ["before_views", "first_view", "later_views"]
            .map(|part| profile[part][key].as_u64().unwrap())
            .iter()
            .sum::<u64>()
    };
    for key in ["submissions", "waits", "bytes_to_device", "bytes_to_host", "buffers"] {
        assert_eq!(profile[key], sum(key), "{key}: {profile}");
    }
    assert!(sum("bytes_to_device") > 0 && sum("bytes_to_host") > 0, "{profile}");
    assert_eq!(profile["views"], 3, "{profile}");
    assert!(profile["kernels"]["illuminate"]["groups"].as_u64().unwrap() > 0, "{profile}");
}
