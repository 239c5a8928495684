//! Illumination curve of thin masks in closed form, and how well counts settle its centre
//! (docs/physics.md, "Illumination curve").

use super::Optics;
use crate::spot::deviation;
use glam::DMat3;

/// Periods on either side that add light to a pixel.
const AROUND: i32 = 2;
/// Least blur of an edge over the wider aperture: without blur the curve has no second derivative.
const LEAST_BLUR: f64 = 1e-3;

/// Points of a period that a Gaussian is fitted to, and sections of the search for its width.
const FITTED_POINTS: u32 = 128;
const FITTED_SECTIONS: u32 = 40;
/// Relative differences of light below which a curve is flat.
const FLAT: f64 = 1e-9;

/// Illumination curve of thin masks without a sample: overlap of the projected apertures of both masks,
/// blurred by the focal spot. Lengths in the plane of the analyser, m.
#[derive(Debug, Clone)]
pub struct ThinCurve {
    /// Pairs of an aperture of each mask.
    pairs: Vec<Pair>,
    /// Standard deviation of the blur.
    blur: f64,
    /// Period of the curve.
    period: f64,
    /// Light per length of overlap, share of open beam.
    per_overlap: f64,
    /// Light that does not pass both apertures.
    background: f64,
    /// Displacement of the projected aperture per mask offset, and without one.
    magnification: f64,
    shift: f64,
}

/// An aperture of the sample mask and one of the detector mask.
#[derive(Debug, Clone, Copy)]
struct Pair {
    /// Half of the sum, and half of the difference, of the two widths.
    edges: [f64; 2],
    /// Distance between their centres without an offset.
    apart: f64,
}

/// Light at an offset with its derivatives by the displacement.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Light {
    pub(super) value: f64,
    slope: f64,
    curvature: f64,
}

/// ∫ Φ(v/s) dv and its derivatives: light behind one blurred edge.
fn edge(v: f64, s: f64) -> Light {
    let slope = 0.5 * libm::erfc(-v / (s * std::f64::consts::SQRT_2));
    let density = (-0.5 * (v / s).powi(2)).exp() / (2.0 * std::f64::consts::PI).sqrt();
    Light { value: v * slope + s * density, slope, curvature: density / s }
}

impl ThinCurve {
    /// The curve of a set-up with both masks of slits, whose bars pass the shares `leaks`; `None` with fewer
    /// masks or other apertures.
    pub fn of(optics: &Optics, leaks: [f64; 2]) -> Option<Self> {
        if optics.has_heights() {
            return None;
        }
        let (first, second) = (optics.sample_mask.as_ref()?, optics.detector_mask.as_ref()?);
        let [seen, own] = [first, second].map(|mask| mask.without_shifts(optics.analyser));
        let width = |[low, high]: [f64; 2]| high - low;
        let [w1, w2] = [&seen, &own].map(|openings| openings.ends().map(width).sum::<f64>());
        let pair = |a: [f64; 2], b: [f64; 2]| Pair {
            edges: [0.5 * (width(a) + width(b)), 0.5 * (width(a) - width(b)).abs()],
            apart: f64::midpoint(a[0], a[1]) - f64::midpoint(b[0], b[1]),
        };
        let pairs = seen.ends().flat_map(|a| own.ends().map(move |b| pair(a, b))).collect();
        let magnification = optics.analyser / first.distance();
        let [p1, p2] = [seen.period[0], own.period[0]];
        let spot = deviation(optics.spot.fwhm()[0]);
        let [e1, e2] = leaks;
        Some(Self {
            pairs,
            blur: ((magnification - 1.0) * spot).max(LEAST_BLUR * w1.max(w2)),
            period: p1,
            per_overlap: (1.0 - e1) * (1.0 - e2) / p2,
            background: e1 * e2 + e1 * (1.0 - e2) * w2 / p2 + e2 * (1.0 - e1) * w1 / p1,
            magnification,
            shift: seen.offset - own.offset,
        })
    }

