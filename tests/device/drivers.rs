//! Other drivers than the one of the tests.
//!
//! A driver without ray query: the software BVH is a first-class path, not a fallback. And
//! `SwiftShader`, which shares no code with Mesa and runs subgroups of 4: what kernels rely on
//! beyond the specification would show.
//!
//! `BEAMLET_NO_RAY_QUERY_ICD` and `BEAMLET_SECOND_DRIVER_ICD` name the descriptions (JSON) of such
//! drivers; `.ci/test` finds them. With `BEAMLET_COMPLETE` both have to be there.
#![cfg(feature = "cli")]

use crate::support::{complete, program};
use ndarray::ArrayD;
use ndarray_npy::read_npy;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A tube with a slab that faces the beam at grazing incidence: both the moments of one walk and
/// the ordered walk of flagged rays take part.
const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [16, 2]
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

const NO_RAY_QUERY: &str = "BEAMLET_NO_RAY_QUERY_ICD";
pub(crate) const SECOND_DRIVER: &str = "BEAMLET_SECOND_DRIVER_ICD";

/// A driver's description; `None` where there is none and none has to be.
#[expect(clippy::print_stderr, reason = "a test that skips itself has to say so")]
pub(crate) fn icd(variable: &str) -> Option<PathBuf> {
    let icd = std::env::var_os(variable).map(PathBuf::from);
    assert!(icd.is_some() || !complete(), "{variable} is not set, and BEAMLET_COMPLETE is");
    if icd.is_none() {
        eprintln!("skipped: {variable} is not set");
    }
    icd
}

/// Runs beamlet with the driver given, or the machine's own.
fn beamlet(driver: Option<&Path>, arguments: &[&OsStr]) -> Output {
    let mut command = Command::new(program::path());
    command.args(arguments);
    if let Some(driver) = driver {
        command.env_remove("BEAMLET_DEVICE");
        command.env("VK_DRIVER_FILES", driver).env("VK_ICD_FILENAMES", driver);
    }
    command.output().expect("beamlet starts")
}

/// Simulates the scene into `folder/run`.
fn simulate(folder: &Path, run: &str, driver: Option<&Path>, backend: &str) -> Output {
    simulate_scene(folder, run, driver, SCENE, &["--backend", backend])
}

fn simulate_scene(
    folder: &Path,
    run: &str,
    driver: Option<&Path>,
    scene: &str,
    options: &[&str],
) -> Output {
    let path = folder.join(format!("{run}.toml"));
    std::fs::write(&path, scene).expect("a scene is written");
    let out = folder.join(run);
    let mut arguments: Vec<&OsStr> = vec!["simulate".as_ref(), path.as_ref(), "-o".as_ref()];
    arguments.extend([out.as_ref(), "--format".as_ref(), OsStr::new("npy")]);
    arguments.extend(options.iter().map(OsStr::new));
    beamlet(driver, &arguments)
}

pub(crate) fn succeeded(output: &Output) {
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
    let Some(icd) = icd(NO_RAY_QUERY) else { return };
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
    let Some(icd) = icd(NO_RAY_QUERY) else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = simulate(folder.path(), "run", Some(&icd), "ray-query");
    let message = String::from_utf8_lossy(&output.stderr).to_lowercase();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("ray query") || message.contains("ray_query"), "{message}");
}

/// Asserts that the second driver gives the stacks of the first, after kernels of these names.
fn assert_same_by_second_driver(scene: &str, options: &[&str], kernels: &[&str]) {
    let Some(icd) = icd(SECOND_DRIVER) else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let options = [options, &["-v"]].concat();
    let output = simulate_scene(folder, "second", Some(&icd), scene, &options);
    succeeded(&output);
    // A driver that ends the process on a kernel leaves its name behind.
    let messages = String::from_utf8_lossy(&output.stderr);
    for kernel in kernels {
        assert!(messages.contains(&format!("making the kernel {kernel}")), "{messages}");
    }
    succeeded(&simulate_scene(folder, "first", None, scene, &options));
    for file in ["flat.npy", "sample.npy"] {
        let worst = difference(&stack(folder, "second", file), &stack(folder, "first", file));
        assert!(worst <= 1e-6, "{file} differs by {worst}: {options:?}");
    }
}

#[test]
fn second_driver_gives_the_same_stacks() {
    let kernels = ["trace_bvh", "exact_bvh", "illuminate"];
    assert_same_by_second_driver(SCENE, &["--backend", "bvh"], &kernels);
    let exact = ["--set", "sampling.transport=exact", "--set", "detector.pixels=[6, 1]"];
    assert_same_by_second_driver(SCENE, &exact, &[]);
}

