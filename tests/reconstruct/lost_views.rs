//! Moments of refraction angles against areas of δ, and views that lost them at faces along the beam.

use crate::reference::blobs::Blob;
use crate::reference::draws::Draws;
use crate::set_up::{PIXEL, blobs, deviation, fan, grid, places, reconstruct, sinograms};
use crate::support::Worst;
use beamlet::ndarray::{Array2, Array3, s};
use beamlet::reconstruct::{
    FbpOptions, IterativeOptions, LostUse, LostViews, Method, Quantity, ScanGeometry, reaching_ends,
};
use beamlet::scene::Motion;
use std::f64::consts::TAU;

/// Blobs that end well inside the rows.
fn narrow() -> [Blob; 2] {
    blobs().map(|blob| Blob { sigma: 5.0 * PIXEL, ..blob })
}

fn lost_in(geometry: &ScanGeometry, angles: &Array3<f32>) -> LostViews {
    LostViews::find(geometry, angles.view(), None).unwrap()
}

/// A nearly normal number of variance 1.
fn normal(draws: &mut Draws) -> f64 {
    (0..12).map(|_| draws.uniform()).sum::<f64>() - 6.0
}

/// Views that lost their moment in any row.
fn numbers(lost: &LostViews) -> Vec<usize> {
    lost.record().lost_views.iter().map(|of| of.view).collect()
}

/// Sinograms whose views are multiplied.
fn scaled(angles: &Array3<f32>, factors: &[(usize, f32)]) -> Array3<f32> {
    let mut scaled = angles.clone();
    for (view, factor) in factors {
        scaled.slice_mut(s![*view, .., ..]).mapv_inplace(|angle| factor * angle);
    }
    scaled
}

/// ∬ δ (1 − t/z)(D/U)² over the middle plane, U = D + t, and the term of the lever arm in inclined lines,
/// Dτ(u − a)/(zU(1 + τ²)), a the axis. Sums of smooth values over a grid of an eighth of σ have errors below 1e-9.
fn area(geometry: &ScanGeometry, view: usize, blobs: &[Blob]) -> f64 {
    let (near, lever) = (geometry.source_distance, geometry.lever);
    let of_blob = |blob: &Blob| {
        let placed = blob.placed(-geometry.angles[view], geometry.axis);
        let step = placed.sigma / 8.0;
        let mut sum = 0.0;
        for i in -60..=60 {
            for j in -60..=60 {
                let [x, y] = [
                    placed.centre[0] + f64::from(i) * step,
                    placed.centre[1] + f64::from(j) * step,
                ];
                let depth = near + y;
                let (slope, u) = (x / depth, near * x / depth);
                let weight = (1.0 - y / lever) * (near / depth).powi(2)
                    + slope * (u - geometry.axis) * near / (lever * depth * (1.0 + slope * slope));
                sum += placed.at([x, y, 0.0]) * weight;
            }
        }
        sum * step * step
    };
    blobs.iter().map(of_blob).sum()
}

#[test]
fn moments_are_areas_of_delta_with_the_weights_of_the_fan() {
    // Angles are f32, and a blob ends at 7 σ.
    let mut worst = Worst::new("moment over the area of δ, less 1", 2e-6);
    for (lever, beside) in [(f64::INFINITY, 0.0), (0.03, 0.0), (0.03, 2.0 * PIXEL)] {
        let mut geometry = fan(180);
        geometry.lever = lever;
        geometry.axis = beside;
        let angles = sinograms(&geometry, &narrow(), Quantity::Delta);
        let found = lost_in(&geometry, &angles);
        for view in [0, 31, 90, 131] {
            let expected = area(&geometry, view, &narrow());
            worst.take(found.moments()[[view, 0]] / expected - 1.0, || {
                format!("lever {lever}, axis {beside}, view {view}")
            });
        }
        assert!(numbers(&found).is_empty(), "{:?}", found.record());
    }
    worst.holds();
}

