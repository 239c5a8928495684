//! Mistakes in scenes and command lines: all of them at once, each at its place.

use crate::support::program::{beamlet, ended, run, workplace};
use std::fs;

const SCENE: &str = r#"
[source]
distance = "1.21 m"
spot = "30 um"
energy = "30 keV"

[detector]
distance = "1.8 m"
pixels = [16, 8]
pitch = "150 um"

[sample_mask]
distance = "1.2 m"
material = "gold"
thickness = "225 um"
projected_aperture = "30 um"

[detector_mask]
material = "gold"
thickness = "225 um"
projected_aperture = "30 um"

[[object]]
name = "rod"
shape = { cylinder = { radius = "0.2 mm", height = "16 mm" } }
material = "PMMA"

[[object]]
name = "part"
mesh = "part.stl"
unit = "mm"
material = "nylon 66"
"#;

const VERBS: [&str; 15] = [
    "simulate",
    "retrieve",
    "compare",
    "check",
    "view",
    "report",
    "spectrum",
    "material",
    "mesh",
    "mask",
    "devices",
    "example",
    "schema",
    "completions",
    "man",
];

#[test]
fn every_verb_takes_quiet_and_verbose_and_has_a_page_and_completions() {
    let place = workplace(SCENE);
    for verb in VERBS {
        let output = run(place.path(), &format!("{verb} --help"));
        ended(&output, 0);
        let help = String::from_utf8(output.stdout).unwrap();
        assert!(help.contains("-q, --quiet") && help.contains("-v, --verbose"), "{verb}: {help}");
    }
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let output = run(place.path(), &format!("completions {shell}"));
        ended(&output, 0);
        let script = String::from_utf8(output.stdout).unwrap();
        assert!(VERBS.iter().all(|verb| script.contains(verb)), "{shell}");
        assert!(script.contains("--memory-limit") || script.contains("memory-limit"), "{shell}");
    }
    ended(&run(place.path(), "man -o pages"), 0);
    for verb in VERBS {
        let page =
            fs::read_to_string(place.path().join(format!("pages/beamlet-{verb}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS") && page.contains("beamlet"), "{verb}");
    }
    let message = ended(&run(place.path(), "man -o pages"), 1);
    assert!(message.contains("pages/beamlet.1: exists already"), "{message}");
    ended(&run(place.path(), "man -o pages --overwrite"), 0);
}

#[test]
fn completions_of_bash_complete_a_verb() {
    let place = workplace(SCENE);
    let output = run(place.path(), "completions bash");
    fs::write(place.path().join("beamlet.bash"), output.stdout).unwrap();
    let script = "source beamlet.bash; COMP_WORDS=(beamlet retr); COMP_CWORD=1; \
                  _beamlet beamlet retr beamlet; echo \"${COMPREPLY[*]}\"";
    let mut bash = std::process::Command::new("bash");
    let output = bash.current_dir(place.path()).args(["-c", script]).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), "retrieve");
}

