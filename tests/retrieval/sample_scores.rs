//! Scores of designs at their sample, against closed forms, computation by hand, and noisy retrievals.

use crate::stacks::images_of;
use crate::support::{Worst, engine};
use beamlet::retrieve::{RetrieveOptions, Weights};
use beamlet::scene::{Mesh, Object, Scene, ShapeOrMesh};
use beamlet::sweep::{Outcome, Sweep};
use beamlet::{Backend, Cancel, IdealOptions, Result, RowsControl, ideal};
use ndarray::{Array2, Axis};

/// Magnification of the detector mask, source to rotation centre over source to sample mask, and lever arm, m.
const MAGNIFICATION: f64 = 1.5;
const MOVED: f64 = 1.21 / 1.2;
const ARM: f64 = 0.59;
const RADIUS: f64 = 0.8e-3;
const PHOTONS: f64 = 20_000.0;
const COLUMNS: usize = 40;

/// The set-up of the paper with bars without thickness.
fn text(pixels: [usize; 2], more: &str) -> String {
    format!(
        "{}\n[detector]\ndistance = \"1.8 m\"\npixels = {pixels:?}\npitch = \"150 um\"\n{more}\n[scan]\n\
         mask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 11 }}\n\
         [materials.plastic]\nmu = \"400 /m\"\ndelta = 2.5e-7\n",
        include_str!("../support/masks.toml")
            .replace("material = \"gold\"\nthickness = \"225 um\"", "transmission = 0.0")
    )
}

/// A rod across the rows in the middle of the detector.
fn rod(rows: usize) -> String {
    format!(
        "{}[[object]]\nname = \"rod\"\nmaterial = \"nylon 6\"\n\
         shape = {{ cylinder = {{ radius = \"{RADIUS} m\", height = \"1 m\" }} }}\n",
        text([COLUMNS, rows], &format!("photons = {PHOTONS}"))
    )
}

fn scored(
    load: &(dyn Fn(&[String]) -> Result<Scene> + Sync),
    vary: &str,
    scores: &str,
) -> Vec<Outcome> {
    let mut sweep = Sweep::new(&[vary.into()], &[scores.into()], None).unwrap();
    sweep.prepare(load).unwrap();
    let mut outcomes = Vec::new();
    let engine = engine(Backend::Bvh);
    sweep.complete(&engine, load, &mut outcomes, &Cancel::default(), &mut |_, _| Ok(())).unwrap();
    assert!(outcomes.iter().all(|outcome| outcome.refused.is_none()), "{outcomes:?}");
    outcomes
}

/// Images of a scene without noise, `[row][column]`, as a weighted fit of its counts would have them.
fn retrieved(scene: &Scene, names: &[&str]) -> Vec<Array2<f64>> {
    let engine = engine(Backend::Bvh);
    let options = RetrieveOptions::default()
        .resolved(scene)
        .unwrap()
        .with_weights(Weights::Poisson)
        .with_gain(1.0 / PHOTONS);
    let mut bare = scene.clone();
    bare.detector.counts = None;
    let stacks = engine.simulate(&bare).unwrap();
    let frames = [stacks.flat.view(), stacks.sample.index_axis(Axis(0), 0)];
    let images = images_of(&engine, &bare, &options, frames);
    names.iter().map(|name| images.get(name).unwrap().mapv(f64::from)).collect()
}

/// Place of a column at the rotation centre, m.
fn place(column: usize) -> f64 {
    (column as f64 + 0.5 - COLUMNS as f64 / 2.0) * 150e-6 * 1.21 / 1.8
}

fn mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    squares.iter().sum::<f64>() / squares.len() as f64
}

/// The attenuation of a wedge, μ s along x, displaces a Gaussian curve of variance σ² by (σ² − a²/12) μ s (docs/physics.md,
/// "Bias of attenuation gradients"). Apertures of 10 um before these spots make nearly a Gaussian.
#[test]
fn the_bias_of_a_wedge_is_that_of_its_attenuation() {
    let (slope, mu) = (1.0, 400.0);
    let half = 3e-3;
    let corner = |x: f64, y: f64, z: f64| [x, y, z];
    let vertices = [-half, half]
        .map(|z| {
            let back = |x: f64| 4e-3 + slope * x;
            [
                corner(-half, 0.0, z),
                corner(half, 0.0, z),
                corner(half, back(half), z),
                corner(-half, back(-half), z),
            ]
        })
        .concat();
    let mut triangles = vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]];
    for side in 0..4 {
        let next = (side + 1) % 4;
        triangles.extend([[side, next, next + 4], [side, next + 4, side + 4]]);
    }
    let shape = ShapeOrMesh::from(Mesh::Arrays { vertices, triangles });
    let load = |sets: &[String]| {
        let narrow = text([13, 2], "").replace("30 um", "10 um");
        let mut scene = Scene::from_toml_with(&narrow, ".", sets)?;
        scene.objects.push(Object::new("wedge", shape.clone(), "plastic"));
        Ok(scene)
    };
    let outcomes = scored(&load, "source.spot=40,50,60 um", "bias_alpha:wedge,bias_alpha");
    let mut worst = Worst::new("bias of the angle of a wedge over the closed form, less 1", 0.03);
    for (spot, outcome) in [40e-6, 50e-6, 60e-6_f64].into_iter().zip(&outcomes) {
        let blur = spot / (8.0 * 2.0_f64.ln()).sqrt() * 0.5;
        let variance = (10e-6_f64.powi(2) / 12.0 + blur * blur) / MAGNIFICATION.powi(2);
        let bias = MAGNIFICATION / ARM * MOVED * variance * mu * slope;
        worst.take(outcome.values[0].unwrap() / bias - 1.0, || format!("{spot} m: {bias:e}"));
        assert_eq!(outcome.values[0], outcome.values[1], "the wedge is the whole sample");
    }
    worst.holds();
}

