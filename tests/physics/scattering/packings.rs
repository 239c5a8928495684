//! Random packings of real bodies by waves, against the loss of contrast of a material that has their diameter and
//! fraction.

use super::SET_UP;
use super::fluid::Layers;
use crate::support::{amount, engine};
use beamlet::Backend;
use beamlet::internals::instances::transforms;
use beamlet::internals::microstructure::Bodies;
use beamlet::scene::{BodyShape, Microstructure, Scene};
use std::f64::consts::{FRAC_PI_6, PI, TAU};
use std::fmt::Write;
use std::fs;
use std::path::Path;

const STEPS: usize = 20;
/// m.
const PERIOD: f64 = 100e-6;
/// Wavelength times photon energy, m keV.
const HC: f64 = 1.239_841_984e-9;
/// Delta of silica, the bodies or their host, times the square of the photon energy, keV².
const DELTA: f64 = 4.41e-4;
/// Width of a pixel, seen from the sample, m.
const PIXEL: f64 = 150e-6 * SET_UP.axis / SET_UP.analyser;

/// Sum over the steps of a period, turned by a harmonic.
pub(super) fn harmonics(light: &[f64], harmonic: f64) -> [f64; 2] {
    let turn = |step: usize| TAU * harmonic * step as f64 / light.len() as f64;
    let sum = |of: fn(f64) -> f64| {
        light.iter().enumerate().map(|(step, light)| of(turn(step)) * light).sum::<f64>()
    };
    [sum(f64::cos), sum(f64::sin)]
}

/// The part of a sample that is seen. Each pixel is one part of the ensemble.
#[derive(Clone, Copy)]
struct Light {
    columns: u32,
    rows: u32,
    /// Height of a row, seen from the sample, m.
    row: f64,
    /// Photon energy, keV.
    energy: f64,
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
        let wide = (f64::from(self.columns) + 3.0) * PIXEL + 3.0 * diameter;
        [wide, f64::from(self.rows) * self.row + 3.0 * diameter]
    }

    fn scene(&self, objects: &str, directory: &Path) -> Scene {
        let offsets = (0..STEPS)
            .map(|step| format!("\"{} um\"", 1e6 * (step as f64 / STEPS as f64 - 0.5) * PERIOD));
        let text = format!(
            "[source]\ndistance = \"1.21 m\"\nspot = [\"30 um\", \"0 um\"]\nenergy = \"{} keV\"\n\
             [sample_mask]\ndistance = \"1.2 m\"\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
             [detector_mask]\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
             [detector]\ndistance = \"1.8 m\"\npixels = [{}, {}]\npitch = [\"150 um\", \"{} m\"]\n\
             [scan]\nmask_offsets = [{}]\n\
             [sampling]\ntolerance = 1e-2\ntransport = \"wave\"\n\
             [materials.silica]\nmu = \"0 /m\"\ndelta = {}\n\
             [materials.hollow]\nmu = \"0 /m\"\ndelta = 0.0\n{objects}",
            self.energy,
            self.columns,
            self.rows,
            self.row * SET_UP.analyser / SET_UP.axis,
            offsets.collect::<Vec<_>>().join(", "),
            DELTA / self.energy.powi(2)
        );
        Scene::from_toml(&text, directory).expect("a scene")
    }

    /// Losses of the second and the third harmonic behind a scene. `expected`: by twice the wavenumber times delta, rad/m,
    /// and the shear, m.
    fn losses(&self, scene: &Scene, expected: &dyn Fn(f64, f64) -> f64) -> [Loss; 2] {
        let stacks = engine(Backend::Bvh).simulate(scene).expect("a run");
        let (rows, columns) = (self.rows as usize, self.columns as usize);
        let scale = SET_UP.analyser / SET_UP.sample_mask;
        let wavelength = HC / self.energy;
        [2.0, 3.0].map(|harmonic| {
            // Light of a pixel over the flat.
            let of_pixel = |(row, column): (usize, usize)| {
                let sum = |of: &dyn Fn(usize) -> f32| {
                    let light: Vec<f64> = (0..STEPS).map(|step| f64::from(of(step))).collect();
                    harmonics(&light, harmonic)
                };
                let [a, b] = sum(&|step| stacks.sample[[0, step, row, column]]);
                let [c, d] = sum(&|step| stacks.flat[[step, row, column]]);
                let square = c * c + d * d;
                [(a * c + b * d) / square, (b * c - a * d) / square]
            };
            let pixels = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
            let parts: Vec<[f64; 2]> = pixels.map(of_pixel).collect();
            let count = parts.len() as f64;
            let mean = [0, 1].map(|at| parts.iter().map(|part| part[at]).sum::<f64>() / count);
            let contrast = mean[0].hypot(mean[1]);
            // Deviation along the mean.
            let along = |part: &[f64; 2]| (part[0] * mean[0] + part[1] * mean[1]) / contrast;
            let variance = parts.iter().map(|part| (along(part) - contrast).powi(2)).sum::<f64>();
            let error = (variance / (count - 1.0) / count).sqrt() / contrast;
            let shear = wavelength * harmonic / PERIOD * (SET_UP.analyser - SET_UP.axis) / scale;
            let phase = 2.0 * TAU / wavelength * DELTA / self.energy.powi(2);
            Loss { harmonic, found: -contrast.ln(), error, expected: expected(phase, shear) }
        })
    }

    /// Compares harmonics, which agree within 3 % and twice the standard error. Between mask steps refraction moves light
    /// at random: that is noise of the first order, which loses weight with the thickness and at higher harmonics.
    /// `most`: largest standard error of the third harmonic over its loss.
    fn compare(
        &self,
        name: &str,
        scene: &Scene,
        most: f64,
        expected: impl Fn(f64, f64) -> f64,
    ) -> String {
        let mut lines = String::new();
        for Loss { harmonic, found, error, expected } in self.losses(scene, &expected) {
            let text = format!(
                "{name}, harmonic {harmonic}: {found:.5} ± {error:.5}, expected {expected:.5}, ratio {:.3} ± {:.3}\n",
                found / expected,
                error / expected
            );
            assert!((found - expected).abs() < 0.03 * expected + 2.0 * error, "{text}");
            assert!(error < most * expected, "{text}");
            lines.push_str(&text);
        }
        lines
    }
}

