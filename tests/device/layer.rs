//! Every kernel of the engine at work under the Khronos validation layer. The other programs of the tests run
//! without the layer, which doubles the time of small scenes.
#![cfg(feature = "cli")]

use super::drivers::{FEW_PIXELS, SECOND_DRIVER, icd, sinograms, succeeded};
use super::gpu::open;
use crate::support::{backends, program};
use beamlet::Backend;
use beamlet::internals::gpu::shaders;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// Kernels of devices whose subgroups cannot hand rays on, as the second driver is.
const WITHOUT_BUNDLES: [&str; 2] = ["trace_bvh", "trace_bvh_many"];

/// A box and a thin slab that faces the beam at grazing incidence, which exact transport follows.
const MESHES: &str = r#"
[[object]]
name = "rod"
shape = { box = { size = ["0.2 mm", "0.2 mm", "1 mm"] } }
material = "water"

[[object]]
name = "slab"
shape = { box = { size = ["0.05 mm", "0.5 mm", "1 mm"] } }
position = ["0.2 mm", "0 mm", "0 mm"]
rotate = [{ axis = [0, 0, 1], angle = "0.1 deg" }]
material = "nylon 6"
"#;

const FIBRE: &str = r#"
[[object]]
name = "fibre"
shape = { cylinder = { radius = "60 um", height = "1 mm" } }
material = "water"
"#;

const ROUGH: &str = r#"
[[object]]
name = "rough"
shape = { cylinder = { radius = "80 um", height = "1 mm" } }
roughness = 0.01
material = "nylon 6"
"#;

/// Small parts of other materials beside an object: sums of more than four materials are not in registers.
fn many(objects: &str) -> String {
    let parts =
        ["aluminium", "PMMA", "graphite", "silicon"].iter().enumerate().map(|(k, material)| {
            format!(
                "[[object]]\nname = \"{material}\"\nmaterial = \"{material}\"\n\
             shape = {{ box = {{ size = [\"20 um\", \"20 um\", \"0.1 mm\"] }} }}\n\
             position = [\"{} mm\", \"1 mm\", \"0 mm\"]\n",
                -0.2 + 0.1 * k as f64
            )
        });
    parts.fold(objects.to_owned(), |all, part| all + &part)
}

/// Runs of the program under the layer, and the kernels that they made.
struct Layer<'a> {
    folder: &'a Path,
    validation: bool,
    made: BTreeSet<String>,
}

impl Layer<'_> {
    fn run(&mut self, driver: Option<&Path>, arguments: &[&str]) {
        let mut command = Command::new(program::path());
        command.current_dir(self.folder).args(arguments).arg("-v").env_remove("RUST_LOG");
        if self.validation {
            command.env("BEAMLET_VALIDATION", "1");
        }
        if let Some(driver) = driver {
            command.env_remove("BEAMLET_DEVICE");
            command.env("VK_DRIVER_FILES", driver).env("VK_ICD_FILENAMES", driver);
        }
        let output = command.output().expect("beamlet starts");
        succeeded(&output);
        let messages = String::from_utf8_lossy(&output.stderr);
        let kernels = messages.lines().filter_map(|line| line.split_once("making the kernel "));
        self.made.extend(kernels.map(|(_, name)| name.trim().to_owned()));
    }

    /// Simulates objects; `more`: values of `--set` and other arguments. Kernels are the same for few rays.
    fn simulate(&mut self, driver: Option<&Path>, objects: &str, more: &[&str]) {
        let scene = [FEW_PIXELS, objects].concat();
        std::fs::write(self.folder.join("scene.toml"), scene).expect("a scene is written");
        let fixed = "simulate scene.toml -o run --overwrite --format npy \
                     --set sampling.tolerance=1e-2 --set sampling.angle_tolerance=1urad";
        let words: Vec<&str> = fixed.split(' ').chain(more.iter().copied()).collect();
        self.run(driver, &words);
    }
}

