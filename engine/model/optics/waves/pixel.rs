//! A pixel with the apertures of both masks, seen from the source in the plane of the sample mask.

use super::super::{Mask, Optics};
use glam::DVec2;
use std::f64::consts::TAU;

/// Exponent beyond which the blur leaves nothing of a frequency.
const BLURRED_AWAY: f64 = 33.0;
/// Most terms: a point source leaves 2p/(w π²) of open beam over their number beyond them.
const MOST_TERMS: f64 = 20_000.0;

/// A Gaussian of the focal spot: its share of the light, and the displacement and standard deviation of its
/// images.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Image {
    share: f64,
    shift: f64,
    sigma: f64,
}

/// A pixel behind the thin apertures of a sample mask, and of a detector mask if there is one. Lengths in the
/// plane of the sample mask, m.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixel {
    /// Period of the sample mask.
    pub(super) period: f64,
    /// Ends of the apertures of the period nearest to the pixel.
    pub(super) apertures: Vec<[f64; 2]>,
    /// Ends of the openings of the detector mask before the pixel; of the pixel without one.
    pub(super) windows: Vec<[f64; 2]>,
    /// Ends of the pixel.
    whole: [f64; 2],
    images: Vec<Image>,
    /// Standard deviation of the blur of a detector without a mask.
    blur: f64,
    /// Distance z of propagation, seen by a parallel beam.
    pub(super) distance: f64,
    /// Factor of the shear of bodies over the shear of the mask.
    pub(super) lever: f64,
}

impl Pixel {
    /// The pixels around the optical axis that see the masks differently, with bodies at the distance `body`
    /// from the source; none without a sample mask.
    #[must_use]
    pub fn around_axis(optics: &Optics, body: f64) -> Vec<Self> {
        let Some(mask) = &optics.sample_mask else { return Vec::new() };
        let middle = i64::from(optics.detector.pixels[0] / 2);
        let mut found: Vec<Self> = Vec::new();
        for column in (middle - 4).max(0)..(middle + 4).min(i64::from(optics.detector.pixels[0])) {
            let pixel = Self::of(optics, mask, column, body);
            if !found.iter().any(|known| known.sees_the_same(&pixel)) {
                found.push(pixel);
            }
        }
        found
    }

    fn of(optics: &Optics, mask: &Mask, column: i64, body: f64) -> Self {
        let detector = &optics.detector;
        let plane = mask.distance();
        let width = detector.pitch_at(0, plane);
        let left = column as f64 - detector.half(0);
        let whole = [left * width, (left + 1.0) * width];
        let windows = match &optics.detector_mask {
            None => vec![whole],
            Some(mask) => {
                let before = super::super::column_places::before_pixel;
                let openings = mask.openings_in_columns(detector, 0.0);
                let parts = before(&openings, left, detector.half(0), f64::INFINITY);
                parts.into_iter().map(|ends| ends.map(|end| end * width)).collect()
            }
        };
        let openings = mask.openings(plane);
        let period = openings.period[0];
        let centre = f64::midpoint(whole[0], whole[1]);
        let first = openings.offset + (0.5 - detector.half(0)) * period;
        let shift = centre - libm::remainder(centre - first, period);
        let shrink = 1.0 - plane / optics.analyser;
        let image = |part: crate::spot::PlacedPart| Image {
            share: part.share,
            shift: -part.offset[0] * shrink,
            sigma: part.deviation[0] * shrink,
        };
        let blur = match optics.detector_mask {
            None => optics.column_blur * plane / detector.distance,
            Some(_) => 0.0,
        };
        Self {
            period,
            apertures: openings.displaced(shift, 0.0).collect(),
            windows,
            whole,
            images: optics.spot.placed().into_iter().map(image).collect(),
            blur,
            distance: shrink * plane,
            lever: (optics.analyser - body) / (optics.analyser - plane),
        }
    }

    /// The same with a focal spot of `factor` times its size.
    #[must_use]
    pub(super) fn with_spot(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        for image in &mut scaled.images {
            image.shift *= factor;
            image.sigma *= factor;
        }
        scaled
    }