/// How spheres come to their places.
#[derive(Debug, Clone, Copy)]
enum Places {
    /// A packing of the scene.
    Packing,
    /// Layers of a Monte Carlo of hard spheres, which a file has.
    Fluid,
}

/// Spheres at random places, and the part of them that is seen: rows are six diameters high.
struct Sample {
    shape: BodyShape,
    places: Places,
    diameter: f64,
    fill: f64,
    /// Thickness of the box along the beam, m; of a fluid about that of its spheres without the gaps between layers.
    thickness: f64,
    columns: u32,
    rows: u32,
    /// Photon energy, keV.
    energy: f64,
    seed: u64,
    /// Largest standard error of the third harmonic over its loss.
    most: f64,
}

/// Bodies of one diameter and their surroundings.
struct Plate {
    scene: Scene,
    fraction: f64,
    /// Length along the beam that has the fraction, m.
    thickness: f64,
}

impl Sample {
    /// Fraction away from walls, and thickness of a plate of this fraction: centres lie a radius or more from each wall.
    fn packed(&self, scene: Scene) -> Plate {
        let object = scene.objects.last().expect("spheres");
        let places = transforms(&scene, object).expect("a packing");
        let ends = |axis: usize| {
            let at = places.iter().map(|place| place.position[axis]);
            at.clone().fold(f64::NEG_INFINITY, f64::max) - at.fold(f64::INFINITY, f64::min)
        };
        let [x, y, z] = [0, 1, 2].map(ends);
        let volume = FRAC_PI_6 * self.diameter.powi(3);
        let fraction = places.len() as f64 * volume / (x * y * z);
        Plate { scene, fraction, thickness: y }
    }

