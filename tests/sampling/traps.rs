//! Bodies that rays at a few places do not see, against rays in f64 at very many places.
//!
//! Bodies are opaque sheets, so that all that counts is which rays they stop. The tolerance is
//! twice that of the scene, 1e-4 of open beam: the reference's own grid takes up to 5e-5.

use crate::reference::closed_form::blurred_overlap;
use crate::reference::rays::{Order, Sample};
use crate::reference::scenes;
use crate::reference::stack::{Quadrature, Setup};
use crate::reference::surfaces::{Body, Mesh, body, cuboid};
use crate::support::{Worst, engine};
use beamlet::Backend;

const COLUMNS: u32 = 8;
const ROWS: u32 = 4;
/// Thickness along the beam, m: bars are seen as sheets.
const THIN: f64 = 1e-6;

/// Place in the rotation centre's plane, m, of `x` from the centre of beamlet 3 in the plane of the
/// sample mask, um, and of row coordinate `row`.
fn place(x: f64, row: f64) -> [f64; 3] {
    let x = (3.5 - f64::from(COLUMNS) / 2.0) * 100e-6 + x * 1e-6;
    let z = (f64::from(ROWS) / 2.0 - row) * 150e-6;
    [x * 1.21 / 1.2, 0.0, z * 1.21 / 1.8]
}

/// A sheet from `x` to `x` (um) and from row to row.
fn sheet(x: [f64; 2], rows: [f64; 2]) -> Mesh {
    let [a, b] = [place(x[0], rows[0]), place(x[1], rows[1])];
    let size = [b[0] - a[0], THIN, a[2] - b[2]];
    cuboid(size).moved([0.5 * (a[0] + b[0]), 0.0, 0.5 * (a[2] + b[2])])
}

fn opaque(mesh: Mesh) -> Body {
    body(mesh.rounded(), 1e8, 0.0)
}

/// Extent of a sheet: x from the centre of beamlet 3, um, and rows.
type Extent = ([f64; 2], [f64; 2]);

/// Offsets of the sample mask.
const OFFSETS: [f64; 3] = [-8e-6, 0.0, 11e-6];

/// Light that sheets which do not overlap along x take from the pixels of column 3,
/// `[row - 1][step]`: of each what it takes where it is endless along z, times its share of the
/// row.
fn taken_by_sheets(setup: &Setup, sheets: &[Extent]) -> Vec<Vec<f64>> {
    let how = Quadrature { cells: 20_000, sources: 41, ..Quadrature::line() };
    let of = |bodies: &[Body]| {
        let sample = Sample::new(bodies, setup.source_distance, 0.0);
        setup.pixel(Some(&sample), Order::First, &how, 3, 1, &OFFSETS)
    };
    let flat = of(&[]);
    let endless: Vec<_> =
        sheets.iter().map(|(x, _)| of(&[opaque(sheet(*x, [-40.0, 40.0]))])).collect();
    let blur = setup.sigma()[1] * 0.59 / 1.21 / 150e-6;
    let pixel = |row: f64, step: usize| {
        let taken = sheets.iter().zip(&endless).map(|((_, rows), endless)| {
            let middle = 0.5 * (rows[0] + rows[1]) - (row + 0.5);
            (flat[step] - endless[step]) * blurred_overlap(middle, rows[1] - rows[0], 1.0, blur)
        });
        taken.sum::<f64>()
    };
    [1.0, 2.0].map(|row| (0..OFFSETS.len()).map(|step| pixel(row, step)).collect()).to_vec()
}

/// Compares the light that bodies take from rows 1 and 2 of column 3 with `want`.
fn check(name: &'static str, bodies: &[Body], want: &[Vec<f64>]) {
    let setup = Setup::paper([COLUMNS, ROWS]);
    let mut scene = scenes::scene(&setup, bodies, &OFFSETS);
    scene.sampling.tolerance = Some(1e-4);
    let stacks = engine(Backend::Bvh).simulate(&scene).expect("a stack");
    let mut worst = Worst::new(name, 2e-4);
    let mut seen = 0.0_f64;
    for (row, want) in (1..).zip(want) {
        for (step, want) in want.iter().enumerate() {
            let at = [step, row, 3];
            let taken = stacks.flat[at] - stacks.sample[[0, step, row, 3]];
            seen = seen.max(want.abs());
            worst.take(f64::from(taken) - want, || format!("{at:?}"));
        }
    }
    assert!(seen > 3e-4, "{name}: the body takes {seen:.1e} of open beam only");
    worst.holds();
}

/// Checks sheets that do not overlap along x.
fn check_sheets(name: &'static str, sheets: &[Extent]) {
    let bodies: Vec<Body> = sheets.iter().map(|(x, rows)| opaque(sheet(*x, *rows))).collect();
    check(name, &bodies, &taken_by_sheets(&Setup::paper([COLUMNS, ROWS]), sheets));
}

#[test]
fn a_corner_in_an_otherwise_empty_cell() {
    // 6 um x 6 um of the cell from 0 to 10 um, from its upper right.
    check_sheets("traps, corner", &[([4.0, 60.0], [0.2, 1.06])]);
}

#[test]
fn a_body_across_a_row_border_alone() {
    check_sheets("traps, row border", &[([-30.0, 30.0], [1.99, 2.02])]);
}

#[test]
fn a_bump_between_two_lines() {
    check_sheets("traps, bump", &[([-80.0, -6.0], [0.0, 4.0]), ([-5.9, -2.0], [1.40, 1.45])]);
}

#[test]
fn a_rim_between_two_rays_with_equal_results() {
    check_sheets("traps, wire between rays", &[([1.0, 2.5], [0.5, 3.5])]);
}

#[test]
fn bars_in_step_with_the_lattice() {
    // A base cell is 10 um wide: bars of 2 um stand at the same place in each that the openings show.
    let bar = |i: i32| {
        let x = 10.0 * f64::from(i) + 1.3;
        ([x, x + 2.0], [0.5, 3.5])
    };
    check_sheets("traps, in step with the lattice", &(-2..2).map(bar).collect::<Vec<_>>());
}

#[test]
fn a_sliver_of_wire_at_45_degrees() {
    let setup = Setup::paper([COLUMNS, ROWS]);
    let wire = cuboid([2e-6, THIN, 60e-6]).turned([0.0, 1.0, 0.0], std::f64::consts::FRAC_PI_4);
    let bodies = [opaque(wire.moved(place(3.0, 1.6)))];
    // The wire slants, so that lines see it at many places of a cell; its ends are seen to 1 % of it.
    let how = Quadrature { cells: 400, sources: 21, lines: 200, ..Quadrature::volume() };
    let sample = Sample::new(&bodies, setup.source_distance, 0.0);
    let taken = |row| -> Vec<f64> {
        let pixel = |sample| setup.pixel(sample, Order::First, &how, 3, row, &OFFSETS);
        pixel(None).iter().zip(pixel(Some(&sample))).map(|(flat, behind)| flat - behind).collect()
    };
    check("traps, wire at 45 degrees", &bodies, &[taken(1), taken(2)]);
}
