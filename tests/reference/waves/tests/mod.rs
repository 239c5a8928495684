//! Waves against Fresnel integrals, closed forms and values of other programs.

mod bodies;
mod flats;
mod fresnel;
mod planes;
mod spheres;
mod stacks;

use super::field::Grid;
use super::light::Case;
use super::setup::{Setup, Slits, Window};
use crate::normal::SIGMA_PER_FWHM;

/// Reference set-up: 30 keV, 1.2 m and 0.6 m, spot of 30 um FWHM.
fn setup() -> Setup {
    Setup::new(30.0, [1.2, 0.6], 30e-6 * SIGMA_PER_FWHM)
}

/// Detector openings of 30 um in pixels of 150 um.
const WINDOW: Window = Window { aperture: 30e-6, pixel: 150e-6, leak: 0.0 };

/// Aperture of the sample mask, m.
const APERTURE: f64 = 20e-6;

fn close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance, "got {got:e}, want {want:e} within {tolerance:e}");
}

fn all_close(got: &[f64], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len());
    let off = got.iter().zip(want).any(|(got, want)| (got - want).abs() > tolerance);
    assert!(!off, "got {got:?}, want {want:?} within {tolerance:e}");
}

/// Flat curve of the reference set-up, waves less rays.
fn excess(case: &Case<'_>, grid: Grid, offsets: &[f64]) -> Vec<f64> {
    let by_waves = case.curve(grid, offsets);
    by_waves.iter().zip(offsets).map(|(w, &f)| w - super::rays::flat(case, 0.0, f)).collect()
}

/// Case of the reference set-up without a sample.
fn empty<'a>(setup: &'a Setup, slits: &'a Slits) -> Case<'a> {
    Case { setup, slits: Some(slits), sample: &[], window: WINDOW }
}
