//! Edges off the rotation centre: the bound that a run reports holds the error of its stacks, against light
//! through slits and past an edge in closed form, summed over points of the spot in f64.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use crate::support::{Checked, engine};
use beamlet::Backend;
use beamlet::check::Check;
use beamlet::scene::Scene;
use beamlet::stack::Stacks;

/// A thin plate of gold, whose right edge lies at [`EDGE`] across the beam; `@` is its place along it.
const BARE: &str = r#"
[source]
distance = "1 m"
spot = ["100 um", "0 um"]
energy = "30 keV"
[detector]
distance = "1.5 m"
pixels = [16, 1]
pitch = "100 um"
[scan]
mask_offsets = ["0 um"]
angles = ["0 deg"]
[[object]]
name = "plate"
shape = { box = { size = ["8 mm", "20 um", "10 mm"] } }
material = "gold"
position = ["-3.998 mm", "-150 mm", "0 mm"]
"#;

const MASKED: &str = r#"
[source]
distance = "1.21 m"
spot = ["80 um", "0 um"]
energy = "30 keV"
[detector]
distance = "1.8 m"
pixels = [16, 1]
pitch = "150 um"
[sample_mask]
distance = "1.2 m"
transmission = 0.0
projected_aperture = "30 um"
[detector_mask]
distance = "1.78 m"
transmission = 0.0
projected_aperture = "30 um"
[scan]
mask_offsets = { from = "-20 um", to = "20 um", count = 5 }
angles = ["0 deg"]
[[object]]
name = "plate"
shape = { box = { size = ["8 mm", "10 um", "10 mm"] } }
material = "gold"
position = ["-3.956 mm", "100 mm", "0 mm"]
"#;

fn scene(text: &str) -> Scene {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scene.toml");
    std::fs::write(&path, text).unwrap();
    Scene::load(&path).unwrap()
}

/// Set-up in f64: what follows from the text of the scenes above.
struct Plate {
    rotation: f64,
    detector: f64,
    pitch: f64,
    sigma: f64,
    /// Distance and aperture of the masks.
    masks: Option<[[f64; 2]; 2]>,
    /// Place of the edge along and across the beam.
    edge: [f64; 2],
    /// Light that the plate lets through.
    passes: f64,
}

impl Plate {
    /// Light of a pixel at an offset of the sample mask.
    fn light(&self, column: u32, offset: f64) -> f64 {
        let centre = (f64::from(column) + 0.5 - 8.0) * self.pitch;
        let points = 2000_i32;
        let mut sum = 0.0;
        let mut shares = 0.0;
        for point in -points..=points {
            let t = 6.0 * f64::from(point) / f64::from(points);
            let share = (-0.5 * t * t).exp();
            shares += share;
            let source = t * self.sigma;
            // Places on the detector, from a point of the source through a place at a distance.
            let seen = |x: f64, at: f64| source + (x - source) * self.detector / at;
            let mut open = [centre - 0.5 * self.pitch, centre + 0.5 * self.pitch];
            for (index, [at, aperture]) in self.masks.into_iter().flatten().enumerate() {
                let middle = centre * at / self.detector + if index == 0 { offset } else { 0.0 };
                open[0] = open[0].max(seen(middle - 0.5 * aperture, at));
                open[1] = open[1].min(seen(middle + 0.5 * aperture, at));
            }
            let edge = seen(self.edge[1], self.rotation + self.edge[0]);
            let length = |low: f64, high: f64| (high - low).max(0.0);
            let behind = length(open[0], open[1].min(edge));
            sum += share * (length(open[0].max(edge), open[1]) + self.passes * behind) / self.pitch;
        }
        sum / shares
    }

    /// Largest error of a stack.
    fn error(&self, scene: &Scene, stacks: &Stacks) -> f64 {
        let mut largest = 0.0_f64;
        for (step, offset) in scene.scan.mask_offsets.iter().enumerate() {
            // The plate ends beyond the detector on one side: the first columns lie behind it.
            for column in 2..14 {
                let value = f64::from(stacks.sample[[0, step, 0, column as usize]]);
                largest = largest.max((value - self.light(column, *offset)).abs());
            }
        }
        largest
    }
}

const FWHM: f64 = 2.354_820_045;

fn plates(engine: &Checked) -> [(Scene, Plate, Stacks); 2] {
    let gold = 53_122.0_f64;
    let bare = Plate {
        rotation: 1.0,
        detector: 1.5,
        pitch: 100e-6,
        sigma: 100e-6 / FWHM,
        masks: None,
        edge: [-0.15, 2e-6],
        passes: (-gold * 20e-6).exp(),
    };
    let aperture = |at: f64| [at, 30e-6 * at / 1.8];
    let masked = Plate {
        rotation: 1.21,
        detector: 1.8,
        pitch: 150e-6,
        sigma: 80e-6 / FWHM,
        masks: Some([aperture(1.2), aperture(1.78)]),
        edge: [0.1, 44e-6],
        passes: (-gold * 10e-6).exp(),
    };
    [(BARE, bare), (MASKED, masked)].map(|(text, plate)| {
        let scene = scene(text);
        let stacks = engine.simulate(&scene).unwrap();
        (scene, plate, stacks)
    })
}

#[test]
fn errors_of_edges_off_the_rotation_centre_are_within_their_bound() {
    let engine = engine(Backend::Bvh);
    for (scene, plate, stacks) in plates(&engine) {
        let error = plate.error(&scene, &stacks);
        let recorded = stacks.record.edge_error.unwrap();
        println!("measured edges: {error:.2e} true, {recorded:.2e} recorded");
        assert!(error > 1e-3, "{error}");
        // Plates let a third and a half of the light through.
        assert!((1.0..3.0).contains(&(recorded / error)), "{recorded} of {error}");
        let report = Check::of(&scene).with_engine(&engine).run().unwrap();
        let warned = report.warnings.iter().any(|text| text.contains("\"plate\""));
        assert!(warned, "{:?}", report.warnings);
        assert!((report.edges.unwrap().error - recorded).abs() < 1e-9);
    }
}

#[test]
fn edges_at_the_rotation_centre_are_right_and_warn_of_nothing() {
    let engine = engine(Backend::Bvh);
    for ((mut scene, mut plate, _), y) in plates(&engine).into_iter().zip([0.0, 2e-5]) {
        scene.objects[0].placement.position[1] = y;
        plate.edge[0] = y;
        let stacks = engine.simulate(&scene).unwrap();
        let error = plate.error(&scene, &stacks);
        // Ends of the plate's faces lie 10 um before and behind its middle: 1e-5 of the blur.
        assert!(error < 1e-4, "{error}");
        assert!(stacks.record.edge_error.unwrap() < 1e-4);
        let warnings = Check::of(&scene).with_engine(&engine).run().unwrap().warnings;
        assert!(
            warnings.iter().all(|text| !text.contains("the blur by the focal spot")),
            "{warnings:?}"
        );
    }
}
