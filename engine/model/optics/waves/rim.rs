//! Light of a pixel whose aperture contains a rim of a round body.

use super::flat::Flat;
use super::pixel::{Pixel, interval};
use super::quadrature::pieces;
use super::series::Series;
use super::{MOST_TERMS, Node, wavelength};
use glam::DVec2;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Points of each piece of a quadrature by waves, and of a quadrature by rays from a rim inwards.
const WAVE_POINTS: usize = 80;
const RAY_POINTS: u32 = 256;
/// Places of the rim in the aperture.
const PLACES: u32 = 7;

/// A cylinder along the slits, in a material.
#[derive(Debug, Clone, PartialEq)]
pub struct Rim {
    /// Radius, m.
    pub radius: f64,
    /// Differences of delta and of the attenuation coefficient (1/m) to the material around, by energy node.
    pub constants: Vec<[f64; 2]>,
}

impl Rim {
    /// Greatest difference of waves and rays over mask offsets (m) and places of the rim in the aperture, share
    /// of open beam; `None` where the spot leaves too many terms.
    #[must_use]
    pub fn error(&self, pixel: &Pixel, nodes: &[Node], offsets: &[f64]) -> Option<f64> {
        if pixel.term_count(2.0 * pixel.period) > MOST_TERMS {
            return None;
        }
        let half = 0.5 * pixel.aperture();
        let most = |place: u32| {
            let rim = half * (f64::from(2 * place + 1) / f64::from(PLACES) - 1.0);
            let [waves, rays] = self.light(pixel, nodes, rim - self.radius);
            let off = |offset: &f64| (waves.at(*offset) - rays.at(*offset)).abs();
            offsets.iter().map(off).fold(0.0, f64::max)
        };
        Some((0..PLACES).into_par_iter().map(most).reduce(|| 0.0, f64::max))
    }

    /// Light over the offset of the sample mask by waves and by rays, with the centre of the body at `centre`
    /// (m) from the middle of the first aperture and moving with it. The body covers no other aperture.
    ///
    /// Two periods keep bent light out of the windows of other pixels. The flat of one aperture on these two
    /// periods is replaced by the flat of all apertures, so that no light of copies is left.
    pub(super) fn light(&self, pixel: &Pixel, nodes: &[Node], centre: f64) -> [Series; 2] {
        let period = 2.0 * pixel.period;
        let [low, high] = pixel.apertures[0];
        let body = InAperture { radius: self.radius, half: 0.5 * (high - low), centre };
        let mut series = [(); 2].map(|()| Series { period, terms: Vec::new() });
        for at in 0..pixel.term_count(period) {
            let frequency = at as f64 / period;
            let twice = if at == 0 { 1.0 } else { 2.0 };
            let place = DVec2::from_angle(-TAU * frequency * f64::midpoint(low, high));
            let mut sums = [DVec2::ZERO; 2];
            for ((energy, weight, [_, leak]), constants) in nodes.iter().zip(&self.constants) {
                let response = pixel.response(frequency, *leak).rotate(place);
                let length = wavelength(*energy);
                let [delta, mu] = *constants;
                let waves = body.waves(pixel, (length, frequency), TAU / length * delta, mu)
                    - body.empty(pixel, length, frequency);
                let rays =
                    body.rays(pixel, frequency, delta, mu) - body.empty(pixel, 0.0, frequency);
                for (sum, light) in sums.iter_mut().zip([waves, rays]) {
                    *sum += light.rotate(response) * (weight * twice / period);
                }
            }
            series.iter_mut().zip(sums).for_each(|(series, sum)| series.terms.push(sum));
        }
        for (energy, weight, leaks) in nodes {
            for (series, length) in series.iter_mut().zip([wavelength(*energy), 0.0]) {
                let flat = Flat::of(pixel, length, *leaks).light.terms;
                let even = series.terms.iter_mut().step_by(2);
                even.zip(flat).for_each(|(sum, term)| *sum += *weight * term);
            }
        }
        series
    }
}

/// A body before an aperture about 0.
#[derive(Debug, Clone, Copy)]
struct InAperture {
    radius: f64,
    /// Half of the width of the aperture.
    half: f64,
    centre: f64,
}

impl InAperture {
    /// ∫ ψ(x − Λ/2) ψ*(x + Λ/2) e^{−2πifx} dx. `phase`: kΔδ, rad/m.
    fn waves(&self, pixel: &Pixel, (length, f): (f64, f64), phase: f64, mu: f64) -> DVec2 {
        let Self { radius, half, centre } = *self;
        let end = half - 0.5 * pixel.fringe_area(length) * f;
        let shift = 0.5 * pixel.body_shear(length, f);
        let chord = |x: f64| 2.0 * (radius * radius - (x - centre).powi(2)).max(0.0).sqrt();
        let value = |x: f64| {
            let [before, behind] = [chord(x - shift), chord(x + shift)];
            let angle = -phase * (before - behind) - TAU * f * x;
            libm::exp(-0.5 * mu * (before + behind)) * DVec2::from_angle(angle)
        };
        let kinks = [-radius, radius].map(|rim| [centre + rim - shift, centre + rim + shift]);
        pieces([-end, end], kinks.as_flattened(), WAVE_POINTS, value)
    }

    /// The same without the body.
    fn empty(&self, pixel: &Pixel, length: f64, f: f64) -> DVec2 {
        let end = self.half - 0.5 * pixel.fringe_area(length) * f;
        interval([-end, end], f)
    }

    /// The same by rays: φ' in place of differences of the phase.
    fn rays(&self, pixel: &Pixel, f: f64, delta: f64, mu: f64) -> DVec2 {
        let Self { radius, half, centre } = *self;
        let [left, right] = [centre - radius, centre + radius];
        let beside = interval([-half, left.min(half)], f) + interval([right.max(-half), half], f);
        // Refraction by a slope of the chord displaces the light by −z Δδ dL/dx.
        let arm = TAU * f * pixel.lever * pixel.distance * delta;
        let side = |sign: f64| {
            // x = centre + sign r cos u: angles u from the rim (0) to the middle (π/2).
            let angle = |x: f64| libm::acos((sign * (x - centre) / radius).clamp(0.0, 1.0));
            let ends = [-half, half].map(angle);
            let [first, last] = [ends[0].min(ends[1]), ends[0].max(ends[1]).min(FRAC_PI_2)];
            let value = |at: u32| {
                // Points crowd at the rim, where slopes have no bound.
                let v = (f64::from(at) + 0.5) / f64::from(RAY_POINTS);
                let u = first + (last - first) * v.powi(3);
                let (sine, cosine) = (libm::sin(u), libm::cos(u));
                let slope = -2.0 * sign * cosine / sine;
                let angle = arm * slope - TAU * f * (centre + sign * radius * cosine);
                let light = libm::exp(-2.0 * mu * radius * sine) * radius * sine;
                light * 3.0 * v * v * (last - first) * DVec2::from_angle(angle)
            };
            (0..RAY_POINTS).map(value).sum::<DVec2>() / f64::from(RAY_POINTS)
        };
        beside + side(-1.0) + side(1.0)
    }
}