/// Sinograms of rods, `rows` high, by these methods; `scan`: more keys of `[scan]`.
fn reconstruct(layer: &mut Layer<'_>, rows: usize, scan: &str, methods: &[&str]) {
    sinograms(layer.folder, rows);
    let scene = format!(
        "[source]\ndistance = \"1.2 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [40, {rows}]\npitch = \"150 um\"\n\
         [scan]\nangles = {{ from = \"0 deg\", to = \"360 deg\", count = 60 }}\n{scan}"
    );
    std::fs::write(layer.folder.join("fan.toml"), scene).expect("a scene is written");
    let motions =
        (0..60).fold("x_mm,y_mm,z_mm\n".to_owned(), |all, view| all + &format!("0,0,0.00{view}\n"));
    std::fs::write(layer.folder.join("motions.csv"), motions).expect("motions are written");
    for method in methods {
        let (quantity, _) = method.split_once(' ').expect("words");
        let line = format!(
            "reconstruct {quantity}.npy --geometry fan.toml -o volume --overwrite --quantity {method}"
        );
        layer.run(None, &line.split(' ').collect::<Vec<_>>());
    }
}

#[test]
fn every_kernel_works_without_a_message_of_the_validation_layer() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let validation = open(false).validation();
    let mut layer = Layer { folder: folder.path(), validation, made: BTreeSet::new() };
    let ray_query = backends().contains(&Backend::RayQuery);
    for backend in if ray_query { &["bvh", "ray-query"][..] } else { &["bvh"] } {
        let backend = ["--backend", backend];
        for objects in [MESHES, &[FIBRE, ROUGH].concat()] {
            layer.simulate(None, objects, &backend);
            layer.simulate(None, &many(objects), &backend);
        }
    }
    // Light of each cell reaches rows beyond the next ones.
    layer.simulate(None, MESHES, &["--set", "source.spot=[\"30 um\", \"260 um\"]"]);
    layer.simulate(None, FIBRE, &["--set", "sampling.transport=wave"]);
    let lengths = ROUGH.replace("roughness", "correlation_length = \"5 um\"\nroughness");
    layer.simulate(None, &lengths, &["--set", "sampling.transport=wave"]);
    let spectrum = "source={ distance = \"1.21 m\", spot = \"30 um\", \
                    spectrum = { anode = \"tungsten\", kvp = \"60 kV\", nodes = 3 } }";
    let spectrum = ["--set", spectrum, "--set", "sampling.transport=exact"];
    layer.simulate(None, MESHES, &spectrum);
    let random = "sampling={scheme=\"random\", rays=[8, 8]}";
    layer.simulate(None, MESHES, &["--set", random]);
    // Rays look for meshes.
    layer.run(None, &["view", "scene.toml", "-o", "pictures"]);
    let heights = ["--set", "sample_mask.shape=rectangle", "--set", "detector_mask.shape=round"];
    layer.simulate(None, FIBRE, &heights);
    layer.simulate(None, FIBRE, &[&heights[..], &["--set", random]].concat());
    let walls = ["--set", "sample_mask.taper=1 deg"];
    layer.simulate(None, FIBRE, &walls);
    layer.simulate(None, FIBRE, &[&walls[..], &["--set", random]].concat());

    let counts = ["--set", "scan.mask_offsets.count=5", "--set", "detector.photons=1000"];
    layer.simulate(None, FIBRE, &counts);
    layer.run(None, &["retrieve", "run", "--counts", "--method", "gaussian"]);
    // Filtered back-projection takes views on a circle.
    let delta = "delta --method cgls --iterations 1";
    reconstruct(&mut layer, 1, "", &["mu --method cgls --iterations 1"]);
    reconstruct(&mut layer, 6, "", &[delta, "mu --method fbp"]);
    reconstruct(&mut layer, 6, "motions = \"motions.csv\"\n", &[delta]);

    let second = icd(SECOND_DRIVER);
    for objects in [MESHES, &many(MESHES)] {
        if let Some(driver) = &second {
            layer.simulate(Some(driver), objects, &["--backend", "bvh"]);
        }
    }
    let left_out = |name: &str| {
        (!ray_query && name.contains("ray_query"))
            || (second.is_none() && WITHOUT_BUNDLES.contains(&name))
    };
    let names = shaders::ALL.iter().map(|(name, _)| *name);
    let missing: Vec<&str> =
        names.filter(|it| !left_out(it) && !layer.made.contains(*it)).collect();
    assert!(missing.is_empty(), "no run made these kernels: {missing:?}");
}
