//! A driver without ray query: the software BVH is a first-class path, not a fallback.
//!
//! `BEAMLET_NO_RAY_QUERY_ICD` names the description (JSON) of such a driver; `.ci/test` unpacks
//! one beside the installed driver. With `CI=true` the variable has to be there.
#![cfg(feature = "cli")]

use ndarray::ArrayD;
use ndarray_npy::read_npy;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A tube with a slab that faces the beam at grazing incidence: both the moments of one walk and
/// the ordered walk of flagged rays take part.
const SCENE: &str = concat!(
    include_str!("support/masks.toml"),
    r#"
[detector]
distance = "1.8 m"
pixels = [24, 3]
pitch = "150 um"

[scan]
mask_offsets = { from = "-20 um", to = "20 um", count = 3 }
angles = ["0 deg", "37 deg"]

[materials.plastic]
mu = "0.25 /cm"
delta = 2.4e-7
[materials.dense]
mu = "0.51 /cm"
delta = 4.6e-7

[[object]]
name = "rod"
shape = { cylinder = { radius = "0.7 mm", height = "2 mm", sides = 64 } }
material = "plastic"

[[object]]
name = "slab"
shape = { box = { size = ["0.3 mm", "0.5 mm", "1.4 mm"] } }  # grazing: refracted in order
material = "dense"
rotate = [{ axis = [0, 0, 1], angle = "0.1 deg" }]
"#
);

/// The driver's description; `None` where there is none and none has to be.
#[expect(clippy::print_stderr, reason = "a test that skips itself has to say so")]
fn icd() -> Option<PathBuf> {
    let icd = std::env::var_os("BEAMLET_NO_RAY_QUERY_ICD").map(PathBuf::from);
    let ci = std::env::var("CI").is_ok_and(|value| value == "true");
    assert!(
        icd.is_some() || !ci,
        "BEAMLET_NO_RAY_QUERY_ICD is not set, and CI=true forbids to skip"
    );
    if icd.is_none() {
        eprintln!("skipped: BEAMLET_NO_RAY_QUERY_ICD is not set");
    }
    icd
}

/// Simulates the scene into `folder/run`, with the driver given or the machine's own.
fn simulate(folder: &Path, run: &str, driver: Option<&Path>, backend: &str) -> Output {
    let scene = folder.join("scene.toml");
    std::fs::write(&scene, SCENE).expect("a scene is written");
    let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
    command.arg("simulate").arg(scene).arg("-o").arg(folder.join(run));
    command.args(["--format", "npy", "--backend", backend]);
    if let Some(driver) = driver {
        command.env_remove("BEAMLET_DEVICE");
        command.env("VK_DRIVER_FILES", driver).env("VK_ICD_FILENAMES", driver);
    }
    command.output().expect("beamlet starts")
}

fn succeeded(output: &Output) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "beamlet failed:\n{message}");
}

fn stack(folder: &Path, run: &str, file: &str) -> ArrayD<f32> {
    read_npy(folder.join(run).join(file)).expect("a stack is read")
}

/// Largest difference between two stacks; infinite where shapes differ or a value is not finite.
fn difference(a: &ArrayD<f32>, b: &ArrayD<f32>) -> f32 {
    if a.shape() != b.shape() {
        return f32::INFINITY;
    }
    a.iter().zip(b).fold(0.0, |worst, (a, b)| {
        let d = (a - b).abs();
        if d.is_finite() { worst.max(d) } else { f32::INFINITY }
    })
}

#[test]
fn driver_without_ray_query_gives_the_same_stacks() {
    let Some(icd) = icd() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    succeeded(&simulate(folder, "without", Some(&icd), "auto"));
    let record = std::fs::read_to_string(folder.join("without/run.json")).expect("run.json");
    let record: serde_json::Value = serde_json::from_str(&record).expect("run.json is JSON");
    assert_eq!(record["backend"], "bvh", "without ray query the choice is the software BVH");

    for backend in ["bvh", "ray-query"] {
        succeeded(&simulate(folder, backend, None, backend));
        for file in ["flat.npy", "sample.npy"] {
            let (ours, theirs) = (stack(folder, "without", file), stack(folder, backend, file));
            let worst = difference(&ours, &theirs);
            assert!(worst <= 1e-6, "{file} differs by {worst} from {backend} of the other driver");
        }
    }
    let (flat, sample) =
        (stack(folder, "without", "flat.npy"), stack(folder, "without", "sample.npy"));
    let first = sample.index_axis(ndarray::Axis(0), 0).to_owned();
    assert!(difference(&flat, &first) > 1e-3, "the sample shows in no pixel");
}

#[test]
fn ray_query_asked_of_a_driver_without_it_fails_and_says_so() {
    let Some(icd) = icd() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = simulate(folder.path(), "run", Some(&icd), "ray-query");
    let message = String::from_utf8_lossy(&output.stderr).to_lowercase();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("ray query") || message.contains("ray_query"), "{message}");
}

#[test]
fn a_changed_pixel_is_a_difference() {
    let stack = ArrayD::<f32>::from_elem(vec![2, 3, 4], 0.2);
    let mut changed = stack.clone();
    changed[[1, 2, 3]] += 1e-5;
    assert!(difference(&stack, &stack) <= 0.0);
    assert!(difference(&stack, &changed) > 1e-6);
    changed[[1, 2, 3]] = f32::NAN;
    assert!(difference(&stack, &changed).is_infinite());
    assert!(difference(&stack, &ArrayD::zeros(vec![2, 3])).is_infinite());
}
