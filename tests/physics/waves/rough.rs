//! Rough surfaces by waves, against Gaussian random phases in closed form.

use super::{BY_WAVES, simulate};
use crate::support::{backends, sample};
use crate::thin_masks::REFERENCE;
use beamlet::Backend;
use beamlet::ndarray::Array4;
use beamlet::scene::{MaterialSpec, Object, Scene, Shape};
use beamlet::stack::Stacks;
use std::f64::consts::TAU;

const COLUMNS: u32 = 64;
/// Rays of a patch, 26 lines: light differs at all heights.
const MOST_RAYS: u32 = 15_000;
/// Mask offsets, evenly over the period.
const STEPS: u32 = 16;
const PERIOD: f64 = 100e-6;
const DELTA: f64 = 1e-5;
const WAVELENGTH: f64 = 1.23984e-9 / 30.0;

/// A plate without absorption across the beam, both faces rough.
fn scene(columns: u32, slope: f64, length: f64) -> Scene {
    let offset = |step| (f64::from(step) / f64::from(STEPS) - 0.5) * PERIOD;
    let offsets: Vec<f64> = (0..STEPS).map(offset).collect();
    let mut scene = REFERENCE.scene(columns, 0.0003, &offsets, BY_WAVES);
    scene.sampling.max_rays = MOST_RAYS;
    let matter = MaterialSpec::Constants { mu: 0.0, delta: DELTA };
    scene.materials.insert("matter".into(), matter);
    let shape = Shape::Box { size: [12e-3, 100e-6, 4e-3] };
    let mut plate = Object::new("plate", shape, "matter");
    plate.roughness = slope;
    plate.correlation_length = Some(length);
    scene.objects.push(plate);
    scene
}

/// Loss of contrast of a harmonic of the curve, -ln of the mean over columns, and its standard deviation.
fn losses(stacks: &Stacks, harmonic: u32) -> [f64; 2] {
    let columns = 1..COLUMNS as usize - 1;
    let transform = |light: &dyn Fn(usize) -> f32| {
        let mut sums = [0.0; 2];
        for step in 0..STEPS {
            let turn = TAU * f64::from(harmonic * step) / f64::from(STEPS);
            let value = f64::from(light(step as usize));
            sums[0] += value * turn.cos();
            sums[1] += value * turn.sin();
        }
        sums
    };
    // All columns see the same flat: contrasts are parts along it and across it.
    let of_column = |column: usize| {
        let flat = transform(&|step| stacks.flat[[step, 0, column]]);
        let sample = transform(&|step| stacks.sample[[0, step, 0, column]]);
        let square = flat[0] * flat[0] + flat[1] * flat[1];
        let along = sample[0] * flat[0] + sample[1] * flat[1];
        let across = sample[1] * flat[0] - sample[0] * flat[1];
        [along / square, across / square]
    };
    let parts: Vec<[f64; 2]> = columns.map(of_column).collect();
    let count = f64::from(COLUMNS - 2);
    let mean = [0, 1].map(|k| parts.iter().map(|part| part[k]).sum::<f64>() / count);
    let square = parts.iter().map(|part| (part[0] - mean[0]).powi(2)).sum::<f64>();
    let deviation = (square / (count - 1.0) / count).sqrt();
    [-mean[0].hypot(mean[1]).ln(), deviation / mean[0]]
}

/// The mean of exp(i (φ(x) - φ(x + Λ))) over Gaussian heights of deviation σ is exp(-k²δ²σ² (1 - ρ(Λ))), σ the
/// slope times the length over the root of two; two faces, and Λ of the harmonic in the plane of the sample.
#[test]
fn rough_plates_lose_contrast_as_random_phases_do_within_four_deviations() {
    let cases = vec![(0.3, 0.4e-6, 0.1), (0.2, 2e-6, 0.12), (0.3, 8e-6, 0.2)];
    for (slope, length, sharp) in sample(cases, 3) {
        let mut scene = scene(COLUMNS, slope, length);
        scene.sampling.max_rays *= if length > 1e-6 { 3 } else { 1 };
        let stacks = simulate(&scene, Backend::Bvh);
        for harmonic in [2, 3] {
            let [found, deviation] = losses(&stacks, harmonic);
            let frequency = f64::from(harmonic) / PERIOD;
            let shear = WAVELENGTH * frequency * 1.2 * (1.8 - 1.2003) / 1.8;
            let phase = TAU / WAVELENGTH * DELTA * slope * length / 2.0_f64.sqrt();
            let want = 2.0 * phase * phase * (1.0 - (-(shear / length).powi(2)).exp());
            let place = format!("{length:e} m: {found:e} ± {deviation:e} for {want:e}");
            assert!(deviation < sharp * want, "{place}");
            // Heights are Gaussian within 0.2 % of their variance, and errors of the light are 1e-4.
            assert!((found - want).abs() < 4.0 * deviation + 0.005 * want + 3e-4, "{place}");
            // Rays have the slopes of both faces at any length.
            let by_rays = (TAU / WAVELENGTH * DELTA * slope * shear).powi(2);
            let ratio = want / by_rays;
            assert!(if length > 5e-6 { ratio > 0.99 } else { ratio < 0.99 }, "{place}: {ratio}");
        }
    }
}

#[test]
fn heights_of_rough_surfaces_are_the_same_on_both_backends_and_differ_by_seed() {
    let scene = scene(4, 0.1, 5e-6);
    let light = |scene: &Scene, backend| simulate(scene, backend).sample;
    let own = light(&scene, Backend::Bvh);
    let most =
        |other: &Array4<f32>| own.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let mut other = scene.clone();
    other.sampling.seed += 1;
    let by_seed = most(&light(&other, Backend::Bvh));
    assert!(by_seed > 1e-4, "{by_seed:e}");
    // The other backend; without one, the same again.
    let backend = backends().pop().expect("a backend");
    let apart = most(&light(&scene, backend));
    assert!(apart < 1e-6, "{backend:?}: {apart:e}");
}
