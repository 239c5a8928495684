//! Light of strips of an aperture behind a correlated Gaussian blur.

use super::equations::{UNKNOWNS, Unknowns, Valued};
use super::profile::Profile;
use super::scan::Points;
use beamlet_core::numbers::whole;

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

/// Light of an aperture, or the curve of two masks over offsets: one of unit area, and the same at the places of its
/// neighbours.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Strips {
    pub(super) strips: Vec<Strip>,
    /// Places of the neighbours, x and z, m.
    pub(super) neighbours: Vec<[f64; 2]>,
    /// True of a list of apertures, whose curve has several peaks.
    pub(super) is_list: bool,
}

/// Tables of derivatives and values, kept between evaluations.
#[derive(Debug, Default)]
pub(super) struct Tables {
    along: [Table; 2],
    pub(super) values: Vec<Valued>,
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

impl Strips {
    /// A strip along z, or an aperture, of these profiles along x and z.
    pub(super) fn one(along: [Profile; 2], neighbours: Vec<[f64; 2]>) -> Self {
        Self { strips: vec![Strip { share: 1.0, along }], neighbours, is_list: false }
    }

    /// Second moments xx and zz of the light without blur, m^2.
    pub(super) fn own_variances(&self) -> [f64; 2] {
        own_variances(&self.strips)
    }

    /// Values and slopes at points for these unknowns, into the values of the tables.
    pub(super) fn evaluate(&self, points: &Points, p: &Unknowns, tables: &mut Tables) {
        let [scale, x, z, xx, zz, xz, background] = *p;
        let sigmas = [xx.sqrt(), zz.sqrt()];
        let correlation = xz / (sigmas[0] * sigmas[1]);
        let terms = terms(correlation);
        tables.values.clear();
        tables.values.resize(points.at.len(), [0.0; 1 + UNKNOWNS]);
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
                add_strip(points, tables, terms);
            }
        }
        for value in &mut tables.values {
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

/// Second moments xx and zz of the light of strips without blur, m^2.
pub(super) fn own_variances(strips: &[Strip]) -> [f64; 2] {
    [0, 1].map(|axis| {
        let of = |strip: &Strip| strip.share * strip.along[axis].variance();
        strips.iter().map(of).sum()
    })
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
fn add_strip(points: &Points, tables: &mut Tables, terms: usize) {
    let Tables { along: [along_x, along_z], values } = tables;
    for ([i, j], sums) in points.at.iter().zip(values) {
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

    fn strips(boxes: [[f64; 2]; 2], neighbours: Vec<[f64; 2]>) -> Strips {
        Strips::one(boxes.map(|boxes| Profile { boxes, shift: 0.0 }), neighbours)
    }

    fn value(strips: &Strips, at: [f64; 2], p: &Unknowns) -> Valued {
        let mut tables = Tables::default();
        strips.evaluate(&Points::of(&[at]), p, &mut tables);
        tables.values[0]
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
                let found = value(&strips([[0.0; 2]; 2], Vec::new()), [x, z], &p)[0];
                assert!((found - truth).abs() < 3e-8, "{rho} {x} {z}: {found} {truth}");
            }
        }
    }

    /// Slopes by every unknown against central differences: 1e-6.
    #[test]
    fn slopes_are_those_of_the_value() {
        let strips = strips([[1.3, 0.4], [0.8, 0.4]], vec![[3.0, 0.0], [-3.0, 0.5]]);
        let p = [2.0, 0.1, -0.2, 0.5, 0.3, 0.2, 0.1];
        for at in [[0.0, 0.0], [0.7, 0.3], [-0.9, 0.8]] {
            let here = value(&strips, at, &p);
            for k in 0..UNKNOWNS {
                let h = 1e-5;
                let moved = |by: f64| {
                    let mut q = p;
                    q[k] += by;
                    value(&strips, at, &q)[0]
                };
                let slope = (moved(h) - moved(-h)) / (2.0 * h);
                assert!((slope - here[k + 1]).abs() < 1e-6, "{at:?} {k}: {slope} {here:?}");
            }
        }
    }
}
