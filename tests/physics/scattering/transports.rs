//! Media by waves, by random rays and under spectra.

use super::{SET_UP, add, disc, empty, middle, plate};
use crate::reference::scattering::{Axis, Medium};
use crate::support::{Worst, engine};
use beamlet::Backend;
use beamlet::material::constants_at;
use beamlet::scene::{Beam, MaterialSpec, RandomRays, Scattering, Scene, Scheme, Transport};
use beamlet::spectrum;
use std::f64::consts::TAU;
use std::fs;

/// Loses the contrast exp(-(2πf)² V/2) at the frequency f of mask offsets, by rays and by waves alike.
#[test]
fn harmonics_of_the_curve_lose_contrast_by_waves_as_by_rays() {
    const STEPS: usize = 40;
    const PERIOD: f64 = 100e-6;
    let powder = plate([-1e-3, 1e-3], 20.0, 1e-7);
    let axis = Axis { direction: [0.6, 0.64, 0.48], excess: -8e-8 };
    let fibres = Medium { axis: Some(axis), ..powder.clone() };
    let scale = SET_UP.analyser / SET_UP.sample_mask;
    let mut worst = Worst::new("loss of contrast of a harmonic, relative", 3e-3);
    for (medium, transport) in [
        (&powder, Transport::Wave),
        (&powder, Transport::Auto),
        (&fibres, Transport::Wave),
        (&fibres, Transport::Auto),
    ] {
        let passed = SET_UP.passed(std::slice::from_ref(medium), 0.0);
        let mut scene = empty(9, "[\"0 um\"]");
        scene.scan.mask_offsets =
            (0..STEPS).map(|step| (step as f64 / STEPS as f64 - 0.5) * PERIOD).collect();
        scene.sampling.tolerance = Some(1e-4);
        scene.sampling.transport = transport;
        add(&mut scene, medium, None);
        if medium.axis.is_some() {
            let along = medium.scattering + axis.excess;
            let scattering = Scattering::new(medium.scattering).with_axis(axis.direction, along);
            scene.scattering.insert("medium 0".into(), scattering);
        }
        let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
        let amplitude = |harmonic: f64, light: &dyn Fn(usize) -> f32| {
            let turn = |step: usize| TAU * harmonic * step as f64 / STEPS as f64;
            let sum = |of: &dyn Fn(f64) -> f64| {
                (0..STEPS).map(|step| of(turn(step)) * f64::from(light(step))).sum::<f64>()
            };
            sum(&f64::cos).hypot(sum(&f64::sin))
        };
        for harmonic in [1.0, 2.0] {
            let sample = amplitude(harmonic, &|step| stacks.sample[[0, step, 0, 4]]);
            let flat = amplitude(harmonic, &|step| stacks.flat[[step, 0, 4]]);
            let found = -(sample / flat).ln() - passed.depth;
            let frequency = TAU * harmonic / PERIOD / scale;
            let expected = 0.5 * frequency * frequency * passed.variance;
            let place = || format!("{transport:?}, {:?}, harmonic {harmonic}", medium.axis);
            worst.take(found / expected - 1.0, place);
        }
    }
    worst.holds();
}

/// Random rays draw the angles of media: their light, over columns behind a plate, is that of the quadrature.
#[test]
fn random_rays_draw_the_angles_of_media() {
    let media = [plate([-1e-3, 1e-3], 20.0, 2e-7)];
    let mut scene = empty(25, "{ from = \"-24 um\", to = \"24 um\", count = 5 }");
    media.iter().for_each(|medium| add(&mut scene, medium, None));
    scene.sampling.scheme = Scheme::Random;
    scene.sampling.rays = RandomRays::Count(40_000);
    let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
    for (step, offset) in scene.scan.mask_offsets.iter().enumerate() {
        let columns = 2..23;
        let light = |column: usize| f64::from(stacks.sample[[0, step, 0, column]]);
        let count = columns.len() as f64;
        let mean = columns.clone().map(light).sum::<f64>() / count;
        let square = columns.map(|column| (light(column) - mean).powi(2)).sum::<f64>();
        let deviation = (square / (count - 1.0) / count).sqrt();
        let expected = SET_UP.light(&media, middle(25, 12), *offset);
        let clear: Vec<Medium> =
            media.iter().map(|it| Medium { scattering: 0.0, ..it.clone() }).collect();
        let unlike = SET_UP.light(&clear, middle(25, 12), *offset);
        let place = format!("step {step}: {mean} ± {deviation} for {expected}, {unlike} without");
        assert!((mean - expected).abs() < 4.0 * deviation, "{place}");
        assert!((mean - unlike).abs() > 4.0 * deviation, "{place}");
    }
}

