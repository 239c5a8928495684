//! Rows whose lines differ: bodies that lean or end, bands, batches and backends.

use super::{BY_WAVES, FIBRE, OFFSETS, SET_UPS, add_cylinder, row, simulate};
use crate::reference::waves::body::{Body, Outline, slice};
use crate::support::cuts::{Cut, bands, batches, no_bit_changes};
use crate::support::{Worst, backends, sample};
use crate::thin_masks::REFERENCE;
use beamlet::Backend;
use beamlet::scene::{MaterialSpec, Object, Scene, Shape, Spot, SpotPart};
use beamlet::stack::Stacks;

/// Height of a row in the plane of the sample, m.
pub(super) const ROW: f64 = 150e-6 / 1.8 * 1.2003;
/// Offsets by which edges lie between samples of 20 nm.
const EVEN: [f64; 2] = [-3e-6, 6.66e-6];
/// Lines of the reference.
const LINES: u32 = 100;

/// A ball at (x, z), m.
fn ball(radius: f64, [x, z]: [f64; 2]) -> Object {
    let mut object = Object::new("ball", Shape::Sphere { radius, sides: None }, "matter");
    object.placement.position = [x, 0.0, z];
    object
}

pub(super) fn with(objects: Vec<Object>, rows: u32) -> Scene {
    let mut scene = REFERENCE.scene(4, 0.0003, &OFFSETS, BY_WAVES);
    let [delta, mu] = FIBRE;
    scene.materials.insert("matter".into(), MaterialSpec::Constants { mu, delta });
    scene.sampling.tolerance = Some(5e-5);
    scene.detector.pixels[1] = rows;
    scene.objects = objects;
    scene
}

/// Blurs light along z by a spot of this height, m.
pub(super) fn blur_along_z(scene: &mut Scene, height: f64) {
    scene.source.spot = Spot::gaussians(vec![SpotPart::new(1.0, [30e-6, height], [0.0; 2])]);
}

/// Compares a row with the mean over lines by FFT; `slice_at`: outlines at a height.
fn compare(what: &'static str, scene: &Scene, slice_at: impl Fn(f64) -> Vec<Body>) {
    let height = |line: u32| ((f64::from(line) + 0.5) / f64::from(LINES) - 0.5) * ROW;
    let weight = 1.0 / f64::from(LINES);
    let lines = (0..LINES).map(|line| (weight, slice_at(height(line))));
    compare_with(Worst::new(what, 1e-5), scene, lines);
}

/// Compares a row with a sum over lines by FFT, each with its weight.
pub(super) fn compare_with(
    mut worst: Worst,
    scene: &Scene,
    lines: impl Iterator<Item = (f64, Vec<Body>)>,
) {
    let mut scene = scene.clone();
    // Light of a row is the mean of its lines without a blur along z.
    blur_along_z(&mut scene, 0.0);
    scene.scan.mask_offsets = EVEN.to_vec();
    scene.sampling.tolerance = Some(2.5e-5);
    let stacks = simulate(&scene, Backend::Bvh);
    let mut set_up = REFERENCE.set_up();
    set_up.sample = 1.2003;
    let row = row(&REFERENCE, 4);
    let mut want = vec![vec![0.0; 4]; EVEN.len()];
    for (weight, bodies) in lines {
        let light = row.light(&set_up, &bodies, 20e-9, &EVEN, None);
        let pairs = want.iter_mut().flatten().zip(light.iter().flatten());
        pairs.for_each(|(want, light)| *want += weight * light);
    }
    for (step, want) in want.iter().enumerate() {
        for (column, want) in want.iter().enumerate() {
            let got = f64::from(stacks.sample[[0, step, 0, column]]);
            worst.take(got - want, || format!("step {step}, column {column}: {got} {want}"));
        }
    }
    worst.holds();
}

#[test]
fn a_sphere_over_a_row_matches_lines_by_fft_within_1e_5() {
    let [delta, mu] = FIBRE;
    let slice_at = |z: f64| {
        let outlines = slice(52e-6, 40e-6, z - 11e-6);
        outlines.into_iter().map(|outline| Body { outline, delta, mu }).collect()
    };
    compare("waves, a sphere", &with(vec![ball(40e-6, [52e-6, 11e-6])], 1), slice_at);
}

