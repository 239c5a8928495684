//! Distances, focal spot, slits and windows.

use rustfft::num_complex::Complex;

/// Wavelength (m) of an energy in keV.
pub fn wavelength(kev: f64) -> f64 {
    1.239_841_984e-9 / kev
}

/// A Gaussian of the focal spot.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// Share of the light.
    pub weight: f64,
    /// Centre in x, m.
    pub centre: f64,
    /// Standard deviation, m.
    pub sigma: f64,
}

/// Distances from the source (m), wavelength and focal spot.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Wavelength, m.
    pub wavelength: f64,
    /// Sample mask; the plane of all coordinates of fields.
    pub mask: f64,
    /// Centre of the sample.
    pub sample: f64,
    /// Detector mask or detector.
    pub analyser: f64,
    /// Gaussians of the spot; their weights sum to 1.
    pub spot: Vec<Spot>,
}

impl Setup {
    /// Set-up with the sample in the plane of the mask and a Gaussian spot.
    pub fn new(kev: f64, [z_o, z_od]: [f64; 2], sigma: f64) -> Self {
        let spot = vec![Spot { weight: 1.0, centre: 0.0, sigma }];
        let wavelength = wavelength(kev);
        Self { wavelength, mask: z_o, sample: z_o, analyser: z_o + z_od, spot }
    }

    /// 2π over the wavelength, 1/m.
    pub fn wavenumber(&self) -> f64 {
        std::f64::consts::TAU / self.wavelength
    }

    /// Magnification of the mask.
    pub fn magnification(&self) -> f64 {
        self.analyser / self.mask
    }

    /// Effective distance between two planes in coordinates of the mask, m.
    pub fn effective(&self, from: f64, to: f64) -> f64 {
        self.mask * self.mask * (1.0 / from - 1.0 / to)
    }

    /// Displacement at the analyser by a source at 1, in coordinates of the mask.
    pub fn source_shift(&self) -> f64 {
        -(1.0 - 1.0 / self.magnification())
    }

    /// Place in the plane of the sample seen through `x` of the mask from a source at `source`, m.
    pub fn in_sample(&self, x: f64, source: f64) -> f64 {
        source + (x - source) * self.sample / self.mask
    }

    /// Inverse of `in_sample`.
    pub fn in_mask(&self, x: f64, source: f64) -> f64 {
        source + (x - source) * self.mask / self.sample
    }
}

/// A thin mask in its plane.
#[derive(Debug, Clone)]
pub struct Slits {
    /// Low and high end of each opening, m; apart.
    pub openings: Vec<[f64; 2]>,
    /// Amplitude behind bars: the square root of their transmission, with their phase.
    pub bars: Complex<f64>,
}

impl Slits {
    /// One opening about 0 in opaque bars.
    pub fn one(aperture: f64) -> Self {
        Self { openings: vec![[-0.5 * aperture, 0.5 * aperture]], bars: Complex::ZERO }
    }

    /// Openings −`count` to `count` of a periodic mask, opening 0 about 0.
    pub fn periodic(aperture: f64, period: f64, count: i32) -> Self {
        let about = |k| f64::from(k) * period;
        let opening = |k| [about(k) - 0.5 * aperture, about(k) + 0.5 * aperture];
        Self { openings: (-count..=count).map(opening).collect(), bars: Complex::ZERO }
    }

    /// The same mask with bars of a transmission and a phase (rad).
    pub fn leaking(mut self, transmission: f64, phase: f64) -> Self {
        self.bars = Complex::from_polar(transmission.sqrt(), phase);
        self
    }

    /// The same mask displaced by `offset`.
    pub fn moved(&self, offset: f64) -> Self {
        let openings = self.openings.iter().map(|[low, high]| [low + offset, high + offset]);
        Self { openings: openings.collect(), bars: self.bars }
    }
}

/// Sensitivity of a pixel along x, in the plane of the analyser.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    /// Opening of the detector mask, m; the pixel without a mask.
    pub aperture: f64,
    /// Pixel, m.
    pub pixel: f64,
    /// Transmission of the bars of the detector mask.
    pub leak: f64,
}

impl Window {
    /// Opaque detector mask.
    pub fn masked(aperture: f64, pixel: f64) -> Self {
        Self { aperture, pixel, leak: 0.0 }
    }

    /// Pixel without a mask.
    pub fn open(pixel: f64) -> Self {
        Self { aperture: pixel, pixel, leak: 0.0 }
    }

    /// Boxes of the window: weight and width (m).
    pub fn boxes(&self) -> [[f64; 2]; 2] {
        [[1.0 - self.leak, self.aperture], [self.leak, self.pixel]]
    }
}
