//! Phase: refraction angles integrated along the rows.

use beamlet_core::numbers::single;
use beamlet_core::{Error, Result};
use beamlet_files::GeometryFile;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Mean angles of rows that were taken off before integration: air on both sides of a sample makes them
/// zero.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Drift {
    /// Root mean square of them over all rows and views, rad.
    pub rms_rad: f64,
    /// Largest size of them, rad.
    pub largest_rad: f64,
    /// Largest size of the sum of a row that was taken off, over the largest phase that is left.
    pub largest_share: f64,
    /// Pixels without an angle, interpolated along their row.
    #[serde(default)]
    pub filled: u64,
}

/// Mean angles of rows while they are collected.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct DriftSum {
    rows: u64,
    squares: f64,
    largest: f64,
    most: f64,
    filled: u64,
}

impl DriftSum {
    /// Takes a row: the mean angle that was taken off, its phase, and its pixels without an angle.
    pub(crate) fn take(&mut self, mean: f64, phase: &[f32], filled: u64) {
        self.rows += 1;
        self.squares += mean * mean;
        self.largest = self.largest.max(mean.abs());
        self.most = phase.iter().fold(self.most, |most, value| most.max(f64::from(value.abs())));
        self.filled += filled;
    }

    /// Value subtracted from rows of a width at the axis of rotation, m.
    pub(crate) fn drift(&self, width: f64) -> Drift {
        let share = if self.most > 0.0 { self.largest * width / self.most } else { 0.0 };
        Drift {
            rms_rad: (self.squares / self.rows.max(1) as f64).sqrt(),
            largest_rad: self.largest,
            largest_share: share,
            filled: self.filled,
        }
    }
}

/// Borders of columns: half the way to the next ones.
pub fn borders(columns: &[f64]) -> Vec<f64> {
    let last = columns.len() - 1;
    let middle = |n: usize| f64::midpoint(columns[n], columns[n + 1]);
    let before = columns[0] - (columns[1] - columns[0]) / 2.0;
    let behind = columns[last] + (columns[last] - columns[last - 1]) / 2.0;
    [before].into_iter().chain((0..last).map(middle)).chain([behind]).collect()
}

/// Angles (rad) integrated along a row at ascending `places` (m on the detector, magnified by `scale`), at
/// its columns, m; and the mean angle that was taken off. `known`: columns with their angles, ascending,
/// one or more; others are interpolated between them. `tangent`: change of the tangent of an angle in the
/// plane of the row per change of the integral along x, at a place.
pub(crate) fn integrated_row(
    known: &[(usize, f64)],
    places: &[f64],
    scale: f64,
    tangent: impl Fn(f64) -> f64,
) -> (Vec<f32>, f64) {
    let angle = |column: usize| {
        let next = known.partition_point(|(at, _)| *at < column);
        match (next.checked_sub(1).map(|before| known[before]), known.get(next).copied()) {
            (_, Some((at, angle))) if at == column => angle,
            (Some((a, from)), Some((b, to))) => {
                let share = (places[column] - places[a]) / (places[b] - places[a]);
                from + share * (to - from)
            }
            (Some((_, angle)), None) | (None, Some((_, angle))) => angle,
            (None, None) => 0.0,
        }
    };
    let borders = borders(places);
    let mut sums = vec![0.0];
    for (column, place) in places.iter().enumerate() {
        let width = (borders[column + 1] - borders[column]) / scale;
        sums.push(sums[column] - angle(column) * width / tangent(*place));
    }
    let last = places.len();
    let ramp = sums[last] / (borders[last] - borders[0]);
    let levelled = |n: usize| sums[n] - ramp * (borders[n] - borders[0]);
    let middle = |column| single(f64::midpoint(levelled(column), levelled(column + 1)));
    ((0..last).map(middle).collect(), -ramp * scale)
}

/// Integrates the refraction images of a scan, view by view.
#[derive(Debug)]
pub(super) struct PhaseImages {
    columns: Vec<f64>,
    rows: Vec<f64>,
    distance: f64,
    scale: f64,
    sum: DriftSum,
}

impl PhaseImages {
    /// # Errors
    /// [`Error::Argument`] for images of fewer than two columns.
    pub(super) fn new(geometry: GeometryFile) -> Result<Self> {
        let GeometryFile { columns_m: columns, rows_m: rows, .. } = geometry;
        if columns.len() < 2 || !columns.is_sorted_by(|a, b| a < b) {
            let found = format!("{} columns", columns.len());
            return Err(Error::argument("phase", found, "two or more columns, ascending"));
        }
        let distance = geometry.source_to_detector_m;
        let scale = distance / geometry.source_to_axis_m;
        Ok(Self { columns, rows, distance, scale, sum: DriftSum::default() })
    }

    /// The phase of a view, m; rows without an angle have none.
    pub(super) fn of(&mut self, angles: &Array2<f32>) -> Array2<f32> {
        let mut phase = Array2::from_elem(angles.dim(), f32::NAN);
        for (row, (line, mut out)) in angles.outer_iter().zip(phase.outer_iter_mut()).enumerate() {
            let known: Vec<(usize, f64)> = (0..)
                .zip(line.iter().map(|angle| f64::from(*angle)))
                .filter(|(_, angle)| angle.is_finite())
                .collect();
            if known.is_empty() {
                continue;
            }
            let height = self.rows.get(row).copied().unwrap_or_default();
            let tangent = |place: f64| {
                let [u, v] = [place, height].map(|at| at / self.distance);
                (1.0 + u * u + v * v) * (1.0 + u * u)
            };
            let (values, mean) = integrated_row(&known, &self.columns, self.scale, tangent);
            self.sum.take(mean, &values, (line.len() - known.len()) as u64);
            out.iter_mut().zip(values).for_each(|(to, from)| *to = from);
        }
        phase
    }

    /// Value subtracted from all rows.
    pub(super) fn drift(&self) -> Drift {
        let borders = borders(&self.columns);
        self.sum.drift((borders[self.columns.len()] - borders[0]) / self.scale)
    }
}
