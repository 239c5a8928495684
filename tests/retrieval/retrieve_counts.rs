//! `beamlet retrieve` of detector numbers: uncertainties, clipped numbers, and refused noise.

use super::retrieve_cli::{SCENE, good};
use beamlet::retrieve::{Record, flags};
use beamlet::stack::Maps;
use ndarray::{Array3, Array4};
use ndarray_npy::read_npy;
use std::path::Path;

/// A run of the cylinder whose detector makes numbers, `[step][row][column]` of 128 columns.
fn noisy(folder: &Path, name: &str, rows: usize, sets: &[&str]) {
    let mut words = vec!["simulate", &*SCENE, "-o", name, "--format", "npy", "-q"];
    let pixels = format!("detector.pixels=[128, {rows}]");
    let common = [&*pixels, "detector.photons=20000", "detector.offset=100"];
    for set in common.iter().chain(sets) {
        words.extend(["--set", set]);
    }
    good(folder, &words);
}

#[test]
fn images_of_counts_scatter_by_their_uncertainties() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sets = ["detector.electronic_noise=12", "detector.gain=0.8", "detector.bit_depth=16"];
    noisy(folder, "run", 48, &sets);
    good(folder, &["retrieve", "run", "--format", "npy", "-o", "light"]);
    let counts = ["retrieve", "run", "--counts", "--weights", "poisson", "--format", "npy"];
    good(folder, &[&counts[..], &["-o", "counts"]].concat());
    let record = Record::read(&folder.join("counts/retrieved.json")).unwrap();
    // From the scene's detector.
    assert_eq!((record.gain, record.read_noise), (Some(0.8), 12.0));
    let [light, counts] = ["light", "counts"].map(|name| Maps::open(folder.join(name)).unwrap());
    // Misfits, and these within a pixel of the silhouettes but for a pixel in a thousand.
    let place = |column: usize| ((column as f64 + 0.5 - 64.0) * 150e-6 * 1.21 / 1.8).abs();
    let mut elsewhere = 0;
    for ((_, column), flags) in counts.map("flags", 0).unwrap().indexed_iter() {
        assert!([0, flags::MISFIT].contains(&(*flags as u32)), "{flags}");
        elsewhere += u32::from(*flags > 0.0 && (place(column) - 4e-3).abs() > 0.15e-3);
    }
    assert!(elsewhere <= 6, "{elsewhere} of 6,144");
    for name in ["transmission", "refraction", "dark_field"] {
        let [a, b, sigma] = [
            counts.map(name, 0).unwrap(),
            light.map(name, 0).unwrap(),
            counts.map(&format!("{name}_sigma"), 0).unwrap(),
        ];
        let mut z = Vec::new();
        for row in 0..48 {
            for column in 0..128_u32 {
                // Silhouettes are no Gaussians: weights there choose another answer.
                let x = (f64::from(column) + 0.5 - 64.0) * 150e-6 * 1.21 / 1.8;
                if (x.abs() - 4e-3).abs() > 0.4e-3 {
                    let at = [row, column as usize];
                    z.push(f64::from(a[at] - b[at]) / f64::from(sigma[at]));
                }
            }
        }
        let count = z.len() as f64;
        let mean = z.iter().sum::<f64>() / count;
        let variance = z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / count;
        println!("{name}: z of mean {mean:.3} and variance {variance:.3} over {count} pixels");
        // Estimates: mean 0.014, variance 0.02, five of each at most; with weights another part
        // of what the curve has beside a Gaussian is left, which moves means by up to 0.05, and
        // sigma is to first order. Without the electronic noise the variance would be 1.4.
        assert!(mean.abs() < 0.12, "{name}: {mean}");
        assert!((variance - 1.0).abs() < 0.15, "{name}: {variance}");
    }
}

#[test]
fn clipped_numbers_are_flagged_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Curves peak at 100 + 0.5 * 0.166 * 20000 = 1760; ten bits end at 1023.
    noisy(folder, "run", 4, &["detector.gain=0.5", "detector.bit_depth=10"]);
    good(folder, &["retrieve", "run", "--counts", "--format", "npy", "-q"]);
    let flat: Array3<f32> = read_npy(folder.join("run/counts/flat.npy")).unwrap();
    let sample: Array4<f32> = read_npy(folder.join("run/counts/sample.npy")).unwrap();
    let flags = Maps::open(folder.join("run/retrieved")).unwrap().map("flags", 0).unwrap();
    let mut clipped = 0;
    for ((row, column), flags) in flags.indexed_iter() {
        let at_the_end = |counts: &dyn Fn(usize) -> f32| (0..11).any(|s| counts(s) >= 1023.0);
        let [of_flat, of_sample] = [
            at_the_end(&|step| flat[[step, row, column]]),
            at_the_end(&|step| sample[[0, step, row, column]]),
        ];
        let bits = *flags as u32;
        assert_eq!([bits & 4 != 0, bits & 4096 != 0], [of_flat, of_sample], "{row}, {column}");
        clipped += u32::from(of_flat) + u32::from(of_sample);
    }
    assert!(clipped > 512, "{clipped}");
    // 16 bits end above all.
    noisy(folder, "deep", 4, &["detector.gain=0.5", "detector.bit_depth=16"]);
    good(folder, &["retrieve", "deep", "--counts", "--format", "npy", "-q"]);
    let flags = Maps::open(folder.join("deep/retrieved")).unwrap().map("flags", 0).unwrap();
    assert!(flags.iter().all(|flags| *flags as u32 & (4 | 4096) == 0));
}
