//! Columns that are kept of frames, and pixels that are added: images, places of columns, refusals.

use crate::retrieve_cli::good;
use crate::support::program::{beamlet, ended, stderr};
use beamlet::retrieve::Record;
use beamlet::stack::{GeometryFile, Maps, OpenRun, StackFile};
use ndarray::{Array3, s};
use ndarray_npy::{read_npy, write_npy};
use std::path::Path;

/// A ball over pixels of this size, with masks of 150 um on the detector.
fn simulate(place: &Path, name: &str, pixels: &str, pitch: &str) {
    let scene = format!(
        "{}\n[detector]\ndistance = \"1.8 m\"\npixels = {pixels}\npitch = {pitch}\n[scan]\n\
         mask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 7 }}\n[sampling]\n\
         tolerance = 1e-4\nangle_tolerance = \"5 nrad\"\n[materials.carbon]\nformula = \"C\"\n\
         density = \"2.0 g/cm3\"\n[[object]]\nname = \"ball\"\nmaterial = \"carbon\"\n\
         shape = {{ sphere = {{ radius = \"3 mm\" }} }}\n",
        include_str!("../support/masks.toml")
            .replace("[detector_mask]", "period = \"100 um\"\n\n[detector_mask]")
    );
    let scene = scene.replace("[scan]", "[scan]\n").replace(
        "projected_aperture = \"30 um\"\n\n[detector]",
        "projected_aperture = \"30 um\"\nperiod = \"150 um\"\n\n[detector]",
    );
    std::fs::write(place.join("scene.toml"), scene).unwrap();
    good(place, &["simulate", "scene.toml", "-o", name, "--format", "npy", "-q"]);
}

#[test]
fn selected_columns_match_sliced_stacks_and_bins_match_larger_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path();
    simulate(place, "fine", "[64, 4]", "\"75 um\"");
    simulate(place, "coarse", "[32, 2]", "\"150 um\"");
    let flat: Array3<f32> = read_npy(place.join("fine/flat.npy")).unwrap();
    let sample = StackFile::open(place.join("fine/sample.npy")).unwrap().view(0).unwrap();
    for (name, stack) in [("flat.npy", &flat), ("sample.npy", &sample)] {
        write_npy(place.join(name), &stack.slice(s![.., .., 1..62;2])).unwrap();
    }
    let images = ["--format", "npy", "--overwrite", "-q"];
    let stacks = ["retrieve", "--flat", "flat.npy", "--sample", "sample.npy", "--geometry", "fine"];
    good(place, &[&stacks[..], &["-o", "sliced"], &images].concat());
    let kept = ["retrieve", "fine", "--columns", "1:62:2", "-o", "kept"];
    good(place, &[&kept[..], &images].concat());
    let added = ["retrieve", "fine", "--bin", "2,2", "-o", "added"];
    good(place, &[&added[..], &images].concat());
    good(place, &[&["retrieve", "coarse", "-o", "coarse_images"][..], &images].concat());
    let maps = |name: &str| Maps::open(place.join(name)).unwrap();
    let record = |name: &str| Record::read(&place.join(name).join("retrieved.json")).unwrap();

    let [a, b] = ["sliced", "kept"].map(|name| maps(name).map("refraction", 0).unwrap());
    assert_eq!((a.dim(), &a), ((4, 31), &b));
    let kept = record("kept");
    assert_eq!((kept.kept_columns.as_deref(), kept.bin), (Some("1:62:2"), None));
    // Slits of 30 um lie over each second border of pixels: half of one at the left of columns 1, 3, ...
    assert_eq!(kept.columns_m.len(), 31);
    let geometry = GeometryFile::read(&place.join("fine")).unwrap();
    for (at, u) in kept.columns_m.iter().enumerate() {
        assert!((u - geometry.columns_m[1 + 2 * at]).abs() < 1e-15, "{u}");
        // Thick bars narrow the slit a little.
        let expected = (1.0 + 2.0 * at as f64 - 32.0) * 75e-6 + 7.5e-6;
        assert!((u - expected).abs() < 0.2e-6, "{u} for {expected}");
    }
    assert_eq!(GeometryFile::read(&place.join("kept")).unwrap().columns_m, kept.columns_m);

    let [added, coarse] = ["added", "coarse_images"].map(|name| (maps(name), record(name)));
    assert_eq!(added.1.bin, Some([2, 2]));
    for (a, b) in added.1.columns_m.iter().zip(&coarse.1.columns_m) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
    assert_eq!((added.1.shape, coarse.1.columns_m.len()), ([1, 2, 32], 32));
    // The light of a pixel is the mean of that of its quarters, within the tolerance of both runs.
    for (name, most) in [("transmission", 1e-3), ("refraction", 3e-8)] {
        let [a, b] = [&added.0, &coarse.0].map(|maps| maps.map(name, 0).unwrap());
        let worst = (&a - &b).iter().fold(0.0_f32, |worst, d| worst.max(d.abs()));
        assert!(worst < most, "{name}: {worst}");
    }
    // Pictures of the images have their own size of a pixel, and their curves.
    good(place, &["view", "added", "-o", "pictures", "-q"]);

    for (words, code, word) in [
        (&["--columns", "64::2"][..], 1, "columns: found 64::2; allowed: columns from 0 to 64"),
        (&["--columns", "0:65"], 1, "columns from 0 to 64"),
        (&["--columns", "3"], 2, "START:END:STEP"),
        (&["--columns", "5:5"], 2, "START:END:STEP"),
        (&["--bin", "0,1"], 2, "columns,rows from 1 on"),
        (&["--bin", "1,9"], 1, "1 to 64 columns and 1 to 4 rows"),
        (&["--bin", "1,3"], 1, "a number that divides 4 rows"),
        (&["--empty-beam", "4:4"], 2, "C0:C1"),
        (&["--empty-beam", "0:9,0"], 2, "C0:C1,R0:R1"),
        (&["--empty-beam", "60:65"], 1, "columns from 0 to 64"),
        (&["--empty-beam", "0:9,0:9"], 1, "rows from 0 to 4"),
    ] {
        let words = [&["retrieve", "fine", "-o", "none"][..], words].concat();
        let output = beamlet(place).args(&words).output().unwrap();
        let message = ended(&output, code);
        assert!(message.contains(word), "{words:?}: {message}");
        assert!(!place.join("none").exists());
    }
    // Images of other pixels are not shown beside the frames of the run.
    let words = ["view", "fine", "-o", "other", "--retrieved", "kept"];
    let output = beamlet(place).args(words).output().unwrap();
    assert!(stderr(&output).contains("--columns or --bin"), "{}", stderr(&output));
    assert_eq!(OpenRun::open(place.join("fine")).unwrap().views(), 1);
}

