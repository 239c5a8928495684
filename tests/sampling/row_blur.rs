//! Light under every blur along x and along z, by the detector and by the spot, against runs of a much
//! smaller tolerance. A mesh is taken by means over its facets, which know their light along z by its
//! line.

#![allow(clippy::unwrap_used, reason = "tests")]

use crate::support::{Worst, engine, sample};
use beamlet::Backend;
use beamlet::scene::Scene;
use ndarray::{Array2, Array4};
use std::path::Path;

/// Tolerance of the scenes, share of open beam.
const TOLERANCE: f64 = 1e-4;
/// Tolerance of the finer runs.
const FINE: f64 = 5e-6;

/// A coarse ball behind one mask; the spot along z, um, and further keys of the detector.
fn scene(spot: &str, detector: &str, tolerance: f64) -> Scene {
    let text = format!(
        "[source]\ndistance = \"1.21 m\"\nspot = [\"30 um\", \"{spot} um\"]\nenergy = \"30 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [7, 9]\npitch = \"150 um\"\n{detector}\n\
         [sample_mask]\ndistance = \"1.2 m\"\nthickness = \"225 um\"\nmaterial = \"bars\"\n\
         projected_aperture = \"30 um\"\n\
         [sampling]\ntolerance = {tolerance}\n\
         [scan]\nmask_offsets = [\"0 um\", \"9 um\"]\nangles = [\"40.107 deg\"]\n\
         [[object]]\nname = \"ball\"\nmaterial = \"dense\"\n\
         shape = {{ sphere = {{ radius = \"0.25 mm\", sides = 24 }} }}\n\
         [materials.bars]\nmu = \"53122 /m\"\ndelta = 4e-6\n\
         [materials.dense]\nmu = \"2049.4 /m\"\ndelta = 4.6092e-7\n"
    );
    Scene::from_toml(&text, ".").unwrap()
}

/// Blur by a measured kernel: an image of a Gaussian of 63 um along x and 20 um along z.
fn measured_kernel(folder: &Path) -> String {
    let path = folder.join("kernel.npy");
    let kernel = Array2::from_shape_fn((21, 61), |(row, column)| {
        let [x, z] = [(column as f32 - 30.0) * 10.0 / 63.0, (row as f32 - 10.0) * 10.0 / 20.0];
        (-0.5 * (x * x + z * z)).exp()
    });
    ndarray_npy::write_npy(&path, &kernel).unwrap();
    format!("blur = {{ kernel = {path:?}, pixel = \"10 um\" }}")
}

fn plain(scene: &Scene) -> Array4<f32> {
    engine(Backend::Bvh).simulate(scene).unwrap().sample
}

/// Blurs of 0.04 to 0.53 rows. Rows receive light of the whole ball, so that errors of one sign add up.
#[test]
fn light_under_a_blur_holds_the_tolerance() {
    let blur = |x: u32, z: u32| format!("blur = {{ sigma = [\"{x} um\", \"{z} um\"] }}");
    let place = tempfile::tempdir().unwrap();
    let measured = measured_kernel(place.path());
    let cases = vec![
        ("along both", "26", blur(50, 80)),
        ("none", "26", String::new()),
        ("along x", "26", blur(50, 0)),
        ("a fourth of a row", "26", blur(0, 40)),
        ("a spot", "200", String::new()),
        ("along z", "26", blur(0, 80)),
        ("no mask", "26", blur(450, 0)),
        ("a kernel", "26", measured.clone()),
        ("no mask, a kernel", "26", measured),
        ("no mask, a spot", "200", blur(50, 0)),
    ];
    for (name, spot, detector) in sample(cases, 2) {
        let [want, got] = [FINE, TOLERANCE].map(|tolerance| {
            let mut scene = scene(spot, &detector, tolerance);
            if name.starts_with("no mask") {
                (scene.sample_mask, scene.scan.mask_offsets) = (None, vec![0.0]);
            }
            plain(&scene)
        });
        let mut worst = Worst::new("light under a blur", TOLERANCE + FINE);
        for ((place, got), want) in got.indexed_iter().zip(want.iter()) {
            worst.take(f64::from(got - want), || format!("{name}, {place:?}"));
        }
        worst.holds();
    }
}
