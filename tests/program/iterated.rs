//! Iterative methods and corrections by `beamlet reconstruct`.

#![expect(clippy::cast_possible_truncation, reason = "sinograms are f32")]

use crate::support::program::{done, ended, run, workplace};
use beamlet::ndarray::Array3;
use ndarray_npy::{read_npy, write_npy};
use std::fs;

const SCENE: &str = r#"
[source]
distance = "1.2 m"
spot = ["0 um", "0 um"]
energy = "30 keV"

[detector]
distance = "1.8 m"
pixels = [48, 1]
pitch = "150 um"

[scan]
angles = { from = "0 deg", to = "360 deg", count = 64 }
"#;

/// Chords of a disc of μ = 50 /m and radius 1 mm beside an axis `shift` columns from the middle.
fn sinograms(shift: f64) -> Array3<f32> {
    Array3::from_shape_fn((64, 1, 48), |(view, _, column)| {
        let angle = std::f64::consts::TAU * view as f64 / 64.0;
        let u = (column as f64 - 23.5) * 1e-4;
        let (across, depth) = (0.5e-3 * angle.cos() + shift * 1e-4, -0.5e-3 * angle.sin());
        let off = (across - u * (1.0 + depth / 1.2)) / (u / 1.2).hypot(1.0);
        (100.0 * (1e-6 - off * off).max(0.0).sqrt()) as f32
    })
}

#[test]
fn methods_write_their_residuals_and_corrections_are_recorded() {
    let directory = workplace(SCENE);
    let path = directory.path();
    write_npy(path.join("mu.npy"), &sinograms(1.3)).unwrap();
    let usual = "reconstruct mu.npy --geometry scene.toml --quantity mu --format npy --centre auto";
    for method in ["cgls", "sirt --non-negative", "bb"] {
        let words = format!("{usual} --method {method} --iterations 6 --overwrite -o volume");
        let printed = done(path, &words);
        let (_, axis) = printed.split_once("axis     in column ").unwrap();
        let column: f64 = axis.split_whitespace().next().unwrap().parse().unwrap();
        assert!((column - 24.8).abs() < 0.05, "{column}");
        let table = fs::read_to_string(path.join("volume/residuals.csv")).unwrap();
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!((lines.len(), lines[0]), (8, "quantity,iteration,residual,taken"));
        assert_eq!(lines.iter().filter(|line| line.ends_with(",1")).count(), 1, "{table}");
        let volume: Array3<f32> = read_npy(path.join("volume/mu.npy")).unwrap();
        // At x = 0.5 mm, y = 0; six iterations of SIRT are 11 % short.
        let middle = volume[[0, 24, 28]];
        assert!((middle - 50.0).abs() < 8.0, "{method}: {middle}");
    }
    let record = fs::read_to_string(path.join("volume/volume.json")).unwrap();
    assert!(record.contains(r#""method": "bb""#) && record.contains(r#""iterations": 6"#));
    done(path, &format!("{usual} --rings --extrapolate -o filtered"));
    let record = fs::read_to_string(path.join("filtered/volume.json")).unwrap();
    assert!(record.contains(r#""rings": true"#) && record.contains(r#""extrapolate": true"#));
    assert!(!path.join("filtered/residuals.csv").exists());
}

#[test]
fn methods_that_do_not_fit_are_refused_before_any_work() {
    let directory = workplace(SCENE);
    let path = directory.path();
    write_npy(path.join("delta.npy"), &Array3::<f32>::zeros((64, 1, 48))).unwrap();
    let usual = "reconstruct delta.npy --geometry scene.toml --quantity delta -o volume";
    for (more, words) in [
        ("--method sirt", "those of derivatives are zero"),
        ("--method cgls --non-negative", "no bounds"),
        ("--extrapolate", "refraction angles"),
        ("--method bb --iterations 0", "iterations"),
        ("--centre middle", "or auto"),
    ] {
        let output = run(path, &format!("{usual} {more}"));
        let code = if more.starts_with("--centre") { 2 } else { 1 };
        let message = ended(&output, code);
        assert!(message.contains(words), "{more}: {message}");
        assert!(!path.join("volume").exists(), "{more}");
    }
}
