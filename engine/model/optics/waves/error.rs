//! Error of the flat of ray optics.

use super::flat::Flat;
use super::pixel::Pixel;
use super::series::Series;
use super::{Node, wavelength};

/// Offsets over a period among which the peak of a flat is found.
const OFFSETS: u32 = 64;
/// Factor of the steps of a search for a set-up without the error, and their greatest number.
const STEP: f64 = 1.1;
const MOST_STEPS: i32 = 40;

/// Light of a flat at the mask offsets of a scan, by rays and by waves, share of open beam. Of the pixels that see
/// the masks differently it belongs to the one that errs most.
#[derive(Debug, Clone, PartialEq)]
pub struct FlatError {
    /// Mask offset (m), light by rays, light by waves less light by rays.
    pub steps: Vec<[f64; 3]>,
    /// Most that the phase of the bars of the sample mask changes the light by waves.
    pub bars: f64,
    /// Greatest light of the curve by rays.
    pub peak: f64,
}

impl FlatError {
    /// Error of the flat at mask offsets, m; the light is the mean over energy nodes with their weights. `None`
    /// without a pixel.
    #[must_use]
    pub fn of(pixels: &[Pixel], nodes: &[Node], offsets: &[f64]) -> Option<Self> {
        let errors = pixels.iter().filter_map(|pixel| Self::of_pixel(pixel, nodes, offsets));
        errors.max_by(|a, b| a.largest().total_cmp(&b.largest()))
    }

    fn of_pixel(pixel: &Pixel, nodes: &[Node], offsets: &[f64]) -> Option<Self> {
        let flats = |of: fn(f64) -> f64| -> Vec<Flat> {
            nodes.iter().map(|(energy, _, leaks)| Flat::of(pixel, of(*energy), *leaks)).collect()
        };
        let mean = |flats: &[Flat], part: fn(&Flat) -> &Series| {
            Series::sum(nodes.iter().zip(flats).map(|((_, weight, _), flat)| (*weight, part(flat))))
        };
        let waves = flats(wavelength);
        let rays = mean(&flats(|_| 0.0), |flat| &flat.light)?;
        let light = mean(&waves, |flat| &flat.light)?;
        let [even, odd] =
            [mean(&waves, |flat| &flat.bars[0])?, mean(&waves, |flat| &flat.bars[1])?];
        let step = |offset: &f64| {
            let by_rays = rays.at(*offset);
            [*offset, by_rays, light.at(*offset) - by_rays]
        };
        let bars = |offset: &f64| libm::hypot(even.at(*offset), odd.at(*offset));
        let period = |at: u32| pixel.period * f64::from(at) / f64::from(OFFSETS);
        let all = offsets.iter().copied().chain((0..OFFSETS).map(period));
        Some(Self {
            steps: offsets.iter().map(step).collect(),
            bars: offsets.iter().map(bars).fold(0.0, f64::max),
            peak: all.map(|offset| rays.at(offset)).fold(0.0, f64::max),
        })
    }

    /// The step that errs most; `None` without steps.
    #[must_use]
    pub fn worst(&self) -> Option<[f64; 3]> {
        self.steps.iter().copied().max_by(|a, b| a[2].abs().total_cmp(&b[2].abs()))
    }

    /// Greatest error, share of open beam.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.worst().map_or(0.0, |[_, _, error]| error.abs())
    }

    /// Greatest error over the peak.
    #[must_use]
    pub fn relative(&self) -> f64 {
        self.largest() / self.peak
    }
}

/// Factors of the size of the focal spot, and of all distances together, that bring the error of a flat below
/// `share` of its peak; `None` where no factor up to 45 does.
#[must_use]
pub fn remedies(pixels: &[Pixel], nodes: &[Node], offsets: &[f64], share: f64) -> [Option<f64>; 2] {
    let search = |scaled: &dyn Fn(&Pixel, f64) -> Pixel, sign: i32| {
        let factors = (1..=MOST_STEPS).map(|step| STEP.powi(sign * step));
        factors.into_iter().find(|factor| {
            let pixels: Vec<Pixel> = pixels.iter().map(|pixel| scaled(pixel, *factor)).collect();
            FlatError::of(&pixels, nodes, offsets).is_some_and(|error| error.relative() < share)
        })
    };
    let has_spot = pixels.iter().all(|pixel| pixel.spot_blur() > 0.0);
    let spot = if has_spot { search(&Pixel::with_spot, 1) } else { None };
    [spot, search(&Pixel::at_distances, -1)]
}
