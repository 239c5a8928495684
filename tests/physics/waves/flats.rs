//! Light without a sample.

use super::{BY_WAVES, OFFSETS, SET_UPS, flat, simulate, without_distance};
use crate::reference::waves::field::Grid;
use crate::reference::waves::light::Case;
use crate::reference::waves::setup::{Slits, Spot, Window};
use crate::support::{GOLD, Worst, sample};
use crate::thin_masks::{LEAKING, REFERENCE};
use beamlet::Backend;
use beamlet::scene::{Scene, Spot as FocalSpot, SpotPart};

#[test]
fn flats_of_thin_masks_match_fft_within_1e_6() {
    let mut worst = Worst::new("waves, flats of four set-ups", 1e-6);
    for (name, masks) in &SET_UPS {
        let want = flat(masks, &OFFSETS);
        let stacks = simulate(&masks.scene(4, 0.0003, &OFFSETS, BY_WAVES), Backend::Bvh);
        for (step, want) in want.iter().enumerate() {
            for column in 0..4 {
                let got = f64::from(stacks.flat[[step, 0, column]]);
                worst.take(got - want, || format!("{name}, step {step}, {column}: {got} {want}"));
            }
        }
    }
    worst.holds();
}

#[test]
fn flats_of_two_spots_and_leaking_bars_match_fft_within_1e_6() {
    // Share, standard deviation and centre of each part, m.
    let parts = [(0.6, 6e-6, -10e-6), (0.4, 3e-6, 15e-6)];
    let mut scene = LEAKING.scene(3, 0.0003, &OFFSETS, BY_WAVES);
    let fwhm = |sigma: f64| sigma / crate::reference::normal::SIGMA_PER_FWHM;
    let part =
        |(weight, sigma, x): (f64, f64, f64)| SpotPart::new(weight, [fwhm(sigma), 0.0], [x, 0.0]);
    scene.source.spot = FocalSpot::gaussians(parts.map(part).to_vec());
    let mut set_up = LEAKING.set_up();
    set_up.spot = parts.map(|(weight, sigma, centre)| Spot { weight, centre, sigma }).to_vec();
    let slits = Slits::periodic(20e-6, 60e-6, 0).leaking(0.01, 0.0);
    let case = Case { setup: &set_up, slits: Some(&slits), sample: &[], window: LEAKING.window() };
    let want = case.curve(Grid { count: 12_000, spacing: 5e-9, repeats: true }, &OFFSETS);
    let stacks = simulate(&scene, Backend::Bvh);
    let mut worst = Worst::new("waves, flats of two spots", 1e-6);
    for (step, want) in want.iter().enumerate() {
        let got = f64::from(stacks.flat[[step, 0, 1]]);
        worst.take(got - want, || format!("step {step}: {got} {want}"));
    }
    worst.holds();
}

/// Attenuation of 225 um of gold at 30 keV: their bars leak 6.5e-6.
const DEPTH: f64 = 225e-6 * GOLD;

#[test]
fn flats_of_thick_bars_match_fft_with_their_mean_edges_within_1e_5() {
    let metal = "material = \"gold\"\nthickness = \"225 um\"";
    let text = REFERENCE.text(64, 0.0003, &OFFSETS, BY_WAVES).replace("transmission = 0.0", metal);
    let scene = Scene::from_toml(&without_distance(&text), ".").expect("a scene");
    let stacks = simulate(&scene, Backend::Bvh);
    let mut set_up = REFERENCE.set_up();
    // The bars end at the detector.
    set_up.analyser = 1.8 - 112.5e-6;
    let mut worst = Worst::new("waves, thick bars", 1e-5);
    let places = [0_u8, 11, 31, 40, 63].into_iter();
    let places = places.flat_map(|column| OFFSETS.iter().enumerate().map(move |it| (column, it)));
    // Every fourth: each column and each step; all with `BEAMLET_ALL`.
    for (column, (step, &offset)) in sample(places.collect(), 4) {
        // Place of the aperture, and the mean inset of an edge by the shadow of its bar.
        let centre = (f64::from(column) - 31.5) * 100e-6;
        let shadow = |x: f64| 225e-6 * ((centre + x) / 1.2).abs();
        let inset = |x: f64| shadow(x) * (0.5 - 1.0 / DEPTH);
        let [low, high] = [-10e-6, 10e-6];
        let openings = vec![[low + inset(low + offset), high - inset(high + offset)]];
        let slits = Slits { openings, ..Slits::periodic(20e-6, 100e-6, 0) };
        let pixel = 150e-6 * set_up.analyser / 1.8;
        let window = Window::masked(30e-6 - 2.0 * inset(0.0), pixel);
        // Soft edges of both masks blur the curve.
        let mut soft = set_up.clone();
        let more = 2.0 * (shadow(0.0) / DEPTH / soft.source_shift()).powi(2);
        soft.spot[0].sigma = (soft.spot[0].sigma.powi(2) + more).sqrt();
        let case = Case { setup: &soft, slits: Some(&slits), sample: &[], window };
        let grid = Grid { count: 1 << 19, spacing: 100e-6 / 524_288.0, repeats: true };
        let want = case.curve(grid, &[offset])[0];
        let got = f64::from(stacks.flat[[step, 0, usize::from(column)]]);
        worst.take(got - want, || format!("column {column}, step {step}: {got} {want}"));
    }
    worst.holds();
}
