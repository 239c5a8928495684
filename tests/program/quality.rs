//! `sampling.quality`: the tolerances of runs, by the real binary.

use crate::support::engine;
use crate::support::program::{done, ended, run, stderr};
use beamlet::Backend;
use beamlet::check::Check;
use beamlet::scene::Scene;
use std::fs;
use std::path::Path;

const MASKS: &str = include_str!("../support/masks.toml");
const ROD: &str = include_str!("../support/rod.toml");

/// A scene of a rod with these keys of the detector and of sampling.
fn scene(detector: &str, sampling: &str) -> String {
    format!(
        "{MASKS}\n[scan]\nmask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 11 }}\n[detector]\n\
         distance = \"1.8 m\"\npixels = [6, 2]\npitch = \"150 um\"\n{detector}\n[sampling]\n{sampling}\n{ROD}"
    )
}

/// Tolerance and angle tolerance (rad), which are compared by bits.
fn bits(tolerances: [f64; 2]) -> [u64; 2] {
    tolerances.map(f64::to_bits)
}

/// Tolerance and angle tolerance (rad) of the scene.toml of a run.
fn of_run(run: &Path) -> [u64; 2] {
    let text = fs::read_to_string(run.join("scene.toml")).unwrap();
    let scene: toml::Table = text.parse().unwrap();
    let sampling = scene["sampling"].as_table().unwrap();
    let (angle, unit) = sampling["angle_tolerance"].as_str().unwrap().split_once(' ').unwrap();
    assert_eq!(unit, "rad");
    bits([sampling["tolerance"].as_float().unwrap(), angle.parse().unwrap()])
}

/// Tolerances of a new run of a scene with these options.
fn traced(here: &Path, [detector, sampling]: [&str; 2], options: &str) -> [u64; 2] {
    fs::write(here.join("scene.toml"), scene(detector, sampling)).unwrap();
    done(here, &format!("simulate scene.toml -o run --overwrite --format npy {options}"));
    of_run(&here.join("run"))
}

/// 80,000 photons have a noise of 3.5e-3 of open beam; sigma of the angle of this set-up is 0.13 urad.
#[test]
fn runs_have_the_tolerances_of_their_quality() {
    let directory = tempfile::tempdir().unwrap();
    let tolerances = |scene, options: &str| {
        let few = format!("{options} --set detector.pixels=[2,1]");
        traced(directory.path(), scene, &few)
    };
    assert_eq!(tolerances(["", ""], ""), bits([1e-4, 30e-9]));
    assert_eq!(tolerances(["photons = 80000", ""], ""), bits([4e-4, 10e-9]));
    assert_eq!(
        tolerances(["photons = 80000", "angle_tolerance = \"5 nrad\""], ""),
        bits([4e-4, 5e-9])
    );
    let set = "--set sampling.quality=fine";
    assert_eq!(tolerances(["photons = 80000", "tolerance = 1e-3"], set), bits([1e-3, 2e-9]));
    // Two offsets settle no angle.
    let offsets = "--set scan.mask_offsets=[\"0um\",\"9um\"]";
    assert_eq!(tolerances(["photons = 80000", ""], offsets), bits([4e-4, 30e-9]));
}

/// A run goes on with its own numbers, also where the rule of the scene has others by now.
#[test]
fn a_resumed_run_keeps_its_tolerances() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let began = traced(here, ["", "quality = \"fine\""], "--set scan.angles=[\"0deg\",\"9deg\"]");
    let path = here.join("run/scene.toml");
    // A resolved scene of numbers alone.
    let text = fs::read_to_string(&path).unwrap().replace("quality = \"fine\"\n", "");
    fs::write(&path, text).unwrap();
    let log = fs::read_to_string(here.join("run/progress.log")).unwrap();
    let first: Vec<&str> = log.lines().filter(|line| !line.starts_with("sample/1")).collect();
    fs::write(here.join("run/progress.log"), first.join("\n") + "\n").unwrap();
    fs::write(here.join("scene.toml"), scene("", "")).unwrap();
    let set = "--set scan.angles=[\"0deg\",\"9deg\"]";
    let output = run(here, &format!("simulate scene.toml -o run --resume {set}"));
    ended(&output, 0);
    assert_eq!(of_run(&here.join("run")), began);
    // A number of its own is another scene.
    fs::write(here.join("scene.toml"), scene("", "tolerance = 1e-3")).unwrap();
    let output = run(here, &format!("simulate scene.toml -o run --resume {set}"));
    assert!(ended(&output, 1).contains("sampling.tolerance"), "{}", stderr(&output));
}

