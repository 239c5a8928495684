//! Light of a pixel without a sample, by waves or by rays.

use super::pixel::{Pixel, interval};
use super::series::Series;
use glam::DVec2;
use std::f64::consts::PI;

/// Light of a pixel behind periodic thin masks over the offset of the sample mask.
#[derive(Debug, Clone)]
pub(super) struct Flat {
    /// Light with bars that transmit without interference.
    pub(super) light: Series,
    /// Interference of openings and bars: factors of the cosine and the sine of the phase of the bars.
    pub(super) bars: [Series; 2],
}

impl Flat {
    /// Light of a wavelength, m; rays for 0. `leaks`: light that the bars of the sample mask and of the
    /// detector mask transmit.
    ///
    /// The field ψ of the mask is periodic: the transform of ψ(x − Λ/2) ψ*(x + Λ/2) at j/p, with Λ = λzj/p,
    /// contains pairs of all its apertures.
    pub(super) fn of(pixel: &Pixel, wavelength: f64, leaks: [f64; 2]) -> Self {
        let period = pixel.period;
        let [leak, behind] = leaks;
        let amplitude = leak.sqrt();
        let mut terms: [Vec<DVec2>; 3] = Default::default();
        for at in 0..pixel.term_count(period) {
            let frequency = at as f64 / period;
            let shear = wavelength * pixel.distance * frequency;
            let twice = if at == 0 { 1.0 } else { 2.0 };
            let response = pixel.response(frequency, behind) * (twice / period);
            let open: DVec2 = pixel.apertures.iter().map(|it| interval(*it, frequency)).sum();
            let pairs = pairs(pixel, frequency, shear);
            let [cosine, sine] = [libm::cos, libm::sin].map(|of| of(PI * frequency * shear));
            let mut base = (1.0 + leak) * pairs - 2.0 * leak * cosine * open;
            if at == 0 {
                base.x += leak * period;
            }
            let even = 2.0 * amplitude * (cosine * open - pairs);
            let odd = -2.0 * amplitude * sine * open;
            let found = [base, even, odd].map(|term| term.rotate(response));
            terms.iter_mut().zip(found).for_each(|(terms, term)| terms.push(term));
        }
        let [light, even, odd] = terms.map(|terms| Series { period, terms });
        Self { light, bars: [even, odd] }
    }
}

/// Transform, over a period, of the part in which light a shear apart passes apertures on both sides.
fn pairs(pixel: &Pixel, frequency: f64, shear: f64) -> DVec2 {
    let mut sum = DVec2::ZERO;
    for [low, high] in &pixel.apertures {
        let first = [low + 0.5 * shear, high + 0.5 * shear];
        for [low, high] in &pixel.apertures {
            // Periods that bring the second aperture over the first.
            let off = first[0] - (low - 0.5 * shear);
            let nearest = (off / pixel.period).round();
            for more in [-1.0, 0.0, 1.0] {
                let shift = (nearest + more) * pixel.period - 0.5 * shear;
                let ends = [first[0].max(low + shift), first[1].min(high + shift)];
                if ends[1] > ends[0] {
                    sum += interval(ends, frequency);
                }
            }
        }
    }
    sum
}
