//! Search of the axis of rotation: each line through the sample is seen twice, from either end.

use super::data::Data;
use super::geometry::{ScanGeometry, same_shape};
use beamlet_core::{Cancel, Error, Result, parallel};
use ndarray::{Array3, ArrayView1, ArrayView3, s};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Deviation of the Gaussian that rows are smoothed by, columns: linear interpolation smooths less at a
/// column than between two, which draws the axis.
const BLUR: f64 = 2.0;
/// Columns on either side that the Gaussian reaches.
const REACH: usize = 6;
/// Columns at either end that count for nothing, since their Gaussian is cut: they draw the axis by up to
/// 0.26 columns, and 0.03 without two deviations of it. Narrow detectors spare a share.
const MARGIN: [f64; 2] = [2.0 * BLUR, 1.0 / 12.0];
/// Most rows that are compared.
const ROWS: usize = 8;
/// Least contrast of a row, a share of the largest.
const CONTRAST: f64 = 0.25;
/// Views that the contrast of a row is measured in.
const VIEWS: usize = 64;
/// Lines of each candidate of the coarse search.
const COARSE: usize = 1 << 18;
/// Least share of the lines that must be seen twice.
const SEEN: f64 = 0.05;
/// Largest cost of an axis, over the mean of all candidates: noise alone gives 0.8 to 0.95, and
/// below 0.5 the axis of noisy discs is found within a column.
const HARDLY: f64 = 0.5;
/// Standard deviation of the axis from which on there is a warning, columns.
const UNSURE: f64 = 0.1;
/// Columns to which the axis is found.
const FINE: f64 = 1e-3;

/// x of the axis of rotation from the optical axis, m, by which lines that are seen from both ends
/// differ least: anywhere on the detector but at its ends. Up to eight rows with contrast count, those
/// nearest to the optical axis; in parallel beams those in the middle. Variances and attenuation give it
/// within a hundredth of a pixel; refraction angles of one scan without dithers do not, for they scatter
/// at silhouettes. Warns where noise leaves it unsure by more than a tenth of a column.
///
/// # Errors
/// [`Error::Argument`] for a geometry that cannot be, sinograms of another shape, values that are not
/// finite, views that see too few lines twice, sinograms without contrast, and an axis that fits hardly
/// better than others or best at an end of the detector; [`Error::Interrupted`].
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
    let search = Search::new(geometry, sinograms, data, cancel)?;
    let every = search.values.len().div_ceil(COARSE);
    let coarse = (0..geometry.columns.len()).into_par_iter();
    let costs: Vec<f64> = coarse
        .map(|column| Ok(search.pairs(column as f64, every, cancel)?.cost()))
        .collect::<Result<_>>()?;
    let best = best_candidate(&costs)?;
    let cost = |column: f64| Ok(search.pairs(column, 1, cancel)?.cost());
    let found = golden_section(best as f64, cost)?;
    let pairs = search.pairs(found, 1, cancel)?;
    let (least, mean) = (pairs.cost(), mean_of_finite(&costs));
    if least > HARDLY * mean {
        let found = format!(
            "no axis of rotation: lines from both ends differ by {:.0} % of the mean at the best column",
            100.0 * least / mean
        );
        return Err(Error::argument("sinograms", found, ALLOWED));
    }
    let deviation = pairs.deviation(cost(found - 1.0)? + cost(found + 1.0)? - 2.0 * least);
    if deviation > UNSURE {
        log::warn!(
            "the axis of rotation is found to about {:.1} columns only: noise, or few lines that views from \
             both ends see",
            2.0 * deviation
        );
    }
    Ok(search.place(found))
}

/// Sinograms that give the axis.
const ALLOWED: &str =
    "views over a turn of a sample with contrast above the noise, and the axis on the detector";

/// The candidate with the least cost.
///
/// # Errors
/// [`Error::Argument`] where there is none, or it is the first or the last.
fn best_candidate(costs: &[f64]) -> Result<usize> {
    let finite = || (0..costs.len()).filter(|n| costs[*n].is_finite());
    let (Some(first), Some(last)) = (finite().next(), finite().next_back()) else {
        let found = "views that see too few lines from both ends, or no contrast";
        return Err(Error::argument("sinograms", found, ALLOWED));
    };
    let best = finite().min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(first);
    if best == first || best == last {
        let found =
            format!("lines from both ends differ least at the end of the search, column {best}");
        return Err(Error::argument("sinograms", found, ALLOWED));
    }
    Ok(best)
}

fn mean_of_finite(costs: &[f64]) -> f64 {
    let finite = costs.iter().filter(|cost| cost.is_finite());
    finite.clone().sum::<f64>() / finite.count().max(1) as f64
}

/// The column with the least cost within 1.5 columns.
fn golden_section(about: f64, cost: impl Fn(f64) -> Result<f64>) -> Result<f64> {
    let ratio = (5.0_f64.sqrt() - 1.0) / 2.0;
    let [mut low, mut high] = [about - 1.5, about + 1.5];
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
    Ok(f64::midpoint(low, high))
}