#[test]
fn a_run_records_when_how_long_and_by_which_command() {
    let text = SCENE.split("[[object]]\nname = \"part\"").next().unwrap();
    let place = workplace(text);
    let record = || {
        let text = fs::read_to_string(place.path().join("run/run.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()
    };
    let line = "simulate scene.toml -q -o run --format npy";
    ended(&beamlet(place.path()).args(line.split(' ')).output().unwrap(), 0);
    let first = record();
    assert_eq!(first["state"], "done");
    assert_eq!(first["commands"][0], format!("beamlet {line}"));
    let (began, written) = (first["began"].as_str().unwrap(), first["written"].as_str().unwrap());
    // RFC 3339 sorts as time does.
    assert!(began.ends_with('Z') && began.len() == 20 && began <= written, "{began} {written}");
    assert!(began > "2025" && first["duration_s"].as_f64().unwrap() > 0.0);
    assert_eq!(first["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(first["commit"].as_str(), option_env!("BEAMLET_COMMIT"));

    // A part of the run that is lost is made again: the command is added, the beginning stays.
    let sample = place.path().join("run/sample.npy");
    let mut bytes = fs::read(&sample).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&sample, bytes).unwrap();
    ended(&run(place.path(), "simulate scene.toml -q -o run --resume"), 0);
    let second = record();
    assert_eq!(second["began"], first["began"]);
    assert_eq!(second["commands"][1], "beamlet simulate scene.toml -q -o run --resume");
    assert!(second["duration_s"].as_f64() > first["duration_s"].as_f64());

    // Two runs differ in their dates and not in what is compared.
    ended(&run(place.path(), "simulate scene.toml -q -o other"), 0);
    ended(&run(place.path(), "compare run other"), 0);
}

#[test]
fn a_retrieval_records_hashes_of_all_that_it_read() {
    use sha2::{Digest, Sha256};
    let text = SCENE.split("[[object]]\nname = \"part\"").next().unwrap();
    let scan = "\n[scan]\nmask_offsets = [\"-10 um\", \"0 um\", \"10 um\"]\n";
    let noise = "pixels = [16, 8]\nphotons = 1000\noffset = 50\n";
    let place = workplace(&(text.replace("pixels = [16, 8]\n", noise) + scan));
    let here = |name: &str| place.path().join(name);
    ended(&run(place.path(), "simulate scene.toml -q -o run"), 0);
    ended(&run(place.path(), "simulate scene.toml -q -o array --format npy"), 0);
    fs::write(here("offsets.txt"), "-10 um\n0 um\n10 um\n").unwrap();
    let line = "retrieve -q --method three-step --flat run/counts/flat --sample array/counts/sample.npy \
                --dark array/dark.npy --geometry scene.toml --offsets offsets.txt -o maps";
    ended(&run(place.path(), line), 0);
    let hashes = |folder: &str| {
        let text = fs::read_to_string(here(folder).join("retrieved.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["inputs"].clone()
    };
    let sha256 = |bytes: &[u8]| {
        Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect::<String>()
    };
    let measured = hashes("maps");
    let mut wanted = serde_json::Map::new();
    for name in ["array/counts/sample.npy", "array/dark.npy", "scene.toml", "offsets.txt"] {
        wanted.insert(name.into(), sha256(&fs::read(here(name)).unwrap()).into());
    }
    let frame = |step: u32| {
        let name = format!("step_{step:03}.exr");
        format!("{}  {name}\n", sha256(&fs::read(here("run/counts/flat").join(&name)).unwrap()))
    };
    let lines: String = (0..3).map(frame).collect();
    wanted.insert("run/counts/flat".into(), sha256(lines.as_bytes()).into());
    assert_eq!(measured, serde_json::Value::Object(wanted));
    ended(&run(place.path(), "retrieve run -q --method three-step"), 0);
    let of_run = hashes("run/retrieved");
    let log = sha256(&fs::read(here("run/progress.log")).unwrap());
    assert_eq!(of_run["run/progress.log"], log);
    assert_eq!(of_run.as_object().unwrap().len(), 2);
}

#[test]
fn shipped_examples_have_no_warnings_but_of_views_rims_and_rays() {
    let place = workplace(SCENE);
    for name in ["cylinder", "bracket", "cylinders", "tomography", "ucl-wire", "lab", "synchrotron"]
    {
        ended(&run(place.path(), &format!("example {name} -o {name}")), 0);
        let output = run(place.path(), &format!("check {name}/scene.toml --no-estimate"));
        ended(&output, 0);
        let text = String::from_utf8(output.stdout).unwrap();
        let warnings: Vec<&str> = text.lines().filter(|line| line.contains("warning")).collect();
        match name {
            "tomography" => {
                let [views, rim, warning] = warnings[..] else { panic!("{name}: {text}") };
                assert!(
                    views.contains("have 180 views over half a turn; a sample of 198"),
                    "{views}"
                );
                assert!(rim.starts_with("warning: \"matrix\" is round about the axis"), "{rim}");
                assert!(
                    warning.starts_with("warning: \"fibres\" is outside ray optics"),
                    "{warning}"
                );
            }
            "lab" => {
                let [warning] = warnings[..] else { panic!("{name}: {text}") };
                assert!(warning.contains("the set-up is outside ray optics"), "{warning}");
            }
            _ => assert!(warnings.is_empty(), "{name}: {text}"),
        }
    }
    // A body that is many times as long is still told, and a material that is not what its name says.
    let text = SCENE.split("[[object]]\nname = \"part\"").next().unwrap();
    fs::write(place.path().join("scene.toml"), text).unwrap();
    for (scene, set, words) in [
        ("scene.toml", "sampling.seed=1", "\"rod\" reaches outside the field of view"),
        (
            "cylinder/scene.toml",
            "materials.carbon.density=1.5 g/cm3",
            "materials.carbon hides the built-in material",
        ),
    ] {
        let mut command = beamlet(place.path());
        let output =
            command.args(["check", scene, "--no-estimate", "--set", set]).output().unwrap();
        ended(&output, 0);
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(said.contains(words), "{set}: {said}");
    }
}