#[test]
fn second_driver_gives_the_same_stacks_by_waves() {
    let few = [
        "--set",
        "sampling.transport=wave",
        "--set",
        "detector.pixels=[6, 1]",
        "--set",
        "sampling.tolerance=1e-2",
    ];
    assert_same_by_second_driver(SCENE, &few, &[]);
}

#[test]
fn second_driver_gives_the_same_stacks_under_a_spectrum() {
    let filters = r#"filters = [{ material = "aluminium", thickness = "1 mm" }]"#;
    let tube = format!("spectrum = {{ anode = \"tungsten\", kvp = \"60 kV\", {filters} }}");
    let scene = SCENE
        .replace("energy = \"30 keV\"", &tube)
        .replace(
            "mu = \"0.25 /cm\"\ndelta = 2.4e-7",
            "formula = \"C2H4\"\ndensity = \"0.93 g/cm3\"",
        )
        .replace("mu = \"0.51 /cm\"\ndelta = 4.6e-7", "formula = \"C\"\ndensity = \"2 g/cm3\"");
    assert_same_by_second_driver(&scene, &[], &[]);
}

/// Masks and a detector of few pixels; a test adds objects.
pub(crate) const FEW_PIXELS: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [6, 1]
[scan]
mask_offsets = { from = "-20 um", to = "20 um", count = 3 }
"#
);

/// Kernels of placed shapes are not the kernels of meshes; smooth normals and rough surfaces are
/// parts of each.
#[test]
fn second_driver_gives_the_same_stacks_of_placed_exact_rough_and_smooth_shapes() {
    let placed = r#"
[[object]]
name = "fibres"
shape = { cylinder = { radius = "20 um", height = "1 mm" } }
instances = { packing = "parallel-fibres", region = { cylinder = { radius = "70 um", height = "1 mm" } }, count = 3 }
position = ["-0.2 mm", "0 mm", "0 mm"]
material = "nylon 6"

[[object]]
name = "tube"
shape = { tube = { outer = "60 um", inner = "40 um", height = "0.2 mm" } }
rotate = [{ axis = [1, 0, 0], angle = "60 deg" }]
position = ["0 mm", "0.3 mm", "0 mm"]
material = "nylon 6"

[[object]]
name = "smooth"
shape = { cylinder = { radius = "80 um", height = "1 mm", sides = 24 } }
normals = "smooth"
material = "water"

[[object]]
name = "rough"
shape = { cylinder = { radius = "80 um", height = "1 mm" } }
roughness = 0.001
position = ["0.2 mm", "0 mm", "0 mm"]
material = "water"
"#;
    // Both drivers trace the same rays, however few of them.
    let few = ["sampling.tolerance=1e-2", "sampling.angle_tolerance=1urad"];
    let options = ["--backend", "bvh", "--set", few[0], "--set", few[1]];
    let kernels = ["trace_bvh_placed", "exact_bvh_placed"];
    assert_same_by_second_driver(&[FEW_PIXELS, placed].concat(), &options, &kernels);
}

/// Draws go through the logarithm, sine and cosine of the driver, which may err: a few
/// rays land on the other side of an edge of a mask. No pixel may change by more than one of them.
#[test]
fn second_driver_draws_the_same_random_rays_but_for_rounding() {
    let Some(icd) = icd(SECOND_DRIVER) else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    // So many values that one ray on the other side leaves the mean below its limit.
    let size = ["--set", "detector.pixels=[24, 3]"];
    let random = ["--set", "sampling={scheme=\"random\", rays=[8, 8]}", size[0], size[1]];
    succeeded(&simulate_scene(folder, "second", Some(&icd), SCENE, &random));
    succeeded(&simulate_scene(folder, "first", None, SCENE, &random));
    for file in ["flat.npy", "sample.npy"] {
        let (second, first) = (stack(folder, "second", file), stack(folder, "first", file));
        let worst = difference(&second, &first);
        assert!(worst <= 1.0 / 64.0, "{file} differs by {worst}");
        let mean = (&second - &first).mapv(f32::abs).mean().expect("a stack has values");
        assert!(mean <= 1e-4, "{file} differs by {mean} on average");
    }
}