/// Sums over the values of lines from both ends.
#[derive(Debug, Clone, Copy, Default)]
struct Pairs {
    count: f64,
    values: f64,
    squares: f64,
    /// Squares of the differences of pairs.
    differences: f64,
    /// Pairs that there may be.
    all: f64,
}

impl Pairs {
    fn take(&mut self, value: f64, other: f64) {
        self.count += 1.0;
        self.values += value + other;
        self.squares += value * value + other * other;
        self.differences += (value - other).powi(2);
    }

    fn with(self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            values: self.values + other.values,
            squares: self.squares + other.squares,
            differences: self.differences + other.differences,
            all: self.all + other.all,
        }
    }

    /// Squares of the differences over those of the deviations from the mean: 1 where values are independent.
    /// Infinite for too few pairs, and without contrast.
    fn cost(&self) -> f64 {
        let deviations = self.squares - self.values * self.values / (2.0 * self.count);
        let is_seen = self.count > SEEN * self.all && deviations > 1e-9 * self.squares;
        if is_seen { self.differences / deviations } else { f64::INFINITY }
    }

    /// Standard deviation of the axis, columns, by the change of the slope of the cost per column. Residuals
    /// of independent lines are half of the pairs, and the Gaussian makes `2 sqrt(pi) BLUR` columns of a row
    /// one.
    fn deviation(&self, curvature: f64) -> f64 {
        let independent = self.count / 2.0 / (2.0 * PI.sqrt() * BLUR);
        (2.0 * self.cost() / (curvature.max(f64::MIN_POSITIVE) * independent)).sqrt()
    }
}

struct Search<'a> {
    geometry: &'a ScanGeometry,
    /// Smoothed rows, `[view][row][column]`, views in the order of `angles`.
    values: Array3<f64>,
    angles: Vec<f64>,
    /// Views go around: the first follows the last.
    is_turn: bool,
    /// −1 where the two ends of a line see opposite values.
    sign: f64,
    /// Places of columns at the axis, m.
    places: Vec<f64>,
    /// Columns at either end that count for nothing.
    margin: f64,
}

/// The other end of the line through a column.
struct Partner {
    column: usize,
    /// Turn of the views from the one end to the other, rad.
    turn: f64,
    /// Column on the right of the other end, and the share of the way to it.
    right: usize,
    across: f64,
}

impl<'a> Search<'a> {
    fn new(
        geometry: &'a ScanGeometry,
        sinograms: ArrayView3<'_, f32>,
        data: Data,
        cancel: &Cancel,
    ) -> Result<Self> {
        let (views, _, columns) = geometry.dim();
        let rows = rows_with_contrast(geometry, sinograms, cancel)?;
        let mut order: Vec<usize> = (0..views).collect();
        order.sort_by(|a, b| geometry.angles[*a].total_cmp(&geometry.angles[*b]));
        let mut values = Array3::zeros((views, rows.len(), columns));
        for (n, view) in order.iter().enumerate() {
            cancel.check()?;
            for (to, row) in rows.iter().enumerate() {
                let line = sinograms.slice(s![*view, *row, ..]);
                if let Some(column) = line.iter().position(|value| !value.is_finite()) {
                    let found =
                        format!("{} in view {view}, row {row}, column {column}", line[column]);
                    return Err(Error::argument("sinograms", found, "finite values"));
                }
                values.slice_mut(s![n, to, ..]).assign(&ArrayView1::from(&smoothed(line)));
            }
        }
        let angles: Vec<f64> = order.iter().map(|view| geometry.angles[*view]).collect();
        let step = (angles[views - 1] - angles[0]) / (views - 1) as f64;
        let is_turn = angles[views - 1] - angles[0] > TAU - 1.5 * step;
        let sign = if data == Data::Refraction { -1.0 } else { 1.0 };
        let scale = geometry.magnification();
        let places = geometry.columns.iter().map(|place| place / scale).collect();
        let margin = MARGIN[0].min(MARGIN[1] * columns as f64);
        Ok(Self { geometry, values, angles, is_turn, sign, places, margin })
    }

    /// x of a column, which may be a fraction, at the axis, m.
    fn place(&self, column: f64) -> f64 {
        let pitch = self.geometry.column_pitch() / self.geometry.magnification();
        self.places[0] + column * pitch
    }

    /// Lines seen twice by the rows and every n-th view, with the axis on a column.
    fn pairs(&self, column: f64, every: usize, cancel: &Cancel) -> Result<Pairs> {
        let partners = self.partners(self.place(column));
        let (views, rows, columns) = self.values.dim();
        let all = (rows * columns) as f64;
        let of_view = |view: usize| {
            cancel.check()?;
            let mut pairs = Pairs { all, ..Pairs::default() };
            for partner in &partners {
                let Some(weights) = self.weights(self.angles[view] + partner.turn) else {
                    continue;
                };
                for row in 0..rows {
                    let line = |view: usize| {
                        let of = |column: usize| self.values[[view, row, column]];
                        let left = of(partner.right - 1);
                        left + partner.across * (of(partner.right) - left)
                    };
                    let found: f64 =
                        weights.iter().map(|(view, weight)| weight * line(*view)).sum();
                    pairs.take(self.values[[view, row, partner.column]], self.sign * found);
                }
            }
            Ok(pairs)
        };
        let chosen: Vec<usize> = (0..views).step_by(every.max(1)).collect();
        let of_views: Vec<Pairs> = chosen.into_par_iter().map(of_view).collect::<Result<_>>()?;
        Ok(of_views.iter().fold(Pairs::default(), Pairs::with))
    }

