//! Corrections of sinograms and slices: each leaves an error that is measured without it.

use crate::reference::blobs::Blob;
use crate::set_up::{
    PIXEL, blobs, deviation, fan, grid, parallel, places, reconstruct, sinograms, views,
};
use crate::support::{self, Worst};
use beamlet::ndarray::{Array3, s};
use beamlet::reconstruct::{
    Data, FbpOptions, IterativeOptions, Measured, Quantity, ScanGeometry, Volume, VolumeGrid,
    add_gradient_bias, find_axis, gradient_bias, iterate, phase_along_rows, suppress_rings,
};
use beamlet::scene::{Beam, Detector, MaskBody, MaskSpec, Scene, Source};
use beamlet::{Backend, Cancel, Result, RowsControl};

/// Chords of discs of value 1, m: means over columns.
fn discs(geometry: &ScanGeometry, discs: &[([f64; 2], f64)]) -> Array3<f32> {
    let shape = (geometry.angles.len(), geometry.rows.len(), geometry.columns.len());
    let pitch = geometry.columns[1] - geometry.columns[0];
    let chord = |view: usize, place: f64, ([x, y], radius): ([f64; 2], f64)| {
        let (sin, cos) = geometry.angles[view].sin_cos();
        let [across, depth] = [x * cos + y * sin, y * cos - x * sin];
        let off = if geometry.source_distance.is_infinite() {
            place - across - geometry.axis
        } else {
            let [u, d] = [place, geometry.detector_distance];
            ((across + geometry.axis) * d - (depth + geometry.source_distance) * u) / u.hypot(d)
        };
        2.0 * (radius * radius - off * off).max(0.0).sqrt()
    };
    Array3::from_shape_fn(shape, |(view, _, column)| {
        let parts = (0..8).map(|n| geometry.columns[column] + (f64::from(n) - 3.5) / 8.0 * pitch);
        let sum = |place: f64| discs.iter().map(|disc| chord(view, place, *disc)).sum::<f64>();
        (parts.map(sum).sum::<f64>() / 8.0) as f32
    })
}

/// Largest distance of the values from 1 for which `counts` says so of the place, and their mean.
fn off(volume: &Volume, counts: impl Fn(f64, f64) -> bool) -> (f64, f64) {
    let VolumeGrid { origin, voxel, .. } = volume.grid;
    let inside: Vec<f64> = volume
        .values
        .indexed_iter()
        .filter(|((_, y, x), _)| {
            counts(origin[0] + voxel[0] * *x as f64, origin[1] + voxel[1] * *y as f64)
        })
        .map(|(_, value)| f64::from(*value))
        .collect();
    let largest = inside.iter().map(|value| (value - 1.0).abs()).fold(0.0, f64::max);
    (largest, inside.iter().sum::<f64>() / inside.len() as f64)
}

/// A body 1.3 times as wide as the detector sees it, with a blob inside.
#[test]
fn truncated_rows_go_on_as_ellipses() {
    let blob = Blob { centre: [-10.0 * PIXEL, 8.0 * PIXEL, 0.0], sigma: 4.0 * PIXEL, peak: 0.5 };
    for (geometry, centre) in [
        (parallel(180), [0.0, 0.0]),
        (parallel(180), [5.0 * PIXEL, -3.0 * PIXEL]),
        (fan(180), [3.0 * PIXEL, 2.0 * PIXEL]),
    ] {
        let body = discs(&geometry, &[(centre, 62.4 * PIXEL)]);
        let sinograms = body + sinograms(&geometry, &[blob], Quantity::Mu);
        let error = |extrapolate: bool| {
            let options = FbpOptions::default().with_extrapolate(extrapolate);
            let grid = grid([64, 64, 1]);
            let made = reconstruct(&geometry, &sinograms, Quantity::Mu, &grid, &options);
            let mut volume = made.unwrap();
            for ((_, y, x), value) in volume.values.indexed_iter_mut() {
                let [x, y] = [(x, 0), (y, 1)].map(|(n, axis)| grid.origin[axis] + n as f64 * PIXEL);
                *value -= blob.at([x, y, 0.0]) as f32;
            }
            off(&volume, |x: f64, y: f64| x.hypot(y) < 24.0 * PIXEL).0
        };
        let [with, without] = [true, false].map(error);
        println!("measured truncation: {with:.2e}, {without:.2e} without");
        assert!(with < 0.02 && without > 0.05, "{with} {without}");
    }
    let geometry = fan(180);
    let zeros = Array3::<f32>::zeros((180, 1, 96));
    let options = FbpOptions::default().with_extrapolate(true);
    let made = reconstruct(&geometry, &zeros, Quantity::Delta, &grid([8, 8, 1]), &options);
    let message = made.unwrap_err().to_string();
    assert!(message.contains("refraction angles"), "{message}");
    // Rows that nothing cuts stay as they are.
    let whole = sinograms(&geometry, &blobs(), Quantity::Mu);
    let volume = reconstruct(&geometry, &whole, Quantity::Mu, &grid([56, 56, 1]), &options);
    assert!(deviation(&volume.unwrap(), &blobs()) < 1e-3);
}

