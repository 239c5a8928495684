//! Sinograms of Gaussian blobs and of discs, in f64, and how far a volume is from them.

use crate::reference::blobs::Blob;
use crate::support;
use beamlet::ndarray::Array3;
use beamlet::reconstruct::{FbpOptions, Quantity, ScanGeometry, Volume, VolumeGrid, fbp};
use beamlet::{Backend, Result, RowsControl};

/// Side of a voxel, and of a pixel as the axis of rotation sees it.
pub(crate) const PIXEL: f64 = 1e-4;

/// Places of pixels about the optical axis.
pub(crate) fn places(count: i32, pitch: f64) -> Vec<f64> {
    (0..count).map(|n| (f64::from(n) + 0.5 - f64::from(count) / 2.0) * pitch).collect()
}

/// Views two degrees apart.
pub(crate) fn views(count: i32) -> Vec<f64> {
    (0..count).map(|n| f64::from(2 * n).to_radians()).collect()
}

/// Views over a whole turn.
pub(crate) fn views_over_a_turn(count: i32) -> Vec<f64> {
    (0..count).map(|n| std::f64::consts::TAU * f64::from(n) / f64::from(count)).collect()
}

/// A fan of ±26° that sees 96 pixels at the axis of rotation, twice as large on the detector.
pub(crate) fn fan(count: i32) -> ScanGeometry {
    ScanGeometry::new([0.01, 0.02], places(96, 2.0 * PIXEL), vec![0.0], views(count))
}

/// A parallel beam.
pub(crate) fn parallel(count: i32) -> ScanGeometry {
    ScanGeometry::new([f64::INFINITY, 1.0], places(96, PIXEL), vec![0.0], views(count))
}

/// Blobs in the plane z = 0.
pub(crate) fn blobs() -> [Blob; 2] {
    [
        Blob { centre: [10.0 * PIXEL, -6.0 * PIXEL, 0.0], sigma: 8.0 * PIXEL, peak: 1.0 },
        Blob { centre: [-9.0 * PIXEL, 8.0 * PIXEL, 0.0], sigma: 8.0 * PIXEL, peak: 0.7 },
    ]
}

/// Integrals of blobs along the lines to the pixels, or slopes of their refraction along x, with the
/// lever arm of the geometry.
pub(crate) fn sinograms(
    geometry: &ScanGeometry,
    blobs: &[Blob],
    quantity: Quantity,
) -> Array3<f32> {
    let shape = (geometry.angles.len(), geometry.rows.len(), geometry.columns.len());
    Array3::from_shape_fn(shape, |(view, row, column)| {
        let (x, z) = (geometry.columns[column], geometry.rows[row]);
        let (from, direction) = if geometry.source_distance.is_infinite() {
            ([x, -1.0, z], [0.0, 1.0, 0.0])
        } else {
            ([0.0, -geometry.source_distance, 0.0], [x, geometry.detector_distance, z])
        };
        let value = |blob: &Blob| {
            // The sample turns back where source and detector turn.
            let placed = match &geometry.motions {
                None => blob.placed(-geometry.angles[view], geometry.axis),
                Some(motions) => {
                    let [x, y, z] = motions[view].point(blob.centre);
                    Blob { centre: [x + geometry.axis, y, z], ..*blob }
                }
            };
            let (integral, deflection) = placed.line(from, direction);
            let [dx, dy, dz] = direction;
            let length = (dx * dx + dy * dy + dz * dz).sqrt();
            let arm = 1.0 - placed.nearest(from, direction)[1] / geometry.lever;
            // Of a Gaussian about the nearest point.
            let spread = blob.sigma * dy / length / geometry.lever;
            match quantity {
                Quantity::Mu => integral,
                Quantity::DarkField => integral * (arm * arm + spread * spread),
                Quantity::Delta => {
                    arm * length * (deflection[0] * dy - dx * deflection[1]) / (dy * dy)
                }
            }
        };
        blobs.iter().map(value).sum::<f64>() as f32
    })
}

/// A grid of voxels about the axis of rotation.
pub(crate) fn grid(size: [usize; 3]) -> VolumeGrid {
    let origin = size.map(|n| -(n as f64 - 1.0) / 2.0 * PIXEL);
    VolumeGrid { size, voxel: [PIXEL; 3], origin }
}

pub(crate) fn reconstruct(
    geometry: &ScanGeometry,
    sinograms: &Array3<f32>,
    quantity: Quantity,
    grid: &VolumeGrid,
    options: &FbpOptions,
) -> Result<Volume> {
    let (engine, mut control) = (support::engine(Backend::Bvh), RowsControl::default());
    fbp(&engine, geometry, sinograms.view(), quantity, grid, options, &mut control)
}

/// Root mean square of the difference to blobs, as a share of the highest peak.
pub(crate) fn deviation(volume: &Volume, blobs: &[Blob]) -> f64 {
    let VolumeGrid { voxel, origin, .. } = volume.grid;
    let square = |((z, y, x), value): ((usize, usize, usize), &f32)| {
        let n = [x, y, z];
        let point = [0, 1, 2].map(|axis| origin[axis] + voxel[axis] * n[axis] as f64);
        let truth: f64 = blobs.iter().map(|blob| blob.at(point)).sum();
        (f64::from(*value) - truth).powi(2)
    };
    let sum: f64 = volume.values.indexed_iter().map(square).sum();
    (sum / volume.values.len() as f64).sqrt() / blobs[0].peak
}
