//! What `simulate` says of a run by waves.

use crate::support::program::{beamlet, ended, workplace};

/// A face along the beam in the middle of an aperture, below the critical angle of 1.4 mrad.
const FACE: &str = r#"
source = { distance = "1.212 m", spot = "30 um", energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [3, 1], pitch = "150 um" }
sample_mask = { distance = "1.2 m", aperture = "20 um", transmission = 0.0 }
detector_mask = { distance = "1.8 m", aperture = "30 um", transmission = 0.0 }
materials.matter = { mu = "0 1/m", delta = 1e-6 }
sampling = { transport = "wave" }
[[object]]
name = "block"
shape = { box = { size = ["2 mm", "10 mm", "4 mm"] } }
material = "matter"
rotate = [{ axis = [0, 0, 1], angle = "0.4 mrad" }]
position = ["1 mm", "0 mm", "0 mm"]
"#;

#[test]
fn light_near_grazing_is_warned_of() {
    let log = |angle: &str| {
        let place = workplace(&FACE.replace("0.4 mrad", angle));
        let words = ["simulate", "scene.toml", "--backend", "bvh", "-o", "run"];
        let output = beamlet(place.path()).args(words).output().unwrap();
        ended(&output, 0);
        String::from_utf8(output.stderr).unwrap()
    };
    let low = log("0.4 mrad");
    assert!(low.contains("surfaces near grazing") && low.contains("computed by rays"), "{low}");
    let steep = log("12 mrad");
    assert!(!steep.contains("near grazing"), "{steep}");
}

#[test]
fn a_sample_far_behind_the_mask_is_warned_of_with_the_size_of_the_error() {
    let place = workplace(&FACE.replace("1.212 m", "1.3 m"));
    let words = ["simulate", "scene.toml", "--backend", "bvh", "-o", "run"];
    let output = beamlet(place.path()).args(words).output().unwrap();
    ended(&output, 0);
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(log.contains("changes light by up to 4.5e-3 of the open beam"), "{log}");
}