/// Axis of fibres.
const OBLIQUE: [f64; 3] = [0.6, 0.0, 0.8];

fn spectral(directory: &std::path::Path, sides: Option<u32>) -> Scene {
    fs::write(directory.join("two.csv"), "24,1\n25,2\n34,3\n35,1\n").expect("a file");
    let rows = "energy_keV,mu_per_cm,delta\n10,0.8,1e-14\n60,0.1,1e-14\n";
    fs::write(directory.join("resin.csv"), rows).expect("a file");
    let mut scene = empty(25, "{ from = \"-24 um\", to = \"24 um\", count = 5 }");
    scene.directory = directory.to_path_buf();
    scene.source.beam = Scene::from_toml(
        "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nspectrum = \"two.csv\"\n\
         [detector]\ndistance = \"2 m\"\npixels = [1, 1]\npitch = \"1 um\"\n",
        directory,
    )
    .expect("a scene")
    .source
    .beam;
    add(&mut scene, &disc([0.0, 0.0], 1e-3, 0.0, 2e-7), sides);
    add(&mut scene, &disc([0.3e-3, 0.2e-3], 0.5e-3, 0.0, 0.0), sides);
    scene.materials.insert("medium 0".into(), MaterialSpec::Table { path: "resin.csv".into() });
    scene.materials.insert("medium 1".into(), MaterialSpec::Table { path: "resin.csv".into() });
    let fibres = Scattering::new(2e-7).with_axis(OBLIQUE, 4e-8);
    scene.scattering.insert("medium 0".into(), fibres.with_exponent(-4.0, 30.0));
    scene.scattering.insert("medium 1".into(), Scattering::new(5e-8).with_exponent(-2.0, 30.0));
    scene
}

/// Light under a spectrum is the sum over its energies, each with its own variance.
#[test]
fn light_of_a_spectrum_is_the_sum_over_energies() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut worst = Worst::new("light of media under a spectrum", 3e-5);
    for (sides, transport) in
        [(None, Transport::Auto), (Some(4096), Transport::Auto), (None, Transport::Exact)]
    {
        let mut scene = spectral(folder.path(), sides);
        scene.sampling.transport = transport;
        let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
        let nodes = spectrum::nodes(&scene).expect("nodes");
        assert!(nodes.energies.len() > 1);
        let at = |energy: f64| -> Vec<Medium> {
            let of = |(name, medium): (&str, Medium)| {
                let mu = constants_at(&scene, name, energy).expect("constants").mu;
                let [across, along] = scene.scattering[name].across_and_along(energy);
                let axis = Some(Axis { direction: OBLIQUE, excess: along - across });
                Medium { mu, scattering: across, axis, ..medium }
            };
            let outer = disc([0.0, 0.0], 1e-3, 0.0, 0.0);
            let inner = disc([0.3e-3, 0.2e-3], 0.5e-3, 0.0, 0.0);
            [("medium 0", outer), ("medium 1", inner)].map(of).into()
        };
        let of_energies: Vec<(f64, Vec<Medium>)> =
            nodes.weights.iter().zip(&nodes.energies).map(|(w, e)| (*w, at(*e))).collect();
        for ((_, step, _, column), light) in stacks.sample.indexed_iter() {
            let offset = scene.scan.mask_offsets[step];
            let of = |(weight, media): &(f64, Vec<Medium>)| {
                weight * SET_UP.light(media, middle(25, column), offset)
            };
            let expected: f64 = of_energies.iter().map(of).sum();
            let place = || format!("{sides:?} sides, {transport:?}, step {step}, column {column}");
            worst.take(f64::from(*light) - expected, place);
        }
        assert!(matches!(scene.source.beam, Beam::Spectrum(_)));
    }
    worst.holds();
}