#[test]
fn a_cylinder_that_leans_matches_lines_by_fft_within_1e_5() {
    let ([delta, mu], angle, radius) = (FIBRE, 0.5_f64, 30e-6);
    let shape = Shape::Cylinder { radius, height: 4e-3, sides: None };
    let mut object = Object::new("rod", shape, "matter");
    object.placement.position = [45e-6, 0.0, 0.0];
    object.placement.rotate = vec![([0.0, 1.0, 0.0], angle)];
    let slice_at = |z: f64| {
        let (centre, radius) = (45e-6 + z * angle.tan(), radius / angle.cos());
        let outline = Outline::Cylinder { centre, radius };
        vec![Body { outline, delta: delta * angle.cos(), mu: mu * angle.cos() }]
    };
    compare("waves, a leaning cylinder", &with(vec![object], 1), slice_at);
}

/// Two balls and a fibre in three rows.
fn crowd() -> Scene {
    let balls = vec![ball(60e-6, [40e-6, 70e-6]), ball(25e-6, [-70e-6, -40e-6])];
    let mut scene = with(balls, 3);
    scene.objects[1].name = "second ball".into();
    scene.scan.angles = vec![0.0, 0.7];
    scene
}

#[test]
fn bands_and_batches_change_no_bit_of_waves() {
    let [one, two] =
        [(1021, 1), (3000, 2)].map(|(rays, rows)| Cut { batch: Some(rays), ..bands(rows) });
    let cuts: Vec<Cut> = sample(vec![one, bands(1), two, batches(257)], 4).collect();
    let tally = no_bit_changes("waves", &crowd(), &cuts).record.tally;
    assert!(tally.patches > 10 && tally.rays > 10_000);
}

#[test]
fn backends_agree_on_waves_within_1e_6() {
    let scene = crowd();
    let all: Vec<Stacks> =
        backends().into_iter().map(|backend| simulate(&scene, backend)).collect();
    let mut worst = Worst::new("waves, backends", 1e-6);
    for other in &all[1..] {
        for ((place, a), b) in all[0].sample.indexed_iter().zip(&other.sample) {
            worst.take(f64::from(a - b), || format!("{place:?}"));
        }
    }
    if all.len() > 1 {
        worst.holds();
    }
}

#[test]
fn estimated_errors_are_those_of_half_the_spacing_within_a_factor_of_3() {
    // The reference and bars that leak; all with `BEAMLET_ALL`.
    for (name, masks) in sample(SET_UPS.iter().collect(), 3) {
        let columns = 96_usize;
        let at = |tolerance: f64| {
            let mut scene = masks.scene(96, 0.0003, &OFFSETS, BY_WAVES);
            // Rims in many places of the apertures.
            for k in 0..30 {
                let centre = 1e-6 * masks.sample[1] * (3.1 * f64::from(k) - 45.0);
                add_cylinder(&mut scene, centre, 1.2e-6 * masks.sample[1], FIBRE);
                scene.objects[usize::try_from(k).expect("a number")].name = format!("rod {k}");
            }
            scene.sampling.tolerance = Some(tolerance);
            simulate(&scene, Backend::Bvh)
        };
        let (coarse, fine) = (at(1e-4), at(2e-5));
        let reported = coarse.record.sampling.as_ref().expect("an estimate").rms_error;
        let change = |step: usize, column: usize| {
            let place = [0, step, 0, column];
            f64::from(coarse.sample[place] - fine.sample[place]).abs()
        };
        let of = |column| (0..OFFSETS.len()).map(|step| change(step, column)).fold(0.0, f64::max);
        let squares = (0..columns).map(|column| of(column).powi(2)).sum::<f64>();
        let actual = (squares / 96.0).sqrt();
        assert!(actual < 5e-5, "{name}: {actual:e}");
        let ratio = reported / actual;
        assert!((0.33..3.0).contains(&ratio), "{name}: {reported:e} for {actual:e}");
    }
}

#[test]
fn upright_bodies_take_one_line_of_a_row() {
    let mut scene = with(vec![], 3);
    add_cylinder(&mut scene, 40e-6, 60e-6, FIBRE);
    let tally = simulate(&scene, Backend::Bvh).record.tally;
    assert!(tally.patches >= 6, "{tally:?}");
    assert_eq!(tally.patch_rays, tally.patches * tally.most_patch_rays);
    let mut leaning = scene.clone();
    leaning.objects[0].placement.rotate = vec![([0.0, 1.0, 0.0], 0.3)];
    assert!(
        simulate(&leaning, Backend::Bvh).record.tally.most_patch_rays > 2 * tally.most_patch_rays
    );
}