    /// The curve behind plates that let this share of the light through.
    #[must_use]
    pub fn dimmed(mut self, share: f64) -> Self {
        self.per_overlap *= share;
        self.background *= share;
        self
    }

    /// Light at a mask offset, m: value, and derivatives by the displacement x of the aperture.
    pub(super) fn at(&self, offset: f64) -> Light {
        let displaced = self.magnification * offset + self.shift;
        let nearest = libm::remainder(displaced, self.period);
        let mut sum = Light { value: self.background, ..Light::default() };
        for (period, pair) in
            (-AROUND..=AROUND).flat_map(|it| self.pairs.iter().map(move |pair| (it, pair)))
        {
            let x = nearest + f64::from(period) * self.period + pair.apart;
            let [outer, inner] = pair.edges;
            for (at, sign) in [(outer, 1.0), (inner, -1.0), (-inner, -1.0), (-outer, 1.0)] {
                let part = edge(x + at, self.blur);
                let weight = sign * self.per_overlap;
                sum.value += weight * part.value;
                sum.slope += weight * part.slope;
                sum.curvature += weight * part.curvature;
            }
        }
        sum
    }

    /// Standard deviation of the Gaussian with background that fits the curve over a period best, m of mask
    /// offset. `None` where the curve is flat.
    pub fn fitted_sigma(&self) -> Option<f64> {
        let period = self.period / self.magnification;
        let centre = -libm::remainder(self.shift, self.period) / self.magnification;
        let from_centre = |i: u32| period * ((f64::from(i) + 0.5) / f64::from(FITTED_POINTS) - 0.5);
        let points: Vec<[f64; 2]> = (0..FITTED_POINTS)
            .map(|i| [from_centre(i), self.at(centre + from_centre(i)).value])
            .collect();
        let most = points.iter().map(|[_, value]| *value).fold(0.0, f64::max);
        let least = points.iter().map(|[_, value]| *value).fold(most, f64::min);
        if most - least <= FLAT * most {
            return None;
        }
        // Part of the curve's variance that a Gaussian of this width explains; its height and background
        // follow by linear least squares.
        let explained = |sigma: f64| {
            let [mut gg, mut gy, mut g, mut y] = [0.0; 4];
            for [x, value] in &points {
                let gaussian = (-0.5 * (x / sigma).powi(2)).exp();
                gg += gaussian * gaussian;
                gy += gaussian * value;
                g += gaussian;
                y += value;
            }
            let count = f64::from(FITTED_POINTS);
            (gy - g * y / count).powi(2) / (gg - g * g / count)
        };
        let [mut low, mut high] = [1e-3 * period, period];
        for _ in 0..FITTED_SECTIONS {
            let third = (high - low) / 3.0;
            match explained(low + third) < explained(high - third) {
                true => low += third,
                false => high -= third,
            }
        }
        Some(f64::midpoint(low, high))
    }

