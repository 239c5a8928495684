//! Memory of one beamlet and row with thousands of silhouettes, with the real program: within what
//! `check` tells and within a limit, or an error that says so.
#![cfg(all(feature = "cli", target_os = "linux"))]

use super::big_input::{check, is_one_process, watched};
use std::fs;
use tempfile::TempDir;

/// `STEPS` mask steps; 2,000 balls of gold in one pixel.
const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [4, 1]
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = STEPS }
[sampling]
tolerance = 1e-6
max_rays = RAYS

[[object]]
name = "powder"
material = "gold"
SHAPE
[object.instances]
packing = "spheres"
count = 2000
region = { box = { size = ["80 um", "80 um", "80 um"] } }
"#
);

const EXACT: &str = "shape = { sphere = { radius = \"2 um\" } }";
const FACETS: &str = "shape = { sphere = { radius = \"2 um\", sides = 8 } }";

fn scene(shape: &str, steps: u32, rays: u32) -> TempDir {
    let text = SCENE.replace("SHAPE", shape).replace("STEPS", &steps.to_string());
    let place = tempfile::tempdir().unwrap();
    let text = text.replace("RAYS", &rays.to_string());
    fs::write(place.path().join("scene.toml"), text).unwrap();
    place
}

const MIB: u64 = 1 << 20;

#[test]
fn a_patch_beyond_the_limit_is_an_error_and_one_within_it_has_the_same_bits() {
    let cpu = is_one_process();
    for shape in [EXACT, FACETS] {
        let place = scene(shape, 5, 100_000);
        let least = check(place.path(), &[])["peak_bytes"].as_u64().unwrap() / MIB;
        let run = |limit: u64| {
            let limit = format!("{limit} MiB");
            let words = ["--format", "npy", "--overwrite", "--memory-limit", &limit];
            let (peak, message, ended) = watched(place.path(), &words);
            (peak, message, ended.code())
        };
        // Little more than what the run takes without lines and rays.
        let tight = least + 14;
        let (peak, message, code) = run(tight);
        assert_eq!(code, Some(1), "{message}");
        for word in ["sampling beamlet", "row 0 (", "raise the memory limit or sampling.tol"] {
            assert!(message.contains(word), "{word}: {message}");
        }
        assert!(!cpu || peak <= tight * MIB, "{peak}");
        // One account has the memory of a patch, whatever its lines are made of: one shape is enough.
        if shape == FACETS {
            continue;
        }
        let bits = || fs::read(place.path().join("run/sample.npy")).unwrap();
        let (_, message, ended) = watched(place.path(), &["--format", "npy", "--overwrite"]);
        assert!(ended.success(), "{message}");
        let free = bits();
        let roomy = least + 100;
        let (peak, message, code) = run(roomy);
        assert_eq!(code, Some(0), "{message}");
        assert!(!cpu || peak <= roomy * MIB, "{peak}");
        assert!(bits() == free, "a limit changes no bit");
    }
}

#[test]
fn a_thousand_steps_take_no_memory_by_the_ray() {
    let peak = |steps| {
        let place = scene(EXACT, steps, 10_000);
        let (peak, message, ended) = watched(place.path(), &[]);
        assert!(ended.success(), "{message}");
        peak
    };
    // 10,000 rays that 400 of the steps see: 30 MiB, were each kept.
    let (few, many) = (peak(5), peak(1000));
    assert!(!is_one_process() || many < few + 20 * MIB, "{few} {many}");
}
