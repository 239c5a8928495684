//! Views that lost their refraction at flat faces along the beam.
//!
//! Faces within some mrad of the beam refract light beyond the illumination curve, or reflect it totally. The
//! moment of the refraction, which is the area of δ in the slice and equal in all views, is near zero or negative
//! in these views, and a reconstruction averages it in.

use super::geometry::{ScanGeometry, same_shape};
use super::lost_record::{LostUse, LostView, MomentRecord};
use super::method::Method;
use super::moment::moments;
use super::redundancy::Redundancy;
use super::view_runs::{Circle, between};
use crate::retrieve::median;
use beamlet_core::numbers::{single, whole};
use beamlet_core::{Error, Result, reserve};
use ndarray::{Array2, Array3, ArrayView1, ArrayView2, ArrayView3, Zip, s};

/// Fewest views that are compared: with fewer a lost view in three leaves no median.
const FEWEST: usize = 12;
/// Views on either side of a view whose median is its expected moment: at least 4, and all within 15°. Moments
/// differ by right over larger angles: by depth in fans, and in slices of cones that are inclined.
const BESIDE: usize = 4;
const NEAR: f64 = 0.26;
/// Standard deviations of the moments by which a lost moment is too small. Medians of a few views make the deviation
/// 5 % too small, and 1 of a million rows is lost by noise.
const DEVIATIONS: f64 = 5.0;
/// Standard deviation of normal noise over its median deviation.
const SIGMA_PER_DEVIATION: f64 = 1.4826;
/// Least share of a moment whose loss counts. Without noise moments of sharp edges between apertures scatter by
/// up to 15 %; faces along the beam lose 70 to 140 %.
const LEAST: f64 = 0.3;
/// Widest run of views that faces lose, rad, beside a step of the views. The refraction of a face at an angle θ to
/// the beam, δ/θ, leaves the curve below δ·(lever arm)/(reach of the curve): some ten mrad on either side. Wider
/// runs have another reason.
const WIDEST: f64 = 0.1;
/// Largest share of lost views; in more of them the expected moment is not known.
const MOST: f64 = 1.0 / 3.0;

/// Moments of the refraction angles of a scan, and the views and rows that lost them.
#[derive(Debug, Clone)]
pub struct LostViews {
    moments: Array2<f64>,
    is_lost: Array2<bool>,
    circle: Option<Circle>,
    record: MomentRecord,
}

/// A lost view and row, and the two views that it is interpolated from with their shares.
type Between = ((usize, usize), [(usize, f64); 2]);

/// Moments of one row, or of all rows together, in the order of a circle.
struct Series {
    /// Expected moments.
    expected: Vec<f64>,
    /// Expected moments less the moments, over the median of the expected ones.
    losses: Vec<f64>,
    /// Noise over the median of the expected moments; infinite where this is not above zero.
    noise: f64,
    /// Least loss that counts, a share of the median.
    limit: f64,
    is_lost: Vec<bool>,
}

impl LostViews {
    /// Compares the moments of the views of refraction angles, `[view][row][column]`. Views and rows that
    /// `unknown`, `[view][row]`, has, and those with values that are not finite, are not compared.
    ///
    /// Not compared are half-fans, whose views see a part of the slice, and motions along or about another axis
    /// than z, which change the slice.
    ///
    /// # Errors
    /// [`Error::Argument`] for arrays of other shapes than the scan has.
    pub fn find(
        geometry: &ScanGeometry,
        sinograms: ArrayView3<'_, f32>,
        unknown: Option<ArrayView2<'_, bool>>,
    ) -> Result<Self> {
        geometry.check()?;
        same_shape("sinograms", sinograms.dim(), geometry.dim())?;
        let (views, rows, _) = geometry.dim();
        if let Some(unknown) = unknown.filter(|unknown| unknown.dim() != (views, rows)) {
            let found = format!("shape {:?}", unknown.dim());
            return Err(Error::argument("unknown", found, format!("{:?}", (views, rows))));
        }
        let mut moments = moments(geometry, sinograms)?;
        if let Some(unknown) = unknown {
            moments.zip_mut_with(&unknown, |moment, unknown| {
                if *unknown {
                    *moment = f64::NAN;
                }
            });
        }
        let record = MomentRecord::default();
        let is_lost = Array2::default(moments.dim());
        let mut made = Self { moments, is_lost, circle: None, record };
        match Circle::of(geometry) {
            Ok(circle) => made.compare(geometry, circle),
            Err(reason) => made.record.not_compared = Some(reason.into()),
        }
        Ok(made)
    }

