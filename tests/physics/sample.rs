//! Stacks of samples against closed forms and against the reference's sums over traced rays.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts are small; rays are rounded to f32 as the engine takes them"
)]

use crate::reference::masks::Bars;
use crate::reference::rays::{Order, Sample};
use crate::reference::scenes;
use crate::reference::stack::{Quadrature, Setup};
use crate::reference::surfaces::{Body, Mesh, body, cuboid, cylinder, sphere, wedge};
use crate::support::{CARBON, Checked, WATER, Worst, amount, engine, sample};
use beamlet::Backend;
use beamlet::scene::Transport;
use ndarray::Array3;
use std::ops::Range;
use std::slice::from_ref;

/// Pixels inside a sample, in open beam: they have to reach 2e-4, and do so with room. The
/// reference itself is good to 2e-5 (kinks of overlapping edges between 121 source points).
const INTERIOR: f64 = 5e-5;
/// Pixels that a silhouette crosses: they have to reach 5e-3. The
/// reference counts whole cells of 0.5 um, smoothed by its source points.
const RIM: f64 = 1e-3;

fn steps(reach: f64, count: u32) -> Vec<f64> {
    (0..count).map(|i| reach * (2.0 * f64::from(i) / f64::from(count - 1) - 1.0)).collect()
}

fn carbon(mesh: Mesh) -> Body {
    body(mesh.rounded(), CARBON[0], CARBON[1])
}

fn water(mesh: Mesh) -> Body {
    body(mesh.rounded(), WATER[0], WATER[1])
}

/// The engine's stack of view 0, `[step][row][column]`, and how many rays were reflected.
fn stack(engine: &Checked, setup: &Setup, bodies: &[Body], offsets: &[f64]) -> (Array3<f32>, u64) {
    let stacks = engine.simulate(&scenes::scene(setup, bodies, offsets)).expect("a stack");
    assert_eq!(stacks.record.tally.unbalanced, 0);
    assert_eq!(stacks.record.tally.not_finite, 0);
    assert_eq!(stacks.record.tally.dropped, 0);
    (stacks.sample.index_axis_move(ndarray::Axis(0), 0), stacks.record.tally.reflected)
}

/// Compares a stretch of a row with the reference.
struct Comparison<'a> {
    setup: &'a Setup,
    bodies: &'a [Body],
    offsets: &'a [f64],
    how: Quadrature,
    got: Array3<f32>,
    reflected: u64,
}

impl<'a> Comparison<'a> {
    fn new(setup: &'a Setup, bodies: &'a [Body], offsets: &'a [f64], how: Quadrature) -> Self {
        let (got, reflected) = stack(&engine(Backend::Bvh), setup, bodies, offsets);
        Self { setup, bodies, offsets, how, got, reflected }
    }

    fn columns(&self, worst: &mut Worst, columns: Range<u32>, row: u32) {
        self.parts(columns.clone(), row, &mut [(worst, &[columns])]);
    }

    /// Computes a stretch once and compares parts of it, each by its own tolerance.
    fn parts(&self, columns: Range<u32>, row: u32, parts: &mut [(&mut Worst, &[Range<u32>])]) {
        let sample = Sample::new(self.bodies, self.setup.source_distance, 0.0);
        let first = columns.start as usize;
        let want =
            self.setup.line(Some(&sample), Order::Exact, &self.how, columns, row, self.offsets);
        for (i, line) in want.iter().enumerate() {
            for (k, want) in line.iter().enumerate() {
                let column = first + k;
                let got = f64::from(self.got[[i, row as usize, column]]);
                for (worst, of) in parts.iter_mut() {
                    if of.iter().any(|part| part.contains(&(column as u32))) {
                        worst.take(got - want, || {
                            format!("row {row}, column {column}, step {i}: {got} for {want}")
                        });
                    }
                }
            }
        }
    }
}

#[test]
fn slab_transmits_exp_of_minus_mu_t() {
    // The slab overfills the beam; rays at right angles to it are not refracted sideways beyond
    // delta * slope, 1e-8 rad at the rim.
    let mut worst = Worst::new("sample, slab, closed form", 1e-6);
    let setup = Setup::paper([32, 3]);
    let slab = [carbon(cuboid([20e-3, 8e-3, 4e-3]))];
    let engine = engine(Backend::Bvh);
    let offsets = steps(25e-6, 5);
    let stacks = engine.simulate(&scenes::scene(&setup, &slab, &offsets)).expect("a stack");
    for ((step, row, column), &flat) in stacks.flat.indexed_iter() {
        let [x, z] = setup.centre(u32::try_from(column).unwrap(), u32::try_from(row).unwrap());
        let secant = (1.0 + (x * x + z * z) / (1.8 * 1.8)).sqrt();
        let want = f64::from(flat) * (-CARBON[0] * 8e-3 * secant).exp();
        let got = f64::from(stacks.sample[[0, step, row, column]]);
        worst.take(got - want, || format!("step {step}, pixel {column}, {row}"));
    }
    worst.holds();
}

