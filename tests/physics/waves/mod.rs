//! Light by waves (`transport = "wave"`) against propagation of fields by FFT in f64.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "numbers of samples")]

mod bodies;
mod facets;
mod flats;
mod grazing;
mod heights;
mod inline;
mod limits;
mod rough;
mod rows;
mod spectra;
mod stacks;

use crate::reference::waves::body::{Body, Outline};
use crate::reference::waves::row::Row;
use crate::support::engine;
use crate::thin_masks::{LARGE_SPOT, LEAKING, Masks, REFERENCE, SMALL_SPOT};
use beamlet::Backend;
use beamlet::scene::{MaterialSpec, Object, Scene, Shape};
use beamlet::stack::Stacks;

const SET_UPS: [(&str, Masks); 4] = [
    ("reference", REFERENCE),
    ("small spot", SMALL_SPOT),
    ("large spot", LARGE_SPOT),
    ("leaking bars", LEAKING),
];

/// Offsets by which edges lie between the samples of the fields.
const OFFSETS: [f64; 7] = [-12e-6, -3e-6, 0.0, 6.665e-6, 13.335e-6, 20e-6, 28e-6];

/// Transport by waves.
const BY_WAVES: &str = "[sampling]\ntransport = \"wave\"\n";

/// Light of the endless mask by FFT on a period.
fn flat(masks: &Masks, offsets: &[f64]) -> Vec<f64> {
    masks.by_fft(&masks.set_up(), offsets, 0.0)
}

/// Pixels of a row behind the periodic mask.
fn row(masks: &Masks, columns: u32) -> Row {
    let [aperture, period] = masks.sample.map(|it| 1e-6 * it);
    Row { columns, window: masks.window(), aperture: Some(aperture), period, leak: masks.leaks[0] }
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
    let mut scene = masks.scene(columns, behind, &OFFSETS, BY_WAVES);
    add_cylinder(&mut scene, centre, radius, matter);
    let stacks = simulate(&scene, Backend::Bvh);
    let own =
        |step| (0..columns as usize).map(|c| f64::from(stacks.sample[[0, step, 0, c]])).collect();
    let mut set_up = masks.set_up();
    set_up.sample = masks.distances[0] + behind;
    let outline = Outline::Cylinder { centre, radius };
    let sample = [Body { outline, delta: matter[0], mu: matter[1] }];
    let pixels = row(masks, columns);
    [(0..OFFSETS.len()).map(own).collect(), pixels.light(&set_up, &sample, 5e-9, &OFFSETS, None)]
}

/// The text of a scene whose detector mask has its default distance.
fn without_distance(text: &str) -> String {
    let (before, after) = text.split_once("[detector_mask]\n").expect("a mask");
    let (_, after) = after.split_once('\n').expect("its distance");
    format!("{before}[detector_mask]\n{after}")
}
