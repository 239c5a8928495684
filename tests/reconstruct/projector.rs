//! Joseph's projector: the transpose by scalar products, integrals against closed forms.

use crate::reference::blobs::Blob;
use crate::set_up::{PIXEL, blobs, fan, grid, parallel, places, sinograms, views};
use crate::support::{self, Worst};
use beamlet::ndarray::{Array3, ArrayView3, s};
use beamlet::reconstruct::{Data, Model, Quantity, ScanGeometry, VolumeGrid};
use beamlet::{Backend, RowsControl};

const ALL: [Data; 4] = [Data::Attenuation, Data::Refraction, Data::Phase, Data::DarkField];

pub(crate) fn model(
    geometry: &ScanGeometry,
    grid: &VolumeGrid,
    data: Data,
    at_once: Option<usize>,
) -> Model {
    Model::new(&support::engine(Backend::Bvh), geometry, grid, data, at_once).unwrap()
}

/// Values between −1 and 1 that look random.
pub(crate) fn noise(shape: (usize, usize, usize), seed: u32) -> Array3<f32> {
    let mut state = seed;
    Array3::from_shape_simple_fn(shape, || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(state >> 8) / f64::from(1 << 23) - 1.0) as f32
    })
}

fn dot(a: ArrayView3<'_, f32>, b: ArrayView3<'_, f32>) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

/// A cone of ±8° about the middle of 12 rows, beside the optical axis.
fn cone() -> ScanGeometry {
    let pitch = 2.0 * PIXEL;
    let rows = places(12, pitch).into_iter().rev().map(|z| z + 0.3 * pitch).collect();
    let mut geometry = ScanGeometry::new([0.02, 0.04], places(40, pitch), rows, views(47));
    geometry.lever = 0.03;
    geometry
}

pub(crate) fn adjoint(geometry: &ScanGeometry, grid: &VolumeGrid, what: &'static str) {
    let mut worst = Worst::new(what, 1e-6);
    let ([x, y, z], control) = (grid.size, &mut RowsControl::default());
    let shape = (geometry.angles.len(), geometry.rows.len(), geometry.columns.len());
    for data in ALL {
        // Not about zero, so that the products do not cancel.
        let (volume, rays) = (noise((z, y, x), 1) + 0.5, noise(shape, 2) + 0.5);
        let one = model(geometry, grid, data, None);
        let forward = one.project(volume.view(), control).unwrap();
        let back = one.transpose(rays.view(), control).unwrap();
        let norm =
            dot(forward.view(), forward.view()).sqrt() * dot(rays.view(), rays.view()).sqrt();
        let products = [dot(forward.view(), rays.view()), dot(volume.view(), back.view())];
        worst.take((products[0] - products[1]) / norm, || format!("{data:?}"));
        // One plane and one view at a time: of one kind, which has the arms; of all with `BEAMLET_ALL`.
        if !support::everything() && data != Data::Phase {
            continue;
        }
        let parts = model(geometry, grid, data, Some(1));
        assert_eq!(parts.project(volume.view(), control).unwrap(), forward, "{data:?}");
        assert_eq!(parts.transpose(rays.view(), control).unwrap(), back, "{data:?}");
    }
    worst.holds();
}

#[test]
fn back_projection_is_the_transpose() {
    adjoint(&parallel(45), &grid([40, 50, 1]), "parallel beam");
    let mut geometry = fan(45);
    adjoint(&geometry, &grid([60, 50, 1]), "fan");
    geometry.axis = 3.7 * PIXEL;
    geometry.lever = 0.02;
    geometry.columns.iter_mut().for_each(|x| *x -= 5.3 * PIXEL);
    let region = VolumeGrid { origin: [12.0 * PIXEL, -20.0 * PIXEL, 0.0], ..grid([30, 17, 1]) };
    adjoint(&geometry, &region, "fan beside the axis, a region, an arm");
    for (n, x) in geometry.columns.iter_mut().enumerate() {
        *x += [0.0, 0.6, -0.4][n % 3] * PIXEL;
    }
    let fine = VolumeGrid { voxel: [0.37 * PIXEL, 0.61 * PIXEL, PIXEL], ..region };
    adjoint(&geometry, &fine, "uneven columns, voxels that are no squares");
    adjoint(&cone(), &grid([20, 24, 9]), "cone");
    let mut moved = cone();
    moved.axis = -2.2 * PIXEL;
    let region =
        VolumeGrid { origin: [-9.0 * PIXEL, 2.0 * PIXEL, 1.5 * PIXEL], ..grid([20, 8, 3]) };
    adjoint(&moved, &region, "cone beside the axis, a region");
}

/// Root mean square of the difference of two sinograms, over the largest value of the second.
pub(crate) fn difference(made: &Array3<f32>, truth: &Array3<f32>) -> f64 {
    let most = truth.iter().fold(0.0_f64, |most, value| most.max(f64::from(value.abs())));
    let sum: f64 = made.iter().zip(truth).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / truth.len() as f64).sqrt() / most
}

/// Values of voxels at their centres.
pub(crate) fn sampled(grid: &VolumeGrid, at: impl Fn([f64; 3]) -> f64) -> Array3<f32> {
    let [x, y, z] = grid.size;
    Array3::from_shape_fn((z, y, x), |(z, y, x)| {
        let n = [x, y, z];
        at([0, 1, 2].map(|axis| grid.origin[axis] + grid.voxel[axis] * n[axis] as f64)) as f32
    })
}

