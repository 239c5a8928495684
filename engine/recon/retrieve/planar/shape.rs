//! Light in two directions: strips of an aperture behind a correlated Gaussian blur.

use super::profile::Profile;
use beamlet_core::numbers::whole;

/// Unknowns of a fit, in this order: light, centre x and z, variances xx and zz and covariance xz of the blur,
/// and background.
pub(super) const UNKNOWNS: usize = 7;
/// Value and its slopes by the unknowns.
pub(super) type Valued = [f64; 1 + UNKNOWNS];
/// Terms of the series of the covariance are left out below this part of the first.
const LAST_TERM: f64 = 1e-8;
/// Largest correlation of the blur: beyond it the series is too long.
pub(super) const MOST_CORRELATED: f64 = 0.9;
/// Standard deviations beyond which a Gaussian is nothing in frames of f32.
const NOTHING: f64 = 5.7;

/// A rectangle of an aperture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Strip {
    /// Part of the light.
    pub(super) share: f64,
    /// Profiles along x and z.
    pub(super) along: [Profile; 2],
}

/// Light of an aperture, or the curve of two masks over offsets in two directions: one of unit area, and the
/// same at the places of its neighbours.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlanarShape {
    pub(super) strips: Vec<Strip>,
    /// Places of the neighbours, x and z, m.
    pub(super) neighbours: Vec<[f64; 2]>,
}

/// Places of values: pairs of indices into distinct x and z.
#[derive(Debug, Clone, Default)]
pub(super) struct Points {
    /// Distinct places along x and z, m.
    pub(super) along: [Vec<f64>; 2],
    /// Indices of each point in them.
    pub(super) at: Vec<[usize; 2]>,
}

impl Points {
    /// Points at these places.
    pub(super) fn of(places: &[[f64; 2]]) -> Self {
        let along = [0, 1].map(|axis| {
            let mut all: Vec<f64> = places.iter().map(|place| place[axis]).collect();
            all.sort_by(f64::total_cmp);
            all.dedup();
            all
        });
        let index = |axis: usize, place: f64| along[axis].partition_point(|other| *other < place);
        let at = places.iter().map(|place| [0, 1].map(|axis| index(axis, place[axis]))).collect();
        Self { along, at }
    }

    /// Place of a point, m.
    pub(super) fn place(&self, point: usize) -> [f64; 2] {
        [0, 1].map(|axis| self.along[axis][self.at[point][axis]])
    }

    /// Half the distance of the outermost places along each axis, m.
    pub(super) fn half(&self) -> [f64; 2] {
        [0, 1].map(|axis| {
            let all = &self.along[axis];
            all.first().zip(all.last()).map_or(0.0, |(low, high)| (high - low) / 2.0)
        })
    }
}

/// Tables of derivatives, kept between evaluations.
#[derive(Debug, Default)]
pub(super) struct Tables {
    along: [Table; 2],
}

/// Derivatives of a profile at the places of an axis: for each place and term the profile, its first and its
/// second derivative, in units of the deviation.
#[derive(Debug, Default)]
struct Table {
    values: Vec<f64>,
    /// True for places that the light reaches.
    reached: Vec<bool>,
    derivatives: Vec<f64>,
}

impl Table {
    /// Fills the table for a profile about a centre. `first`, `ratio`: factor of the first term, and from term to
    /// term.
    fn fill(
        &mut self,
        places: &[f64],
        (profile, centre, sigma): (Profile, f64, f64),
        (terms, [first, ratio]): (usize, [f64; 2]),
    ) {
        let reach = profile.reach() + NOTHING * sigma;
        self.derivatives.resize(terms + 2, 0.0);
        self.values.clear();
        self.reached.clear();
        for place in places {
            let is_reached = (place - centre).abs() < reach;
            self.reached.push(is_reached);
            let start = self.values.len();
            self.values.resize(start + 3 * terms, 0.0);
            if !is_reached {
                continue;
            }
            profile.derivatives(place - centre, sigma, &mut self.derivatives);
            let mut power = first;
            for (n, term) in self.values[start..].chunks_exact_mut(3).enumerate() {
                let by_one = ((n + 1) as f64).sqrt();
                let by_two = by_one * ((n + 2) as f64).sqrt();
                let all = [1.0, by_one, by_two];
                for (k, (value, factor)) in term.iter_mut().zip(all).enumerate() {
                    *value = power * factor * self.derivatives[n + k];
                }
                power *= ratio;
            }
        }
    }
}

impl PlanarShape {
    /// Second moments xx and zz of the light without blur, m^2.
    pub(super) fn own_variances(&self) -> [f64; 2] {
        [0, 1].map(|axis| {
            let of = |strip: &Strip| strip.share * strip.along[axis].variance();
            self.strips.iter().map(of).sum()
        })
    }

