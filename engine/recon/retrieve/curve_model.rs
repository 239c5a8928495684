//! Model of the curves of an image, and its fit in two directions by least squares.

use super::background_term::BackgroundTerm;
use super::curves::Curve;
use super::equations::{Equations, UNKNOWNS, Unknowns};
use super::fit::{Fit, Fitting, NOISE, clamp_covariance};
use super::flags;
use super::model::{Model, SLITS};
use super::scan::{Scan, Values};
use super::strips::{MOST_CORRELATED, Tables};
use super::value_noise::ValueNoise;

/// Fewest values of a fit of all unknowns.
pub(super) const NEEDED: usize = UNKNOWNS + 1;
/// Uncertainty of the centre of a curve over offsets, at that noise, beyond which steps along an axis do not change the
/// light, as a part of half their range.
const BLIND: f64 = 0.5;
/// Variance inflation of an unknown from which on the values hardly determine it.
const ILL_CONDITIONED: f64 = 100.0;

/// Model of the curves of an image.
#[derive(Debug, Clone)]
pub(super) struct CurveModel {
    pub(super) model: Model,
    /// Background of the curves.
    pub(super) background: BackgroundTerm,
    /// Variances xx and zz of the blur by the geometry, m^2; `None`: unknown, and the fitted ones count.
    pub(super) blur: Option<[f64; 2]>,
    /// Size of a pixel, m, of beamlets.
    pub(super) pixel: Option<[f64; 2]>,
    /// True for curves in two directions; slits have no z.
    pub(super) is_planar: bool,
}

impl CurveModel {
    /// A model of slits over mask offsets along x. `spread`: variance of its blur by the geometry, m^2.
    pub(super) const fn of_slits(model: Model, background: BackgroundTerm, spread: f64) -> Self {
        Self { model, background, blur: Some([spread, 1.0]), pixel: None, is_planar: false }
    }

