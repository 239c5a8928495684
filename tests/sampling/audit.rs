//! The measured error of sampling against true errors.

use super::kinds::{apart, few_rows, meshes, run, shapes};
use super::unresolved::fibres;
use crate::support::engine;
use beamlet::scene::Scene;
use beamlet::{Backend, SamplingError};

/// Tolerance of the runs that are audited.
const TOLERANCE: f64 = 1e-3;

/// Scenes of each class of patches, some with fewer lines than their light needs.
fn scenes() -> Vec<(&'static str, Scene, f64)> {
    let few_lines = |mut scene: Scene| {
        scene.sampling.max_rays = 4;
        scene
    };
    vec![
        ("meshes", meshes(), 5e-5),
        ("shapes", shapes(), 5e-5),
        ("meshes by few lines", few_lines(meshes()), 5e-5),
        ("fibres", few_rows(fibres(0.0)), 2e-4),
    ]
}

fn audited(mut scene: Scene, share: f64) -> Scene {
    scene.sampling.audit = share;
    scene
}

/// Where every patch is audited, the square of the measured error is that of the true one within 60 % (30 %
/// of the error) or two of its standard errors. The true
/// one is that to a run at a tolerance of a twentieth or a fifth.
#[test]
fn measured_errors_are_true_ones() {
    let engine = engine(Backend::Bvh);
    for (name, scene, finer) in scenes() {
        let mut fine = audited(scene.clone(), 0.0);
        fine.sampling.max_rays = 200_000;
        let (want, exact) = run(&engine, &fine, finer);
        assert_eq!(exact.sampling_error, None, "{name}");
        let (got, record) = run(&engine, &audited(scene.clone(), 1.0), TOLERANCE);
        let (same, _) = run(&engine, &audited(scene, 0.0), TOLERANCE);
        assert_eq!(got, same, "{name}: an audit changes light");
        let [_, all] = apart(&got, &want);
        let touched = record.tally.patches as f64;
        let pixels = (got.len() / got.len_of(ndarray::Axis(1))) as f64;
        let error = all * (pixels / touched).sqrt();
        let SamplingError { all, .. } = record.sampling_error.expect("a measured error");
        let told = record.sampling.expect("an estimated error").rms_error;
        println!("measured audit, {name}: {all:?} for {error:.1e}, told {told:.1e}");
        assert_eq!(all.patches, record.tally.patches, "{name}");
        let [square, want] = [all.rms, error].map(|it| it * it);
        let deviation = (all.rms + all.standard_error).powi(2) - square;
        let slack = (0.6 * want).max(2.0 * deviation);
        assert!((square - want).abs() < slack, "{name}: {all:?} for {error:e}");
        assert!(all.standard_error < 0.7 * error, "{name}: {all:?} for {error:e}");
    }
}