    /// Values and slopes at points for these unknowns.
    pub(super) fn evaluate(
        &self,
        points: &Points,
        p: &[f64; UNKNOWNS],
        tables: &mut Tables,
        out: &mut Vec<Valued>,
    ) {
        let [scale, x, z, xx, zz, xz, background] = *p;
        let sigmas = [xx.sqrt(), zz.sqrt()];
        let correlation = xz / (sigmas[0] * sigmas[1]);
        let terms = terms(correlation);
        out.clear();
        out.resize(points.at.len(), [0.0; 1 + UNKNOWNS]);
        let places = std::iter::once([0.0; 2]).chain(self.neighbours.iter().copied());
        for [dx, dz] in places {
            let centre = [x + dx, z + dz];
            for strip in &self.strips {
                if !reaches(points, strip, centre, sigmas) {
                    continue;
                }
                let powers = [[strip.share, correlation], [1.0, 1.0]];
                for axis in [0, 1] {
                    let of = (strip.along[axis], centre[axis], sigmas[axis]);
                    tables.along[axis].fill(&points.along[axis], of, (terms, powers[axis]));
                }
                add_strip(points, tables, terms, out);
            }
        }
        for value in out.iter_mut() {
            // Derivatives by place, in the units of the tables, to slopes by the unknowns.
            let [unit, by_x, by_z, by_xx, by_zz, by_xz, ..] = *value;
            let [sx, sz] = sigmas;
            *value = [
                scale * unit + background,
                unit,
                -scale * by_x / sx,
                -scale * by_z / sz,
                scale * by_xx / (2.0 * xx),
                scale * by_zz / (2.0 * zz),
                scale * by_xz / (sx * sz),
                1.0,
            ];
        }
    }
}

/// Terms of the series at a correlation.
fn terms(correlation: f64) -> usize {
    let size = correlation.abs().min(MOST_CORRELATED);
    if size < LAST_TERM { 1 } else { 2 + whole::<usize>((LAST_TERM.ln() / size.ln()).floor()) }
}

/// Decides whether the light of a strip about a centre reaches a point.
fn reaches(points: &Points, strip: &Strip, centre: [f64; 2], sigmas: [f64; 2]) -> bool {
    (0..2).all(|axis| {
        let reach = strip.along[axis].reach() + NOTHING * sigmas[axis];
        let all = &points.along[axis];
        let [low, high] = [all.first(), all.last()].map(|end| end.copied().unwrap_or(f64::NAN));
        low - reach < centre[axis] && centre[axis] < high + reach
    })
}

/// Adds a strip: the value, and derivatives by x, z, xx, zz and xz in units of the deviations.
fn add_strip(points: &Points, tables: &Tables, terms: usize, out: &mut [Valued]) {
    let [along_x, along_z] = &tables.along;
    for ([i, j], sums) in points.at.iter().zip(out) {
        if !(along_x.reached[*i] && along_z.reached[*j]) {
            continue;
        }
        let x = along_x.values[3 * terms * i..][..3 * terms].chunks_exact(3);
        let z = along_z.values[3 * terms * j..][..3 * terms].chunks_exact(3);
        for (x, z) in x.zip(z) {
            sums[0] += x[0] * z[0];
            sums[1] += x[1] * z[0];
            sums[2] += x[0] * z[1];
            sums[3] += x[2] * z[0];
            sums[4] += x[0] * z[2];
            sums[5] += x[1] * z[1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(boxes: [[f64; 2]; 2]) -> PlanarShape {
        let along = boxes.map(|boxes| Profile { boxes, shift: 0.0 });
        PlanarShape { strips: vec![Strip { share: 1.0, along }], neighbours: Vec::new() }
    }

    fn value(shape: &PlanarShape, at: [f64; 2], p: &[f64; UNKNOWNS]) -> Valued {
        let mut out = Vec::new();
        shape.evaluate(&Points::of(&[at]), p, &mut Tables::default(), &mut out);
        out[0]
    }

    /// The series against the closed form of a bivariate Gaussian: 3e-8 at correlations up to 0.9.
    #[test]
    fn series_of_a_correlated_gaussian_is_its_closed_form() {
        for rho in [0.0, 0.1, -0.5, 0.8, -0.9] {
            let [sx, sz]: [f64; 2] = [1.2, 0.7];
            let p = [2.0, 0.1, -0.2, sx * sx, sz * sz, rho * sx * sz, 0.3];
            for [x, z] in [[0.0, 0.0], [1.0, 0.5], [-1.5, 1.1], [2.4, -0.6]] {
                let [u, w] = [(x - 0.1) / sx, (z + 0.2) / sz];
                let free: f64 = 1.0 - rho * rho;
                let square = (u * u - 2.0 * rho * u * w + w * w) / free;
                let height = 2.0 / (std::f64::consts::TAU * sx * sz * free.sqrt());
                let truth = height * (-0.5 * square).exp() + 0.3;
                let found = value(&shape([[0.0; 2]; 2]), [x, z], &p)[0];
                assert!((found - truth).abs() < 3e-8, "{rho} {x} {z}: {found} {truth}");
            }
        }
    }

    /// Slopes by every unknown against central differences: 1e-6.
    #[test]
    fn slopes_are_those_of_the_value() {
        let mut shape = shape([[1.3, 0.4], [0.8, 0.4]]);
        shape.neighbours = vec![[3.0, 0.0], [-3.0, 0.5]];
        let p = [2.0, 0.1, -0.2, 0.5, 0.3, 0.2, 0.1];
        for at in [[0.0, 0.0], [0.7, 0.3], [-0.9, 0.8]] {
            let here = value(&shape, at, &p);
            for k in 0..UNKNOWNS {
                let h = 1e-5;
                let moved = |by: f64| {
                    let mut q = p;
                    q[k] += by;
                    value(&shape, at, &q)[0]
                };
                let slope = (moved(h) - moved(-h)) / (2.0 * h);
                assert!((slope - here[k + 1]).abs() < 1e-6, "{at:?} {k}: {slope} {here:?}");
            }
        }
    }
}
