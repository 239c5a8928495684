//! Mistakes in scenes and command lines: all of them at once, each at its place.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

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

/// Message of `check` about the scene with these lines exchanged.
fn said(changes: &[(&str, &str)]) -> String {
    let mut text = SCENE.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    let place = workplace(&text);
    let facets = "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
                  endloop\nendfacet\n";
    fs::write(place.path().join("part.stl"), format!("solid a\n{facets}endsolid a\n")).unwrap();
    ended(&run(place.path(), "check scene.toml --no-estimate"), 1)
}

/// Line numbers of the errors, in their order.
fn lines(message: &str) -> Vec<usize> {
    let errors = message.lines().filter(|line| line.starts_with("error: "));
    let line = |error: &str| {
        let rest = error.strip_prefix("error: scene.toml:").unwrap_or_else(|| panic!("{error}"));
        rest.split(':').next().unwrap().parse().unwrap()
    };
    errors.map(line).collect()
}

#[test]
fn all_mistakes_of_a_scene_are_told_at_once_each_with_its_caret() {
    let message = said(&[
        ("distance = \"1.21 m\"", "distance = \"1,21 m\""),
        ("spot = \"30 um\"", "focal_spot = \"30 um\""),
        ("pitch = \"150 um\"", "pixel_size = \"150 um\""),
        ("pixels = [16, 8]", "pixels = [16, 0]"),
        ("thickness = \"225 um\"", "thickness = \"-225 um\""),
        ("radius = \"0.2 mm\"", "radius = 0.2"),
        ("material = \"PMMA\"", "material = \"nylonn\""),
        ("part.stl", "parts.stl"),
        ("unit = \"mm\"", "unit = \"yard\""),
    ]);
    assert_eq!(lines(&message), [3, 4, 9, 10, 15, 25, 26, 30, 31], "{message}");
    for words in [
        "source.distance: found \"1,21 m\", with a comma",
        "did you mean `spot`?",
        "did you mean `pitch`?",
        "detector.pixels[1]: found the number 0",
        "sample_mask.thickness: found -225 um",
        "object[0].shape.cylinder.radius: found the number 0.2, without a unit",
        "did you mean \"nylon 6\"",
        "object[1].mesh: found \"",
        "object[1].unit: found the unit \"yard\"",
    ] {
        assert!(message.contains(words), "{words} in {message}");
    }
    let carets =
        message.lines().filter(|line| line.trim_start().starts_with("| ") && line.contains('^'));
    assert_eq!(carets.count(), 9, "{message}");
}

/// Keys that exclude one another, packings and polygons.
const RIVALS: &str = r#"
[source]
distance = "1.21 m"
spot = "30 um"
energy = "30"
spectrum = { anode = "tungsten", kvp = "40 kV" }

[detector]
distance = "1.8 m"
pixels = [16, 8]
pitch = "150 um"

[sample_mask]
distance = "1.2 m"
transmission = 0.1
aperture = "20"
projected_aperture = "30 um"

[scan]
mask_offsets = { from = "-20 um", start = "-30", to = "20 um", count = 5 }

[[object]]
name = "plate"
material = "PMMA"
shape = { extrusion = { height = "0 mm", points = [
    ["0 mm", "0 mm"], ["2 mm", "1 mm"],
    ["2 mm", "0 mm"],
    ["0 mm", "1 mm"], ["0 mm", "5 mm"],
    ["1 mm", "-1 mm"],
] } }

[[object]]
name = "fibres"
material = "carbon"
shape = { cylinder = { radius = "10 um", height = "1 mm" }, sphere = { radius = "1 mm" } }
instances = { packing = "parallel-fibres", fill = 2, diameter_spread = 3, gap = "-1 um", region = {
    box = { size = ["1 mm", "0 mm", "-1 mm"] }, sphere = { radius = "1 mm" } } }
"#;

