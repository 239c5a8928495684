//! Shears of a set-up at the rotation centre of the sample.

use crate::optics::Optics;
use crate::optics::waves::{Pixel, wavelength};
use crate::scene::{Blur, Scene};
use crate::spot::deviation;
use std::f64::consts::TAU;

/// Distances and illumination curve of a scene. Frequencies are cycles per metre in the plane of the sample mask, or of
/// the rotation centre without one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetUp {
    /// Shear at the rotation centre per wavelength and frequency, m.
    distance: f64,
    /// Standard deviation of the illumination curve in the plane of the frequencies, m.
    width: f64,
    /// Width of a pixel seen from the source at the rotation centre, m.
    pixel: f64,
}

impl SetUp {
    /// The set-up of a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let optics = Optics::of(&scene.of_groups());
        let pixel = optics.detector.pitch_at(0, optics.rotation);
        let plane = optics.cell_plane;
        let width = match Pixel::around_axis(&optics, scene.axis_distance()).first() {
            Some(pixel) => pixel.curve_width(),
            None => {
                // Without a sample mask: width of an edge in a window, as it is in the plane of the frequencies.
                let scale = plane / optics.analyser;
                let window = scale * optics.windows().narrowest(0);
                let spot = deviation(optics.spot.fwhm()[0]) * (1.0 - scale);
                let blur = match &scene.detector.blur {
                    Some(Blur::Gaussian { sigma }) => sigma[0] * plane / optics.detector.distance,
                    Some(Blur::Kernel(_)) | None => 0.0,
                };
                (window * window / 12.0 + spot * spot + blur * blur).sqrt()
            }
        };
        Self { distance: plane * optics.lever_arm / optics.analyser, width, pixel }
    }

    /// Frequency at which a curve of this width tells its variance, 1/(2πσ), cycles per metre.
    #[must_use]
    pub fn frequency(&self) -> f64 {
        1.0 / (TAU * self.width)
    }

    /// Shear of light of an energy, keV, at a frequency, m.
    #[must_use]
    pub fn shear(&self, energy: f64, frequency: f64) -> f64 {
        wavelength(energy) * frequency * self.distance
    }

    /// Width of a pixel at the rotation centre, m.
    #[must_use]
    pub const fn pixel(&self) -> f64 {
        self.pixel
    }
}