    /// Standard deviation of the centre of a curve fitted to counts at these offsets, m in the plane of
    /// the analyser: from the Fisher information of area, centre and variance above a known background. `variance` of the
    /// value of a pixel by its light. `None` where the offsets do not settle it.
    pub fn centre_deviation(&self, offsets: &[f64], variance: impl Fn(f64) -> f64) -> Option<f64> {
        let mut different: Vec<u64> = offsets.iter().map(|offset| offset.to_bits()).collect();
        different.sort_unstable();
        different.dedup();
        if different.len() < 3 {
            return None;
        }
        // Lengths in units of the wider aperture keep the matrix near 1.
        let unit = self.pairs.iter().map(|pair| pair.edges[0]).fold(f64::INFINITY, f64::min);
        let mut information = [[0.0; 3]; 3];
        for offset in offsets {
            let light = self.at(*offset);
            let by = [
                light.value - self.background,
                unit * light.slope,
                0.5 * unit * unit * light.curvature,
            ];
            let weight = 1.0 / variance(light.value);
            for (row, a) in information.iter_mut().zip(by) {
                for (sum, b) in row.iter_mut().zip(by) {
                    *sum += weight * a * b;
                }
            }
        }
        let inverse = DMat3::from_cols_array_2d(&information).inverse();
        let centre = unit * inverse.y_axis.y.sqrt();
        (centre.is_finite() && centre > 0.0).then_some(centre)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's set-up in the plane of the analyser.
    fn paper(leak: f64, spot: f64) -> ThinCurve {
        ThinCurve {
            pairs: vec![Pair { edges: [30e-6, 0.0], apart: 0.0 }],
            blur: (0.5 * spot / 2.354_820).max(3e-8),
            period: 150e-6,
            per_overlap: (1.0 - leak).powi(2) / 150e-6,
            background: leak * leak + 2.0 * leak * (1.0 - leak) * 0.2,
            magnification: 1.5,
            shift: 0.0,
        }
    }

    /// Design values: 0.16612 at the peak with a spot of 30 um, 0.2 with a point source.
    #[test]
    fn the_peak_is_that_of_the_closed_form() {
        assert!((paper(0.0, 30e-6).at(0.0).value - 0.16612).abs() < 2e-4);
        assert!((paper(0.0, 0.0).at(0.0).value - 0.2).abs() < 2e-4);
        assert!((paper(1.0, 30e-6).at(3e-6).value - 1.0).abs() < 1e-12);
    }

    /// Two apertures of each mask a third of a period apart: twice the light at alignment, once where one pair
    /// is aligned.
    #[test]
    fn several_apertures_add_their_overlaps() {
        let pair = |apart: f64| Pair { edges: [30e-6, 0.0], apart };
        let pairs = vec![pair(0.0), pair(50e-6), pair(-50e-6), pair(0.0)];
        let curve = ThinCurve { pairs, ..paper(0.0, 0.0) };
        assert!((curve.at(0.0).value - 0.4).abs() < 4e-4);
        assert!((curve.at(50e-6 / 1.5).value - 0.2).abs() < 2e-4);
    }

    #[test]
    fn the_mean_over_a_period_is_the_product_of_the_open_shares() {
        let curve = paper(0.0, 30e-6);
        let mean = (0..1000).map(|i| curve.at(0.1e-6 * f64::from(i)).value).sum::<f64>() / 1000.0;
        assert!((mean - 0.04).abs() < 1e-9, "{mean}");
    }

    /// Derivatives against central differences of 1 nm.
    #[test]
    fn derivatives_match_differences_of_the_light() {
        let curve = paper(0.1, 30e-6);
        for offset in [-17e-6, -4e-6, 0.0, 9e-6, 31e-6] {
            let [low, mid, high] = [-1e-9, 0.0, 1e-9].map(|d| curve.at(offset + d / 1.5));
            let slope = (high.value - low.value) / 2e-9;
            let curvature = (high.slope - low.slope) / 2e-9;
            assert!((mid.slope - slope).abs() < 1e-5 * curve.per_overlap, "{offset}");
            assert!((mid.curvature - curvature).abs() < 1e-4 * curve.per_overlap / curve.blur);
        }
    }

    /// A fit on a device over a period of the cylinder of the paper, whose masks are thick, has 9.78 um;
    /// its flat over ±40 um has 9.825 um (docs/experiments).
    #[test]
    fn a_gaussian_fits_the_curve_with_the_width_of_experiments() {
        let sigma = paper(0.0, 30e-6).fitted_sigma().unwrap();
        assert!((sigma - 9.8e-6).abs() < 0.05e-6, "{sigma:e}");
        let shifted = ThinCurve { shift: 40e-6, ..paper(0.0, 30e-6) }.fitted_sigma().unwrap();
        assert!((sigma - shifted).abs() < 1e-9, "{sigma:e} {shifted:e}");
        assert!(paper(1.0, 30e-6).fitted_sigma().is_none(), "bars that pass everything");
    }

    #[test]
    fn two_offsets_settle_no_centre() {
        let curve = paper(0.0, 30e-6);
        assert!(curve.centre_deviation(&[0.0, 1e-5, 1e-5], |light| light).is_none());
        assert!(curve.centre_deviation(&[-1e-5, 0.0, 1e-5], |light| light).is_some());
    }
}