#[test]
fn added_counts_are_sums_with_their_noise() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path();
    simulate(place, "run", "[32, 8]", "\"150 um\"");
    let flat: Array3<f32> = read_npy(place.join("run/flat.npy")).unwrap();
    let counts = flat.mapv(|y| (2e4 * y).round());
    let twice = Array3::from_shape_fn((7, 4, 32), |(step, row, column)| {
        counts[[step, 2 * row, column]] + counts[[step, 2 * row + 1, column]]
    });
    for (name, stack) in [("one", &counts), ("two", &twice)] {
        write_npy(place.join(format!("{name}_flat.npy")), stack).unwrap();
        let mut sample = stack.mapv(|y| (0.8 * y).round());
        sample[[3, 0, 0]] += 1.0;
        write_npy(place.join(format!("{name}_sample.npy")), &sample).unwrap();
    }
    let sample: Array3<f32> = read_npy(place.join("one_sample.npy")).unwrap();
    let added = Array3::from_shape_fn((7, 4, 32), |(step, row, column)| {
        sample[[step, 2 * row, column]] + sample[[step, 2 * row + 1, column]]
    });
    write_npy(place.join("two_sample.npy"), &added).unwrap();
    let common = ["--geometry", "run", "--format", "npy", "-q", "--weights", "poisson"];
    let one = ["retrieve", "--flat", "one_flat.npy", "--sample", "one_sample.npy", "-o", "one"];
    let one = [&one[..], &common, &["--bin", "1,2", "--read-noise", "3"]].concat();
    let two = ["retrieve", "--flat", "two_flat.npy", "--sample", "two_sample.npy", "-o", "two"];
    let two = [&two[..], &common, &["--read-noise", "4.242640687119285"]].concat();
    good(place, &one);
    good(place, &two);
    let [one, two] = ["one", "two"].map(|name| Maps::open(place.join(name)).unwrap());
    for name in ["transmission", "refraction", "transmission_sigma", "flags"] {
        let [a, b] = [&one, &two].map(|maps| maps.map(name, 0).unwrap());
        assert_eq!(a, b, "{name}");
    }
}
