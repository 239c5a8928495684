//! Deviations of volumes by those of sinograms, against the scatter over noisy sinograms.

use crate::set_up::{PIXEL, fan, grid, places, reconstruct, views};
use crate::support::{self, Worst};
use beamlet::ndarray::{Array3, s};
use beamlet::reconstruct::{
    FbpOptions, Filter, Quantity, ScanGeometry, VolumeGrid, fbp_mean_shared_sigma, fbp_mean_sigma,
    fbp_shared_sigma, fbp_sigma,
};
use beamlet::{Backend, Cancel, Error, RowsControl};

const COUNT: usize = 100;

/// Standard normal numbers.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((*state >> 11) as f64 + 0.5) / 2.0_f64.powi(53)
    };
    (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
}

/// Noise that changes from view to view and over the row.
fn deviations(geometry: &ScanGeometry) -> Array3<f32> {
    let shape = (geometry.angles.len(), geometry.rows.len(), geometry.columns.len());
    Array3::from_shape_fn(shape, |(view, _, column)| {
        (1e-3 * (1.0 + 0.5 * (view as f64 / 20.0).sin()) * (1.0 + column as f64 / 96.0)) as f32
    })
}

fn compare(geometry: &ScanGeometry, quantity: Quantity, grid: &VolumeGrid, options: FbpOptions) {
    let sigmas = deviations(geometry);
    let control = &mut RowsControl::default();
    let engine = support::engine(Backend::Bvh);
    let map =
        fbp_sigma(&engine, (geometry, sigmas.view(), quantity), grid, &options, control).unwrap();
    // A disc of voxels beside the middle, in the first plane.
    let region: Vec<[usize; 3]> = (0..grid.size[0] * grid.size[1])
        .map(|n| [n % grid.size[0], n / grid.size[0], 0])
        .filter(|[x, y, _]| (*x as f64 - 12.0).hypot(*y as f64 - 14.0) < 7.0)
        .collect();
    let given = (geometry, sigmas.view(), quantity);
    let of_mean = fbp_mean_sigma(given, grid, &region, &options, control).unwrap();
    let mut state = 7;
    let mut squares = Array3::<f64>::zeros(map.values.dim());
    let mut of_means = 0.0;
    for _ in 0..COUNT {
        let noise = sigmas.mapv(|sigma| (f64::from(sigma) * normal(&mut state)) as f32);
        let made = reconstruct(geometry, &noise, quantity, grid, &options).unwrap().values;
        squares.zip_mut_with(&made, |sum, value| *sum += f64::from(*value).powi(2) / COUNT as f64);
        let sum: f64 = region.iter().map(|[x, y, z]| f64::from(made[[*z, *y, *x]])).sum();
        of_means += (sum / region.len() as f64).powi(2) / COUNT as f64;
    }
    // Means over blocks, for a hundred sinograms scatter by 7 % in a voxel.
    let mut worst = Worst::new("deviation of voxels", 0.1);
    let block = grid.size[0] / 2;
    for (left, top) in [(0, 0), (block, 0), (0, block), (block, block)] {
        let part = |squares: &dyn Fn(usize, usize) -> f64| -> f64 {
            (0..block * block).map(|n| squares(top + n / block, left + n % block)).sum()
        };
        let found = part(&|y, x| squares[[0, y, x]]).sqrt();
        let expected = part(&|y, x| f64::from(map.values[[0, y, x]]).powi(2)).sqrt();
        worst.take(expected / found - 1.0, || format!("{quantity:?}"));
    }
    worst.holds();
    let mut worst = Worst::new("deviation of a mean", 0.15);
    worst.take(of_mean / of_means.sqrt() - 1.0, || format!("{quantity:?}"));
    worst.holds();
    // As if voxels were independent.
    let square = |at: &[usize; 3]| f64::from(map.values[[at[2], at[1], at[0]]]).powi(2);
    let alone = region.iter().map(square).sum::<f64>().sqrt() / region.len() as f64;
    assert!((alone / of_mean - 1.0).abs() > 0.3, "{alone} {of_mean}");
}

#[test]
fn deviations_are_the_scatter_of_noisy_sinograms() {
    let grid = grid([40, 40, 1]);
    compare(&fan(118), Quantity::Mu, &grid, FbpOptions::default());
    let smooth = FbpOptions::default().with_filter(Filter::Hann).with_cut_off(0.8);
    compare(&fan(180), Quantity::Delta, &grid, smooth);
    let pitch = 2.0 * PIXEL;
    let rows = places(6, pitch).into_iter().rev().collect();
    let cone = ScanGeometry::new([0.02, 0.04], places(60, pitch), rows, views(180));
    compare(&cone, Quantity::DarkField, &crate::set_up::grid([40, 40, 2]), FbpOptions::default());
}

