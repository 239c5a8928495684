//! Slit masks whose walls are slanted or whose bars have several layers: paths cut wall by wall, and flats summed over
//! rays of every source point.

use super::normal::density;
use rayon::prelude::*;

/// A periodic mask. Aperture k is centred at `origin + k * period`, and `aperture` wide on its centre plane.
#[derive(Debug, Clone)]
pub struct Walls {
    /// Source to centre plane, m.
    pub distance: f64,
    pub period: f64,
    pub aperture: f64,
    pub origin: f64,
    /// dx/dy of the walls: apertures are wider towards the detector where it is above 0.
    pub taper: f64,
    /// Linear attenuation coefficient (1/m) and thickness (m) of the layers of the bars, from the source on.
    pub layers: Vec<[f64; 2]>,
}

impl Walls {
    /// Transmission of a straight ray through `x` on the centre plane with slopes dx/dy, dz/dy.
    pub fn transmission(&self, x: f64, slope: [f64; 2]) -> f64 {
        let depth: f64 = self.layers.iter().map(|[_, thickness]| thickness).sum();
        let mut cuts = Vec::with_capacity(16);
        let mut face = -0.5 * depth;
        cuts.push(face);
        for [_, thickness] in &self.layers {
            face += thickness;
            cuts.push(face);
        }
        let reach = 0.5 * depth * (slope[0].abs() + self.taper.abs());
        let mut number = ((x - reach - self.origin) / self.period).floor();
        while self.origin + (number - 1.0) * self.period < x + reach {
            for side in [-1.0, 1.0] {
                let edge = self.origin + number * self.period + 0.5 * side * self.aperture;
                let y = (edge - x) / (slope[0] - side * self.taper);
                if y.abs() < 0.5 * depth {
                    cuts.push(y);
                }
            }
            number += 1.0;
        }
        cuts.sort_by(f64::total_cmp);
        let mut attenuation = 0.0;
        for pair in cuts.windows(2) {
            let y = 0.5 * (pair[0] + pair[1]);
            let at = (x + slope[0] * y - self.origin) / self.period;
            let from_centre = (at - at.round()).abs() * self.period;
            if from_centre > 0.5 * self.aperture + self.taper * y {
                attenuation += self.coefficient_at(y + 0.5 * depth) * (pair[1] - pair[0]);
            }
        }
        (-attenuation * (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt()).exp()
    }

    /// Attenuation coefficient of the bars this far behind their first face, 1/m.
    fn coefficient_at(&self, depth: f64) -> f64 {
        let mut face = 0.0;
        for [mu, thickness] in &self.layers {
            face += thickness;
            if depth < face {
                return *mu;
            }
        }
        0.0
    }
}

/// Flat of a row in the plane of the source.
#[derive(Debug, Clone)]
pub struct Flat {
    pub masks: Vec<Walls>,
    /// Source to detector, m.
    pub detector: f64,
    /// Columns of pixels and their pitch, m.
    pub columns: u32,
    pub pitch: f64,
    /// Standard deviation of the focal spot, m.
    pub sigma: f64,
    /// Rays of a pixel from each source point, and source points over 6 standard deviations on either side.
    pub rays: u32,
    pub sources: u32,
}

impl Flat {
    /// Light of a column while the first mask is displaced by `offset`: a share of open beam.
    pub fn pixel(&self, column: u32, offset: f64) -> f64 {
        let mut masks = self.masks.clone();
        masks[0].origin += offset;
        let left = (f64::from(column) - 0.5 * f64::from(self.columns)) * self.pitch;
        let through = |source: f64| {
            let ray = |number: u32| {
                let target = left + self.pitch * (f64::from(number) + 0.5) / f64::from(self.rays);
                let slope = (target - source) / self.detector;
                let at =
                    |mask: &Walls| mask.transmission(source + slope * mask.distance, [slope, 0.0]);
                masks.iter().map(at).product::<f64>()
            };
            (0..self.rays).into_par_iter().map(ray).sum::<f64>() / f64::from(self.rays)
        };
        if self.sigma == 0.0 {
            return through(0.0);
        }
        let places = (0..self.sources)
            .map(|number| 12.0 * (f64::from(number) + 0.5) / f64::from(self.sources) - 6.0);
        let weights: f64 = places.clone().map(density).sum();
        places.map(|place| density(place) * through(place * self.sigma)).sum::<f64>() / weights
    }
}