/// Gains that differ by 1 % from column to column add 1 % to −ln T.
#[test]
fn gains_of_columns_leave_a_fifth_of_their_rings() {
    let geometry = parallel(180);
    let small = [20.0 * PIXEL, 6.0 * PIXEL];
    // −ln T up to 1.
    let clean =
        discs(&geometry, &[([3.0 * PIXEL, -5.0 * PIXEL], 35.0 * PIXEL), (small, 5.0 * PIXEL)])
            .mapv(|chord| chord / (70.0 * PIXEL) as f32);
    let mut state = 5_u32;
    let mut striped = || {
        let gains: Vec<f32> = (0..96)
            .map(|_| {
                // Sums of twelve: standard deviation 1.
                let mut sum = -6.0;
                for _ in 0..12 {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    sum += f64::from(state >> 8) / f64::from(1 << 24);
                }
                (0.01 * sum) as f32
            })
            .collect();
        let mut striped = clean.clone();
        striped.indexed_iter_mut().for_each(|((_, _, column), value)| *value += gains[column]);
        striped
    };
    let grid = grid([96, 96, 1]);
    let made = |sinograms: &Array3<f32>| {
        let options = FbpOptions::default();
        reconstruct(&geometry, sinograms, Quantity::Mu, &grid, &options).unwrap()
    };
    let corrected = |sinograms: &Array3<f32>| {
        let mut sinograms = sinograms.clone();
        suppress_rings(&geometry, sinograms.view_mut(), &Cancel::default()).unwrap();
        made(&sinograms)
    };
    let [truth, touched] = [made(&clean), corrected(&clean)];
    let square = |a: &Volume| {
        let inside = |x: f64, y: f64| x.hypot(y) < 44.0 * PIXEL;
        let mut difference = a.clone();
        difference.values.zip_mut_with(&truth.values, |a, b| *a = (*a - b).powi(2));
        off(&difference, inside).1.sqrt()
    };
    // Some gains have more of long waves, which are left, than others: the mean of four.
    let shares: Vec<f64> = (0..4)
        .map(|_| {
            let striped = striped();
            square(&corrected(&striped)) / square(&made(&striped))
        })
        .collect();
    println!("measured rings: {shares:.3?} left");
    assert!(shares.iter().sum::<f64>() / 4.0 < 0.2, "{shares:?}");
    for (centre, radius) in [([3.0, -5.0], 20.0), ([20.0, 6.0], 4.0), ([-10.0, 5.0], 8.0)] {
        let counts = |x: f64, y: f64| (x / PIXEL - centre[0]).hypot(y / PIXEL - centre[1]) < radius;
        let moved = off(&touched, counts).1 / off(&truth, counts).1 - 1.0;
        println!("measured mean of a region: moved by {moved:.1e}");
        assert!(moved.abs() < 1e-3, "{moved}");
    }
    let few = ScanGeometry::new([f64::INFINITY, 1.0], places(96, PIXEL), vec![0.0], views(5));
    let mut zeros = Array3::zeros((5, 1, 96));
    assert!(suppress_rings(&few, zeros.view_mut(), &Cancel::default()).is_err());
}

#[test]
fn integrated_angles_are_the_phase() {
    let mut worst = Worst::new("phase of blobs", 3e-3);
    {
        let geometry = parallel(60);
        let mut angles = sinograms(&geometry, &blobs(), Quantity::Delta);
        // Flagged pixels, pixels without a value, and a drift.
        angles.slice_mut(s![.., .., 30]).fill(f32::NAN);
        angles.slice_mut(s![.., .., 60]).fill(1.0);
        let mut usable = Array3::from_elem(angles.dim(), true);
        usable.slice_mut(s![.., .., 60]).fill(false);
        let most =
            angles.iter().filter(|a| a.is_finite() && **a < 1.0).fold(0.0, |m: f32, a| m.max(*a));
        angles.mapv_inplace(|angle| angle + 0.05 * most);
        let phase = phase_along_rows(&geometry, angles.view(), Some(usable.view())).unwrap();
        let truth = sinograms(&geometry, &blobs(), Quantity::Mu);
        let peak = truth.iter().copied().fold(0.0, f32::max);
        let square: f64 =
            phase.iter().zip(&truth).map(|(a, b)| f64::from((a - b) / peak).powi(2)).sum();
        worst
            .take((square / truth.len() as f64).sqrt(), || format!("{}", geometry.source_distance));
    }
    worst.holds();
    let geometry = fan(180);
    let angles = sinograms(&geometry, &blobs(), Quantity::Delta);
    let none = Array3::from_elem(angles.dim(), false);
    let message = phase_along_rows(&geometry, angles.view(), Some(none.view())).unwrap_err();
    assert!(message.to_string().contains("view 0, row 0"), "{message}");
    let phase = phase_along_rows(&geometry, angles.view(), None).unwrap();
    let measured = Measured::new(Data::Phase, phase.view());
    let (engine, control) = (support::engine(Backend::Bvh), &mut RowsControl::default());
    let options = IterativeOptions::default().with_iterations(10);
    let made = iterate(&engine, &geometry, &measured, &grid([64, 64, 1]), &options, control);
    let error = deviation(&made.unwrap().volume, &blobs());
    println!("measured δ of phase: {error:.2e}");
    assert!(error < 8e-3, "{error}");
}

