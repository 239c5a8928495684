//! Keys of the detector: the resolved scene and JSON read back.

use beamlet::scene::{Blur, Scatter, Scene};
use std::collections::BTreeMap;

const SCENE: &str = r#"
[source]
distance = "1 m"
spot = "0 um"
energy = "30 keV"
[detector]
distance = "2 m"
pixels = [4, 2]
pitch = "100 um"
"#;

fn load(detector: &str) -> beamlet::Result<Scene> {
    Scene::from_toml(&format!("{SCENE}{detector}"), ".")
}

#[test]
fn resolved_detector_reads_back_the_same() {
    let texts = [
        "mode = \"integrating\"\nphotons = 1234.5\nswank = 0.85\nelectronic_noise = 2.5\ngain = 0.1\noffset = 100\nbit_depth = 14\nblur = { fwhm = [\"80 um\", \"0.1 mm\"] }\nabsorber = { material = \"gold\", thickness = \"1 mm\" }",
        "threshold_low = \"10 keV\"\nthreshold_high = \"29 keV\"\nphotons = 5\nblur = { kernel = \"k.tif\", pixel = \"9 um\" }\nscatter = { image = \"s.png\" }",
        "scatter = { kernel = \"v.npy\", pixel = [\"1 mm\", \"2 mm\"], fraction = 0.07 }",
        "",
    ];
    for text in texts {
        let scene = load(text).unwrap();
        let resolved = scene.to_toml(".", &BTreeMap::new(), &[]).unwrap();
        assert_eq!(Scene::from_toml(&resolved, ".").unwrap(), scene, "{resolved}");
    }
}

#[test]
fn json_has_the_same_keys() {
    let text = r#"{
        "source": { "distance": "1 m", "spot": "0 um", "energy": "30 keV" },
        "detector": {
            "distance": "2 m", "pixels": [4, 2], "pitch": "100 um", "photons": 500, "bit_depth": 12,
            "blur": { "sigma": "40 um" }, "scatter": { "image": "s.tif" }
        }
    }"#;
    let scene = Scene::from_json(text, ".").unwrap();
    let toml = "photons = 500\nbit_depth = 12\nblur = { sigma = \"40 um\" }\nscatter = { image = \"s.tif\" }";
    assert_eq!(scene, load(toml).unwrap());
    assert!(matches!(scene.detector.blur, Some(Blur::Gaussian { .. })));
    assert!(matches!(scene.detector.scatter, Some(Scatter::Image(_))));
}
