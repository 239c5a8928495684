//! Search of the axis of rotation: each line through the sample is seen twice, from either end.

use super::data::Data;
use super::geometry::{ScanGeometry, same_shape};
use crate::{Cancel, Error, Result, parallel};
use ndarray::{Array2, ArrayView3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Deviation of the Gaussian that rows are smoothed by, columns: linear interpolation smooths less at a
/// column than between two, which draws the axis.
const BLUR: f64 = 2.0;
/// Columns on either side that the Gaussian reaches.
const REACH: usize = 6;
/// Share of the width of the detector that the axis is looked for on either side of the optical axis.
const RANGE: f64 = 0.25;
/// Least share of the lines of a view that must be seen twice.
const SEEN: f64 = 0.2;
/// Columns to which the axis is found.
const FINE: f64 = 1e-3;

/// x of the axis of rotation from the optical axis, m, by which lines that are seen from both ends
/// differ least. The row next to the optical axis counts; in parallel beams the middle one. Variances
/// and attenuation give it within a hundredth of a pixel; refraction angles of one scan without dithers
/// do not, for they scatter at silhouettes.
///
/// # Errors
/// [`Error::Argument`] for a geometry that cannot be, sinograms of another shape, values that are not
/// finite, views that see too few lines twice, and sinograms without contrast; [`Error::Interrupted`].
pub fn find_axis(
    geometry: &ScanGeometry,
    sinograms: ArrayView3<'_, f32>,
    data: Data,
    cancel: &Cancel,
) -> Result<f64> {
    geometry.check()?;
    geometry.require_circle("the search of the axis of rotation")?;
    same_shape("sinograms", sinograms.dim(), geometry.dim())?;
    parallel::start_threads()?;
    let search = Search::new(geometry, sinograms, data)?;
    let pitch = geometry.column_pitch() / geometry.magnification();
    let columns = geometry.columns.len() as f64;
    let far = (columns * RANGE).floor();
    let coarse: Vec<f64> = (0..).map(|n| f64::from(n) - far).take_while(|n| *n <= far).collect();
    let cost = |n: f64| search.cost(n * pitch, cancel);
    let costs: Vec<f64> = coarse.par_iter().map(|n| cost(*n)).collect::<Result<_>>()?;
    let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(0);
    if !costs[best].is_finite() {
        let found = "views that see too few lines from both ends, or no contrast";
        return Err(Error::argument("sinograms", found, "views over a turn, with a sample"));
    }
    // Golden section about the best column.
    let ratio = (5.0_f64.sqrt() - 1.0) / 2.0;
    let [mut low, mut high] = [coarse[best] - 1.5, coarse[best] + 1.5];
    let [mut a, mut b] = [high - ratio * (high - low), low + ratio * (high - low)];
    let [mut at_a, mut at_b] = [cost(a)?, cost(b)?];
    while high - low > FINE {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - ratio * (high - low);
            at_a = cost(a)?;
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + ratio * (high - low);
            at_b = cost(b)?;
        }
    }
    Ok(f64::midpoint(low, high) * pitch)
}

struct Search<'a> {
    geometry: &'a ScanGeometry,
    /// Smoothed row of each view, in the order of `angles`.
    values: Array2<f64>,
    angles: Vec<f64>,
    /// Views go around: the first follows the last.
    is_turn: bool,
    /// −1 where the two ends of a line see opposite values.
    sign: f64,
    /// Places of columns at the axis, m.
    places: Vec<f64>,
}

