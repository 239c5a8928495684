//! Spheres: two dimensions against lines.

use super::super::body::{bodies, slice};
use super::super::light::Light;
use super::super::plane;
use super::super::setup::Slits;
use super::{APERTURE, WINDOW, close, setup};
use crate::waves::field::Grid;

#[test]
fn lines_of_a_row_match_two_dimensions_except_near_its_borders() {
    let (setup, slits) = (setup(), Slits::one(APERTURE));
    let grid = Grid { count: 1 << 12, spacing: 20e-9, repeats: false };
    let lines = Grid { count: 512, spacing: 100e-9, repeats: true };
    let sphere = |z: f64| {
        let outline: Vec<_> = slice(4e-6, 5e-6, z).into_iter().collect();
        bodies(&outline, 4.61e-7, 51.2)
    };
    let by_plane = plane::intensity(&setup, &slits, grid, lines, sphere);
    let by_lines: Vec<Vec<f64>> = (0..lines.count)
        .map(|i| grid.through(&setup, &sphere(lines.x(i)), 0.0))
        .map(|sample| grid.intensity(&setup, Some(&slits), &sample))
        .collect();
    // Light over z in parts of the open beam times a length.
    let seen = |intensity: &[Vec<f64>], ends: [f64; 2], blur: f64| {
        let sum = plane::row_sum(intensity, lines, ends, blur);
        let light = Light::blurred(grid, &setup, &sum, &setup.spot);
        light.seen(&setup, &WINDOW, 0.0) * lines.spacing
    };
    let error = |half: f64, blur: f64| {
        let ends = [-half, half];
        (seen(&by_plane, ends, blur) - seen(&by_lines, ends, blur)).abs() / (2.0 * half)
    };
    let blur = setup.spot[0].sigma * setup.source_shift().abs();
    // Propagation along z is unitary over all lines, under a blur too.
    let all = 0.5 * lines.length();
    close(error(all, 0.0).max(error(all, blur)), 0.0, 1e-12);
    // A row that ends 12 um beside the sphere, and one that ends 5 um beside: light that the spot and
    // the sphere throw over the border.
    let errors = [17e-6, 10e-6].map(|half| error(half, blur));
    assert!(errors[0] < 1.5e-5 && errors[1] > 1e-4, "{errors:?}");
}

#[test]
fn slices_of_a_sphere_are_its_chords() {
    let case_of = |z: f64| slice(1e-6, 5e-6, z);
    assert!(case_of(5.1e-6).is_none());
    let length = case_of(3e-6).expect("within the sphere").path(1e-6)[0];
    close(length, 8e-6, 1e-15);
}
