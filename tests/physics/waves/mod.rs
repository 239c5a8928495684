//! Light by waves (`transport = "wave"`) against propagation of fields by FFT in f64.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "numbers of samples")]

mod bodies;
mod flats;
mod limits;
mod refused;
mod rows;
mod spectra;

use crate::reference::normal::SIGMA_PER_FWHM;
use crate::reference::waves::body::{Body, Outline};
use crate::reference::waves::field::Grid;
use crate::reference::waves::light::Case;
use crate::reference::waves::row::Row;
use crate::reference::waves::setup::{Setup, Slits, Window};
use crate::support::engine;
use beamlet::Backend;
use beamlet::scene::{MaterialSpec, Object, Scene, Shape};
use beamlet::stack::Stacks;

/// Set-up with thin masks: energy (keV), distances source to mask to detector (m), FWHM of the spot, aperture and
/// period of the sample mask, aperture of the detector mask, pixel (um), and light that the bars of both masks
/// transmit.
struct Masks {
    energy: f64,
    distances: [f64; 2],
    spot: f64,
    sample: [f64; 2],
    detector: [f64; 2],
    leaks: [f64; 2],
}

/// The set-up of the reference values.
const REFERENCE: Masks = Masks {
    energy: 30.0,
    distances: [1.2, 0.6],
    spot: 30.0,
    sample: [20.0, 100.0],
    detector: [30.0, 150.0],
    leaks: [0.0; 2],
};
/// Fringes wider than the blur.
const SMALL_SPOT: Masks = Masks {
    energy: 20.0,
    distances: [0.5, 0.5],
    spot: 5.0,
    sample: [15.0, 31.0],
    detector: [20.0, 62.0],
    leaks: [0.0; 2],
};
/// Short periods and a large spot.
const LARGE_SPOT: Masks = Masks {
    energy: 21.0,
    distances: [1.6, 0.4],
    spot: 70.0,
    sample: [12.0, 40.0],
    detector: [20.0, 50.0],
    leaks: [0.0; 2],
};
/// The same with apertures far apart.
const LONE: Masks = Masks { sample: [12.0, 400.0], detector: [20.0, 500.0], ..LARGE_SPOT };
/// Near neighbours, and bars that transmit.
const LEAKING: Masks = Masks {
    energy: 25.0,
    distances: [1.2, 0.6],
    spot: 30.0,
    sample: [20.0, 60.0],
    detector: [30.0, 90.0],
    leaks: [0.01, 0.02],
};

const SET_UPS: [(&str, Masks); 4] = [
    ("reference", REFERENCE),
    ("small spot", SMALL_SPOT),
    ("large spot", LARGE_SPOT),
    ("leaking bars", LEAKING),
];

/// Offsets by which edges lie between the samples of the fields.
const OFFSETS: [f64; 7] = [-12e-6, -3e-6, 0.0, 6.665e-6, 13.335e-6, 20e-6, 28e-6];

impl Masks {
    /// Scene of `columns` pixels whose sample lies `behind` the mask (m).
    fn scene(&self, columns: u32, behind: f64, offsets: &[f64]) -> Scene {
        Scene::from_toml(&self.text(columns, behind, offsets), ".").expect("a scene")
    }

    fn text(&self, columns: u32, behind: f64, offsets: &[f64]) -> String {
        let Self { energy, distances: [near, far], spot, sample, detector, leaks } = self;
        let steps: Vec<String> = offsets.iter().map(|it| format!("\"{} um\"", 1e6 * it)).collect();
        format!(
            "[source]\ndistance = \"{} m\"\nspot = \"{spot} um\"\nenergy = \"{energy} keV\"\n\
             [detector]\ndistance = \"{} m\"\npixels = [{columns}, 1]\npitch = \"{} um\"\n\
             [sample_mask]\ndistance = \"{near} m\"\naperture = \"{} um\"\nperiod = \"{} um\"\n\
             transmission = {:?}\n\
             [detector_mask]\ndistance = \"{1} m\"\naperture = \"{} um\"\ntransmission = {:?}\n\
             [scan]\nmask_offsets = [{}]\n[sampling]\ntransport = \"wave\"\n",
            near + behind,
            near + far,
            detector[1],
            sample[0],
            sample[1],
            leaks[0],
            detector[0],
            leaks[1],
            steps.join(", ")
        )
    }

    fn set_up(&self) -> Setup {
        Setup::new(self.energy, self.distances, 1e-6 * self.spot * SIGMA_PER_FWHM)
    }

    fn window(&self) -> Window {
        let [aperture, pixel] = self.detector.map(|it| 1e-6 * it);
        Window { aperture, pixel, leak: self.leaks[1] }
    }

    /// Light of the endless mask by FFT on a period.
    fn flat(&self, offsets: &[f64]) -> Vec<f64> {
        let [aperture, period] = self.sample.map(|it| 1e-6 * it);
        let slits = Slits::periodic(aperture, period, 0).leaking(self.leaks[0], 0.0);
        let set_up = self.set_up();
        let case = Case { setup: &set_up, slits: Some(&slits), sample: &[], window: self.window() };
        let spacing = 5e-9;
        case.curve(
            Grid { count: (period / spacing).round() as usize, spacing, repeats: true },
            offsets,
        )
    }

    /// Pixels of a row behind the periodic mask.
    fn row(&self, columns: u32) -> Row {
        let [aperture, period] = self.sample.map(|it| 1e-6 * it);
        Row {
            columns,
            window: self.window(),
            aperture: Some(aperture),
            period,
            leak: self.leaks[0],
        }
    }
}

fn simulate(scene: &Scene, backend: Backend) -> Stacks {
    engine(backend).simulate(scene).expect("stacks")
}

/// Adds a cylinder along z: x of its axis and its radius (m).
fn add_cylinder(scene: &mut Scene, centre: f64, radius: f64, [delta, mu]: [f64; 2]) {
    scene.materials.insert("matter".into(), MaterialSpec::Constants { mu, delta });
    let shape = Shape::Cylinder { radius, height: 4e-3, sides: None };
    let mut object = Object::new("cylinder", shape, "matter");
    object.placement.position = [centre, 0.0, 0.0];
    scene.objects.push(object);
}

/// Carbon at 30 keV: decrement, and attenuation in 1/m.
const FIBRE: [f64; 2] = [4.61e-7, 51.2];

/// Light of a row behind a cylinder by the engine and by FFT, `[offset][column]`.
fn both(
    masks: &Masks,
    columns: u32,
    behind: f64,
    (centre, radius, matter): (f64, f64, [f64; 2]),
) -> [Vec<Vec<f64>>; 2] {
    let mut scene = masks.scene(columns, behind, &OFFSETS);
    add_cylinder(&mut scene, centre, radius, matter);
    let stacks = simulate(&scene, Backend::Bvh);
    let own =
        |step| (0..columns as usize).map(|c| f64::from(stacks.sample[[0, step, 0, c]])).collect();
    let mut set_up = masks.set_up();
    set_up.sample = masks.distances[0] + behind;
    let outline = Outline::Cylinder { centre, radius };
    let sample = [Body { outline, delta: matter[0], mu: matter[1] }];
    let row = masks.row(columns);
    [(0..OFFSETS.len()).map(own).collect(), row.light(&set_up, &sample, 5e-9, &OFFSETS, None)]
}

/// The text of a scene whose detector mask has its default distance.
fn without_distance(text: &str) -> String {
    let (before, after) = text.split_once("[detector_mask]\n").expect("a mask");
    let (_, after) = after.split_once('\n').expect("its distance");
    format!("{before}[detector_mask]\n{after}")
}
