//! Random packings of real spheres by waves, against the loss of contrast of a material that has their diameter and
//! fraction.

use super::SET_UP;
use crate::support::{amount, engine};
use beamlet::Backend;
use beamlet::internals::instances::transforms;
use beamlet::internals::microstructure::Bodies;
use beamlet::scene::{BodyShape, Microstructure, Scene};
use std::f64::consts::{PI, TAU};

const STEPS: usize = 20;
/// m.
const PERIOD: f64 = 100e-6;
const WAVELENGTH: f64 = 1.239_841_984e-9 / 30.0;
/// Delta of the spheres in vacuum: silica.
const DELTA: f64 = 4.9e-7;
/// Rows whose light is one part of the ensemble: their height is two diameters.
const ROWS_OF_PART: usize = 4;

/// Sum over the steps of a period, turned by a harmonic.
pub(super) fn harmonics(light: &[f64], harmonic: f64) -> [f64; 2] {
    let turn = |step: usize| TAU * harmonic * step as f64 / light.len() as f64;
    let sum = |of: fn(f64) -> f64| {
        light.iter().enumerate().map(|(step, light)| of(turn(step)) * light).sum::<f64>()
    };
    [sum(f64::cos), sum(f64::sin)]
}

/// A packing, and the part of it that is seen.
struct Sample {
    diameter: f64,
    fill: f64,
    /// Thickness of the box along the beam, m.
    thickness: f64,
    columns: u32,
    rows: u32,
    seed: u64,
}

impl Sample {
    /// Rows are half a diameter high, seen from the sample; the box is larger than the field by three diameters.
    fn scene(&self) -> Scene {
        let scale = SET_UP.analyser / SET_UP.axis;
        let row = 0.5 * self.diameter;
        let wide = (f64::from(self.columns) + 3.0) * 150e-6 / scale + 3.0 * self.diameter;
        let high = f64::from(self.rows) * row + 3.0 * self.diameter;
        let offsets = (0..STEPS)
            .map(|step| format!("\"{} um\"", 1e6 * (step as f64 / STEPS as f64 - 0.5) * PERIOD));
        let text = format!(
            "[source]\ndistance = \"1.21 m\"\nspot = [\"30 um\", \"0 um\"]\nenergy = \"30 keV\"\n\
             [sample_mask]\ndistance = \"1.2 m\"\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
             [detector_mask]\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
             [detector]\ndistance = \"1.8 m\"\npixels = [{}, {}]\npitch = [\"150 um\", \"{} m\"]\n\
             [scan]\nmask_offsets = [{}]\n\
             [sampling]\ntolerance = 1e-2\ntransport = \"wave\"\n\
             [materials.silica]\nmu = \"0 /m\"\ndelta = {DELTA}\n\
             [[object]]\nname = \"spheres\"\nmaterial = \"silica\"\n\
             shape = {{ sphere = {{ radius = \"{} m\" }} }}\n\
             instances = {{ packing = \"spheres\", fill = {}, seed = {}, \
             region = {{ box = {{ size = [\"{wide} m\", \"{} m\", \"{high} m\"] }} }} }}\n",
            self.columns,
            self.rows,
            row * scale,
            offsets.collect::<Vec<_>>().join(", "),
            0.5 * self.diameter,
            self.fill,
            self.seed,
            self.thickness
        );
        Scene::from_toml(&text, ".").expect("a scene")
    }

    /// Fraction away from walls, and thickness of a plate of this fraction: centres lie a radius or more from each wall.
    fn inside(&self, scene: &Scene) -> [f64; 2] {
        let places = transforms(scene, &scene.objects[0]).expect("a packing");
        let ends = |axis: usize| {
            let at = places.iter().map(|place| place.position[axis]);
            at.clone().fold(f64::NEG_INFINITY, f64::max) - at.fold(f64::INFINITY, f64::min)
        };
        let [x, y, z] = [0, 1, 2].map(ends);
        let volume = PI / 6.0 * self.diameter.powi(3);
        [places.len() as f64 * volume / (x * y * z), y]
    }

