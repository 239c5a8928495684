//! Keys of the detector: what is refused, and that the resolved scene reads back.

use beamlet::internals::detector::DetectorModel;
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
fn bad_values_are_refused_with_their_key_and_what_is_allowed() {
    let cases = [
        ("photons = 0", "detector.photons", "> 0"),
        ("photons = -5", "detector.photons", "> 0"),
        ("photons = nan", "detector.photons", "finite"),
        ("photons = 1e13", "detector.photons", "1e12"),
        ("photons = \"100\"", "detector.photons", "number"),
        ("electronic_noise = 3", "detector.electronic_noise", "photons"),
        ("bit_depth = 16", "detector.bit_depth", "photons"),
        ("photons = 10\nelectronic_noise = -1", "detector.electronic_noise", ">= 0"),
        ("photons = 10\nswank = 0.9", "detector.swank", "integrating"),
        ("photons = 10\nmode = \"integrating\"\nswank = 0", "detector.swank", "up to 1"),
        ("photons = 10\nmode = \"integrating\"\nswank = 1.1", "detector.swank", "up to 1"),
        ("photons = 10\ngain = 0", "detector.gain", "> 0"),
        ("photons = 10\noffset = inf", "detector.offset", "finite"),
        ("photons = 10\nbit_depth = 0", "detector.bit_depth", "from 1 to 24"),
        ("photons = 10\nbit_depth = 32", "detector.bit_depth", "from 1 to 24"),
        ("mode = \"counts\"", "detector.mode", "counting"),
        ("threshold_low = \"40 keV\"", "detector.threshold_low", "30 keV"),
        ("threshold_high = \"40 keV\"", "detector.threshold_high", "30 keV"),
        ("threshold_low = \"-1 keV\"", "detector.threshold_low", "> 0"),
        ("threshold_low = 20", "detector.threshold_low", "keV"),
        (
            "threshold_low = \"20 keV\"\nthreshold_high = \"10 keV\"",
            "detector.threshold_high",
            "threshold_low",
        ),
        (
            "mode = \"integrating\"\nthreshold_low = \"20 keV\"",
            "detector.threshold_low",
            "counting",
        ),
        ("absorber = { material = \"CsI\" }", "detector.absorber.thickness", "missing"),
        (
            "absorber = { material = \"CsI\", thickness = \"0 um\" }",
            "detector.absorber.thickness",
            "> 0",
        ),
        ("blur = {}", "detector.blur.sigma", "fwhm"),
        ("blur = { sigma = \"-1 um\" }", "detector.blur.sigma", ">= 0"),
        ("blur = { fwhm = \"-1 um\" }", "detector.blur.fwhm: found -1 um", ">= 0"),
        ("blur = { sigma = \"1 m\" }", "detector.blur.sigma", "100 pixels"),
        ("blur = { fwhm = \"1 m\" }", "detector.blur.sigma", "half maximum of 1 m"),
        ("blur = { sigma = \"1 um\", fwhm = \"1 um\" }", "detector.blur.sigma", "one of"),
        ("blur = { kernel = \"k.npy\" }", "detector.blur.pixel", "missing"),
        ("blur = { kernel = \"k.npy\", pixel = \"0 um\" }", "detector.blur.pixel", "> 0"),
        ("blur = { width = \"1 um\" }", "detector.blur.width", "unknown"),
        ("scatter = {}", "detector.scatter.kernel", "image"),
        ("scatter = { image = \"a.npy\", fraction = 1 }", "detector.scatter.fraction", "either"),
        (
            "scatter = { kernel = \"k.npy\", pixel = \"1 um\", fraction = 0 }",
            "detector.scatter.fraction",
            "> 0",
        ),
        ("photon = 5", "detector.photon", "did you mean `photons`"),
    ];
    for (text, key, words) in cases {
        let message = load(text).expect_err(text).to_string();
        assert!(message.contains(key) && message.contains(words), "{text}: {message}");
    }
}

#[test]
fn files_and_materials_that_cannot_serve_are_refused_before_anything_runs() {
    let place = tempfile::tempdir().unwrap();
    let write = |name: &str, values: &[&[f64]]| {
        let shape = (values.len(), values[0].len());
        let all = values.concat();
        let array = ndarray::Array2::from_shape_vec(shape, all).unwrap();
        ndarray_npy::write_npy(place.path().join(name), &array).unwrap();
    };
    write("negative.npy", &[&[0.0, 1.0], &[-0.1, 0.0]]);
    write("nan.npy", &[&[0.0, f64::NAN]]);
    write("zero.npy", &[&[0.0, 0.0]]);
    write("good.npy", &[&[1.0, 1.0, 1.0]]);
    std::fs::write(place.path().join("text.png"), "no image").unwrap();
    let cases = [
        ("blur = { kernel = \"none.npy\", pixel = \"9 um\" }", "none.npy"),
        ("blur = { kernel = \"text.png\", pixel = \"9 um\" }", "PNG"),
        ("blur = { kernel = \"k.jpg\", pixel = \"9 um\" }", ".npy, .tif, .tiff or .png"),
        ("blur = { kernel = \"negative.npy\", pixel = \"9 um\" }", "-0.1 in row 1, column 0"),
        ("blur = { kernel = \"nan.npy\", pixel = \"9 um\" }", "NaN"),
        ("blur = { kernel = \"zero.npy\", pixel = \"9 um\" }", "sum"),
        ("blur = { kernel = \"good.npy\", pixel = \"1 m\" }", "up to 100 pixels"),
        ("scatter = { image = \"good.npy\" }", "4 x 2 pixels"),
        ("absorber = { material = \"csx\", thickness = \"1 mm\" }", "detector.absorber.material"),
    ];
    for (text, words) in cases {
        let scene = Scene::from_toml(&format!("{SCENE}{text}"), place.path()).unwrap();
        let message = DetectorModel::of(&scene).expect_err(text).to_string();
        assert!(message.contains(words), "{text}: {message}");
        // The run and the check refuse in the same words.
        assert_eq!(beamlet::check::Check::of(&scene).run().expect_err(text).to_string(), message);
    }
    let scene = load("absorber = { material = \"vacuum\", thickness = \"1 mm\" }").unwrap();
    assert!(DetectorModel::of(&scene).unwrap_err().to_string().contains("no signal"));
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
