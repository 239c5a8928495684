//! Measured kernels: direction, shape and direction of the image, rows and columns.

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{body, cuboid};
use crate::support::{Worst, engine};
use beamlet::Backend;
use beamlet::scene::{Blur, KernelFile, Scene};
use ndarray::Array2;
use std::path::Path;

const PITCH: f64 = 150e-6;

fn with_kernel(mut scene: Scene, path: &Path, pixel: f64) -> Scene {
    scene.detector.blur = Some(Blur::Kernel(KernelFile::new(path, [pixel; 2])));
    scene
}

/// Six by six pixels with a block that shades the lower left.
fn block(setup: &Setup) -> Scene {
    // Edges in the middle of a pixel, at the near face: 0.3 mm of it beyond the axis.
    let scale = 1.2095 / 1.8;
    let at = |pixels: f64| pixels * PITCH * scale;
    let size = 20.0;
    let solid =
        cuboid([at(size), 1e-3, at(size)]).moved([at(0.5 - 0.5 * size), 0.0, at(0.5 - 0.5 * size)]);
    scenes::scene(setup, &[body(solid, 1e6, 0.0)], &[0.0])
}

/// All light goes two pixels to the right and one down, over a tenth of a pixel.
#[test]
fn kernel_image_shifts_light_by_its_offset() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("kernel.npy");
    let mut kernel = Array2::<f32>::zeros((51, 51));
    kernel[[25 + 10, 25 + 20]] = 7.0;
    ndarray_npy::write_npy(&path, &kernel).unwrap();
    let mut setup = Setup::paper([10, 8]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    setup.spot = [0.0; 2];
    let sharp = block(&setup);
    let engine = engine(Backend::Bvh);
    let want = engine.simulate(&sharp).unwrap().sample;
    let got = engine.simulate(&with_kernel(sharp, &path, PITCH / 10.0)).unwrap().sample;
    // Edges in the middle of pixels: no light crosses borders. Cell rows of 1/256 row, and parts of
    // the grid in which the edge stands are as wide as they are.
    let mut worst = Worst::new("detector, kernel that moves light", 1.0 / 256.0);
    for row in 1..8 {
        for column in 2..10 {
            let (got, want) = (got[[0, 0, row, column]], want[[0, 0, row - 1, column - 2]]);
            worst.take(f64::from(got - want), || format!("row {row}, column {column}"));
        }
    }
    // It is a picture of something.
    assert!(want[[0, 0, 0, 0]] > 0.99 && want[[0, 0, 7, 0]] < 0.01 && want[[0, 0, 7, 9]] > 0.99);
    worst.holds();
}

/// A Gaussian as samples: its blur is that of the Gaussian, but for the breadth of a sample.
#[test]
fn sampled_gaussian_blurs_as_the_gaussian() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("kernel.npy");
    let (sigma, pixel) = (60e-6_f64, 5e-6);
    // A sample spreads light over itself: the Gaussian is narrower by that.
    let narrow = (sigma * sigma - pixel * pixel / 12.0).sqrt();
    let kernel = Array2::from_shape_fn((145, 145), |(row, column)| {
        let [z, x] = [row, column].map(|i| (i as f64 - 72.0) * pixel / narrow);
        (-0.5 * (x * x + z * z)).exp()
    });
    ndarray_npy::write_npy(&path, &kernel).unwrap();
    let mut setup = Setup::paper([10, 8]);
    setup.sample_mask = setup.sample_mask.map(|mut mask| {
        mask.period *= 2.0;
        mask
    });
    let sharp = block(&setup);
    let mut gaussian = sharp.clone();
    gaussian.detector.blur = Some(Blur::Gaussian { sigma: [sigma; 2] });
    let engine = engine(Backend::Bvh);
    let want = engine.simulate(&gaussian).unwrap().sample;
    let got = engine.simulate(&with_kernel(sharp, &path, pixel)).unwrap().sample;
    // Rows are cut into parts for the kernel, and not for the Gaussian: 5e-3 of what is lit, 0.2
    // of open beam.
    let mut worst = Worst::new("detector, Gaussian as samples", 1e-3);
    for ((place, got), want) in got.indexed_iter().zip(&want) {
        worst.take(f64::from(got - want), || format!("{place:?}"));
    }
    worst.holds();
}