/// In a fan of ±26° moments differ by 25 % by right, and a view that keeps 80 % is no lost one.
#[test]
fn lost_views_are_found_and_filtered_back_projection_interpolates_them() {
    let geometry = fan(180);
    let angles = sinograms(&geometry, &narrow(), Quantity::Delta);
    let spoilt = scaled(&angles, &[(0, 0.1), (45, -0.4), (90, 0.0), (91, 0.2), (130, 0.8)]);
    let mut lost = lost_in(&geometry, &spoilt);
    assert_eq!(numbers(&lost), [0, 45, 90, 91]);
    let first = &lost.record().lost_views[0];
    assert!((first.left - 0.1).abs() < 0.01 && first.rows == 1, "{first:?}");
    let error = |angles: &Array3<f32>| {
        let options = FbpOptions::default();
        let volume = reconstruct(&geometry, angles, Quantity::Delta, &grid([56, 56, 1]), &options);
        deviation(&volume.unwrap(), &narrow())
    };
    let mut mended = spoilt.clone();
    let method = Method::default();
    assert!(lost.leave_out(&geometry, (&method, false), &mut mended, None).unwrap().is_none());
    assert_eq!(lost.record().lost_views_are, Some(LostUse::Interpolated));
    let [whole, before, after] = [&angles, &spoilt, &mended].map(error);
    println!("measured: {whole:.2e}, {before:.2e} with lost views, {after:.2e} interpolated");
    assert!(before > 5e-3, "{before}");
    // A blob moves by half its σ between views 6° apart: a quarter of the second difference.
    assert!(after < whole + 1e-3, "{after} {whole}");
    let mut kept = spoilt.clone();
    lost.leave_out(&geometry, (&method, true), &mut kept, None).unwrap();
    assert_eq!(lost.record().lost_views_are, Some(LostUse::Kept));
    assert_eq!(kept, spoilt);
}

#[test]
fn iterative_methods_give_lost_views_no_weight_also_in_short_scans() {
    let options = IterativeOptions::default();
    let method = Method::iterative(options, false);
    for count in [180, 118] {
        let geometry = fan(count);
        let angles = sinograms(&geometry, &narrow(), Quantity::Delta);
        let mut spoilt = scaled(&angles, &[(59, 0.0)]);
        let mut lost = lost_in(&geometry, &spoilt);
        assert_eq!(numbers(&lost), [59]);
        let given = Array3::from_elem(spoilt.dim(), 3.0);
        let before = spoilt.clone();
        for (weights, usual) in [(None, 1.0), (Some(given), 3.0)] {
            let made = lost.leave_out(&geometry, (&method, false), &mut spoilt, weights).unwrap();
            let made = made.unwrap();
            assert!(made.slice(s![59, .., ..]).iter().all(|weight| *weight == 0.0));
            let others =
                made.iter().filter(|weight| weight.to_bits() == f32::to_bits(usual)).count();
            assert_eq!(others, made.len() - 96);
        }
        assert_eq!(before, spoilt);
        assert_eq!(lost.record().lost_views_are, Some(LostUse::ZeroWeight));
    }
    // Parker's weights of a short scan count each line once.
    let geometry = fan(118);
    let angles = sinograms(&geometry, &narrow(), Quantity::Delta);
    let mut spoilt = scaled(&angles, &[(59, 0.0)]);
    let mut lost = lost_in(&geometry, &spoilt);
    lost.leave_out(&geometry, (&Method::default(), false), &mut spoilt, None).unwrap();
    assert_eq!(lost.record().lost_views_are, Some(LostUse::Kept));
    assert!(spoilt.slice(s![59, .., ..]).iter().all(|angle| *angle == 0.0));
}

/// The limit is five standard deviations of the moments, at least 30 %.
#[test]
fn the_limit_follows_the_noise_of_the_moments() {
    let geometry = fan(180);
    let angles = sinograms(&geometry, &narrow(), Quantity::Delta);
    let spoilt = scaled(&angles, &[(0, 0.0), (90, 0.5)]);
    let area = area(&geometry, 0, &narrow());
    // Standard deviation of a moment per deviation of an angle, m².
    let squares = places(96, PIXEL).iter().map(|x| (x * PIXEL).powi(2)).sum::<f64>();
    for (share, expected) in
        [(0.0, vec![0, 90]), (0.06, vec![0, 90]), (0.18, vec![0]), (0.4, vec![])]
    {
        let sigma = share * area / squares.sqrt();
        let mut draws = Draws(7);
        let noisy = spoilt.mapv(|angle| angle + (sigma * normal(&mut draws)) as f32);
        let lost = lost_in(&geometry, &noisy);
        assert_eq!(numbers(&lost), expected, "{share}: {:?}", lost.record());
        let (noise, limit) = (lost.record().noise.unwrap(), lost.record().limit);
        // Weights of the fan are below 1, and moments 180: their deviation is known to 7 %.
        assert!(noise <= 1.2 * share + 0.02 && noise >= 0.7 * share, "{noise} for {share}");
        assert_eq!(limit.is_none(), expected.is_empty(), "{limit:?}");
        assert!(limit.is_none_or(|limit| (limit - f64::max(0.3, 5.0 * noise)).abs() < 1e-9));
    }
}

