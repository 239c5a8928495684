//! Options with their ranges, and names as they are printed.

use super::{beamlet, ends, simulate, workplace};
use crate::support::program::ended;
use std::fs;

#[test]
fn options_out_of_range_or_without_effect_are_usage_errors_with_what_is_allowed() {
    let place = workplace();
    simulate(place.path(), "");
    ends(place.path(), "retrieve run -q", 0);
    for (line, wanted) in [
        ("compare run run --tolerance nan", "of 0 or more"),
        ("compare run run --tolerance -1", "of 0 or more"),
        ("compare run run --tolerance inf", "of 0 or more"),
        ("compare run run --format npy", "--difference"),
        ("retrieve run --gain -1", "above 0"),
        ("retrieve run --gain nan", "above 0"),
        ("retrieve run --gain 0", "above 0"),
        ("retrieve run --read-noise -3", "of 0 or more"),
        ("retrieve run --read-noise nan", "of 0 or more"),
        ("retrieve run --saturation nan", "above 0"),
        ("retrieve run --saturation 1e39", "3.4e38"),
        ("retrieve run --saturation -5", "above 0"),
        ("view run -o p --show frames --pixel 1,1", "--show profiles, curve, sinograms"),
        ("view run -o p --show retrieved --step 1", "--show frames"),
        ("view run -o p --show frames --row 1", "--show profiles"),
        ("material H999999999999 --density 1g/cm3 --energy 30keV", "1e6"),
        ("material water --density 1e300g/cm3 --energy 30keV", "100 g/cm3"),
    ] {
        let message = ends(place.path(), line, 2);
        assert!(message.contains(wanted), "{line}: {message}");
    }
    // A formula has no exponents: the element "e300" is unknown, as a material is.
    let message = ends(place.path(), "material H1e300O --density 1g/cm3 --energy 30keV", 1);
    assert!(message.contains("\"e300O\" is not part of a formula"), "{message}");
    assert!(!place.path().join("p").exists());
    for set in ["materials.x.formula=H999999999999", "materials.x.density=1e5 g/cm3"] {
        let mut command = beamlet(place.path(), "check scene.toml --set materials.x.formula=C");
        command.args(["--set", "materials.x.density=1 g/cm3", "--set", set]);
        let message = ended(&command.output().unwrap(), 1);
        assert!(message.contains("allowed: ") && message.contains("materials.x."), "{message}");
    }
}

#[test]
fn names_are_printed_without_characters_that_terminals_obey() {
    let place = workplace();
    let sly = "a\u{1b}[2J\u{202e}b\u{9b}";
    let unsafe_ones = |text: &str| text.chars().any(|c| "\u{1b}\u{202e}\u{9b}\r".contains(c));
    let say = |words: &[&str]| {
        let output = beamlet(place.path(), "").args(words).output().unwrap();
        [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
    };
    simulate(place.path(), "");
    fs::copy(place.path().join("scene.toml"), place.path().join(format!("{sly}.toml"))).unwrap();
    let file = format!("{sly}.toml");
    let lines = format!("one\ntwo{sly}");
    for words in [
        ["check", "scene.toml", "--set", &format!("object[0].name='{sly}'")].as_slice(),
        &["check", "scene.toml", "--set", &format!("object[0].material='{sly}'")],
        &["check", "scene.toml", "--set", &format!("{sly}=1")],
        &["check", &lines],
        &["check", sly],
        &["simulate", &file, "-o", sly],
        &["retrieve", sly],
        &["retrieve", "run", "-o", &lines],
        &["view", "run", "-o", &format!("pictures{sly}")],
        &["material", sly],
        &["spectrum", "--anode", "W", "--kvp", "60kV", "--filter", &format!("{sly}:1mm")],
        &["example", sly, "-o", "x"],
        &["compare", "run", sly],
        &["devices", sly],
    ] {
        let [out, err] = say(words);
        assert!(!unsafe_ones(&out) && !unsafe_ones(&err), "{words:?}: {out:?} {err:?}");
        assert!(!(out + &err).contains("one\ntwo"), "{words:?}");
    }
    // A name of an object cannot make lines of its own in a report.
    let [_, err] = say(&["check", "scene.toml", "--set", "object[0].name=\"rod\\nfine\""]);
    assert!(err.contains("object[0].name") && err.contains("control"), "{err}");
}