    /// The scene of a light, whose tables are in a folder.
    fn plate(&self, light: Light, folder: &Path) -> Plate {
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
             shape = {{ sphere = {{ radius = \"{} m\" }} }}\n",
            0.5 * self.diameter
        );
        match self.places {
            Places::Packing => {
                let instances = format!(
                    "instances = {{ packing = \"spheres\", fill = {}, seed = {}, \
                     region = {{ box = {{ size = [\"{wide} m\", \"{} m\", \"{high} m\"] }} }} }}\n",
                    self.fill, self.seed, self.thickness
                );
                self.packed(light.scene(&(objects + &instances), folder))
            }
            Places::Fluid => {
                let field = [wide, high].map(|side| side / self.diameter);
                let layers =
                    Layers::new(self.fill, self.thickness / self.diameter, field, self.seed);
                let mut rows = String::from("x_m,y_m,z_m\n");
                for place in &layers.places {
                    let [x, y, z] = place.map(|at| at * self.diameter);
                    writeln!(rows, "{x:e},{y:e},{z:e}").expect("a text");
                }
                fs::write(folder.join("places.csv"), rows).expect("a table");
                let scene = light.scene(&(objects + "instances = \"places.csv\"\n"), folder);
                let thickness = layers.thickness * self.diameter;
                Plate { scene, fraction: self.fill, thickness }
            }
        }
    }

    fn compare(&self) -> String {
        let Self { columns, rows, energy, .. } = *self;
        let light = Light { columns, rows, row: 6.0 * self.diameter, energy };
        let folder = tempfile::tempdir().expect("a folder");
        let Plate { scene, fraction, thickness } = self.plate(light, folder.path());
        let medium = Microstructure::new(self.shape, "silica", self.diameter, fraction);
        let bodies = Bodies::new(&medium);
        let name = format!(
            "{:?} of {} um, {:?}, {columns} x {rows} pixels, fraction {fraction:.3}",
            self.shape,
            1e6 * self.diameter,
            self.places
        );
        light.compare(&name, &scene, self.most, |phase, shear| {
            thickness * bodies.loss(phase, shear).value
        })
    }
}

/// Spheres of 5 um in a plate that loses about half of the contrast of the third harmonic at 15 keV; more of them with
/// `BEAMLET_ALL`.
fn thin(shape: BodyShape, places: Places, fill: f64, thickness: f64) -> Sample {
    let (columns, rows, most) = amount((3, 3, 0.06), (4, 12, 0.03));
    let (diameter, energy, seed) = (5e-6, 15.0, 2);
    Sample { shape, places, diameter, fill, thickness, columns, rows, energy, seed, most }
}

/// For each commit dense spheres of a Monte Carlo, and a packing; dilute ones and voids, too, with `BEAMLET_ALL`.
#[test]
fn packings_of_spheres_of_5_um_lose_the_contrast_of_their_medium() {
    let samples = [
        thin(BodyShape::Spheres, Places::Fluid, 0.5, 120e-6),
        thin(BodyShape::Spheres, Places::Packing, 0.3, 150e-6),
        thin(BodyShape::Spheres, Places::Packing, 0.1, 400e-6),
        thin(BodyShape::Voids, Places::Packing, 0.3, 150e-6),
    ];
    for sample in samples.into_iter().take(amount(2, 4)) {
        print!("{}", sample.compare());
    }
}

/// Larger spheres and ensembles.
#[test]
#[ignore = "minutes: .ci/long"]
fn packings_of_all_sizes_lose_the_contrast_of_their_medium() {
    let fills = [
        (Places::Packing, 0.1, 400e-6),
        (Places::Packing, 0.3, 150e-6),
        (Places::Fluid, 0.5, 120e-6),
    ];
    for (diameter, factor, columns, rows, energy) in
        [(5e-6, 1.0, 4, 12, 15.0), (10e-6, 1.6, 6, 12, 15.0), (50e-6, 24.0, 20, 50, 30.0)]
    {
        for (places, fill, thickness) in fills {
            let of_fill = thin(BodyShape::Spheres, places, fill, factor * thickness);
            let sample = Sample { diameter, columns, rows, energy, seed: 4, most: 0.04, ..of_fill };
            print!("{}", sample.compare());
        }
    }
}

/// Parallel fibres at a fraction of 0.05. Along the slits: the structure function of a cylinder, and discs that exclude one
/// another to first order in their density. Across the slits phases do not change along x, and nothing is lost.
#[test]
fn parallel_fibres_lose_the_contrast_of_their_structure_function() {
    const DIAMETER: f64 = 5e-6;
    const FILL: f64 = 0.05;
    const THICKNESS: f64 = 0.5e-3;
    // Fibres along the slits are the same in all rows.
    let light = Light { columns: 300, rows: 1, row: 2e-6, energy: 15.0 };
    let [wide, high] = light.field(DIAMETER);
    let radius = 0.5 * DIAMETER;
    let objects = |across: f64, along: f64| {
        format!(
            "[[object]]\nname = \"fibres\"\nmaterial = \"silica\"\n\
             shape = {{ cylinder = {{ radius = \"{radius} m\", height = \"{along} m\" }} }}\n\
             instances = {{ packing = \"parallel-fibres\", fill = {FILL}, seed = 3, \
             region = {{ box = {{ size = [\"{across} m\", \"{THICKNESS} m\", \"{} m\"] }} }} }}\n",
            along + 1e-6
        )
    };
    let scene = light.scene(&objects(wide, high), Path::new("."));
    let places = transforms(&scene, &scene.objects[0]).expect("a packing");
    let ends = |axis: usize| {
        let at = places.iter().map(|place| place.position[axis]);
        at.clone().fold(f64::NEG_INFINITY, f64::max) - at.fold(f64::INFINITY, f64::min)
    };
    let per_length = places.len() as f64 / ends(0);
    let density = per_length / ends(1);
    let expected = |phase: f64, shear: f64| {
        per_length * (cylinder(radius, phase, shear) + order(radius, phase, shear, density))
    };
    print!("{}", light.compare("fibres of 5 um along the slits", &scene, 0.04, expected));

    let light = Light { columns: 3, rows: 4, row: 20e-6, energy: 15.0 };
    let [wide, high] = light.field(DIAMETER);
    let turned = objects(high, wide) + "rotate = [{ axis = [0, 1, 0], angle = \"90 deg\" }]\n";
    let scene = light.scene(&turned, Path::new("."));
    for Loss { harmonic, found, expected, .. } in light.losses(&scene, &expected) {
        println!("across the slits, harmonic {harmonic}: {found:.5}, {expected:.5} along them");
        assert!(found.abs() < 0.01 * expected, "{harmonic}: {found}");
    }
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
