//! Contrasts behind media: what a retrieval finds, ideal images, the truth of a reconstruction.

use super::{Medium, SET_UP, add, disc, empty, middle, plate, truth_of, wedge};
use crate::support::{Worst, engine};
use beamlet::reconstruct::Quantity;
use beamlet::retrieve::{Method, RetrieveOptions, Retriever};
use beamlet::scene::{MaterialSpec, Scene};
use beamlet::{Backend, IdealOptions, RowsControl, ideal};
use ndarray::Axis;
use std::collections::BTreeMap;

const OFFSETS: &str = "{ from = \"-30 um\", to = \"30 um\", count = 13 }";
const COLUMNS: usize = 17;

/// Transmission, refraction and dark field by column.
fn retrieved(scene: &Scene) -> BTreeMap<&'static str, Vec<f64>> {
    let engine = engine(Backend::Bvh);
    let stacks = engine.simulate(scene).expect("a run");
    let options = RetrieveOptions::default().with_method(Method::ExactCurve);
    let mut retriever = Retriever::new(&engine, scene, &options).expect("a retriever");
    retriever.set_flat_array(stacks.flat.view()).expect("a flat");
    let images = retriever.retrieve_array(stacks.sample.index_axis(Axis(0), 0)).expect("images");
    let row = |name| {
        let image = images.get(name).expect("an image");
        (name, image.row(0).iter().map(|it| f64::from(*it)).collect())
    };
    ["transmission", "refraction", "dark_field"].map(row).into()
}

fn scene(medium: &Medium, delta: f64) -> Scene {
    let mut scene = empty(17, OFFSETS);
    add(&mut scene, medium, None);
    let MaterialSpec::Constants { mu, .. } = scene.materials["medium 0"] else { unreachable!() };
    scene.materials.insert("medium 0".into(), MaterialSpec::Constants { mu, delta });
    scene
}

/// The dark field of a medium is that of its mean ray, and a plate keeps transmission and angle. Behind a wedge the
/// widening differs from step to step, which moves the curve as a gradient of attenuation does.
#[test]
fn retrieved_dark_fields_are_variances_times_lengths() {
    let mut dark = Worst::new("dark field over that of the mean ray", 5e-3);
    let mut kept = Worst::new("transmission and 1e5 angles that scattering changes", 1e-5);
    let media = [("a plate", plate([-1e-3, 1e-3], 20.0, 1e-7)), ("a wedge", wedge(2e-7))];
    for (name, medium) in media {
        let clear = retrieved(&scene(&Medium { scattering: 0.0, ..medium.clone() }, 2e-7));
        let found = retrieved(&scene(&medium, 2e-7));
        for column in 0..COLUMNS {
            let place = || format!("{name}, column {column}");
            let slope = middle(COLUMNS, column) / SET_UP.analyser;
            let passed = SET_UP.passed(std::slice::from_ref(&medium), slope);
            let lever = SET_UP.analyser - SET_UP.axis;
            let expected = passed.variance / (lever * lever);
            dark.take(found["dark_field"][column] / expected - 1.0, place);
            kept.take(found["transmission"][column] - clear["transmission"][column], place);
            if name == "a plate" {
                let angle = found["refraction"][column] - clear["refraction"][column];
                kept.take(1e5 * angle, place);
            }
        }
    }
    dark.holds();
    kept.holds();
}

#[test]
fn ideal_images_have_the_variance_of_media() {
    let mut worst = Worst::new("dark field of ideal images, relative", 1e-4);
    let medium = plate([-1e-3, 1e-3], 20.0, 1e-7);
    let scene = scene(&medium, 0.0);
    let options = IdealOptions::default();
    let images = ideal(&engine(Backend::Bvh), &scene, &options, &mut RowsControl::default())
        .expect("images");
    for ((.., column), value) in images.images["dark_field"].indexed_iter() {
        let slope = middle(COLUMNS, column) / SET_UP.analyser;
        let passed = SET_UP.passed(std::slice::from_ref(&medium), slope);
        let expected = passed.variance / (SET_UP.analyser - SET_UP.axis).powi(2);
        worst.take(f64::from(*value) / expected - 1.0, || format!("column {column}"));
    }
    worst.holds();
}

#[test]
fn the_truth_of_a_dark_field_is_the_scattering_of_each_voxel() {
    let mut scene = empty(32, OFFSETS);
    scene.scan.angles = (0..8).map(|k| f64::from(k) * std::f64::consts::PI / 8.0).collect();
    add(&mut scene, &disc([0.0, 0.0], 1e-3, 20.0, 2e-7), None);
    add(&mut scene, &disc([0.3e-3, 0.0], 0.4e-3, 0.0, 5e-8), None);
    let engine = engine(Backend::Bvh);
    let truth = truth_of(&engine, &scene);
    let values = truth.values(Quantity::DarkField).expect("media scatter");
    for (label, value) in truth.labels().iter().zip(&values) {
        let expected: f32 = [0.0, 2e-7, 5e-8][usize::from(*label)];
        assert_eq!(value.to_bits(), expected.to_bits());
    }
    assert!([0, 1, 2].iter().all(|label| truth.labels().iter().any(|it| it == label)));
    scene.scattering.clear();
    assert!(truth_of(&engine, &scene).values(Quantity::DarkField).is_none());
}