#[test]
fn keys_that_exclude_one_another_packings_and_polygons_hide_no_other_mistake() {
    let place = workplace(RIVALS);
    let message = ended(&run(place.path(), "check scene.toml --no-estimate"), 1);
    let wanted = [
        (5, "source.energy: found \"30\""),
        (6, "source.spectrum: found both energy and spectrum; allowed: either energy or spectrum"),
        (16, "sample_mask.aperture: found \"20\""),
        (17, "sample_mask.projected_aperture: found both aperture and projected_aperture"),
        (20, "scan.mask_offsets.start: found both from and start; allowed: either from or start"),
        (25, "object[0].shape.extrusion.height: found 0 m"),
        (27, "object[0].shape.extrusion.points[2]: found edges 0 and 2 that touch or cross"),
        (28, "object[0].shape.extrusion.points[4]: found edges 0 and 4 that touch or cross"),
        (28, "object[0].shape.extrusion.points[4]: found edges 2 and 4 that touch or cross"),
        (
            35,
            "object[1].shape.sphere: found both cylinder and sphere; allowed: one of: box; cylinder",
        ),
        (36, "object[1].instances.fill: found 2.0; allowed: a number > 0, up to"),
        (
            36,
            "object[1].instances.diameter_spread: found 3.0; allowed: a standard deviation of ln(diameter) from 0 to",
        ),
        (36, "object[1].instances.gap: found -1 um; allowed: a value >= 0"),
        (37, "object[1].instances.region.box.size[1]: found 0 m; allowed: a value > 0"),
        (37, "object[1].instances.region.box.size[2]: found -1 mm; allowed: a value > 0"),
        (37, "object[1].instances.region.sphere: found both box and sphere"),
    ];
    for (line, words) in wanted {
        let told = message
            .lines()
            .any(|it| it.starts_with(&format!("error: scene.toml:{line}:")) && it.contains(words));
        assert!(told, "{line}: {words} in {message}");
    }
}

#[test]
fn a_mistake_is_told_once_and_what_follows_from_it_is_not() {
    for (from, to, line) in [
        ("distance = \"1.8 m\"", "distance = \"1.8\"", 8),
        ("distance = \"1.21 m\"", "distance = \"one\"", 3),
        ("distance = \"1.2 m\"", "distanse = \"1.2 m\"", 13),
        ("pixels = [16, 8]", "pixels = [16]", 9),
        ("pitch = \"150 um\"", "pitch = \"150\"", 10),
        ("[sample_mask]\ndistance", "[sample_mask]\naperture = \"20 um\"\ndistance", 17),
        ("projected_aperture = \"30 um\"", "projected_aperture = 30", 16),
    ] {
        let message = said(&[(from, to)]);
        assert_eq!(lines(&message), [line], "{to}: {message}");
    }
}

#[test]
fn the_thickness_of_bars_is_blamed_where_the_mask_itself_stands_well() {
    let message = said(&[("thickness = \"225 um\"", "thickness = \"225 mm\"")]);
    assert!(
        message.contains("sample_mask.thickness: found 225 mm; allowed: up to 20 mm"),
        "{message}"
    );
    let message = said(&[("distance = \"1.2 m\"", "distance = \"1.3 m\"")]);
    assert!(message.contains("sample_mask.distance: found 1.3 m"), "{message}");
}

#[test]
fn a_unit_beside_a_shape_is_named_and_replaces_no_shape() {
    let place = workplace(SCENE);
    let line = "check scene.toml --no-estimate --set object.rod.unit=mm";
    let message = ended(&run(place.path(), line), 1);
    assert!(message.contains("object[0].unit: found both shape and unit"), "{message}");
}

#[test]
fn what_is_missing_is_named() {
    let place = workplace(SCENE);
    for (line, code, words) in [
        ("compare nowhere run", 2, "nowhere: cannot be read"),
        ("view nowhere -o pictures", 1, "nowhere: cannot be read"),
        ("check nowhere", 1, "nowhere: cannot be read"),
        ("report nowhere", 1, "nowhere: does not exist"),
        ("simulate scene.toml -o nowhere --resume", 1, "nowhere: does not exist"),
        ("simulate scene.toml -o . --resume", 1, ".: holds no run to resume"),
        (
            "retrieve --flat a.npy --sample b.npy --geometry scene.toml -o out --offsets list.txt",
            1,
            "list.txt: cannot be read as a file of offsets",
        ),
    ] {
        let message = ended(&run(place.path(), line), code);
        assert!(message.contains(words), "{line}: {message}");
    }
}

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
fn a_long_option_with_one_dash_has_a_tip() {
    let place = workplace(SCENE);
    let message = ended(&run(place.path(), "simulate scene.toml -output run"), 2);
    assert!(message.contains("tip: --output has two dashes"), "{message}");
}

#[test]
fn shipped_examples_have_no_warnings_but_of_the_limits_of_rays() {
    let place = workplace(SCENE);
    for name in ["cylinder", "bracket", "cylinders", "tomography"] {
        ended(&run(place.path(), &format!("example {name} -o {name}")), 0);
        let output = run(place.path(), &format!("check {name}/scene.toml --no-estimate"));
        ended(&output, 0);
        let text = String::from_utf8(output.stdout).unwrap();
        let warnings: Vec<&str> = text.lines().filter(|line| line.contains("warning")).collect();
        match name {
            "tomography" => {
                let [warning] = warnings[..] else { panic!("{name}: {text}") };
                assert!(
                    warning.starts_with("warning: \"fibres\" is outside ray optics"),
                    "{warning}"
                );
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
