//! Flats and darks every few views on disk: parts and resumed runs have the bits of one run in every
//! format.

use super::crash::assert_same;
use crate::support::program::{Workplace, ended};
use crate::support::{files, sample};
use beamlet::stack::{OpenRun, StackFile};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Flats before views 0, 3 and 6 and behind view 6; darks before views 0 and 4 and behind view 6.
const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [6, 3]
photons = 1000
electronic_noise = 2
bit_depth = 14
[sampling]
tolerance = 1e-2
angle_tolerance = "1 urad"
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 3 }
angles = { from = "0 deg", to = "360 deg", count = 7 }
flats_every = 3
darks_every = 4
errors = { offset_sigma = "0.5 um", intensity_walk = 0.01, source_walk = "1 um" }

"#,
    include_str!("../support/rod.toml")
);

/// Views of the scene: 7 of the sample, 4 flats, 3 darks.
const VIEWS: usize = 14;

/// Files of a run but its log, which lists a view that is made again twice.
fn values(run: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = files::of_run(run);
    files.remove(Path::new("progress.log"));
    files
}

#[test]
fn flats_and_darks_between_views_survive_parts_damage_and_resuming() {
    let damaged = ["run/flat/view_0002/step_001.exr", "run/counts/flat.npy", "run/dark.tif"];
    let cases = ["exr", "npy", "tiff"].into_iter().zip(damaged).collect();
    for (format, damaged) in sample(cases, 3) {
        let place = Workplace::new(SCENE);
        let run = |words: &[&str]| ended(&place.beamlet(words), 0);
        let common = ["--backend", "bvh", "--format", format];
        run(&[&["simulate", "scene.toml", "-q", "-o", "whole"][..], &common].concat());
        // A part between two flats has none.
        let parts = ["4..6", "0..4", "6..7"];
        for part in parts {
            let words = ["simulate", "scene.toml", "-q", "--views", part, "-o", part];
            run(&[&words[..], &common].concat());
        }
        run(&[&["join", "-o", "run"][..], &parts].concat());
        assert_same(&place.path(""), VIEWS);
        // A lost or changed flat or dark is made again.
        let path = place.path(damaged);
        let mut bytes = fs::read(&path).unwrap();
        let last = bytes.len() - 3;
        bytes[last] ^= 0x11;
        fs::write(&path, bytes).unwrap();
        assert!(!place.beamlet(&["check", "run"]).status.success(), "{damaged}");
        run(&["simulate", "scene.toml", "-q", "-o", "run", "--resume", "--backend", "bvh"]);
        assert!(values(&place.path("run")) == values(&place.path("whole")), "{damaged}");
        run(&["check", "run"]);
        let open = OpenRun::open(place.path("run")).unwrap();
        let views = |stack: StackFile| stack.shape()[..2].to_vec();
        assert_eq!(views(open.flat().unwrap()), [4, 3], "{format}");
        assert_eq!(views(open.counts_flat().unwrap().unwrap()), [4, 3], "{format}");
        assert_eq!(views(open.dark().unwrap().unwrap()), [3, 3], "{format}");
        // Each flat and dark has noise and light of its own.
        for stack in [open.counts_flat(), open.dark()] {
            let stack = stack.unwrap().unwrap();
            let all: Vec<_> = (0..stack.shape()[0]).map(|view| stack.view(view).unwrap()).collect();
            assert!(all.windows(2).all(|pair| pair[0] != pair[1]), "{format}");
        }
        for name in ["run.json", "geometry.json"] {
            let text = fs::read_to_string(place.path("run").join(name)).unwrap();
            let json: serde_json::Value = serde_json::from_str(&text).unwrap();
            assert_eq!(json["flats_before_views"], serde_json::json!([0, 3, 6, 7]), "{name}");
            assert_eq!(json["darks_before_views"], serde_json::json!([0, 4, 7]), "{name}");
        }
        // Another number of flats overwrites all of them.
        let other = ["--set", "scan.flats_every=5", "--overwrite"];
        run(&[&["simulate", "scene.toml", "-q", "-o", "run"][..], &common, &other].concat());
        run(&["check", "run"]);
        assert_eq!(views(OpenRun::open(place.path("run")).unwrap().flat().unwrap()), [3, 3]);
        assert!(!place.path("run/flat/view_0003").exists());
    }
}