#[test]
fn cylinder_of_the_paper_matches_the_reference() {
    let setup = Setup::paper([128, 1]);
    let bodies = [carbon(cylinder(4e-3, 16e-3, 2048, 0.25))];
    let offsets = steps(25e-6, 11);
    let compared = Comparison::new(&setup, &bodies, &offsets, Quadrature::line());
    // The cylinder's rims stand 4 mm * 1.8 / 1.21 / 0.15 mm = 39.7 columns from the axis.
    let mut inside = Worst::new("sample, cylinder, interior", INTERIOR);
    compared.columns(&mut inside, 30..amount(36, 50), 0);
    compared.columns(&mut inside, 95..101, 0);
    let mut rim = Worst::new("sample, cylinder, silhouettes", RIM);
    compared.columns(&mut rim, 20..30, 0);
    compared.columns(&mut rim, 101..107, 0);
    inside.holds();
    rim.holds();
}

#[test]
fn sphere_matches_the_reference_off_its_equator() {
    let setup = Setup::paper([32, 8]);
    let bodies = [carbon(sphere(1.2e-3, 5).moved([0.05e-3, 0.0, 0.02e-3]))];
    let offsets = steps(20e-6, 3);
    let how = Quadrature { lines: 48, cells: 40, sources: 121, ..Quadrature::volume() };
    let compared = Comparison::new(&setup, &bodies, &offsets, how);
    let mut inside = Worst::new("sample, sphere, interior", INTERIOR);
    compared.columns(&mut inside, 12..amount(13, 14), 1);
    // The rim stands in column 4.
    let mut rim = Worst::new("sample, sphere, silhouettes", RIM);
    compared.columns(&mut rim, amount(4, 3)..amount(5, 6), 3);
    inside.holds();
    rim.holds();
}

#[test]
fn tilted_cylinder_matches_the_reference_across_rows() {
    // 30 degrees in the plane of the detector: both silhouettes cross every row.
    let setup = Setup::paper([40, 4]);
    let tilted = cylinder(1.0e-3, 6e-3, 512, 0.1).turned([0.0, 1.0, 0.0], 0.5);
    let bodies = [carbon(tilted)];
    let offsets = steps(20e-6, 3);
    let how = Quadrature { lines: 48, cells: 40, sources: 121, ..Quadrature::volume() };
    let compared = Comparison::new(&setup, &bodies, &offsets, how);
    let mut inside = Worst::new("sample, tilted cylinder, interior", INTERIOR);
    compared.columns(&mut inside, 18..amount(19, 20), 1);
    let mut rim = Worst::new("sample, tilted cylinder, silhouettes", RIM);
    compared.columns(&mut rim, 8..amount(9, 10), 1);
    compared.columns(&mut rim, 30..31, 1);
    inside.holds();
    rim.holds();
}

#[test]
fn nested_shells_and_a_void_match_the_reference() {
    let setup = Setup::paper([40, 1]);
    let bodies = [
        carbon(cylinder(1.8e-3, 8e-3, 1024, 0.1)),
        water(cylinder(1.3e-3, 7e-3, 1024, 0.2)),
        body(cylinder(0.7e-3, 6e-3, 1024, 0.3).moved([0.2e-3, 0.1e-3, 0.0]).rounded(), 0.0, 0.0),
    ];
    let offsets = steps(25e-6, amount(3, 5));
    let compared = Comparison::new(&setup, &bodies, &offsets, Quadrature::line());
    // Rims of the shells: columns 2.1, 7.1, 15.0; 28.9, 32.9, 37.9 (with `BEAMLET_ALL`).
    let mut rim = Worst::new("sample, shells, silhouettes", RIM);
    let mut inside = Worst::new("sample, shells, interior", INTERIOR);
    let interior = [4..6, 10..14, 17..27, 35..37];
    let all = 0..amount(20, 40);
    compared.parts(all.clone(), 0, &mut [(&mut rim, from_ref(&all)), (&mut inside, &interior)]);
    rim.holds();
    inside.holds();
}

/// A cylinder whose rim is seen in the middle of a pixel (columns 5 and 42), this far behind the
/// mask: its silhouette is blurred by the spot.
fn compare_cylinder_behind(behind: f64, inside: &mut Worst, rim: &mut Worst) {
    let mut setup = Setup::paper([48, 1]);
    setup.source_distance = 1.2 + behind;
    let radius = 18.5 * 150e-6 * setup.source_distance / 1.8;
    let bodies = [carbon(cylinder(radius, 8e-3, 2048, 0.25))];
    let offsets = steps(25e-6, amount(3, 5));
    let how = Quadrature { cells: 400, ..Quadrature::line() };
    let compared = Comparison::new(&setup, &bodies, &offsets, how);
    compared.columns(inside, 8..amount(11, 14), 0);
    compared.columns(inside, 23..amount(24, 25), 0);
    compared.columns(rim, 4..amount(7, 8), 0);
}

