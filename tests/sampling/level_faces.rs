//! Opaque bodies whose level faces lie within a degree of the beam: a face towards the source reflects all of its light
//! off the detector, the other one lies in the shadow. A row has the light that the corners of the bodies leave open.

use crate::support::engine;
use beamlet::Backend;
use beamlet::scene::{Object, Placement, Scene, Shape};

/// Largest deviation, share of open beam: an edge between two lines, a tenth of the tolerance.
const APART: f64 = 1e-4;
const SOURCE: f64 = 1.2;
const DETECTOR: f64 = 1.8;
const PITCH: f64 = 50e-6;
const ROWS: u32 = 6;
/// Tilt of the faces, rad.
const TILT: f64 = 0.06 / 180.0 * std::f64::consts::PI;

/// Sections of boxes in the plane of y and z: depth and height, and the heights of their centres, m.
struct Boxes {
    size: [f64; 2],
    heights: &'static [f64],
}

impl Boxes {
    /// Shares of the rows that the projected corners leave open.
    fn open(&self) -> Vec<f64> {
        let [depth, height] = self.size.map(|size| 0.5 * size);
        let (sin, cos) = TILT.sin_cos();
        let shadow = |centre: &f64| {
            let corner = |[y, z]: [f64; 2]| {
                let along = SOURCE + y * cos - z * sin;
                (centre + y * sin + z * cos) * DETECTOR / along
            };
            let corners = [[-depth, -height], [-depth, height], [depth, -height], [depth, height]];
            let ends = corners.map(corner);
            let low = ends.into_iter().fold(f64::INFINITY, f64::min);
            [low, ends.into_iter().fold(f64::NEG_INFINITY, f64::max)]
        };
        let shadows: Vec<[f64; 2]> = self.heights.iter().map(shadow).collect();
        let row = |row: u32| {
            let top = (0.5 * f64::from(ROWS) - f64::from(row)) * PITCH;
            let dark = |[low, high]: &[f64; 2]| (high.min(top) - low.max(top - PITCH)).max(0.0);
            1.0 - shadows.iter().map(dark).sum::<f64>() / PITCH
        };
        (0..ROWS).map(row).collect()
    }

    fn scene(&self, material: &str, energy: &str, masks: &str) -> Scene {
        let text = format!(
            "[source]\ndistance = \"{SOURCE} m\"\nspot = [\"20 um\", \"0 um\"]\nenergy = \"{energy}\"\n\
             [detector]\ndistance = \"{DETECTOR} m\"\npixels = [4, {ROWS}]\npitch = \"50 um\"\n{masks}"
        );
        let mut scene = Scene::from_toml(&text, std::path::Path::new(".")).expect("a scene");
        scene.objects = (0..)
            .zip(self.heights)
            .map(|(number, height)| {
                let size = [4e-3, self.size[0], self.size[1]];
                let mut object =
                    Object::new(format!("box {number}"), Shape::Box { size }, material);
                let rotate = vec![([1.0, 0.0, 0.0], TILT)];
                object.placement =
                    Placement { rotate, position: [0.0, 0.0, *height], ..object.placement };
                object
            })
            .collect();
        scene
    }
}

#[test]
fn level_faces_of_opaque_bodies_leave_open_what_their_corners_do() {
    let masks = "[sample_mask]\ndistance = \"1.15 m\"\ntransmission = 0\nprojected_aperture = \"20 um\"\n\
        [detector_mask]\ntransmission = 0\nprojected_aperture = \"30 um\"\n\
        [scan]\nmask_offsets = [\"-8 um\", \"0 um\", \"5 um\"]\n";
    let block = Boxes { size: [20e-3, 1e-3], heights: &[-0.4885e-3] };
    let foils = Boxes { size: [1e-3, 20e-6], heights: &[-61e-6, 3e-6, 55e-6] };
    let engine = engine(Backend::Bvh);
    for (name, boxes, [material, energy]) in [
        ("block", &block, ["aluminium", "12 keV"]),
        ("foils of gold", &foils, ["gold", "30 keV"]),
        ("foils of tungsten", &foils, ["tungsten", "30 keV"]),
        ("foils of iron", &foils, ["iron", "12 keV"]),
    ] {
        for (design, masks) in [("masks", masks), ("no masks", "")] {
            let stacks = engine.simulate(&boxes.scene(material, energy, masks)).expect("a run");
            let open = boxes.open();
            let mut worst: (f64, String) = (0.0, String::new());
            for ((view, step, row, column), light) in stacks.sample.indexed_iter() {
                let expected = f64::from(stacks.flat[[step, row, column]]) * open[row];
                let apart = (f64::from(*light) - expected).abs();
                if apart > worst.0 {
                    let place = format!("view {view} step {step} row {row} column {column}");
                    worst = (apart, format!("{place}: {light} for {expected}"));
                }
            }
            println!("measured level faces, {name}, {design}: {:.1e} at {}", worst.0, worst.1);
            assert!(worst.0 < APART, "{name}, {design}: {} at {}", worst.0, worst.1);
        }
    }
}