    /// Integral of α·x over each row, `[view][row]`, m²: in thin samples the area of δ in the slice, equal in all
    /// views. NaN where it is unknown.
    #[must_use]
    pub const fn moments(&self) -> &Array2<f64> {
        &self.moments
    }

    /// Views and rows that lost their moment, `[view][row]`.
    #[must_use]
    pub const fn is_lost(&self) -> &Array2<bool> {
        &self.is_lost
    }

    /// Its entry of volume.json.
    #[must_use]
    pub const fn record(&self) -> &MomentRecord {
        &self.record
    }

    fn compare(&mut self, geometry: &ScanGeometry, circle: Circle) {
        let rows = self.moments.dim().1;
        let series: Vec<Option<Series>> =
            (0..rows).map(|row| Series::of(&circle, |view| self.moments[[view, row]])).collect();
        // The sum of all rows shows losses that the noise of a row hides.
        let summed = |view: usize| {
            let known = self.moments.row(view).into_iter().filter(|moment| moment.is_finite());
            let (count, sum) = known.fold((0, 0.0), |(n, sum), moment| (n + 1, sum + moment));
            if count == rows { sum } else { f64::NAN }
        };
        let all = Series::of(&circle, summed);
        let mut left = Array2::from_elem(self.moments.dim(), f64::NAN);
        let mut noises = Vec::new();
        for (row, own) in series.iter().enumerate() {
            let Some(own) = own else { continue };
            noises.push(own.noise);
            for (at, view) in circle.order.iter().enumerate() {
                let with_all = || all.as_ref().is_some_and(|all| own.follows(all, at));
                if self.moments[[*view, row]].is_finite() && (own.is_lost[at] || with_all()) {
                    self.is_lost[[*view, row]] = true;
                    left[[*view, row]] = self.moments[[*view, row]] / own.expected[at];
                }
            }
        }
        let record = &mut self.record;
        record.noise = median(noises);
        let limits = series.iter().flatten().chain(&all).map(|of| of.limit);
        record.limit = limits.filter(|limit| *limit < 1.0).reduce(f64::min);
        if record.limit.is_none() {
            record.not_compared = Some(match record.noise {
                Some(_) => "noise of the moments hides the loss of one".into(),
                None => format!("fewer than {FEWEST} views whose rows begin and end in air"),
            });
        }
        for (view, lost) in self.is_lost.outer_iter().enumerate() {
            let rows = lost.iter().filter(|lost| **lost).count();
            if rows > 0 {
                let left = left.row(view).iter().filter(|left| left.is_finite()).sum::<f64>();
                record.lost_views.push(LostView {
                    view,
                    angle_deg: geometry.angles[view].to_degrees(),
                    rows,
                    left: left / rows as f64,
                });
            }
        }
        self.circle = Some(circle);
    }

    /// Takes the weight of lost views in δ, in sinograms for filtered back-projection and in weights for iterative
    /// methods; `keep`: they keep it, as in a short scan in filtered back-projection, whose weights count lines
    /// once. Returns the weights, and warns of the lost views.
    ///
    /// # Errors
    /// [`Error::Argument`] for arrays of other shapes; [`Error::Memory`].
    pub fn leave_out(
        &mut self,
        geometry: &ScanGeometry,
        (method, keep): (&Method, bool),
        sinograms: &mut Array3<f32>,
        weights: Option<Array3<f32>>,
    ) -> Result<Option<Array3<f32>>> {
        same_shape("sinograms", sinograms.dim(), geometry.dim())?;
        if let Some(weights) = &weights {
            same_shape("weights", weights.dim(), geometry.dim())?;
        }
        if self.record.lost_views.is_empty() {
            return Ok(weights);
        }
        let is_short = method.filtered().is_some() && !Redundancy::of(geometry)?.is_turn();
        let way = match (method.filtered(), keep || is_short) {
            (_, true) => LostUse::Kept,
            (Some(_), false) => LostUse::Interpolated,
            (None, false) => LostUse::ZeroWeight,
        };
        self.record.lost_views_are = Some(way);
        self.warn(keep, is_short);
        match way {
            LostUse::Kept => Ok(weights),
            LostUse::Interpolated => {
                self.interpolate(sinograms);
                Ok(weights)
            }
            LostUse::ZeroWeight => {
                let mut weights = match weights {
                    Some(weights) => weights,
                    None => ones(geometry)?,
                };
                for ((view, row), lost) in self.is_lost.indexed_iter() {
                    if *lost {
                        weights.slice_mut(s![view, row, ..]).fill(0.0);
                    }
                }
                Ok(Some(weights))
            }
        }
    }