/// Rows that are too noisy alone follow the sum of all rows.
#[test]
fn rows_together_show_a_loss_that_one_row_hides() {
    let mut geometry = fan(180);
    // Rows so near that they see one slice.
    geometry.rows = places(25, 1e-3 * PIXEL).into_iter().rev().collect();
    let angles = sinograms(&geometry, &narrow(), Quantity::Delta);
    let spoilt = scaled(&angles, &[(17, 0.0)]);
    let squares = places(96, PIXEL).iter().map(|x| (x * PIXEL).powi(2)).sum::<f64>();
    let sigma = 0.6 * area(&geometry, 0, &narrow()) / squares.sqrt();
    let mut draws = Draws(3);
    let noisy = spoilt.mapv(|angle| angle + (sigma * normal(&mut draws)) as f32);
    let lost = lost_in(&geometry, &noisy);
    assert_eq!(numbers(&lost), [17]);
    assert_eq!(lost.record().lost_views[0].rows, 25);
}

/// Loss over more than the angles at which a face is along the beam has another reason, as a body that leaves the
/// field of view.
#[test]
fn views_whose_areas_differ_by_right_keep_their_weight() {
    let geometry = fan(180);
    let angles = sinograms(&geometry, &narrow(), Quantity::Delta);
    let wide: Vec<(usize, f32)> = (20..32).map(|view| (view, 0.2)).collect();
    assert!(numbers(&lost_in(&geometry, &scaled(&angles, &wide))).is_empty());
    // A body that reaches an end of the row.
    let spoilt = scaled(&angles, &[(20, 0.0), (60, 0.0)]);
    let mut unknown = Array2::default((180, 1));
    unknown[[20, 0]] = true;
    let lost = LostViews::find(&geometry, spoilt.view(), Some(unknown.view())).unwrap();
    assert_eq!(numbers(&lost), [60]);
    assert!(lost.moments()[[20, 0]].is_nan());
    // Many views.
    let many: Vec<(usize, f32)> = (0..45).map(|n| (4 * n, 0.0)).collect();
    assert_eq!(numbers(&lost_in(&geometry, &scaled(&angles, &many))).len(), 45);
    let most: Vec<(usize, f32)> = (0..90).map(|n| (2 * n, 0.0)).collect();
    assert!(numbers(&lost_in(&geometry, &scaled(&angles, &most))).is_empty());
    // A half-fan.
    let mut half = fan(180);
    half.axis = 15.0 * PIXEL;
    let lost = lost_in(&half, &scaled(&sinograms(&half, &narrow(), Quantity::Delta), &[(9, 0.0)]));
    assert!(lost.record().not_compared.as_ref().unwrap().contains("half-fan"));
    assert!(numbers(&lost).is_empty());
    // Few views.
    let few = fan(11);
    let lost = lost_in(&few, &sinograms(&few, &narrow(), Quantity::Delta));
    assert!(lost.record().not_compared.as_ref().unwrap().contains("fewer than 12 views"));
}

/// Motions along x keep the slice, motions along z change it.
#[test]
fn motions_are_compared_where_they_keep_the_slice() {
    let turn = |n: i32| TAU * f64::from(n) / 72.0;
    let moved = |by: [f64; 3]| {
        let motion = |n: i32| {
            let share = f64::from(n) / 72.0;
            Motion::about_z(-turn(n)).then(&Motion::translation(by.map(|side| side * share)))
        };
        let made =
            ScanGeometry::new([0.01, 0.02], places(96, 2.0 * PIXEL), vec![0.0], vec![0.0; 72]);
        made.with_motions((0..72).map(motion).collect())
    };
    let cycloid = moved([8.0 * PIXEL, 0.0, 0.0]);
    let angles = scaled(&sinograms(&cycloid, &narrow(), Quantity::Delta), &[(30, 0.0)]);
    assert_eq!(numbers(&lost_in(&cycloid, &angles)), [30]);
    let helix = moved([0.0, 0.0, 2.0 * PIXEL]);
    let angles = scaled(&sinograms(&helix, &narrow(), Quantity::Delta), &[(30, 0.0)]);
    let lost = lost_in(&helix, &angles);
    assert!(numbers(&lost).is_empty());
    assert!(lost.record().not_compared.as_ref().unwrap().contains("change the slice"));
}

#[test]
fn bodies_reach_ends_of_rows_where_the_attenuation_there_is_a_fifth_of_the_largest() {
    let body =
        |from: usize, to: usize| {
            Array3::from_shape_fn((1, 1, 64), |(_, _, column)| {
                if (from..to).contains(&column) { 0.7_f32 } else { 0.01 }
            })
        };
    for (from, to, reaches) in [(8, 50, false), (0, 50, true), (20, 64, true), (0, 64, true)] {
        assert_eq!(reaching_ends(body(from, to).view())[[0, 0]], reaches, "{from} to {to}");
    }
}
