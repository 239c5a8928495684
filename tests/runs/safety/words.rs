//! Names as they are printed.

use super::{beamlet, simulate, workplace};
use std::fs;

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