#[test]
fn sample_10_mm_behind_the_mask_matches_the_reference() {
    let mut inside = Worst::new("sample 10 mm behind the mask, interior", INTERIOR);
    let mut rim = Worst::new("sample 10 mm behind the mask, silhouettes", RIM);
    compare_cylinder_behind(10e-3, &mut inside, &mut rim);
    inside.holds();
    rim.holds();
}

#[test]
fn sample_100_mm_behind_the_mask_matches_the_reference() {
    let mut inside = Worst::new("sample 100 mm behind the mask, interior", INTERIOR);
    let mut rim = Worst::new("sample 100 mm behind the mask, silhouettes", RIM);
    compare_cylinder_behind(100e-3, &mut inside, &mut rim);
    inside.holds();
    rim.holds();
}

#[test]
fn sample_300_mm_behind_the_mask_matches_the_reference() {
    let mut inside = Worst::new("sample 300 mm behind the mask, interior", INTERIOR);
    let mut rim = Worst::new("sample 300 mm behind the mask, silhouettes", RIM);
    compare_cylinder_behind(300e-3, &mut inside, &mut rim);
    inside.holds();
    rim.holds();
}

#[test]
fn face_within_the_critical_angle_reflects_into_other_pixels() {
    // A face 0.5 mrad off the beam lies in the light over 8 mm: 4 um of the beam is thrown
    // 2 * 0.5 mrad * 0.59 m = 0.59 mm aside, four columns.
    let setup = Setup::paper([24, 1]);
    let slab = cuboid([1.14e-3, 8e-3, 4e-3]).turned([0.0, 0.0, 1.0], 0.5e-3);
    let bodies = [carbon(slab)];
    let offsets = steps(25e-6, amount(3, 5));
    let how = Quadrature::fine().following(1.5e-3);
    let compared = Comparison::new(&setup, &bodies, &offsets, how);
    // What the faces throw: the silhouettes' share of light goes elsewhere.
    let mut worst = Worst::new("sample, total reflection, all pixels", RIM);
    // Rims at columns 6.35 and 17.65, in openings of the sample mask; reflections land beyond.
    let mut inside = Worst::new("sample, total reflection, interior", INTERIOR);
    let (all, inner) = (0..24, 8..16);
    let parts = &mut [(&mut worst, from_ref(&all)), (&mut inside, from_ref(&inner))];
    compared.parts(all.clone(), 0, parts);
    assert!(compared.reflected > 0);
    worst.holds();
    inside.holds();
}

const OPAQUE: Bars = Bars::Sheet { transmission: 0.0 };

/// A wedge of a large delta throws light by `delta tan(angle) * 0.59 m`.
fn strong_wedge(delta: f64) -> Body {
    let wedge = wedge(2.4e-3, 0.8, 6e-3).moved([-1.2e-3, -1.2e-3, 0.0]);
    body(wedge.rounded(), 0.0, delta)
}

#[test]
fn light_deflected_along_x_lands_in_the_pixel_next_door_and_farther() {
    for (delta, name) in [
        (1.5e-4, "sample, deflection by 0.6 pixels along x"),
        (6e-4, "sample, deflection by 2.4 pixels along x"),
    ] {
        for masks in [true, false] {
            // Thin sheets: these deltas are a hundred times those of matter at such energies, and
            // thick bars would shade rays bent by 0.6 mrad in earnest.
            let mut setup = Setup::paper([32, 1]).with_bars(OPAQUE);
            if !masks {
                setup.detector_mask = None;
            }
            let bodies = [strong_wedge(delta)];
            let offsets = steps(25e-6, 5);
            let how = Quadrature::line().following(0.8e-3);
            let compared = Comparison::new(&setup, &bodies, &offsets, how);
            // The wedge spans columns 4.1 to 27.9; its light arrives up to 2.5 columns lower.
            let mut inside = Worst::new(name, INTERIOR);
            compared.columns(&mut inside, 8..22, 0);
            let mut rim = Worst::new("sample, deflection along x, silhouettes", RIM);
            compared.columns(&mut rim, 1..8, 0);
            inside.holds();
            rim.holds();
        }
    }
}

