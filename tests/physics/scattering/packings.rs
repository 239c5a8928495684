//! Random packings of real bodies by waves, against the loss of contrast of a material that has their diameter and
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
/// Delta of the bodies or their host in vacuum: silica.
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

/// The part of a sample that is seen.
#[derive(Clone, Copy)]
struct Light {
    columns: u32,
    rows: u32,
    /// Height of a row, seen from the sample, m.
    row: f64,
}

/// Loss of contrast of a harmonic.
#[derive(Clone, Copy)]
struct Loss {
    harmonic: f64,
    found: f64,
    /// Standard error.
    error: f64,
    expected: f64,
}

impl Light {
    /// Width and height of a box that is larger than the field by three pixels and three diameters, m.
    fn field(&self, diameter: f64) -> [f64; 2] {
        let scale = SET_UP.analyser / SET_UP.axis;
        let wide = (f64::from(self.columns) + 3.0) * 150e-6 / scale + 3.0 * diameter;
        [wide, f64::from(self.rows) * self.row + 3.0 * diameter]
    }

    fn scene(&self, objects: &str) -> Scene {
        let scale = SET_UP.analyser / SET_UP.axis;
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
             [materials.hollow]\nmu = \"0 /m\"\ndelta = 0.0\n{objects}",
            self.columns,
            self.rows,
            self.row * scale,
            offsets.collect::<Vec<_>>().join(", ")
        );
        Scene::from_toml(&text, ".").expect("a scene")
    }

    /// Losses of harmonics behind a scene. `expected`: by twice the wavenumber times delta, rad/m, and the shear, m.
    fn losses(&self, scene: &Scene, expected: &dyn Fn(f64, f64) -> f64) -> [Loss; 2] {
        let stacks = engine(Backend::Bvh).simulate(scene).expect("a run");
        let (rows, columns) = (self.rows as usize, self.columns as usize);
        let scale = SET_UP.analyser / SET_UP.sample_mask;
        [2.0, 3.0].map(|harmonic| {
            // Parts of the ensemble: some rows of a column, their light over the flat.
            let parts = (0..rows / ROWS_OF_PART)
                .flat_map(|part| (0..columns).map(move |column| (part, column)));
            let of_part = |(part, column): (usize, usize)| {
                let own = part * ROWS_OF_PART..(part + 1) * ROWS_OF_PART;
                let sum = |of: &dyn Fn(usize, usize) -> f32| {
                    let light: Vec<f64> = (0..STEPS)
                        .map(|step| own.clone().map(|row| f64::from(of(step, row))).sum())
                        .collect();
                    harmonics(&light, harmonic)
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
            let expected = expected(2.0 * TAU / WAVELENGTH * DELTA, shear);
            Loss { harmonic, found: -contrast.ln(), error, expected }
        })
    }

    /// Compares harmonics, which agree within 3 % and twice the standard error. Between mask steps refraction moves light
    /// at random: that is noise of the first order, which loses weight with the thickness and at higher harmonics.
    fn compare(&self, name: &str, objects: &str, expected: impl Fn(f64, f64) -> f64) -> String {
        let mut lines = String::new();
        for Loss { harmonic, found, error, expected } in
            self.losses(&self.scene(objects), &expected)
        {
            let text = format!(
                "{name}, harmonic {harmonic}: {found:.5} ± {error:.5}, expected {expected:.5}, ratio {:.3}\n",
                found / expected
            );
            assert!((found - expected).abs() < 0.03 * expected + 2.0 * error, "{text}");
            assert!(error < 0.1 * expected, "{text}");
            lines.push_str(&text);
        }
        lines
    }
}

/// A packing of spheres, and the part of it that is seen: rows are half a diameter high.
struct Sample {
    shape: BodyShape,
    diameter: f64,
    fill: f64,
    /// Thickness of the box along the beam, m.
    thickness: f64,
    columns: u32,
    rows: u32,
    seed: u64,
}

impl Sample {
    /// Fraction away from walls, and thickness of a plate of this fraction: centres lie a radius or more from each wall.
    fn inside(&self, scene: &Scene) -> [f64; 2] {
        let object = scene.objects.last().expect("spheres");
        let places = transforms(scene, object).expect("a packing");
        let ends = |axis: usize| {
            let at = places.iter().map(|place| place.position[axis]);
            at.clone().fold(f64::NEG_INFINITY, f64::max) - at.fold(f64::INFINITY, f64::min)
        };
        let [x, y, z] = [0, 1, 2].map(ends);
        let volume = PI / 6.0 * self.diameter.powi(3);
        [places.len() as f64 * volume / (x * y * z), y]
    }

    fn compare(&self) -> String {
        let light = Light { columns: self.columns, rows: self.rows, row: 0.5 * self.diameter };
        let [wide, high] = light.field(self.diameter);
        let (host, material) = match self.shape {
            BodyShape::Voids => {
                let margin = 1e-4;
                let size =
                    [wide, self.thickness, high].map(|side| format!("\"{} m\"", side + margin));
                let host = format!(
                    "[[object]]\nname = \"host\"\nmaterial = \"silica\"\nshape = {{ box = {{ size = [{}] }} }}\n",
                    size.join(", ")
                );
                (host, "hollow")
            }
            BodyShape::Spheres | BodyShape::Cylinders => (String::new(), "silica"),
        };
        let objects = format!(
            "{host}[[object]]\nname = \"spheres\"\nmaterial = \"{material}\"\n\
             shape = {{ sphere = {{ radius = \"{} m\" }} }}\n\
             instances = {{ packing = \"spheres\", fill = {}, seed = {}, \
             region = {{ box = {{ size = [\"{wide} m\", \"{} m\", \"{high} m\"] }} }} }}\n",
            0.5 * self.diameter,
            self.fill,
            self.seed,
            self.thickness
        );
        let [fraction, thickness] = self.inside(&light.scene(&objects));
        let medium = Microstructure::new(self.shape, "silica", self.diameter, fraction);
        let bodies = Bodies::new(&medium);
        let name = format!("{:?} of {} um, fill {}", self.shape, 1e6 * self.diameter, self.fill);
        light.compare(&name, &objects, |phase, shear| thickness * bodies.loss(phase, shear).value)
    }
}

/// A sample for each commit: dense spheres of 5 um; dilute ones and voids, too, with `BEAMLET_ALL`.
#[test]
fn packings_of_spheres_of_5_um_lose_the_contrast_of_their_medium() {
    let samples =
        [(BodyShape::Spheres, 0.3, 2), (BodyShape::Spheres, 0.1, 1), (BodyShape::Voids, 0.3, 5)];
    for (shape, fill, seed) in samples.into_iter().take(amount(1, 3)) {
        let (diameter, thickness) = (5e-6, 1e-3);
        let sample = Sample { shape, diameter, fill, thickness, columns: 3, rows: 24, seed };
        print!("{}", sample.compare());
    }
}

/// Larger spheres and ensembles.
#[test]
#[ignore = "minutes: .ci/long"]
fn packings_of_all_sizes_lose_the_contrast_of_their_medium() {
    let shape = BodyShape::Spheres;
    for (fill, thickness, seed) in [(0.1, 2e-3, 3), (0.3, 1e-3, 4)] {
        for (diameter, factor, columns, rows) in
            [(5e-6, 1.0, 4, 64), (10e-6, 2.0, 8, 64), (50e-6, 4.0, 20, 96)]
        {
            let thickness = factor * thickness;
            let sample = Sample { shape, diameter, fill, thickness, columns, rows, seed };
            print!("{}", sample.compare());
        }
    }
}

/// Parallel fibres along the slits at a fraction of 0.05: the structure function of a cylinder, and discs that exclude one
/// another to first order in their density.
#[test]
fn parallel_fibres_lose_the_contrast_of_their_structure_function() {
    const DIAMETER: f64 = 5e-6;
    const FILL: f64 = 0.05;
    const THICKNESS: f64 = 4e-3;
    // Fibres along the slits are the same in all rows.
    let light = Light { columns: 48, rows: 4, row: 0.5 * DIAMETER };
    let [wide, high] = light.field(DIAMETER);
    let radius = 0.5 * DIAMETER;
    let objects = format!(
        "[[object]]\nname = \"fibres\"\nmaterial = \"silica\"\n\
         shape = {{ cylinder = {{ radius = \"{radius} m\", height = \"{high} m\" }} }}\n\
         instances = {{ packing = \"parallel-fibres\", fill = {FILL}, seed = 3, \
         region = {{ box = {{ size = [\"{wide} m\", \"{THICKNESS} m\", \"{} m\"] }} }} }}\n",
        high + 1e-6
    );
    let scene = light.scene(&objects);
    let places = transforms(&scene, &scene.objects[0]).expect("a packing");
    let ends = |axis: usize| {
        let at = places.iter().map(|place| place.position[axis]);
        at.clone().fold(f64::NEG_INFINITY, f64::max) - at.fold(f64::INFINITY, f64::min)
    };
    let per_length = places.len() as f64 / ends(0);
    let density = per_length / ends(1);
    let lines = light.compare("fibres of 5 um along the slits", &objects, |phase, shear| {
        per_length * (cylinder(radius, phase, shear) + order(radius, phase, shear, density))
    });
    print!("{lines}");
}

/// ∫ [1 − cos(φ(x − Λ/2) − φ(x + Λ/2))] dx of a cylinder, m.
fn cylinder(radius: f64, phase: f64, shear: f64) -> f64 {
    const POINTS: u32 = 200_000;
    let reach = radius + 0.5 * shear;
    let chord = |x: f64| phase * (radius * radius - x * x).max(0.0).sqrt();
    let term = |at: u32| {
        let x = reach * (f64::from(at) + 0.5) / f64::from(POINTS);
        1.0 - (chord(x - 0.5 * shear) - chord(x + 0.5 * shear)).cos()
    };
    2.0 * (0..POINTS).map(term).sum::<f64>() * reach / f64::from(POINTS)
}

/// Change of it by discs that exclude one another, to first order in their number per area and for small phases:
/// ∫ F² (S − 1) (1 − cos qΛ) dq/π from 0, F = ½ phase 2πr J₁(qr)/q, S − 1 = −n π d² 2 J₁(qd)/(qd).
fn order(radius: f64, phase: f64, shear: f64, density: f64) -> f64 {
    const POINTS: u32 = 20_000;
    let step = 100.0 / radius / f64::from(POINTS);
    let term = |at: u32| {
        let q = step * (f64::from(at) + 0.5);
        let form = 0.5 * phase * TAU * radius * libm::j1(q * radius) / q;
        let exclusion = 4.0 * PI * radius * radius * libm::j1(2.0 * q * radius) / (q * radius);
        -density * form * form * exclusion * (1.0 - (q * shear).cos())
    };
    (0..POINTS).map(term).sum::<f64>() * step / PI
}