impl<'a> Search<'a> {
    fn new(geometry: &'a ScanGeometry, sinograms: ArrayView3<'_, f32>, data: Data) -> Result<Self> {
        let (views, rows, columns) = geometry.dim();
        let height = |row: &usize| geometry.rows[*row].abs();
        let nearest = (0..rows).min_by(|a, b| height(a).total_cmp(&height(b))).unwrap_or(0);
        let row = if geometry.source_distance.is_infinite() { rows / 2 } else { nearest };
        let mut order: Vec<usize> = (0..views).collect();
        order.sort_by(|a, b| geometry.angles[*a].total_cmp(&geometry.angles[*b]));
        let kernel: Vec<f64> = (0..=2 * REACH)
            .map(|n| libm::exp(-0.5 * ((n as f64 - REACH as f64) / BLUR).powi(2)))
            .collect();
        let mut values = Array2::zeros((views, columns));
        for (n, view) in order.iter().enumerate() {
            let line: Vec<f64> =
                (0..columns).map(|column| f64::from(sinograms[[*view, row, column]])).collect();
            if let Some(column) = line.iter().position(|value| !value.is_finite()) {
                let found = format!("{} in view {view}, row {row}, column {column}", line[column]);
                return Err(Error::argument("sinograms", found, "finite values"));
            }
            for column in 0..columns {
                let (mut sum, mut weights) = (0.0, 0.0);
                for (at, weight) in (column..).zip(&kernel) {
                    let inside = at.checked_sub(REACH).and_then(|at| line.get(at));
                    sum += inside.map_or(0.0, |value| value * weight);
                    weights += inside.map_or(0.0, |_| *weight);
                }
                values[[n, column]] = sum / weights;
            }
        }
        let angles: Vec<f64> = order.iter().map(|view| geometry.angles[*view]).collect();
        let step = (angles[views - 1] - angles[0]) / (views - 1) as f64;
        let is_turn = angles[views - 1] - angles[0] > TAU - 1.5 * step;
        let sign = if data == Data::Refraction { -1.0 } else { 1.0 };
        let scale = geometry.magnification();
        let places = geometry.columns.iter().map(|place| place / scale).collect();
        Ok(Self { geometry, values, angles, is_turn, sign, places })
    }

    /// Squares of the differences of lines seen twice, over those of their values.
    fn cost(&self, axis: f64, cancel: &Cancel) -> Result<f64> {
        let per = self.geometry.per_distance();
        let (mut squares, mut energy, mut seen) = (0.0, 0.0, 0_usize);
        for (view, angle) in self.angles.iter().enumerate() {
            cancel.check()?;
            for (column, u) in self.places.iter().enumerate() {
                let fan = libm::atan(u * per);
                let beside = (u - axis) / (u * per).hypot(1.0);
                // The same line from its other end.
                let mut other = axis - beside;
                for _ in 0..4 {
                    other = axis - beside * (other * per).hypot(1.0);
                }
                let turned = angle - fan + PI + libm::atan(other * per);
                let Some(found) = self.at(turned, other) else { continue };
                let value = self.values[[view, column]];
                squares += (value - self.sign * found).powi(2);
                energy += value * value + found * found;
                seen += 1;
            }
        }
        let enough = seen as f64 > SEEN * self.values.len() as f64;
        Ok(if enough && energy > 0.0 { squares / energy } else { f64::INFINITY })
    }

    /// Value at an angle and a place at the axis, `None` beyond the views or the detector.
    fn at(&self, angle: f64, place: f64) -> Option<f64> {
        let views = self.angles.len();
        let last = self.places.len() - 1;
        if place < self.places[0] || place > self.places[last] {
            return None;
        }
        let right = self.places.partition_point(|at| *at < place).clamp(1, last);
        let across =
            (place - self.places[right - 1]) / (self.places[right] - self.places[right - 1]);
        let angle = self.angles[0] + (angle - self.angles[0]).rem_euclid(TAU);
        let next = self.angles.partition_point(|at| *at <= angle);
        if next == views && !self.is_turn {
            return None;
        }
        // Four views about the angle, by a cubic: linear interpolation smooths between views.
        let before = next - 1;
        let behind = if next == views { self.angles[0] + TAU } else { self.angles[next] };
        let along = (angle - self.angles[before]) / (behind - self.angles[before]);
        let value = |n: usize| {
            let row = self.values.row(n % views);
            row[right - 1] + across * (row[right] - row[right - 1])
        };
        let is_inner = self.is_turn || (before > 0 && next + 1 < views);
        let [b, c] = [value(before), value(next)];
        if !is_inner {
            return Some(b + along * (c - b));
        }
        let [a, d] = [value(before + views - 1), value(next + 1)];
        let cubic =
            c - a + along * (2.0 * a - 5.0 * b + 4.0 * c - d + along * (3.0 * (b - c) + d - a));
        Some(b + 0.5 * along * cubic)
    }
}
