//! What `check` and `simulate` say of detector numbers that are clipped at 0.

use crate::support::program::{beamlet, ended, workplace};
use std::fs;
use std::process::Output;
use tempfile::TempDir;

const SCENE: &str = r#"
source = { distance = "1 m", spot = "0 um", energy = "30 keV" }
[detector]
distance = "2 m"
pixels = [64, 32]
pitch = "100 um"
photons = 50
electronic_noise = 10
bit_depth = 12
"#;

fn simulate(place: &TempDir, name: &str, set: &str) -> (Output, serde_json::Value) {
    let words = ["simulate", "scene.toml", "--backend", "bvh", "--format", "npy", "-o", name];
    let mut command = beamlet(place.path());
    command.args(words);
    if !set.is_empty() {
        command.args(["--set", set]);
    }
    let output = command.output().unwrap();
    ended(&output, 0);
    let run = fs::read_to_string(place.path().join(name).join("run.json")).unwrap();
    let run: serde_json::Value = serde_json::from_str(&run).unwrap();
    (output, run["tally"].clone())
}

#[test]
fn offsets_below_4_deviations_are_warned_of_and_clipped_numbers_are_counted() {
    let place = workplace(SCENE);
    let check = |set: &str| {
        let words = ["check", "scene.toml", "--no-estimate", "--set", set];
        let output = beamlet(place.path()).args(words).output().unwrap();
        ended(&output, 0);
        String::from_utf8(output.stdout).unwrap()
    };
    let warning = "detector.offset is 0, below 4 standard deviations of the electronic noise (40): 48.01 % \
                   of the numbers without light are clipped at 0";
    assert!(check("detector.offset=0").contains(&format!("warning: {warning}")));
    for right in ["detector.offset=40", "detector.photons=50"] {
        assert!(!check(right).contains("detector.offset"), "{right}");
    }

    let (output, tally) = simulate(&place, "low", "detector.offset=0");
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(log.contains(&format!("warn: {warning}")), "{log}");
    // A dark frame of 2048 numbers: 983, with a standard deviation of 23.
    let clipped = tally["clipped_at_zero"].as_u64().unwrap();
    assert!((868..1098).contains(&clipped), "{clipped}");
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains(&format!("{clipped} detector numbers clipped at 0")), "{printed}");

    let (output, tally) = simulate(&place, "default", "");
    assert!(!String::from_utf8(output.stderr).unwrap().contains("detector.offset"));
    assert_eq!(tally["clipped_at_zero"], 0);
    // The resolved scene has the number: 8.3 deviations.
    let scene = fs::read_to_string(place.path().join("default/scene.toml")).unwrap();
    assert!(scene.contains("offset = 83.0"), "{scene}");
}