#[test]
fn light_deflected_along_z_lands_in_the_row_next_door_and_farther() {
    let cases = vec![
        (6e-4, "sample, deflection by 2.4 pixels along z"),
        (1.5e-4, "sample, deflection by 0.6 pixels along z"),
    ];
    for (delta, name) in sample(cases, 2) {
        let mut setup = Setup::paper([4, 24]).with_bars(OPAQUE);
        // The wedge does not change along x: without blur there one source point serves.
        setup.spot[0] = 0.0;
        let turned = strong_wedge(delta);
        let mesh = turned.mesh.clone().turned([0.0, 1.0, 0.0], -std::f64::consts::FRAC_PI_2);
        let bodies = [Body { mesh: mesh.rounded(), ..turned }];
        let offsets = [0.0, 11e-6];
        let how = Quadrature { lines: 2000, cells: 20, sources: 1, ..Quadrature::volume() };
        let how = how.following_along_z(0.6e-3);
        let compared = Comparison::new(&setup, &bodies, &offsets, how);
        let mut inside = Worst::new(name, INTERIOR);
        compared.columns(&mut inside, 1..3, 10);
        compared.columns(&mut inside, 1..2, 5);
        // The wedge's horizontal edges stand in rows 0.09 and 23.9.
        let mut rim = Worst::new("sample, deflection along z, silhouettes", RIM);
        for row in sample(vec![0, 1, 2, 3, 4, 20, 21, 22, 23], 2) {
            compared.columns(&mut rim, 1..2, row);
        }
        inside.holds();
        rim.holds();
    }
}

#[test]
fn first_order_matches_exact_transport_except_at_grazing() {
    let setup = Setup::paper([32, 1]);
    let bodies = [carbon(cylinder(1.5e-3, 8e-3, 2048, 0.25))];
    let offsets = steps(25e-6, 5);
    let engine = engine(Backend::Bvh);
    let stacks = [Transport::FirstOrder, Transport::Auto, Transport::Exact].map(|transport| {
        let mut scene = scenes::scene(&setup, &bodies, &offsets);
        scene.sampling.transport = transport;
        // Rays in order and sums over facets make different cells: finer than what is compared.
        scene.sampling.tolerance = Some(2e-6);
        engine.simulate(&scene).expect("a stack").sample
    });
    // Second order in delta: 1e-9 rad where rays are not flagged, 0.6 nm on the detector and
    // 4e-6 of open beam. A cylinder's flagged rays are a cell row of 60 nm at either rim, most of
    // whose light misses the apertures in any order.
    // Rims stand in columns 1 and 30. There the stack in order, which rays alone make, is cut down
    // to the 2 nm that coordinates in f32 allow, and right to 2e-5.
    let mut auto = Worst::new("sample, auto against exact transport", 1e-5);
    let mut first = Worst::new("sample, first order against exact transport", 1e-5);
    let mut rims = Worst::new("sample, transports against one another, rims", 2e-5);
    for (place, &exact) in stacks[2].indexed_iter() {
        let [by_auto, by_first] = [1, 0].map(|i: usize| f64::from(stacks[i][place] - exact));
        if [0, 1, 2, 29, 30, 31].contains(&place.3) {
            rims.take(by_auto, || format!("auto, {place:?}"));
            rims.take(by_first, || format!("first order, {place:?}"));
        } else {
            auto.take(by_auto, || format!("{place:?}"));
            first.take(by_first, || format!("{place:?}"));
        }
    }
    auto.holds();
    first.holds();
    rims.holds();
}

#[test]
fn set_ups_without_one_mask_or_both_show_the_sample() {
    let cases = vec![
        (true, false, "sample, sample mask alone, interior"),
        (false, true, "sample, detector mask alone, interior"),
        (false, false, "sample, no masks, interior"),
    ];
    for (sample_mask, detector_mask, name) in sample(cases, 2) {
        let mut setup = Setup::paper([24, 1]).with_bars(OPAQUE);
        if !sample_mask {
            setup.sample_mask = None;
        }
        if !detector_mask {
            setup.detector_mask = None;
        }
        let bodies = [carbon(cylinder(1.0e-3, 8e-3, 2048, 0.25))];
        let offsets = if sample_mask { vec![-40e-6, 0.0, 20e-6] } else { vec![0.0] };
        let mut compared = Comparison::new(&setup, &bodies, &offsets, Quadrature::line());
        // Nothing averages over the sample in a plane of its own: cells of 0.25 um, which cells of 10 nm
        // confirm to 5e-7, and of 10 nm for the rims, where facets are as narrow.
        let cells = |finer: usize| if sample_mask { 200 } else { finer };
        // Rims at columns 2.1 and 21.9.
        let mut inside = Worst::new(name, INTERIOR);
        compared.how.cells = cells(400);
        compared.columns(&mut inside, 5..amount(12, 19), 0);
        compared.how.cells = cells(10_000);
        let mut rim = Worst::new("sample, one mask or none, silhouettes", RIM);
        compared.columns(&mut rim, 1..amount(3, 4), 0);
        inside.holds();
        rim.holds();
    }
}
