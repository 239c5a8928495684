//! Scatter that is added.

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::support::{Worst, engine};
use beamlet::Backend;
use beamlet::scene::{KernelFile, Scatter};
use ndarray::Array2;

#[test]
fn scatter_image_is_added_behind_the_sample_and_not_to_the_flat() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("scatter.npy");
    let image = Array2::from_shape_fn((3, 8), |(row, column)| 0.01 * (row * 8 + column) as f32);
    ndarray_npy::write_npy(&path, &image).unwrap();
    let mut scene = scenes::scene(&Setup::paper([8, 3]), &[], &[0.0, 5e-6]);
    let engine = engine(Backend::Bvh);
    let without = engine.simulate(&scene).unwrap();
    scene.detector.scatter = Some(Scatter::Image(path));
    let with = engine.simulate(&scene).unwrap();
    assert_eq!(with.flat, without.flat);
    let mut worst = Worst::new("detector, scatter image", 1e-7);
    for ((place, with), without) in with.sample.indexed_iter().zip(&without.sample) {
        let want = without + image[[place.2, place.3]];
        worst.take(f64::from(with - want), || format!("{place:?}"));
    }
    worst.holds();
}

#[test]
fn scatter_kernel_spreads_a_fraction_of_the_light_of_the_detector() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("veil.npy");
    ndarray_npy::write_npy(&path, &Array2::from_elem((5, 5), 1.0_f64)).unwrap();
    let mut setup = Setup::paper([9, 7]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    let mut scene = scenes::scene(&setup, &[], &[0.0]);
    let kernel = KernelFile::new(path, setup.pitch);
    scene.detector.scatter = Some(Scatter::Kernel { kernel, fraction: 0.1 });
    let flat = engine(Backend::Bvh).simulate(&scene).unwrap().flat;
    // Beyond the detector there is no light.
    // Light spread evenly over a pixel, moved evenly over a sample of the same size: 3/4 of it
    // land in the pixel where the sample is, 1/8 on either side.
    let weight = |d: i32| -> f64 {
        let share = |k: i32| match (d - k).abs() {
            0 => 0.75,
            1 => 0.125,
            _ => 0.0,
        };
        (-2..=2).map(share).sum::<f64>() / 5.0
    };
    let mut worst = Worst::new("detector, scatter kernel", 1e-6);
    for ((_, row, column), &got) in flat.indexed_iter() {
        let sum = |at: usize, count: usize| -> f64 {
            (0..count as i32).map(|other| weight(other - at as i32)).sum()
        };
        let want = 1.0 + 0.1 * sum(row, 7) * sum(column, 9);
        worst.take(f64::from(got) - want, || format!("row {row}, column {column}"));
    }
    // In the middle all of the fraction arrives, in a corner 0.6 x 0.6 of it.
    assert!((flat[[0, 3, 4]] - 1.1).abs() < 1e-6 && (flat[[0, 0, 0]] - 1.036).abs() < 1e-6);
    worst.holds();
}