    /// Axes along which the mask is stepped.
    pub(super) const fn axes(&self) -> &'static [usize] {
        if self.is_planar { &[0, 1] } else { &[0] }
    }

    /// Equations of the unknowns of the fits.
    pub(super) fn equations(&self) -> Equations {
        let held = if self.is_planar { [false; UNKNOWNS] } else { SLITS };
        Equations::new(&self.background.held(held))
    }

    /// Places of values of the same weight, with their noise.
    pub(super) fn scan(&self, places: Vec<[f64; 2]>, noise: ValueNoise) -> Scan {
        Scan::new(places, noise, self.background)
    }

    /// Fits a curve. `flat`: the same curve of the flat, `None` for the flat itself; `centre`: centre of the
    /// flat's curve to begin with, for a list.
    pub(super) fn fit(
        &self,
        scan: &Scan,
        curve: impl Iterator<Item = f32>,
        flat: Option<&Curve>,
        centre: Option<[f64; 2]>,
    ) -> Curve {
        let values = &scan.values(curve, NEEDED);
        if values.flags & flags::NO_ANSWER != 0 {
            return Curve::unknown(values.flags);
        }
        let mut fitting = self.fitting(scan, values);
        let answer = flat.filter(|flat| flat.has_answer());
        let known = flat.map(|flat| self.model.unknowns(flat));
        let mut fit = fitting.from(match centre {
            Some(centre) => self.start_at(&fitting, known.filter(|_| answer.is_some()), centre),
            None => self.start(&fitting, known.filter(|_| answer.is_some())),
        });
        // The pixels of beamlets determine a centre by their size.
        let blind = match (self.pixel, answer) {
            (Some(_), _) => [false; 2],
            (None, Some(flat)) => flat.uncentred,
            (None, None) => self.blind(&fitting, &fit.p),
        };
        let resolves = |axis: usize| {
            let of_flat = flat.map(|flat| !flat.unresolved[axis]);
            fitting.resolves_blur(&fit, axis, self.blur.map(|blur| blur[axis]), of_flat)
        };
        let unresolved = [0, 1].map(|axis| blind[axis] || !resolves(axis));
        fitting.held[1..3].copy_from_slice(&blind);
        if unresolved[0] || unresolved[1] {
            let mut p = fit.p;
            for axis in [0, 1].into_iter().filter(|axis| unresolved[*axis]) {
                let of_flat = known.map(|known| known[3 + axis]).filter(|v| v.is_finite());
                let of_geometry = self.blur.map(|blur| blur[axis]);
                p[3 + axis] =
                    of_flat.or(of_geometry).unwrap_or(p[3 + axis]).max(fitting.least[axis]);
                if let (true, Some(known)) = (blind[axis], known) {
                    p[1 + axis] = known[1 + axis];
                }
                fitting.held[3 + axis] = true;
            }
            p[5] = clamp_covariance(known.map_or(0.0, |known| known[5]), p[3] * p[4]);
            fitting.held[5] = true;
            fit = fitting.from(p);
        }
        let mut curve = self.curve(&fitting, &fit, unresolved);
        for axis in [0, 1].into_iter().filter(|axis| blind[*axis]) {
            curve.uncentred[axis] = true;
            curve.centre_sigma[axis] = f64::NAN;
        }
        if blind == [true; 2] {
            curve.flags |= flags::NO_PEAK;
        }
        curve
    }

    /// A fit of all unknowns.
    fn fitting<'a>(&'a self, scan: &'a Scan, values: &'a Values) -> Fitting<'a> {
        let least = self.model.least_blur(&values.points);
        Fitting { model: &self.model, scan, values, held: [false; UNKNOWNS], least }
    }

    /// Fits all unknowns of a curve, from these on but for the light and the background.
    pub(super) fn fit_from(
        &self,
        scan: &Scan,
        curve: impl Iterator<Item = f32>,
        start: Unknowns,
    ) -> Curve {
        let values = &scan.values(curve, NEEDED);
        if values.flags & flags::NO_ANSWER != 0 {
            return Curve::unknown(values.flags);
        }
        let fitting = self.fitting(scan, values);
        fitting.curve(&fitting.from(fitting.linear(start)))
    }

    /// Axes along which the offsets do not change the light: of the curve by the geometry, else of the fitted one.
    fn blind(&self, of: &Fitting<'_>, fitted: &Unknowns) -> [bool; 2] {
        let points = &of.values.points;
        let [x, z] = points.ends().map(|[low, high]| f64::midpoint(low, high));
        let of_geometry =
            |[xx, zz]: [f64; 2]| [1.0, x, z, xx.max(of.least[0]), zz.max(of.least[1]), 0.0, 0.0];
        let p = self.blur.map_or(*fitted, of_geometry);
        let mut tables = Tables::default();
        let (equations, _) = of.normal(&p, &vec![1.0; of.values.values.len()], &mut tables);
        let (matrix, peak) = (equations.matrix(), of.peak(&p));
        [0, 1].map(|axis| {
            let sigma = NOISE * peak / matrix[1 + axis][1 + axis].sqrt();
            sigma > BLIND * points.half()[axis]
        })
    }

    /// Unknowns to begin with: of a sample the flat's, displaced as the centroid is; of the flat of a curve over offsets
    /// the blur by the geometry, since moments of a coarse scan are too wide.
    fn start(&self, of: &Fitting<'_>, flat: Option<Unknowns>) -> Unknowns {
        let [_, x, z, second @ ..] = of.values.moments(of.values.range[0]);
        let own = self.model.own_variances();
        let mut p = [1.0, x, z, 0.0, 0.0, 0.0, 0.0];
        for axis in [0, 1] {
            let by_moments = (second[axis] - own[axis]).max(0.1 * second[axis]);
            let by_geometry = self.blur.filter(|_| self.pixel.is_none()).map(|blur| blur[axis]);
            p[3 + axis] = by_geometry.unwrap_or(by_moments).max(2.0 * of.least[axis]);
        }
        p[5] = clamp_covariance(second[2], 0.3 * p[3] * p[4]);
        if let Some(flat) = flat {
            p[3..6].copy_from_slice(&flat[3..6]);
        }
        of.linear(p)
    }

    /// Unknowns of a list to begin with: of a sample the flat's, of a flat the blur by the geometry about a centre.
    fn start_at(&self, of: &Fitting<'_>, flat: Option<Unknowns>, [x, z]: [f64; 2]) -> Unknowns {
        let [xx, zz] =
            [0, 1].map(|axis| self.blur.map_or(0.0, |it| it[axis]).max(2.0 * of.least[axis]));
        of.linear(flat.unwrap_or([1.0, x, z, xx, zz, 0.0, 0.0]))
    }

    /// The curve of a fit, with its uncertainties and flags.
    fn curve(&self, of: &Fitting<'_>, fit: &Fit, unresolved: [bool; 2]) -> Curve {
        let mut curve = Curve { unresolved, ..of.curve(fit) };
        let correlation = fit.p[5].abs() / (fit.p[3] * fit.p[4]).sqrt();
        if unresolved[0] || unresolved[1] || correlation > 0.999 * MOST_CORRELATED {
            curve.flags |= flags::UNRESOLVED;
        }
        if fit.inflation > ILL_CONDITIONED {
            curve.flags |= flags::ILL_CONDITIONED;
        }
        if self.model.is_list() {
            curve.flags &= !flags::OUTSIDE;
        }
        for axis in [0, 1] {
            let is_fine = |pixel: [f64; 2]| of.resolves_centre(fit, axis, pixel[axis]);
            if !self.pixel.is_none_or(is_fine) {
                curve.uncentred[axis] = true;
                curve.flags |= flags::UNRESOLVED;
            }
        }
        curve
    }
}
