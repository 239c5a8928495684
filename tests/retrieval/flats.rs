//! Flats and darks that a simulated scan has between its views are interpolated by retrieval.

use crate::support::engine;
use beamlet::retrieve::Input;
use beamlet::scene::Scene;
use beamlet::stack::{Format, OpenRun, RunDirectory, StackFile};
use beamlet::{Backend, Control};
use ndarray::{Array3, Axis};

/// A source that loses 3 % of its light in each of 6 views.
const SCENE: &str = r#"
[source]
distance = "1.2 m"
spot = "20 um"
energy = "30 keV"
[detector]
distance = "1.8 m"
pixels = [6, 2]
pitch = "150 um"
photons = 1000
electronic_noise = 40
offset = 300
[sample_mask]
distance = "1.1 m"
projected_aperture = "30 um"
transmission = 0.0
[detector_mask]
distance = "1.8 m"
projected_aperture = "30 um"
transmission = 0.0
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 5 }
angles = { from = "0 deg", to = "360 deg", count = 6 }
errors = { intensities = LIGHT }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.3 mm", height = "5 mm" } }
material = "polyethylene"
"#;
const VIEWS: usize = 6;

fn scene(flats_every: u32, darks_every: u32) -> Scene {
    let light: Vec<Vec<f64>> = (0..VIEWS).map(|view| vec![1.0 - 0.03 * view as f64; 5]).collect();
    let mut scene = Scene::from_toml(&SCENE.replace("LIGHT", &format!("{light:?}")), ".").unwrap();
    (scene.scan.flats_every, scene.scan.darks_every) = (Some(flats_every), Some(darks_every));
    scene
}

fn run(scene: &Scene, to: &std::path::Path) -> OpenRun {
    let mut sink = RunDirectory::create(to, Format::Npy, false).unwrap();
    engine(Backend::Bvh).run(scene, &mut sink, Control::default()).unwrap();
    OpenRun::open(to).unwrap()
}

/// Index of the flat or dark before a view, and the share of the next: taken before these views.
fn between(places: &[usize], view: usize) -> (usize, f64) {
    // The last is as the last view.
    let of = |index: usize| places[index].min(VIEWS - 1) as f64;
    let last = places.len() - 1;
    let before = (0..last).rev().find(|index| places[*index] <= view).unwrap();
    match of(last) <= view as f64 {
        true => (last, 0.0),
        false => (before, (view as f64 - of(before)) / (of(before + 1) - of(before))),
    }
}

/// Dark at a view or flat by f64 arithmetic, `[row][column]` of step 0.
fn dark(stack: &StackFile, places: &[usize], view: usize) -> Array3<f64> {
    let mean = |index: usize| {
        let frames = stack.view(index).unwrap().mapv(f64::from);
        frames.mean_axis(Axis(0)).unwrap().insert_axis(Axis(0))
    };
    let (before, share) = between(places, view);
    match share > 0.0 {
        true => mean(before) * (1.0 - share) + mean(before + 1) * share,
        false => mean(before),
    }
}

#[test]
fn flats_and_darks_are_interpolated_between_their_views() {
    let place = tempfile::tempdir().unwrap();
    let run = run(&scene(4, 2), &place.path().join("run"));
    let (flats, darks) = ([0, 4, 6], [0, 2, 4, 6]);
    let sources = [run.counts_flat(), run.counts_sample(), run.dark()];
    let [of_flats, of_sample, of_darks] = sources.map(|stack| stack.unwrap().unwrap());
    let input = Input::of_run(&run, true).unwrap();
    let near = |found: Array3<f32>, wanted: &Array3<f64>, what: &str| {
        for (at, wanted) in wanted.indexed_iter() {
            // Numbers of 300 to 1400 in f32: 1e-4.
            assert!((f64::from(found[at]) - wanted).abs() < 1e-3, "{what} at {at:?}");
        }
    };
    for view in 0..VIEWS {
        let sample = of_sample.view(view).unwrap().mapv(f64::from) - dark(&of_darks, &darks, view);
        near(input.sample_rows(view, 0..2).unwrap(), &sample, "sample");
        let flat = |index: usize| {
            let view = flats[index].min(VIEWS - 1);
            of_flats.view(index).unwrap().mapv(f64::from) - dark(&of_darks, &darks, view)
        };
        let (before, share) = between(&flats, view);
        let flat = match share > 0.0 {
            true => flat(before) * (1.0 - share) + flat(before + 1) * share,
            false => flat(before),
        };
        near(input.flat_rows(view, 0..2).unwrap(), &flat, "flat");
        // A band alone has the same dark.
        let part = flat.slice_axis(Axis(1), (1..2).into()).to_owned();
        near(input.flat_rows(view, 1..2).unwrap(), &part, "second row of the flat");
    }
}