fn axis_of(geometry: &ScanGeometry, sinograms: &Array3<f32>, data: Data) -> Result<f64> {
    find_axis(geometry, sinograms.view(), data, &Cancel::default())
}

#[test]
fn lines_seen_twice_give_the_axis() {
    let mut worst = Worst::new("axis of rotation, pixels", 0.1);
    let bodies =
        [([12.0 * PIXEL, -6.0 * PIXEL], 9.0 * PIXEL), ([-14.0 * PIXEL, 3.0 * PIXEL], 6.0 * PIXEL)];
    for shift in [3.7, -2.45] {
        for mut geometry in [parallel(180), fan(180), fan(130)] {
            let is_turn = geometry.angles.len() == 180;
            geometry.axis = shift * PIXEL;
            for (data, quantity) in [
                (Data::Attenuation, Quantity::Mu),
                (Data::DarkField, Quantity::DarkField),
                (Data::Refraction, Quantity::Delta),
            ] {
                let given = sinograms(&geometry, &blobs(), quantity);
                let found = axis_of(&geometry, &given, data).unwrap() / PIXEL;
                worst.take(found - shift, || format!("blobs, {data:?}, {shift}, turn: {is_turn}"));
            }
            // Sharp borders, with noise of 1 % of the largest value.
            let mut given = discs(&geometry, &bodies);
            let mut state = 3_u32;
            given.mapv_inplace(|value| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                value + (f64::from(state >> 8) / f64::from(1 << 24) - 0.5) as f32 * 6e-5
            });
            let found = axis_of(&geometry, &given, Data::Attenuation).unwrap() / PIXEL;
            worst.take(found - shift, || format!("discs, {shift}, turn: {is_turn}"));
        }
    }
    worst.holds();
    let geometry = parallel(60);
    let half = sinograms(&geometry, &blobs(), Quantity::Mu);
    let message = axis_of(&geometry, &half, Data::Attenuation).unwrap_err().to_string();
    assert!(message.contains("from both ends"), "{message}");
    let geometry = parallel(180);
    let flat = Array3::<f32>::zeros((180, 1, 96));
    assert!(axis_of(&geometry, &flat, Data::Attenuation).is_err());
}

/// The paper's masks; a curve of 9.48 um.
#[test]
fn gradient_bias_is_added() {
    let source = Source::new(1.213, [30e-6; 2], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(1.8, [4, 1], [150e-6; 2]));
    assert!(gradient_bias(&scene, 9e-6).unwrap_err().to_string().contains("sample_mask"));
    let body = MaskBody::Sheet { transmission: 0.0 };
    scene.sample_mask = Some(MaskSpec::new(1.2, 100e-6, 20e-6, body));
    let k = gradient_bias(&scene, 9.48e-6).unwrap();
    println!("measured k: {k:.3e} m");
    // (1.8 / 1.2 / 0.587)(1.213 / 1.2)(89.87 - 33.33) um².
    assert!((k / 1.460e-10 - 1.0).abs() < 2e-3, "{k}");
    assert!(gradient_bias(&scene, 5e-6).is_err());
    let geometry = parallel(90);
    let volume = |quantity| {
        let sinograms = sinograms(&geometry, &blobs(), Quantity::Mu);
        reconstruct(&geometry, &sinograms, quantity, &grid([8, 8, 1]), &FbpOptions::default())
            .unwrap()
    };
    let (mut delta, mu) = (volume(Quantity::Delta), volume(Quantity::Mu));
    let before = delta.values[[0, 3, 4]];
    add_gradient_bias(&mut delta, &mu, 0.5).unwrap();
    assert!((delta.values[[0, 3, 4]] - before - 0.5 * mu.values[[0, 3, 4]]).abs() < 1e-6);
    assert!(add_gradient_bias(&mut mu.clone(), &delta, 0.5).is_err());
}