    /// Loss of contrast of harmonics found, its standard error, and expected.
    fn losses(&self, harmonics_of: &[f64]) -> Vec<[f64; 3]> {
        let scene = self.scene();
        let [fraction, thickness] = self.inside(&scene);
        let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
        let (rows, columns) = (self.rows as usize, self.columns as usize);
        let scale = SET_UP.analyser / SET_UP.sample_mask;
        let medium = Microstructure::new(BodyShape::Spheres, "silica", self.diameter, fraction);
        let bodies = Bodies::new(&medium);
        let of_harmonic = |harmonic: &f64| {
            // Parts of the ensemble: some rows of a column, their light over the flat.
            let parts = (0..rows / ROWS_OF_PART)
                .flat_map(|part| (0..columns).map(move |column| (part, column)));
            let of_part = |(part, column): (usize, usize)| {
                let own = part * ROWS_OF_PART..(part + 1) * ROWS_OF_PART;
                let sum = |of: &dyn Fn(usize, usize) -> f32| {
                    let light: Vec<f64> = (0..STEPS)
                        .map(|step| own.clone().map(|row| f64::from(of(step, row))).sum())
                        .collect();
                    harmonics(&light, *harmonic)
                };
                let [a, b] = sum(&|step, row| stacks.sample[[0, step, row, column]]);
                let [c, d] = sum(&|step, row| stacks.flat[[step, row, column]]);
                let square = c * c + d * d;
                [(a * c + b * d) / square, (b * c - a * d) / square]
            };
            let parts: Vec<[f64; 2]> = parts.map(of_part).collect();
            let count = parts.len() as f64;
            let mean = [0, 1].map(|at| parts.iter().map(|part| part[at]).sum::<f64>() / count);
            let contrast = mean[0].hypot(mean[1]);
            // Deviation along the mean.
            let along = |part: &[f64; 2]| (part[0] * mean[0] + part[1] * mean[1]) / contrast;
            let variance = parts.iter().map(|part| (along(part) - contrast).powi(2)).sum::<f64>();
            let error = (variance / (count - 1.0) / count).sqrt() / contrast;
            let shear = WAVELENGTH * harmonic / PERIOD * (SET_UP.analyser - SET_UP.axis) / scale;
            let loss = bodies.loss(2.0 * TAU / WAVELENGTH * DELTA, shear);
            [-contrast.ln(), error, loss.value * thickness]
        };
        harmonics_of.iter().map(of_harmonic).collect()
    }

    /// Compares harmonics, which agree within 3 % and twice the standard error. Between mask steps refraction moves light
    /// at random: that is noise of the first order, which loses weight with the thickness and at higher harmonics.
    fn compare(&self) -> String {
        let harmonics = [2.0, 3.0];
        let mut lines = String::new();
        for (harmonic, [found, error, expected]) in harmonics.iter().zip(self.losses(&harmonics)) {
            let text = format!(
                "{} um, fill {}, harmonic {harmonic}: {found:.5} ± {error:.5}, expected {expected:.5}, ratio {:.3}\n",
                1e6 * self.diameter,
                self.fill,
                found / expected
            );
            assert!((found - expected).abs() < 0.03 * expected + 2.0 * error, "{text}");
            assert!(error < 0.1 * expected, "{text}");
            lines.push_str(&text);
        }
        lines
    }
}

/// A sample for each commit: dense spheres of 5 um; dilute ones, too, with `BEAMLET_ALL`.
#[test]
fn packings_of_spheres_of_5_um_lose_the_contrast_of_their_medium() {
    for (fill, seed) in [(0.3, 2), (0.1, 1)].into_iter().take(amount(1, 2)) {
        let sample = Sample { diameter: 5e-6, fill, thickness: 1e-3, columns: 3, rows: 24, seed };
        print!("{}", sample.compare());
    }
}

/// Larger spheres and ensembles.
#[test]
#[ignore = "minutes: .ci/long"]
fn packings_of_all_sizes_lose_the_contrast_of_their_medium() {
    for (fill, thickness, seed) in [(0.1, 2e-3, 3), (0.3, 1e-3, 4)] {
        for (diameter, factor, columns, rows) in
            [(5e-6, 1.0, 4, 64), (10e-6, 2.0, 8, 64), (50e-6, 4.0, 20, 96)]
        {
            let thickness = factor * thickness;
            let sample = Sample { diameter, fill, thickness, columns, rows, seed };
            print!("{}", sample.compare());
        }
    }
}
