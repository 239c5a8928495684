//! Random stacks of fibres: dark field by waves and by rays.

use super::super::body::{Body, Outline, bodies, stack};
use super::super::light::{Case, transform};
use super::super::rays;
use super::super::setup::Slits;
use super::{APERTURE, all_close, close, empty, setup};
use crate::fit::fit;
use crate::waves::field::Grid;
use rayon::prelude::*;
use rustfft::num_complex::Complex;
use std::f64::consts::{PI, TAU};

const RADIUS: f64 = 2.5e-6;
const DELTA: f64 = 4.61e-7;
/// Effective distance, m.
const DISTANCE: f64 = 0.4;

/// Offsets every 5 um, m.
fn offsets() -> Vec<f64> {
    (-9..=9).map(|i| f64::from(i) * 5e-6).collect()
}

/// A curve of each stack of fibres at random places that rays cross `crossings` times in the mean.
fn curves(crossings: f64, stacks: u64, curve: impl Fn(&Case<'_>) -> Vec<f64> + Sync) -> Vec<f64> {
    let (setup, slits) = (setup(), Slits::one(APERTURE));
    let (low, high) = (-65e-6, 65e-6);
    let count = (crossings * (high - low) / (2.0 * RADIUS)).round() as u32;
    let of = |seed| {
        let sample = bodies(&stack(count, RADIUS, [low, high], seed), DELTA, 0.0);
        curve(&Case { sample: &sample, ..empty(&setup, &slits) })
    };
    let all: Vec<Vec<f64>> = (0..stacks).into_par_iter().map(of).collect();
    let mean = |i: usize| all.iter().map(|curve| curve[i]).sum::<f64>() / stacks as f64;
    (0..offsets().len()).map(mean).collect()
}

/// Structure function of rays of a cylinder: 2r (1 − A K₁(A)), A = 2kδΛ.
fn structure_of_rays(radius: f64, shear: f64) -> f64 {
    let a = 2.0 * setup().wavenumber() * DELTA * shear;
    // K₁ = ∫ exp(−A cosh s) cosh s ds.
    let (top, count) = ((60.0 / a).ln() + 1.0, 2000);
    let step = top / f64::from(count);
    let term = |i| ((f64::from(i) + 0.5) * step).cosh();
    let bessel = (0..count).map(|i| (-a * term(i)).exp() * term(i)).sum::<f64>() * step;
    2.0 * radius * (1.0 - a * bessel)
}

/// Curve of rays expected over stacks: the transform of the flat times exp(−nD).
fn expected_of_rays(density: f64) -> Vec<f64> {
    let setup = setup();
    let blur = setup.spot[0].sigma * setup.source_shift();
    let step = 200.0;
    let frequencies = (0..1000).map(|i| (f64::from(i) + 0.5) * step);
    let terms: Vec<[f64; 2]> = frequencies
        .map(|f| {
            let shear = setup.wavelength * DISTANCE * f;
            let scatter = -density * structure_of_rays(RADIUS, shear);
            let aperture = (PI * f * APERTURE).sin() / (PI * f);
            [f, (scatter - 2.0 * (PI * f * blur).powi(2)).exp() * aperture * aperture]
        })
        .collect();
    let light = |offset: f64| {
        let sum: f64 = terms.iter().map(|[f, term]| 2.0 * term * (TAU * f * offset).cos()).sum();
        sum * step / 100e-6
    };
    offsets().into_iter().map(light).collect()
}

/// Width σ² of a fit to the seven steps from −30 to 30 um, m².
fn fitted(curve: &[f64]) -> f64 {
    let seven =
        |values: &[f64]| values.iter().skip(3).step_by(2).take(7).copied().collect::<Vec<_>>();
    fit(&seven(&offsets()), &seven(curve))[2].powi(2)
}

/// −ln of the ratio of the transforms at `f` behind a stack and of the flat curve: nD.
fn scatter(sample: &[f64], flat: &[f64]) -> f64 {
    // 1/(2πσ) of the flat curve.
    let f = 1.0 / (TAU * 9.2e-6);
    -(transform(&offsets(), sample, f) / transform(&offsets(), flat, f)).norm().ln()
}

#[test]
fn rays_behind_stacks_scatter_as_their_structure_function_within_2_percent() {
    let crossings = 50.0;
    let density = crossings / (2.0 * RADIUS);
    let rays = curves(crossings, 64, |case| rays::curve(case, 1e-4, 24, &offsets()));
    let got = scatter(&rays, &expected_of_rays(0.0));
    let shear = setup().wavelength * DISTANCE / (TAU * 9.2e-6);
    // 64 stacks have a standard error of 1 %.
    close(got / (density * structure_of_rays(RADIUS, shear)), 1.0, 0.02);
    // The mean curve is 0.018 below the flat one in the middle.
    all_close(&rays, &expected_of_rays(density), 6e-4);
}

#[test]
fn dark_field_of_fibres_by_waves_is_half_of_rays() {
    let offsets = offsets();
    // Half of the spacing changes ratios by 2e-4.
    let grid = Grid { count: 1 << 12, spacing: 40e-9, repeats: false };
    let (setup, slits) = (setup(), Slits::one(APERTURE));
    let flat = empty(&setup, &slits).curve(grid, &offsets);
    let flat_of_rays = expected_of_rays(0.0);
    let crossings = 50.0;
    let waves = curves(crossings, 320, |case| case.curve(grid, &offsets));
    let rays = expected_of_rays(crossings / (2.0 * RADIUS));
    // Structure functions of waves and rays expect 0.477 of fits to these seven steps and 0.488 of
    // transforms; standard errors over stacks are 0.02.
    let widths = [fitted(&waves) - fitted(&flat), fitted(&rays) - fitted(&flat_of_rays)];
    close(widths[0] / widths[1], 0.477, 0.04);
    close(scatter(&waves, &flat) / scatter(&rays, &flat_of_rays), 0.488, 0.03);
}

/// Loss of the transform of the light of an aperture at `shear`, times the length over which a fibre
/// is placed at random: the structure function of waves.
fn structure_of_waves(radius: f64, shear: f64) -> f64 {
    let setup = setup();
    let f = shear / (setup.wavelength * DISTANCE);
    let grid = Grid { count: 1 << 13, spacing: 20e-9, repeats: false };
    let slits = Slits::one(APERTURE);
    let at_f = |sample: &[Body]| {
        let light = grid.intensity(&setup, Some(&slits), &grid.through(&setup, sample, 0.0));
        let term = |(i, light): (usize, &f64)| Complex::from_polar(*light, -TAU * f * grid.x(i));
        light.iter().enumerate().map(term).sum::<Complex<f64>>()
    };
    let flat = at_f(&[]);
    // A fibre beyond this reach is in the light of no pair of points.
    let reach = 0.5 * APERTURE + radius + shear;
    let count = (2.0 * reach / (0.25 * shear)).ceil() as u32;
    let step = 2.0 * reach / f64::from(count);
    let loss = |i: u32| {
        let centre = (f64::from(i) + 0.5) * step - reach;
        let fibre = [Outline::Cylinder { centre, radius }];
        1.0 - (at_f(&bodies(&fibre, DELTA, 0.0)) / flat).re
    };
    (0..count).into_par_iter().map(loss).sum::<f64>() * step
}

#[test]
fn dark_field_by_diameter_has_the_values_of_structure_functions_within_0_01() {
    let shear = setup().wavelength * DISTANCE / (TAU * 9.2e-6);
    let table = [(0.5, 0.18), (2.0, 0.37), (5.0, 0.49), (20.0, 0.67), (100.0, 0.86)];
    for (diameter, want) in table {
        let radius = 0.5e-6 * diameter;
        let ratio = structure_of_waves(radius, shear) / structure_of_rays(radius, shear);
        close(ratio, want, 0.01);
    }
}
