//! Bodies that are the same at all z.

use super::{BY_WAVES, FIBRE, add_cylinder, both, row, simulate};
use crate::reference::waves::body::{Body, Outline};
use crate::support::{Worst, sample};
use crate::thin_masks::{LONE, REFERENCE};
use beamlet::Backend;

#[test]
fn light_of_single_bodies_matches_fft_within_2e_5() {
    let mut worst = Worst::new("waves, single bodies", 2e-5);
    let cases = vec![
        (50e-6, 2.5e-6),
        (57e-6, 2.5e-6),
        (52e-6, 10e-6),
        (41e-6, 10e-6),
        (-99e-6, 150e-6),
        (-93e-6, 150e-6),
    ];
    // One of each radius; all with `BEAMLET_ALL`.
    for (centre, radius) in sample(cases, 2) {
        let [got, want] = both(&REFERENCE, 4, 0.0003, (centre, radius, FIBRE));
        for (step, (got, want)) in got.iter().zip(&want).enumerate() {
            for (column, (got, want)) in got.iter().zip(want).enumerate() {
                let place =
                    || format!("{centre:e} {radius:e}, step {step}, {column}: {got} {want}");
                worst.take(got - want, place);
            }
        }
    }
    worst.holds();
}

#[test]
fn wire_of_another_group_has_its_ten_values_within_4e_4() {
    let want = [
        (-150.0, 0.7500),
        (-145.0, 0.7188),
        (-140.0, 0.7941),
        (-100.0, 0.8935),
        (0.0, 0.9381),
        (100.0, 1.0122),
        (140.0, 1.1453),
        (145.0, 1.1690),
        (150.0, 1.2162),
        (155.0, 1.0849),
    ];
    let mut worst = Worst::new("waves, the wire of another group", 4e-4);
    for (x, want) in want {
        // The openings of both masks are half a detector opening apart.
        let mut scene = LONE.scene(1, 0.0003, &[-8e-6], BY_WAVES);
        let mu = 2.0 * LONE.set_up().wavenumber() * 1e-9;
        // The wire of the reference lies in the plane of the mask.
        let scale = 1.0 + 0.0003 / 1.6;
        let centre = (-x * 1e-6 - 8e-6) * scale;
        add_cylinder(&mut scene, centre, 150e-6 * scale, [1e-6 / scale, mu / scale]);
        let stacks = simulate(&scene, Backend::Bvh);
        let got = f64::from(stacks.sample[[0, 0, 0, 0]]) / f64::from(stacks.flat[[0, 0, 0]]);
        worst.take(got - want, || format!("{x} um: {got} for {want}"));
    }
    worst.holds();
}

#[test]
fn bodies_behind_the_mask_match_two_steps_of_fft_from_points_of_the_spot_within_2e_5() {
    let mut worst = Worst::new("waves, bodies seen from points of the spot", 2e-5);
    let mut most = 0.0_f64;
    let cases = vec![
        (41e-6, 50e-6, 0.1),
        (52e-6, 10e-6, 0.012),
        (-95e-6, 150e-6, 0.012),
        (41e-6, 50e-6, 0.001),
    ];
    for (centre, radius, behind) in sample(cases, 4) {
        let offsets = [-3e-6, 9e-6];
        let mut scene = REFERENCE.scene(4, behind, &offsets, BY_WAVES);
        add_cylinder(&mut scene, centre, radius, FIBRE);
        let stacks = simulate(&scene, Backend::Bvh);
        let mut set_up = REFERENCE.set_up();
        set_up.sample = 1.2 + behind;
        let [delta, mu] = FIBRE;
        let sample = [Body { outline: Outline::Cylinder { centre, radius }, delta, mu }];
        let light = |points| row(&REFERENCE, 4).light(&set_up, &sample, 20e-9, &offsets, points);
        let (want, blurred) = (light(Some(80)), light(None));
        for (step, (want, blurred)) in want.iter().zip(&blurred).enumerate() {
            for (column, (want, blurred)) in want.iter().zip(blurred).enumerate() {
                most = most.max((want - blurred).abs());
                let got = f64::from(stacks.sample[[0, step, 0, column]]);
                worst.take(got - want, || {
                    format!("{radius:e}, {behind} m, step {step}, {column}: {got} {want}")
                });
            }
        }
    }
    // A blur at the analyser does not move the sample.
    assert!(most > 3e-5, "{most:e}");
    worst.holds();
}