    /// The same with all distances along the axis `factor` times their length.
    #[must_use]
    pub(super) fn at_distances(&self, factor: f64) -> Self {
        Self { distance: factor * self.distance, ..self.clone() }
    }

    /// True if masks, windows and pixel lie in the same way to one another.
    fn sees_the_same(&self, other: &Self) -> bool {
        let places = |pixel: &Self| -> Vec<f64> {
            let ends = pixel.apertures.iter().chain(&pixel.windows);
            ends.flatten().map(|end| end - pixel.whole[0]).collect()
        };
        let (a, b) = (places(self), places(other));
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6 * self.period)
    }

    /// Least standard deviation of the blur, m.
    pub(super) fn least_blur(&self) -> f64 {
        let least = self.images.iter().map(|image| image.sigma).fold(f64::INFINITY, f64::min);
        libm::hypot(least, self.blur)
    }

    /// Standard deviation of the blur by the focal spot, m.
    #[must_use]
    pub fn spot_blur(&self) -> f64 {
        let square = |image: &Image| image.share * (image.shift.powi(2) + image.sigma.powi(2));
        self.images.iter().map(square).sum::<f64>().sqrt()
    }

    /// Width of the narrowest aperture of the sample mask, m.
    #[must_use]
    pub fn aperture(&self) -> f64 {
        self.apertures.iter().map(|[low, high]| high - low).fold(f64::INFINITY, f64::min)
    }

    /// Standard deviation of the illumination curve of one aperture and one window, m: of their widths and the blur.
    #[must_use]
    pub fn curve_width(&self) -> f64 {
        let variance = |[low, high]: [f64; 2]| (high - low).powi(2) / 12.0;
        let windows = self.windows.iter().map(|ends| variance(*ends)).fold(0.0, f64::max);
        let blur = self.spot_blur().powi(2) + self.blur.powi(2);
        (self.aperture().powi(2) / 12.0 + windows + blur).sqrt()
    }

    /// Product λz of a wavelength, m².
    #[must_use]
    pub fn fringe_area(&self, wavelength: f64) -> f64 {
        wavelength * self.distance
    }

    /// Shear of a body at a frequency of the curve, cycles per metre, m.
    #[must_use]
    pub fn body_shear(&self, wavelength: f64, frequency: f64) -> f64 {
        self.lever * self.fringe_area(wavelength) * frequency
    }

    /// Terms of a series of a period that the blur leaves.
    pub(super) fn term_count(&self, period: f64) -> usize {
        let last = (BLURRED_AWAY / 2.0).sqrt() / std::f64::consts::PI / self.least_blur();
        beamlet_core::numbers::whole((last * period).min(MOST_TERMS).ceil() + 1.0)
    }

    /// Transform of window and blur over the width of the pixel: ∫ T e^{2πifx} dx times the transform of the
    /// spot. `leak`: light that the bars of the detector mask transmit.
    pub(super) fn response(&self, frequency: f64, leak: f64) -> DVec2 {
        let of = |ends: &[f64; 2]| interval(*ends, -frequency);
        let windows: DVec2 = self.windows.iter().map(of).sum();
        let opening = leak * of(&self.whole) + (1.0 - leak) * windows;
        let image = |image: &Image| {
            let exponent =
                0.5 * (TAU * frequency).powi(2) * (image.sigma.powi(2) + self.blur.powi(2));
            image.share * libm::exp(-exponent) * DVec2::from_angle(-TAU * frequency * image.shift)
        };
        let spot: DVec2 = self.images.iter().map(image).sum();
        opening.rotate(spot) / (self.whole[1] - self.whole[0])
    }
}

/// ∫ e^{−2πifx} dx between two ends.
pub(super) fn interval([low, high]: [f64; 2], frequency: f64) -> DVec2 {
    let width = (high - low).max(0.0);
    let argument = 0.5 * TAU * frequency * width;
    let sinc = if argument.abs() < 1e-8 { 1.0 } else { libm::sin(argument) / argument };
    width * sinc * DVec2::from_angle(-TAU * frequency * f64::midpoint(low, high))
}
