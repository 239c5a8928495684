//! Spacing of lines, and frequencies of the light of an energy.

use beamlet_model::optics::Optics;
use beamlet_model::optics::waves::wavelength;
use beamlet_model::scene::Scene;
use std::f64::consts::PI;

/// Periods of the sample mask after which light repeats: a pixel sees its own beamlet and one on either side, and
/// of endless masks all of them.
pub(super) const PERIODS: f64 = 3.0;
/// Exponent of the blur beyond which a frequency is left out: 1e-8 of open beam.
const BLURRED_AWAY: f64 = 18.0;
/// Spacing at a tolerance of 1e-4, m: the edge of a body of 300 um errs by 3e-5 there.
const SPACING: f64 = 55e-9;
/// Power of the spacing that the error of an edge grows with: 1.4e-5 at 41 nm, 7e-5 at 83 nm.
const ORDER: f64 = 2.3;
/// Rays within the correlation length of a rough surface: its heights have nothing finer than a quarter of it.
const PER_LENGTH: f64 = 4.0;
/// Cycles of a turn of the kernel: frequencies are multiples of it per cell.
const TURN: f64 = 4_294_967_296.0;

/// Distances of propagation, in the plane of the sample mask, m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Distances {
    /// Mask to analyser, for shears of apertures.
    pub mask: f64,
    /// Centre of the sample to analyser, for shears of the sample.
    pub sample: f64,
}

impl Distances {
    pub(super) fn of(optics: &Optics) -> Self {
        let (mask, analyser) = (optics.cell_plane, optics.analyser);
        let sample = analyser - optics.lever_arm;
        Self {
            mask: (analyser - mask) * mask / analyser,
            sample: optics.lever_arm * mask * mask / (analyser * sample),
        }
    }
}

/// Lines that frequencies belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Lines of rays: the shear of the sample is a whole number of spacings.
    Rays,
    /// Lines without rays: light repeats after whole periods, so that all apertures of endless masks count.
    Flat,
}

/// Frequencies of the light of an energy, and their shears.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frequencies {
    /// Spacing of the rays, m.
    pub spacing: f64,
    /// Shear of the sample per frequency, in spacings; 0 without rays.
    pub pairs: u32,
    /// Frequency per spacing, 2^-32 cycles.
    pub turn: u32,
    /// Number of frequencies, 0 included.
    pub count: u32,
    /// Shear of the sample mask per frequency, m.
    pub mask_shear: f64,
}

impl Frequencies {
    /// Frequencies at a wavelength (m) on rays of a spacing. `widest`: largest shear of pairs that pass the mask, m.
    pub(super) fn of(
        optics: &Optics,
        (spacing, kind): (f64, Kind),
        wavelength: f64,
        period: f64,
        widest: f64,
    ) -> Self {
        let Distances { mask, sample } = Distances::of(optics);
        let area = wavelength * sample;
        let length = PERIODS * period;
        let (pairs, step) = match kind {
            Kind::Rays => {
                let pairs = (area / (length * spacing) + 1e-6).floor().max(1.0);
                (pairs, pairs * spacing / area)
            }
            Kind::Flat => (0.0, 1.0 / length),
        };
        let turn = (step * spacing * TURN).round();
        let step = turn / TURN / spacing;
        let mask_shear = wavelength * mask * step;
        let last = last_frequency(optics).min(widest / mask_shear * step);
        let count = (last / step).floor() + 1.0;
        let of = |value: f64| beamlet_core::numbers::whole::<u32>(value);
        Self { spacing, pairs: of(pairs), turn: of(turn), count: of(count), mask_shear }
    }

    /// A frequency, cycles per metre.
    pub(super) fn at(&self, index: u32) -> f64 {
        f64::from(index) * f64::from(self.turn) / TURN / self.spacing
    }

    /// Largest shear of the sample or the mask, m.
    pub(super) fn largest_shear(&self) -> f64 {
        let last = f64::from(self.count.saturating_sub(1));
        last * self.mask_shear.max(f64::from(self.pairs) * self.spacing)
    }
}

/// Frequency beyond which the focal spot blurs light away, cycles per metre.
pub(super) fn last_frequency(optics: &Optics) -> f64 {
    let shrink = 1.0 - optics.cell_plane / optics.analyser;
    (BLURRED_AWAY / 2.0).sqrt() / (PI * optics.spot.narrowest(0) * shrink)
}

/// Spacing of the rays of all energies, m: the shear of the shortest wavelength per frequency is a whole number of
/// spacings, at most as long as the tolerance and the lengths of rough surfaces allow.
pub(super) fn spacing(scene: &Scene, optics: &Optics, energies: &[f64], period: f64) -> f64 {
    let highest = energies.iter().copied().fold(0.0, f64::max);
    let shear = wavelength(highest) * Distances::of(optics).sample / (PERIODS * period);
    let tolerance = scene.sampling.tolerances().light;
    let rough = scene.objects.iter().filter(|object| object.roughness > 0.0);
    let lengths = rough.filter_map(|object| object.correlation_length);
    let longest = lengths.fold(f64::INFINITY, f64::min) / PER_LENGTH;
    let wanted = (SPACING * (tolerance / 1e-4).powf(1.0 / ORDER)).min(longest);
    shear / (shear / wanted - 1e-6).ceil().max(1.0)
}