#[test]
fn second_driver_fits_the_same_curves() {
    let Some(icd) = icd(SECOND_DRIVER) else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let scan = ["--set", "scan.mask_offsets.count=11"];
    succeeded(&simulate_scene(folder, "run", None, SCENE, &scan));
    let run = folder.join("run");
    for (out, driver) in [("second", Some(icd.as_path())), ("first", None)] {
        let out = folder.join(out);
        let arguments = ["retrieve".as_ref(), run.as_os_str(), "--format".as_ref(), "npy".as_ref()];
        succeeded(&beamlet(driver, &[&arguments[..], &["-o".as_ref(), out.as_ref()]].concat()));
    }
    for (image, limit) in [("transmission.npy", 1e-6), ("refraction.npy", 1e-12)] {
        let worst = difference(&stack(folder, "second", image), &stack(folder, "first", image));
        assert!(worst <= limit, "{image} differs by {worst}");
    }
}

/// Sinograms of two Gaussian rods in a fan and in a cone: attenuation and refraction.
pub(crate) fn sinograms(folder: &Path, rows: usize) {
    let shape = (60, rows, 40);
    for (name, is_angle) in [("mu.npy", false), ("delta.npy", true)] {
        let values = ndarray::Array3::from_shape_fn(shape, |(view, _, column)| {
            let angle = std::f64::consts::TAU * view as f64 / 60.0;
            let u = (column as f64 - 19.5) * 1e-4;
            let rod = |x: f64, y: f64, width: f64| {
                let off = (u - x * angle.cos() - y * angle.sin()) / width;
                let value = (-off * off / 2.0).exp();
                if is_angle { off / width * 1e-9 * value } else { value }
            };
            single(rod(6e-4, 2e-4, 3e-4) + 0.5 * rod(-5e-4, -4e-4, 2e-4))
        });
        ndarray_npy::write_npy(folder.join(name), &values).expect("sinograms are written");
    }
}

const fn single(value: f64) -> f32 {
    value as f32
}

/// Back-projection, and the projector with its transpose, which every iteration is made of.
#[test]
fn second_driver_reconstructs_the_same_volumes() {
    let Some(icd) = icd(SECOND_DRIVER) else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let scene = "[source]\ndistance = \"1.2 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n\
                 [detector]\ndistance = \"1.8 m\"\npitch = \"150 um\"\n\
                 [scan]\nangles = { from = \"0 deg\", to = \"360 deg\", count = 60 }\n";
    // A fan and a cone, each kernel with either quantity.
    let filtered = |quantity| (quantity, "fbp", None, ["back_project", "back_project"]);
    let iterated = |quantity| (quantity, "cgls", Some("1"), ["project", "project_back"]);
    for (rows, cases) in
        [(1, [filtered("mu"), iterated("delta")]), (6, [filtered("delta"), iterated("mu")])]
    {
        let text = scene.replace("[detector]", &format!("[detector]\npixels = [40, {rows}]"));
        std::fs::write(folder.join("fan.toml"), text).expect("a scene is written");
        sinograms(folder, rows);
        for (quantity, method, iterations, kernels) in cases {
            let volume = |name: &str, driver: Option<&Path>| {
                let out = folder.join(format!("{name}_{quantity}_{method}_{rows}"));
                let (given, scene) =
                    (folder.join(format!("{quantity}.npy")), folder.join("fan.toml"));
                let mut arguments: Vec<&OsStr> = vec!["reconstruct".as_ref(), given.as_ref()];
                arguments.extend(["--geometry".as_ref(), scene.as_os_str(), "-o".as_ref()]);
                arguments.extend([out.as_os_str(), "-v".as_ref(), "--format".as_ref()]);
                arguments
                    .extend(["npy", "--quantity", quantity, "--method", method].map(OsStr::new));
                if let Some(count) = iterations {
                    arguments.extend(["--iterations", count].map(OsStr::new));
                }
                let output = beamlet(driver, &arguments);
                succeeded(&output);
                // A driver that ends the process on a kernel leaves its name behind.
                let messages = String::from_utf8_lossy(&output.stderr);
                for kernel in kernels {
                    assert!(
                        messages.contains(&format!("making the kernel {kernel}")),
                        "{messages}"
                    );
                }
                stack(&out, ".", &format!("{quantity}.npy"))
            };
            let (second, first) = (volume("second", Some(&icd)), volume("first", None));
            let largest = first.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
            let worst = difference(&second, &first) / largest;
            println!("measured {quantity} by {method}, {rows} rows: {worst:.1e} of the largest");
            assert!(largest > 0.0 && worst <= 1e-6, "{quantity} by {method}, {rows} rows: {worst}");
        }
    }
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
