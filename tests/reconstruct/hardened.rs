//! Values that are expected under a spectrum, beside the means over it.

use crate::support;
use beamlet::material::constants_over;
use beamlet::ndarray::Array3;
use beamlet::reconstruct::{
    BeamEnergy, GridChoice, Input, Method, Quantity, VolumeFormat, VolumePlan, VolumesTo,
    reconstruct,
};
use beamlet::scene::{Beam, Scene};
use beamlet::spectrum::{Spectrum, response};
use beamlet::{Backend, Cancel, RowsControl};

const SCENE: &str = r#"
detector = { distance = "1.8 m", pixels = [96, 1], pitch = "100 um" }
scan = { angles = { from = "0 deg", to = "360 deg", count = 90 } }
[source]
distance = "1.2 m"
spot = "0 um"
spectrum = { anode = "tungsten", kvp = "60 kV", filters = [{ material = "Al", thickness = "1 mm" }] }
[[object]]
name = "rod"
shape = { cylinder = { radius = "2.2 mm", height = "5 mm" } }
material = "Al"
position = ["0.3 mm", "-0.2 mm", "0 mm"]
"#;

/// −ln of the transmission of the rod, summed over all rows of the spectrum in f64.
fn sinograms(scene: &Scene) -> Array3<f32> {
    let Beam::Spectrum(spec) = &scene.source.beam else { panic!("a spectrum") };
    let rows = Spectrum::after_filters(scene, spec).unwrap();
    let mu = constants_over(scene, "Al", &rows.energies_kev).unwrap();
    let seen = |energy: &f64| response(scene, *energy).unwrap();
    let light: Vec<f64> =
        rows.energies_kev.iter().zip(&rows.weights).map(|(e, weight)| weight * seen(e)).collect();
    let total: f64 = light.iter().sum();
    Array3::from_shape_fn((90, 1, 96), |(view, _, column)| {
        let (sin, cos) = (std::f64::consts::TAU * view as f64 / 90.0).sin_cos();
        let [x, y] = [0.3e-3 * cos - 0.2e-3 * sin, -0.2e-3 * cos - 0.3e-3 * sin];
        let u = (column as f64 - 47.5) * 1e-4;
        let off = (x * 1.8 - (y + 1.2) * u) / u.hypot(1.8);
        let chord = 2.0 * (2.2e-3_f64.powi(2) - off * off).max(0.0).sqrt();
        let behind = light.iter().zip(&mu).map(|(light, it)| light * (-it.mu * chord).exp());
        -(behind.sum::<f64>() / total).ln() as f32
    })
}

/// A rod of aluminium hardens the beam: its mean is far below the mean of μ over the spectrum, and at the value
/// that errors.csv expects. The volume is of 96 columns, and the chords of its voxels are off by up to half a
/// voxel of 69, which changes hardening by a tenth of that at most.
#[test]
fn hardening_is_expected_and_no_error() {
    let scene = Scene::from_toml(SCENE, ".").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mu.npy");
    ndarray_npy::write_npy(&path, &sinograms(&scene)).unwrap();
    let input = Input::of_file(&path, Quantity::Mu, &scene).unwrap();
    let grid = GridChoice::default().grid(input.geometry()).unwrap();
    let plan = VolumePlan::new(vec![Quantity::Mu], grid, Method::default())
        .with_beam(BeamEnergy::of(&scene).unwrap());
    let engine = support::engine(Backend::Bvh);
    let truth =
        beamlet::truth(&engine, &scene, input.geometry(), &grid, &Cancel::default()).unwrap();
    let at = folder.path().join("volume");
    let to = VolumesTo::new(&at, VolumeFormat::Npy);
    let control = &mut RowsControl::default();
    let done = reconstruct(&engine, &input, &plan, Some(&truth), to, control).unwrap();
    let table = done.errors.unwrap();
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let rod = lines.find(|line| line[0] == "rod").unwrap();
    let value = |name: &str| -> f64 {
        rod[names.iter().position(|other| *other == name).unwrap()].parse().unwrap()
    };
    let (mean, expected) = (value("mean"), value("expected"));
    println!("measured: {table}");
    assert!(value("error_percent") < -5.0, "{table}");
    assert!((mean / expected - 1.0).abs() < 2e-3, "{table}");
    assert!((value("off_expected_percent") - 100.0 * (mean / expected - 1.0)).abs() < 1e-3);
}
