//! Frames are compared with their checksums when they are read, view by view.

use super::{SCENE, assert_says};
use crate::support::files;
use crate::support::program::{Workplace, ended};
use std::fs;

/// Runs with counts in both formats, each frame of 5 steps.
fn runs() -> [(Workplace, &'static str); 2] {
    ["npy", "exr"].map(|format| {
        let photons = "pitch = \"150 um\"\nphotons = 1000\nelectronic_noise = 3\n";
        let steps = "from = \"-25 um\", to = \"25 um\", count = ";
        let scene = SCENE.replace("pitch = \"150 um\"\n", photons);
        let place = Workplace::new(&scene.replace(&format!("{steps}2"), &format!("{steps}5")));
        ended(&place.simulate(&["--format", format]), 0);
        (place, format)
    })
}

/// Doubles one value of a stack: the first of view 2, or of the flat.
fn double(place: &Workplace, format: &str, stack: &str) {
    if format == "npy" {
        let name = format!("{stack}.npy");
        let mut array = place.bytes(&name);
        let view = if stack.ends_with("sample") { 2 } else { 0 };
        // The exponent of a float.
        let at = 128 + view * 4 * 5 * 2 * 8 + 2;
        let exponent = u16::from_le_bytes([array[at], array[at + 1]]) + (1 << 7);
        array[at..at + 2].copy_from_slice(&exponent.to_le_bytes());
        place.write(&name, &array);
    } else {
        // Another frame in place of this one.
        let folder =
            if stack.ends_with("sample") { format!("{stack}/view_0002") } else { stack.into() };
        let other = place.bytes(&format!("{folder}/step_001.exr"));
        place.write(&format!("{folder}/step_000.exr"), &other);
    }
}

/// The files of a stack that [`double`] changes.
fn restore(place: &Workplace, format: &str, stack: &str, from: &Workplace) {
    let name = match format {
        "npy" => format!("{stack}.npy"),
        _ if stack.ends_with("sample") => format!("{stack}/view_0002/step_000.exr"),
        _ => format!("{stack}/step_000.exr"),
    };
    place.write(&name, &from.bytes(&name));
}

fn copy(place: &Workplace) -> Workplace {
    let copy = Workplace::new(&fs::read_to_string(place.path("scene.toml")).unwrap());
    for name in files::paths(&place.path("run")) {
        let to = copy.path("run").join(&name);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(place.path("run").join(name), to).unwrap();
    }
    copy
}

#[test]
fn a_doubled_value_is_found_by_every_verb_that_reads_it() {
    for (place, format) in runs() {
        let whole = copy(&place);
        let other = whole.path("run").display().to_string();
        for (stack, name) in [("sample", "sample/2"), ("flat", "flat")] {
            double(&place, format, stack);
            let verbs: [&[&str]; 4] = [
                &["retrieve", "run", "-q"],
                &["report", "run"],
                &["view", "run", "-o", "pictures", "--view", "2"],
                &["compare", "run", &other],
            ];
            for verb in verbs {
                let code = if verb[0] == "compare" { 2 } else { 1 };
                let message = ended(&place.beamlet(verb), code);
                let expected = format!("{name} differs from its committed state");
                assert_says(&message, &[&expected, stack]);
            }
            assert!(!place.path("run/retrieved").exists() && !place.path("pictures").exists());
            restore(&place, format, stack, &whole);
        }
        for (stack, name) in [("counts/sample", "counts/sample/2"), ("dark", "dark")] {
            double(&place, format, stack);
            let message = ended(&place.beamlet(&["retrieve", "run", "-q", "--counts"]), 1);
            assert_says(&message, &[&format!("{name} differs from its committed state")]);
            restore(&place, format, stack, &whole);
        }
        ended(&place.beamlet(&["compare", "run", &other]), 0);
    }
}

#[test]
fn pictures_of_one_view_ask_for_no_other() {
    for (place, format) in runs() {
        double(&place, format, "sample");
        let view = ["view", "run", "-o", "pictures", "--show", "frames,profiles,curve"];
        ended(&place.beamlet(&[&view[..], &["--view", "1"]].concat()), 0);
        let message =
            ended(&place.beamlet(&[&view[..], &["--view", "2", "--overwrite"]].concat()), 1);
        assert_says(&message, &["sample/2 differs from its committed state"]);
    }
}

#[test]
fn check_finds_what_is_wrong_with_a_run_and_says_when_it_is_whole() {
    for (place, format) in runs() {
        let whole = copy(&place);
        let done = place.beamlet(&["check", "run"]);
        assert_eq!(ended(&done, 0), "");
        let told = String::from_utf8_lossy(&done.stdout).into_owned();
        assert_says(&told, &["6 of 6", "whole    yes"]);
        let views = [
            ("flat", "flat"),
            ("sample", "sample/2"),
            ("dark", "dark"),
            ("counts/flat", "flat"),
            ("counts/sample", "sample/2"),
        ];
        for (stack, view) in views {
            double(&place, format, stack);
            let message = ended(&place.beamlet(&["check", "run"]), 1);
            assert_says(&message, &[&format!("{view} differs from its committed state")]);
            restore(&place, format, stack, &whole);
        }
        let log = String::from_utf8(place.bytes("progress.log")).unwrap();
        let head: String = log.split_inclusive('\n').filter(|l| !l.contains("sample/1")).collect();
        place.write("progress.log", head.as_bytes());
        let message = ended(&place.beamlet(&["check", "run"]), 1);
        assert_says(&message, &["1 of 6 views are not committed, first sample/1"]);
    }
}

#[test]
fn check_tells_of_files_that_changed() {
    let place = Workplace::new(&SCENE.replace("energy = \"30 keV\"", "spectrum = \"beam.csv\""));
    fs::write(place.path("beam.csv"), "energy_keV,weight\n30,1\n").unwrap();
    let table = "table = \"resin.csv\"";
    let scene = fs::read_to_string(place.path("scene.toml")).unwrap();
    let scene = scene.replace("mu = \"0.25 /cm\"\ndelta = 2.4e-7", table);
    fs::write(place.path("scene.toml"), scene).unwrap();
    let resin = "energy_keV,mu_per_cm,delta\n5,90,9e-6\n30,0.25,2.4e-7\n60,0.2,6e-8\n";
    fs::write(place.path("resin.csv"), resin).unwrap();
    ended(&place.simulate(&[]), 0);
    fs::write(place.path("beam.csv"), "energy_keV,weight\n30,2\n").unwrap();
    let done = place.beamlet(&["check", "run"]);
    assert_eq!(ended(&done, 0), "");
    let told = String::from_utf8_lossy(&done.stdout).into_owned();
    assert_says(&told, &["note ", "beam.csv", "whole    yes"]);
    let message = ended(&place.beamlet(&["check", "run", "--set", "a.b=1"]), 2);
    assert_says(&message, &["this is a run"]);
}

#[test]
fn a_run_of_another_format_is_refused_with_its_number() {
    let place = Workplace::new(SCENE);
    ended(&place.simulate(&["--format", "npy"]), 0);
    let run = String::from_utf8(place.bytes("run.json")).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&run).unwrap();
    json["format_version"] = 7.into();
    // Another format may have other keys.
    json.as_object_mut().unwrap().remove("extent");
    place.write("run.json", json.to_string().as_bytes());
    for (line, code) in [
        (&["check", "run"][..], 1),
        (&["retrieve", "run", "--method", "three-step"], 1),
        (&["view", "run", "-o", "pictures"], 1),
        (&["report", "run"], 1),
        (&["compare", "run", "run"], 2),
        (&["simulate", "scene.toml", "-o", "run", "--resume"], 1),
    ] {
        assert_says(&ended(&place.beamlet(line), code), &["has the format_version 7"]);
    }
    json.as_object_mut().unwrap().remove("format_version");
    place.write("run.json", json.to_string().as_bytes());
    assert_says(&ended(&place.beamlet(&["check", "run"]), 1), &["missing field `format_version`"]);
}
