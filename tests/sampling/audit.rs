//! The measured error of sampling against true errors.

use super::apertures;
use super::kinds::{apart, few_rows, meshes, run, shapes};
use super::unresolved::fibres;
use crate::support::{engine, everything};
use beamlet::scene::Scene;
use beamlet::{Backend, RunRecord, SamplingError};
use ndarray::{Array4, Axis};

/// Tolerance of the runs that are audited.
const TOLERANCE: f64 = 1e-3;

/// The scene with fewer lines than its light needs.
fn few_lines(mut scene: Scene) -> Scene {
    scene.sampling.max_rays = 4;
    scene
}

/// Scenes of each class of patches with the tolerance of their true light, and whether few lines take them as well.
fn scenes() -> Vec<(&'static str, Scene, f64, bool)> {
    vec![
        ("meshes", meshes(), 1e-4, true),
        ("shapes", shapes(), 1e-4, false),
        ("fibres", few_rows(fibres(0.0)), 2e-4, false),
    ]
}

fn audited(mut scene: Scene, share: f64) -> Scene {
    scene.sampling.audit = share;
    scene
}

/// Root mean square over patches and mask steps of the error of a run, whose values are to be `want`.
fn error_of_patches(got: &Array4<f32>, want: &Array4<f32>, record: &RunRecord) -> f64 {
    let pixels = (got.len() / got.len_of(Axis(1))) as f64;
    apart(got, want)[1] * (pixels / record.tally.patches as f64).sqrt()
}

/// Where every patch is audited, the square of the measured error is that of the true one within 60 % (30 %
/// of the error) or two of its standard errors. The true one is that to a run at a tenth or a fifth of the tolerance, whose
/// own error is a hundredth or a twenty-fifth of the square.
#[test]
fn measured_errors_are_true_ones() {
    let engine = engine(Backend::Bvh);
    for (name, scene, finer, with_few) in scenes() {
        let (want, exact) = run(&engine, &audited(scene.clone(), 0.0), finer);
        assert_eq!(exact.sampling_error, None, "{name}");
        let (same, _) = run(&engine, &audited(scene.clone(), 0.0), TOLERANCE);
        let check = |name: &str, scene: Scene| {
            let (got, record) = run(&engine, &audited(scene, 1.0), TOLERANCE);
            let error = error_of_patches(&got, &want, &record);
            let SamplingError { all, .. } = record.sampling_error.expect("a measured error");
            let told = record.sampling.expect("an estimated error").rms_error;
            println!("measured audit, {name}: {all:?} for {error:.1e}, told {told:.1e}");
            assert_eq!(all.patches, record.tally.patches, "{name}");
            let [square, want] = [all.rms, error].map(|it| it * it);
            let deviation = (all.rms + all.standard_error).powi(2) - square;
            let slack = (0.6 * want).max(2.0 * deviation);
            assert!((square - want).abs() < slack, "{name}: {all:?} for {error:e}");
            assert!(all.standard_error < 0.7 * error, "{name}: {all:?} for {error:e}");
            got
        };
        assert_eq!(check(name, scene.clone()), same, "{name}: an audit changes light");
        if with_few {
            check(&format!("{name} by few lines"), few_lines(scene));
        }
    }
}

/// Light behind strips of both masks or one, whose bars leak or not, with steps along both directions. A few places have
/// most of the error of so few pixels, so the mean square of draws counts: it is within a factor of three of the true one, or
/// two of its standard errors. The true error is that to a run at a fortieth of the tolerance. Two masks that leak; the
/// others with `BEAMLET_ALL`.
#[test]
fn measured_errors_behind_apertures_are_true_ones() {
    const DRAWS: u64 = 8;
    let engine = engine(Backend::Bvh);
    let names = ["pattern", "beam tracking", "squares off the rows", "detector mask alone"];
    let names = if everything() { &names[..] } else { &names[..1] };
    let mut scenes = apertures::scenes();
    scenes.retain(|(name, _)| names.contains(name));
    assert_eq!(scenes.len(), names.len());
    for (name, scene) in scenes {
        let (want, _) = run(&engine, &audited(scene.clone(), 0.0), 1e-4);
        let mut squares = Vec::new();
        let mut error = 0.0;
        for seed in 0..DRAWS {
            let mut scene = audited(scene.clone(), 1.0);
            scene.sampling.seed = seed;
            let (got, record) = run(&engine, &scene, 4e-3);
            error = error_of_patches(&got, &want, &record);
            squares.push(record.sampling_error.expect("a measured error").all.rms.powi(2));
        }
        let count = squares.len() as f64;
        let mean = squares.iter().sum::<f64>() / count;
        let deviations: f64 = squares.iter().map(|it| (it - mean).powi(2)).sum();
        let deviation = (deviations / (count - 1.0) / count).sqrt();
        let ratio = mean / (error * error);
        println!("measured audit, {name}: {:.1e} for {error:.1e}", mean.sqrt());
        let is_near = ratio < 3.0 && ratio > 1.0 / 3.0;
        assert!(is_near || (mean - error * error).abs() < 2.0 * deviation, "{name}: {ratio}");
        assert!(deviation < 1.5 * error * error, "{name}: {deviation:e} for {error:e}");
    }
}