/// Noise of rows and columns that all views share, against the scatter over draws: rms over rings of voxels,
/// and the mean of a region.
fn compare_shared(
    geometry: &ScanGeometry,
    quantity: Quantity,
    grid: &VolumeGrid,
    options: FbpOptions,
    draws: usize,
) {
    let mut sigmas = deviations(geometry);
    let first = sigmas.slice(s![..1, .., ..]).to_owned();
    sigmas.assign(&first);
    let (views, rows, columns) = sigmas.dim();
    let control = &mut RowsControl::default();
    let given = (geometry, sigmas.view(), quantity);
    let map = fbp_shared_sigma(given, grid, &options, control).unwrap().values;
    let region: Vec<[usize; 3]> = (0..grid.size[0] * grid.size[1])
        .map(|n| [n % grid.size[0], n / grid.size[0], 0])
        .filter(|[x, y, _]| (*x as f64 - 12.0).hypot(*y as f64 - 14.0) < 3.0)
        .collect();
    let of_mean = fbp_mean_shared_sigma(given, grid, &region, &options, control).unwrap();
    let one = fbp_mean_shared_sigma(given, grid, &[[24, 9, 0]], &options, control).unwrap();
    let mut state = 11;
    let mut squares = Array3::<f64>::zeros(map.dim());
    let mut of_means = 0.0;
    for _ in 0..draws {
        let noise = Array3::from_shape_fn((1, rows, columns), |at| {
            (f64::from(first[at]) * normal(&mut state)) as f32
        });
        let noise = noise.broadcast((views, rows, columns)).unwrap().to_owned();
        let made = reconstruct(geometry, &noise, quantity, grid, &options).unwrap().values;
        squares.zip_mut_with(&made, |sum, value| *sum += f64::from(*value).powi(2) / draws as f64);
        let sum: f64 = region.iter().map(|[x, y, z]| f64::from(made[[*z, *y, *x]])).sum();
        of_means += (sum / region.len() as f64).powi(2) / draws as f64;
    }
    // A hundred draws scatter by 7 % in a ring, whose voxels share their noise.
    let mut worst = Worst::new("deviation of rings", 0.25);
    for [low, high] in [[0.0, 2.0], [2.0, 6.0], [6.0, 12.0], [12.0, 19.0]] {
        let is_in = |((_, y, x), _): &((usize, usize, usize), &f64)| {
            let [x, y] = [x, y].map(|n| *n as f64 - (grid.size[0] as f64 - 1.0) / 2.0);
            (low..high).contains(&x.hypot(y))
        };
        let found: f64 = squares.indexed_iter().filter(is_in).map(|(_, square)| square).sum();
        let squares_of_map = map.mapv(|sigma| f64::from(sigma).powi(2));
        let expected: f64 = squares_of_map.indexed_iter().filter(is_in).map(|(_, s)| s).sum();
        worst.take((expected / found).sqrt() - 1.0, || format!("{quantity:?}, from {low}"));
    }
    worst.holds();
    let mut worst = Worst::new("deviation of a mean by shared noise", 0.2);
    worst.take(of_mean / of_means.sqrt() - 1.0, || format!("{quantity:?}"));
    // A region of one voxel is exact, and may be beside the mean of its ring.
    worst.take(one / squares[[0, 9, 24]].sqrt() - 1.0, || format!("{quantity:?}, one voxel"));
    worst.holds();
    // The same deviations in independent views are another figure.
    let alone = fbp_mean_sigma(given, grid, &region, &options, control).unwrap();
    assert!((alone / of_mean - 1.0).abs() > 0.3, "{alone} {of_mean}");
}

#[test]
fn deviations_by_shared_noise_are_the_scatter_of_rings() {
    let flat = grid([40, 40, 1]);
    compare_shared(&fan(180), Quantity::Delta, &flat, FbpOptions::default(), COUNT);
    let smooth = FbpOptions::default().with_filter(Filter::Hann).with_cut_off(0.8);
    compare_shared(&fan(118), Quantity::Mu, &flat, smooth, COUNT);
    let pitch = 2.0 * PIXEL;
    let rows = places(6, pitch).into_iter().rev().collect();
    let cone = ScanGeometry::new([0.02, 0.04], places(60, pitch), rows, views(180));
    compare_shared(
        &cone,
        Quantity::DarkField,
        &grid([40, 40, 2]),
        FbpOptions::default(),
        4 * COUNT,
    );
    let sigmas = deviations(&cone);
    let cancel = Cancel::default();
    cancel.cancel();
    let control = &mut RowsControl::default().with_cancel(cancel);
    let given = (&cone, sigmas.view(), Quantity::Mu);
    let made = fbp_shared_sigma(given, &grid([40, 40, 2]), &FbpOptions::default(), control);
    assert!(matches!(made, Err(Error::Interrupted)));
}

#[test]
fn unknown_deviations_are_refused() {
    let mut geometry = fan(180);
    let engine = support::engine(Backend::Bvh);
    let grid = grid([8, 8, 1]);
    let refused = |geometry: &ScanGeometry, sigmas: &Array3<f32>, options, words: &str| {
        let control = &mut RowsControl::default();
        let made =
            fbp_sigma(&engine, (geometry, sigmas.view(), Quantity::Mu), &grid, &options, control);
        let message = made.unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    let mut sigmas = deviations(&geometry);
    let extrapolated = FbpOptions::default().with_extrapolate(true);
    refused(&geometry, &sigmas, extrapolated, "extrapolated");
    sigmas[[2, 0, 3]] = -1.0;
    refused(&geometry, &sigmas, FbpOptions::default(), "view 2, row 0, column 3");
    sigmas[[2, 0, 3]] = 1.0;
    geometry.columns[5] += 0.5 * PIXEL;
    refused(&geometry, &sigmas, FbpOptions::default(), "uneven");
}