    /// Interpolates lost rows by angle between the next views on both sides that did not lose them.
    fn interpolate(&self, sinograms: &mut Array3<f32>) {
        for ((view, row), [(before, share), (behind, other)]) in self.neighbours() {
            let line = |view: usize| sinograms.slice(s![view, row, ..]).to_owned();
            let [a, b] = [line(before), line(behind)];
            let mean = |a: &f32, b: &f32| single(share * f64::from(*a) + other * f64::from(*b));
            let made = Zip::from(&a).and(&b).map_collect(mean);
            sinograms.slice_mut(s![view, row, ..]).assign(&made);
        }
    }

    /// Lost rows, with the views that they are interpolated from and their shares.
    fn neighbours(&self) -> Vec<Between> {
        let Some(circle) = &self.circle else { return Vec::new() };
        let of_row = |(row, lost): (usize, ArrayView1<'_, bool>)| {
            let lost: Vec<bool> = circle.order.iter().map(|view| lost[*view]).collect();
            let of = |(at, beside): (usize, [(usize, f64); 2])| {
                ((circle.order[at], row), beside.map(|(at, share)| (circle.order[at], share)))
            };
            between(circle, &lost).into_iter().map(of).collect::<Vec<_>>()
        };
        self.is_lost.columns().into_iter().enumerate().flat_map(of_row).collect()
    }

    fn warn(&self, keep: bool, is_short: bool) {
        let after = match self.record.lost_views_are {
            Some(LostUse::Interpolated) => {
                "delta is interpolated there from the views on both sides".to_owned()
            }
            Some(LostUse::ZeroWeight) => "they have weight 0 in delta".to_owned(),
            _ if is_short && !keep => {
                "they stay in delta, which is too small: views over less than a turn have \
                                       none to spare in fbp; a whole turn, or cgls"
                    .to_owned()
            }
            _ => "they stay in delta, which is too small".to_owned(),
        };
        log::warn!(
            "{} lost their refraction, as at flat faces along the beam: {after}; angles half a step later may \
             avoid these faces",
            self.record.words()
        );
    }
}

impl Series {
    /// Moments in the order of a circle; `None` for too few that are known.
    fn of(circle: &Circle, moment: impl Fn(usize) -> f64) -> Option<Self> {
        let all: Vec<f64> = circle.order.iter().map(|view| moment(*view)).collect();
        let known: Vec<usize> = (0..all.len()).filter(|at| all[*at].is_finite()).collect();
        let count = known.len();
        if count < FEWEST {
            return None;
        }
        let beside = whole::<usize>(NEAR / circle.step).max(BESIDE).min((count - 1) / 2);
        let around = |n: usize| {
            (0..=2 * beside).map(|k| all[known[(n + count + k - beside) % count]]).collect()
        };
        let medians = (0..count).map(|n| median(around(n))).collect::<Option<Vec<f64>>>()?;
        let deviations = medians.iter().zip(&known).map(|(median, at)| (all[*at] - median).abs());
        let sigma = SIGMA_PER_DEVIATION * median(deviations.collect())?;
        let usual = median(medians.clone())?;
        let noise = if usual > 0.0 { sigma / usual } else { f64::INFINITY };
        let limit = LEAST.max(DEVIATIONS * noise);
        let mut made = Self {
            expected: vec![f64::NAN; all.len()],
            losses: vec![f64::NAN; all.len()],
            noise,
            limit,
            is_lost: vec![false; all.len()],
        };
        for (at, median) in known.into_iter().zip(medians) {
            made.expected[at] = median;
            made.losses[at] = (median - all[at]) / usual;
            made.is_lost[at] = limit < 1.0 && made.losses[at] > limit;
        }
        circle.keep_wide_runs(&mut made.is_lost, WIDEST);
        let lost = made.is_lost.iter().filter(|lost| **lost).count();
        if lost as f64 > MOST * count as f64 {
            made.is_lost.fill(false);
        }
        Some(made)
    }

    /// True if a place is lost because it is lost in the sum of all rows: in rows that lack as much as counts there,
    /// and in rows whose noise hides any loss.
    fn follows(&self, all: &Self, at: usize) -> bool {
        all.is_lost[at] && (self.limit >= 1.0 || self.losses[at] > all.limit)
    }
}

/// Weight 1 for every value.
fn ones(geometry: &ScanGeometry) -> Result<Array3<f32>> {
    let (views, rows, columns) = geometry.dim();
    let mut values = reserve::room(views * rows * columns, "weights")?;
    values.resize(views * rows * columns, 1.0);
    Array3::from_shape_vec((views, rows, columns), values)
        .map_err(|error| Error::argument("weights", error.to_string(), "their shape"))
}