    /// Other ends of the lines through the columns, where they are on the detector.
    fn partners(&self, axis: f64) -> Vec<Partner> {
        let per = self.geometry.per_distance();
        let last = self.places.len() - 1;
        let ends = [self.place(self.margin), self.place(last as f64 - self.margin)];
        let is_inside = |place: f64| place >= ends[0] && place <= ends[1];
        let mut partners = Vec::with_capacity(self.places.len());
        for (column, u) in self.places.iter().enumerate().filter(|(_, place)| is_inside(**place)) {
            let beside = (u - axis) / (u * per).hypot(1.0);
            let mut other = axis - beside;
            for _ in 0..4 {
                other = axis - beside * (other * per).hypot(1.0);
            }
            if !is_inside(other) {
                continue;
            }
            let turn = PI - libm::atan(u * per) + libm::atan(other * per);
            let right = self.places.partition_point(|at| *at < other).clamp(1, last);
            let [from, to] = [self.places[right - 1], self.places[right]];
            partners.push(Partner { column, turn, right, across: (other - from) / (to - from) });
        }
        partners
    }

    /// Views about an angle with their weights in a cubic, since linear interpolation smooths between
    /// views; two at the ends of less than a turn, `None` beyond.
    fn weights(&self, angle: f64) -> Option<[(usize, f64); 4]> {
        let views = self.angles.len();
        let angle = self.angles[0] + (angle - self.angles[0]).rem_euclid(TAU);
        let next = self.angles.partition_point(|at| *at <= angle);
        if next == views && !self.is_turn {
            return None;
        }
        let before = next.saturating_sub(1);
        let behind = if next == views { self.angles[0] + TAU } else { self.angles[next] };
        let t = (angle - self.angles[before]) / (behind - self.angles[before]);
        let is_inner = self.is_turn || (before > 0 && next + 1 < views);
        let [a, b, c, d] = [before + views - 1, before, next, next + 1].map(|view| view % views);
        if !is_inner {
            return Some([(b, 1.0 - t), (c, t), (b, 0.0), (c, 0.0)]);
        }
        let square = t * t;
        Some([
            (a, 0.5 * t * (2.0 * t - 1.0 - square)),
            (b, 1.0 + 0.5 * square * (3.0 * t - 5.0)),
            (c, 0.5 * t * (1.0 + 4.0 * t - 3.0 * square)),
            (d, 0.5 * square * (t - 1.0)),
        ])
    }
}

/// A row smoothed by the Gaussian, cut at its ends.
fn smoothed(line: ArrayView1<'_, f32>) -> Vec<f64> {
    let weight = |n: usize| libm::exp(-0.5 * ((n as f64 - REACH as f64) / BLUR).powi(2));
    let kernel: Vec<f64> = (0..=2 * REACH).map(weight).collect();
    let of_column = |column: usize| {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (at, weight) in (column..).zip(&kernel) {
            let inside = at.checked_sub(REACH).and_then(|at| line.get(at));
            sum += inside.map_or(0.0, |value| f64::from(*value) * weight);
            weights += inside.map_or(0.0, |_| *weight);
        }
        sum / weights
    };
    (0..line.len()).map(of_column).collect()
}

/// Rows with contrast, those nearest to the optical axis; in a parallel beam those in the middle.
fn rows_with_contrast(
    geometry: &ScanGeometry,
    sinograms: ArrayView3<'_, f32>,
    cancel: &Cancel,
) -> Result<Vec<usize>> {
    let (views, rows, _) = geometry.dim();
    let every = views.div_ceil(VIEWS);
    let contrast = |row: usize| {
        cancel.check()?;
        let lines = (0..views).step_by(every).map(|view| sinograms.slice(s![view, row, ..]));
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for value in lines.flat_map(smoothed) {
            sum += value;
            squares += value * value;
            count += 1.0;
        }
        Ok(squares - sum * sum / count)
    };
    let contrasts: Vec<f64> = (0..rows).into_par_iter().map(contrast).collect::<Result<_>>()?;
    let most = contrasts.iter().copied().fold(0.0, f64::max);
    let middle = (rows as f64 - 1.0) / 2.0;
    let far = |row: &usize| match geometry.source_distance.is_infinite() {
        true => (*row as f64 - middle).abs(),
        false => geometry.rows[*row].abs(),
    };
    // Rows with values that are not finite are among them, and refused.
    let is_chosen = |row: &usize| contrasts[*row].is_nan() || contrasts[*row] >= CONTRAST * most;
    let mut chosen: Vec<usize> = (0..rows).filter(is_chosen).collect();
    chosen.sort_by(|a, b| far(a).total_cmp(&far(b)));
    chosen.truncate(ROWS);
    Ok(chosen)
}