/// Deviation of the angle by thin masks against the Fisher information of the real curve and fit: 15 %,
/// since a Gaussian is not the shape of the curve. A spot of 60 um, four offsets, bars that leak, and three
/// offsets beside the paper's set-up.
#[test]
fn the_closed_form_is_the_expected_uncertainty_of_check() {
    let engine = engine(Backend::Bvh);
    let cases: [&[&str]; 6] = [
        &[],
        &["source.spot=60um"],
        &["scan.mask_offsets=[\"-22um\",\"-7um\",\"8um\",\"21um\"]"],
        &["source.energy=60keV"],
        &["scan.mask_offsets=[\"-12um\",\"0um\",\"12um\"]"],
        &["sample_mask.projected_aperture=20um", "detector.electronic_noise=20"],
    ];
    for case in cases {
        let sets: Vec<String> = case.iter().map(|set| (*set).to_owned()).collect();
        let scene = Scene::from_toml_with(&scene("photons = 80000", ""), ".", &sets).unwrap();
        let report = Check::of(&scene).with_engine(&engine).without_estimate().run().unwrap();
        let closed = report.work.tolerances.expected_angle.unwrap();
        let Some(curve) = report.illumination else { panic!("{case:?}: no curve") };
        let fitted = curve.expected.unwrap().refraction;
        println!(
            "measured sigma of the angle, {case:?}: {closed:.3e} by thin masks, {fitted:.3e} by the fit"
        );
        assert!((closed / fitted - 1.0).abs() < 0.15, "{case:?}: {closed:e} for {fitted:e}");
    }
}

#[test]
fn check_names_needless_tolerances_and_shapes_that_cross() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let checked = |text: &str| {
        fs::write(here.join("scene.toml"), text).unwrap();
        done(here, "check scene.toml --no-estimate")
    };
    let plain = scene("photons = 80000", "");
    let text = checked(&plain);
    assert!(text.contains("4.0e-4 of open beam, angles 10 nrad"), "{text}");
    assert!(!text.contains("warning: sampling"), "{text}");
    let text = checked(&scene("photons = 80000", "tolerance = 1e-6\nangle_tolerance = \"2 nrad\""));
    assert_eq!(text.matches("times below the noise").count(), 2, "{text}");
    let bore = "[[object]]\nname = \"bore\"\nmaterial = \"air\"\nshape = { cylinder = { radius = \"0.1 mm\", \
                height = \"20 mm\" } }\n";
    let solid = plain.replace(", sides = 16", "");
    // Exact shapes that cross, or touch all along a wall, stay exact; only the overlap is listed.
    let text = checked(&[&*solid, bore].concat());
    assert!(text.contains("\"bore\" wins") && !text.contains("mesh"), "{text}");
    let beside = bore.replace("material", "position = [\"0.1 mm\", \"0 mm\", \"0 mm\"]\nmaterial");
    let text = checked(&[&*solid, &*beside].concat());
    assert!(text.contains("\"bore\" wins") && !text.contains("mesh"), "{text}");
    let tube = bore.replace(
        "cylinder = { radius = \"0.1 mm\"",
        "tube = { outer = \"0.1 mm\", inner = \"0.08 mm\"",
    );
    let far = ["name = \"filling\"\nposition = [\"0 mm\", \"3 mm\", \"0 mm\"]", "0.08 mm"];
    let apart = tube
        .replace("name = \"bore\"", "name = \"tube\"\nposition = [\"0 mm\", \"3 mm\", \"0 mm\"]");
    let filling = bore.replace("name = \"bore\"", far[0]).replace("0.1 mm", far[1]);
    let text = checked(&[&*solid, &*apart, &*filling].concat());
    assert!(!text.contains("\"filling\" wins") && !text.contains("mesh"), "{text}");
    // Facets that an exact shape crosses make a mesh of it.
    let text = checked(&[&*plain, &*beside].concat());
    assert!(
        text.contains("\"bore\" crosses \"rod\", which has facets: it becomes a mesh"),
        "{text}"
    );
}

/// The estimate says how long a run takes with the tolerances of the noise, and how much its moments take.
#[test]
fn check_estimates_a_run_without_needless_tolerances_and_its_moments() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let sampling = "tolerance = 1e-6\nangle_tolerance = \"2 nrad\"";
    fs::write(here.join("scene.toml"), scene("photons = 80000", sampling)).unwrap();
    let text = done(here, "check scene.toml");
    assert_eq!(text.matches("is faster: about ").count(), 2, "{text}");
    assert!(text.contains("uses 4e-4 and") && text.contains("uses 10 nrad and"), "{text}");
}
