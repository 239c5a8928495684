//! The detector of a scene: response, blur, and noise.

use beamlet_core::{random, setters};
use std::path::PathBuf;

/// Flat detector across the optical axis.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Detector {
    /// Source to detector, m. > source distance.
    pub distance: f64,
    /// Columns and rows. >= 1 each.
    pub pixels: [u32; 2],
    /// Pixel pitch along x and z, m. > 0.
    pub pitch: [f64; 2],
    /// Contribution of a photon to the signal.
    pub mode: DetectorMode,
    /// Scintillator or sensor; `None` absorbs every photon.
    pub absorber: Option<Absorber>,
    /// Blur of the light behind the detector mask.
    pub blur: Option<Blur>,
    /// Light that is added to the simulated one.
    pub scatter: Option<Scatter>,
    /// Noise and numbers of the counts; `None`: intensities alone.
    pub counts: Option<Counts>,
}

impl Detector {
    /// A detector that counts every photon in the pixel where it lands, without noise.
    #[must_use]
    pub const fn new(distance: f64, pixels: [u32; 2], pitch: [f64; 2]) -> Self {
        Self {
            distance,
            pixels,
            pitch,
            mode: DetectorMode::Counting { low: None, high: None },
            absorber: None,
            blur: None,
            scatter: None,
            counts: None,
        }
    }

    /// Width and height of all pixels, m.
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.pitch[axis] * f64::from(self.pixels[axis]))
    }
}

/// Contribution of a photon to the signal.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum DetectorMode {
    /// One count, if its energy lies within the thresholds.
    Counting {
        /// Photons below are not counted, keV. > 0.
        low: Option<f64>,
        /// Photons above are not counted, keV. > `low`.
        high: Option<f64>,
    },
    /// Its energy.
    Integrating,
}

/// The layer that absorbs photons: the fraction 1 - exp(-mu thickness) of them.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Absorber {
    /// Material name.
    pub material: String,
    /// Thickness along y, m. > 0.
    pub thickness: f64,
}

impl Absorber {
    /// A layer of a material, thickness in m.
    #[must_use]
    pub fn new(material: impl Into<String>, thickness: f64) -> Self {
        Self { material: material.into(), thickness }
    }
}

/// Blur of the light behind the detector mask, before pixels integrate it.
#[derive(Debug, Clone, PartialEq)]
pub enum Blur {
    /// Gaussian.
    Gaussian {
        /// Standard deviation along x and z, m. >= 0.
        sigma: [f64; 2],
    },
    /// A measured image of a point.
    Kernel(KernelFile),
}

/// An image of a kernel: its middle is the origin, its sum counts as 1.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct KernelFile {
    /// NPY, TIFF or PNG file, relative to the scene's directory.
    pub path: PathBuf,
    /// Size of its pixels along x and z on the detector, m. > 0.
    pub pixel: [f64; 2],
}

impl KernelFile {
    /// An image and the size of its pixels along x and z, m.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>, pixel: [f64; 2]) -> Self {
        Self { path: path.into(), pixel }
    }
}

/// Light that is added: scatter is not simulated.
#[derive(Debug, Clone, PartialEq)]
pub enum Scatter {
    /// An image in units of open beam, of the detector's pixels, added to every frame with the
    /// sample.
    Image(PathBuf),
    /// The light of the detector's pixels spread by a kernel, added to every frame.
    Kernel {
        /// The kernel.
        kernel: KernelFile,
        /// Scattered light over the light that scatters. > 0.
        fraction: f64,
    },
}

/// Light of an open pixel in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Photons {
    /// Mean number of photons that the pixel detects. > 0.
    Number(f64),
    /// Exposure time of a frame, s, under the built-in tube with [`Source::current`](super::Source). > 0.
    Exposure(f64),
}

/// From intensities to the numbers that the detector reads out.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Counts {
    /// Light of an open pixel.
    pub photons: Photons,
    /// Standard deviation of the electronic noise, detector numbers. >= 0.
    pub electronic_noise: f64,
    /// Swank factor of an integrating detector, in (0, 1].
    pub swank: f64,
    /// Detector numbers per photon. > 0.
    pub gain: f64,
    /// Detector number of no light; `None` takes [`Counts::number_without_light`].
    pub offset: Option<f64>,
    /// Bits of a number: it is rounded and clipped to 0..=2^bits - 1; `None` does neither.
    pub bit_depth: Option<u32>,
}

impl Counts {
    /// A mean number of photons alone: no electronic noise, gain 1, offset 0, no rounding.
    #[must_use]
    pub const fn of_photons(photons: f64) -> Self {
        Self::of(Photons::Number(photons))
    }

    /// As [`Self::of_photons`], with an exposure time in s.
    #[must_use]
    pub const fn of_exposure(seconds: f64) -> Self {
        Self::of(Photons::Exposure(seconds))
    }

    const fn of(photons: Photons) -> Self {
        Self {
            photons,
            electronic_noise: 0.0,
            swank: 1.0,
            gain: 1.0,
            offset: None,
            bit_depth: None,
        }
    }

    /// Detector number of no light: the offset. Where there is none, 0, or with a bit depth the
    /// least whole number whose electronic noise is never clipped at 0.
    #[must_use]
    pub fn number_without_light(&self) -> f64 {
        let default = || match self.bit_depth {
            Some(_) => (random::REACH * self.electronic_noise).ceil(),
            None => 0.0,
        };
        self.offset.unwrap_or_else(default)
    }

    setters! {
        /// Sets the standard deviation of the electronic noise, detector numbers.
        with_electronic_noise(electronic_noise: f64);
        /// Sets the Swank factor of an integrating detector.
        with_swank(swank: f64);
        /// Sets the detector numbers per photon.
        with_gain(gain: f64);
        /// Sets the detector number of no light.
        with_offset(offset: impl Into<Option<f64>>);
        /// Rounds and clips to this many bits.
        with_bit_depth(bit_depth: impl Into<Option<u32>>);
    }
}