/// Contrast and noise of a rod by hand: the pixels whose middle the rod covers, and those beside it.
#[test]
fn contrast_to_noise_is_that_of_the_retrieved_images() {
    let text = rod(2);
    let load = |sets: &[String]| Scene::from_toml_with(&text, ".", sets);
    let names = ["transmission", "refraction", "dark_field"];
    let outcomes = scored(
        &load,
        "sample_mask.projected_aperture=30,45 um",
        "cnr:rod,cnr_alpha:rod,cnr_dark_field",
    );
    let mut worst = Worst::new("contrast to noise over that by hand, less 1", 1e-4);
    for (aperture, outcome) in [30.0, 45.0].into_iter().zip(&outcomes) {
        let set = format!("sample_mask.projected_aperture={aperture} um");
        let scene = load(&[set]).unwrap();
        for (name, score) in names.into_iter().zip(&outcome.values) {
            let images = retrieved(&scene, &[name, &format!("{name}_sigma")]);
            let edge = 0.5 * aperture * 1e-6 * 1.21 / 1.8;
            let own = |at: &&(usize, usize)| place(at.1).abs() < RADIUS;
            let beside = |at: &&(usize, usize)| place(at.1).abs() - edge > RADIUS;
            let all: Vec<(usize, usize)> = images[0].indexed_iter().map(|(at, _)| at).collect();
            let level = all.iter().filter(beside).map(|at| images[0][*at]).sum::<f64>()
                / all.iter().filter(beside).count() as f64;
            let contrast = mean_square(all.iter().filter(own).map(|at| images[0][*at] - level));
            let [noise, noise_beside] = [
                mean_square(all.iter().filter(own).map(|at| images[1][*at])),
                mean_square(all.iter().filter(beside).map(|at| images[1][*at])),
            ];
            let by_hand = (contrast / f64::midpoint(noise, noise_beside)).sqrt();
            worst.take(score.unwrap() / by_hand - 1.0, || {
                format!("{name}, {aperture} um: {by_hand}")
            });
        }
    }
    worst.holds();
}

/// A part of the detector is simulated: pixels far from the sample change no score of its own pixels.
#[test]
fn a_wider_detector_has_the_same_scores() {
    let of = |columns: usize, rows: usize| {
        let text = rod(rows)
            .replace(&format!("[{COLUMNS}, {rows}]"), &format!("[{columns}, {rows}]"))
            + "position = [\"0.1 mm\", \"0 mm\", \"0 mm\"]\n";
        let text = text.replace("height = \"1 m\"", "height = \"0.6 mm\"");
        let load = |sets: &[String]| Scene::from_toml_with(&text, ".", sets);
        scored(&load, "detector.blur.fwhm=60 um", "bias_alpha:rod,error_transmission:rod,cnr:rod")
    };
    let [narrow, wide] = [of(48, 38), of(150, 130)];
    let mut worst = Worst::new("score of a wider detector over that of a narrow one, less 1", 2e-3);
    for (wide, narrow) in wide[0].values.iter().zip(&narrow[0].values) {
        worst.take(wide.unwrap() / narrow.unwrap() - 1.0, || format!("{wide:?}"));
    }
    worst.holds();
}

/// The error of a score is that of noisy retrievals of 26 columns of 200 rows, which differ by their noise alone: two rows
/// have the score and the truth. The root mean square of 5,200 values is known to 1 %, a fourth of the limit. And designs
/// that share their light have the scores that each has alone.
#[test]
fn errors_are_those_of_noisy_retrievals() {
    let text = rod(2);
    let load = |sets: &[String]| Scene::from_toml_with(&text, ".", sets);
    let scores = "error_transmission:rod,error_alpha:rod,error_dark_field:rod,bias_alpha:rod";
    let together = scored(&load, "detector.photons=20000,80000", scores);
    let alone = scored(&load, "detector.photons=80000", scores);
    assert_eq!(together[1], alone[0]);
    assert_eq!(together[0].values[3].is_some(), together[1].values[3].is_some());

    let engine = engine(Backend::Bvh);
    let truth = load(&[]).unwrap();
    let truth =
        ideal(&engine, &truth, &IdealOptions::default(), &mut RowsControl::default()).unwrap();
    let scene = Scene::from_toml(&rod(200), ".").unwrap();
    let numbers = engine.simulate(&scene).unwrap().counts.unwrap();
    let options = RetrieveOptions::default().with_weights(Weights::Poisson).with_gain(1.0);
    let frames = [numbers.flat.view(), numbers.sample.index_axis(Axis(0), 0)];
    let images = images_of(&engine, &scene, &options, frames);
    let mut worst = Worst::new("error of noisy retrievals over the score, less 1", 0.04);
    for (name, score) in
        ["transmission", "refraction", "dark_field"].into_iter().zip(&together[0].values)
    {
        let (found, truth) = (images.get(name).unwrap(), &truth.images[name]);
        let own = found.indexed_iter().filter(|((_, column), _)| place(*column).abs() < RADIUS);
        let error =
            mean_square(own.map(|(at, value)| f64::from(value - truth[[0, 0, at.1]]))).sqrt();
        worst.take(error / score.unwrap() - 1.0, || format!("{name}: {error:e}"));
    }
    worst.holds();
}