/// Linear interpolation of voxels adds 1/6 of a squared voxel to the variance of a blob of 8, the
/// difference over a column 1/12: 0.4 % of the height of its derivative, half of that in the mean.
#[test]
fn projected_blobs_are_the_closed_form() {
    let mut worst = Worst::new("projected blobs", 2.2e-3);
    let mut take = |geometry: &ScanGeometry, blobs: &[Blob], size, kinds: &[(Data, Quantity)]| {
        let grid = grid(size);
        let volume = sampled(&grid, |point| blobs.iter().map(|blob| blob.at(point)).sum());
        for (data, quantity) in kinds {
            let truth = sinograms(geometry, blobs, *quantity);
            let one = model(geometry, &grid, *data, None);
            let made = one.project(volume.view(), &mut RowsControl::default()).unwrap();
            let place = || format!("{data:?}, source at {} m", geometry.source_distance);
            worst.take(difference(&made, &truth), place);
        }
    };
    let kinds = [
        (Data::Attenuation, Quantity::Mu),
        (Data::Refraction, Quantity::Delta),
        (Data::DarkField, Quantity::DarkField),
    ];
    for mut geometry in [parallel(60), fan(90)] {
        take(&geometry, &blobs(), [80, 90, 1], &kinds);
        // Blobs at 1.2 mm then have arms from 0.94 to 1.06.
        geometry.lever = 0.02;
        geometry.axis = 2.5 * PIXEL;
        take(&geometry, &blobs(), [80, 90, 1], &kinds);
    }
    let mut geometry = cone();
    geometry.columns = places(96, 2.0 * PIXEL);
    let blobs = blobs().map(|blob| {
        let [x, y, _] = blob.centre;
        Blob { centre: [x, y, 1.5 * PIXEL], ..blob }
    });
    take(&geometry, &blobs, [80, 80, 60], &kinds);
    worst.holds();
}

/// Chords of an ellipse; voxels at its border hold the shares that lie inside.
#[test]
fn projected_ellipses_are_chords() {
    let [a, b, turn] = [26.0 * PIXEL, 14.0 * PIXEL, 0.4_f64];
    let centre = [6.0 * PIXEL, -4.0 * PIXEL];
    let level = |x: f64, y: f64| {
        let (sin, cos) = turn.sin_cos();
        [(x * cos + y * sin) / a, (y * cos - x * sin) / b]
    };
    let grid = grid([80, 80, 1]);
    let volume = sampled(&grid, |[x, y, _]| {
        let part = |n: i32| (f64::from(n) + 0.5) / 16.0 * PIXEL - PIXEL / 2.0;
        let is_inside = |n: i32| {
            let [p, q] = level(x + part(n % 16) - centre[0], y + part(n / 16) - centre[1]);
            p * p + q * q <= 1.0
        };
        f64::from((0..256).map(|n| u16::from(is_inside(n))).sum::<u16>()) / 256.0
    });
    let mut worst = Worst::new("projected ellipse", 4e-3);
    for geometry in [parallel(60), fan(90)] {
        let shape = (geometry.angles.len(), 1, geometry.columns.len());
        let truth = Array3::from_shape_fn(shape, |(view, _, column)| {
            let (sin, cos) = geometry.angles[view].sin_cos();
            let u = geometry.columns[column];
            let ([x, y], [dx, dy]) = if geometry.source_distance.is_infinite() {
                ([u, 0.0], [0.0, 1.0])
            } else {
                ([0.0, -geometry.source_distance], [u, geometry.detector_distance])
            };
            let turned = |x: f64, y: f64| [x * cos - y * sin, x * sin + y * cos];
            let ([x, y], [dx, dy], length) = (turned(x, y), turned(dx, dy), dx.hypot(dy));
            let [p, q] = level(x - centre[0], y - centre[1]);
            let [dp, dq] = level(dx / length, dy / length);
            let (square, half, rest) = (dp * dp + dq * dq, p * dp + q * dq, p * p + q * q - 1.0);
            (2.0 * (half * half - square * rest).max(0.0).sqrt() / square) as f32
        });
        let one = model(&geometry, &grid, Data::Attenuation, None);
        let made = one.project(volume.view(), &mut RowsControl::default()).unwrap();
        // Where the chord ends within a voxel the ray sees the mean over it.
        let made =
            Array3::from_shape_fn(shape, |at| if truth[at] > 8e-4 { made[at] } else { truth[at] });
        worst.take(difference(&made, &truth), || format!("{} m", geometry.source_distance));
    }
    worst.holds();
}

/// In a parallel beam the phase is the integral of δ with the arms.
#[test]
fn phase_counts_voxels_by_their_arm() {
    let mut geometry = parallel(60);
    geometry.lever = 0.02;
    let grid = grid([80, 90, 1]);
    let volume = sampled(&grid, |point| blobs()[0].at(point));
    let made = model(&geometry, &grid, Data::Phase, None)
        .project(volume.view(), &mut RowsControl::default())
        .unwrap();
    let mut truth = sinograms(&geometry, &blobs()[..1], Quantity::Mu);
    let [x, y, _] = blobs()[0].centre;
    for (view, angle) in geometry.angles.iter().enumerate() {
        let depth = y * angle.cos() - x * angle.sin();
        truth.slice_mut(s![view, .., ..]).mapv_inplace(|v| v * (1.0 - depth / 0.02) as f32);
    }
    let mut worst = Worst::new("phase of a blob", 1.5e-3);
    worst.take(difference(&made, &truth), String::new);
    worst.holds();
}
