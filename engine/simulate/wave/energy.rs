//! Masks and frequencies at an energy, and their tables on the device.

use super::bars::Bars;
use super::columns::{Columns, motions};
use super::frequencies::{Frequencies, Kind};
use crate::sampling::Lattice;
use beamlet_core::numbers::{self, single};
use beamlet_core::{Error, Result};
use beamlet_gpu::{Buffer, Device};
use beamlet_interface::{WaveBeamlet, WaveParams};
use beamlet_model::optics::Optics;
use beamlet_model::optics::waves::wavelength;
use beamlet_model::scene::Scene;
use std::sync::Arc;

/// Most frequencies of an energy.
const MOST_FREQUENCIES: u32 = 1 << 16;

/// Lines of a kind: spacing of their rays and period of their beamlets, m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spacing {
    pub rays: f64,
    pub beamlets: f64,
    pub kind: Kind,
}

/// Masks and frequencies at an energy.
pub(super) struct Energy {
    sample: Bars,
    pub(super) detector: Option<Bars>,
    pub(super) frequencies: Frequencies,
    /// Share of the light.
    share: f64,
}

impl Energy {
    pub(super) fn of(
        scene: &Scene,
        optics: &Optics,
        (energy, share): (f64, f64),
        spacing: Spacing,
    ) -> Result<Self> {
        let sample = match &optics.sample_mask {
            Some(mask) => Bars::of(scene, optics, mask, energy)?,
            None => Bars::none(optics, spacing.beamlets),
        };
        let detector = optics.detector_mask.as_ref();
        let detector = detector.map(|mask| Bars::of(scene, optics, mask, energy)).transpose()?;
        let [low, high] = sample.ends;
        let widest = match sample.leak {
            0.0 => high - low,
            _ if optics.sample_mask.is_none() => f64::INFINITY,
            _ => sample.period,
        };
        let wavelength = wavelength(energy);
        let lines = (spacing.rays, spacing.kind);
        let frequencies = Frequencies::of(optics, lines, wavelength, sample.period, widest);
        if frequencies.count > MOST_FREQUENCIES {
            return refuse(format!("{} frequencies", frequencies.count));
        }
        Ok(Self { sample, detector, frequencies, share })
    }

    /// Half of a line, m: pairs of a beamlet lie on it. `offsets`: of the sample mask.
    pub(super) fn reach(&self, offsets: &[f64]) -> f64 {
        let farthest =
            |f: &f64| self.sample.ends.map(|end| (end + f).abs()).into_iter().fold(0.0, f64::max);
        let farthest = offsets.iter().map(farthest).fold(0.0, f64::max);
        let shear = self.frequencies.largest_shear();
        match self.sample.leak > 0.0 {
            true => farthest.max(0.5 * self.sample.period) + shear,
            false if shear > self.sample.bar() => farthest + shear,
            false => farthest,
        }
    }

    /// Records of the beamlets.
    fn beamlets(&self, columns: &Columns, lattice: &Lattice) -> Vec<WaveBeamlet> {
        let cells = 1.0 / self.frequencies.spacing;
        let mut first_target = 0;
        let record = |(beamlet, (_, target_count)): (i64, &(u32, u32))| {
            let centre = lattice.centre(beamlet);
            let narrowed = self.sample.narrowed(self.sample.ends.map(|end| centre + end));
            let [low, high] = narrowed.map(|end| single((end - centre) * cells));
            let variance = self.sample.variance(centre)
                + self.detector.map_or(0.0, |bars| bars.variance(centre));
            let record = WaveBeamlet {
                low,
                high,
                tilt: single(self.sample.tilt(centre)),
                variance: single(variance * cells * cells),
                first_target,
                target_count: *target_count,
            };
            first_target += target_count;
            record
        };
        columns.beamlets.clone().zip(&columns.pixels).map(record).collect()
    }

    /// Refuses bars with edges that are not one soft edge.
    pub(super) fn check(&self, optics: &Optics, tolerance: f64) -> Result<()> {
        let shrink = 1.0 - optics.cell_plane / optics.analyser;
        let blur = optics.spot.narrowest(0) * shrink;
        let farthest =
            0.5 * optics.detector.extent(0) * optics.cell_plane / optics.detector.distance;
        let masks = [Some(&self.sample), self.detector.as_ref()];
        masks.into_iter().flatten().try_for_each(|bars| bars.check(farthest, blur, tolerance))
    }

    /// Largest change of light by the phase of bars that leak, share of open beam (2√e Λ/w, Λ the shear at the width
    /// of the curve).
    pub(super) fn by_phase_of_bars(&self, optics: &Optics) -> f64 {
        if optics.sample_mask.is_none() {
            return 0.0;
        }
        let width = |[low, high]: [f64; 2]| high - low;
        let pixel = optics.detector.pitch_at(0, optics.cell_plane);
        let window = self.detector.map_or(pixel, |bars| width(bars.ends));
        let blur = optics.spot.narrowest(0) * (1.0 - optics.cell_plane / optics.analyser);
        let squares = (width(self.sample.ends).powi(2) + window.powi(2)) / 12.0 + blur * blur;
        let area = self.frequencies.mask_shear / self.frequencies.at(1);
        let shear = area / (std::f64::consts::TAU * squares.sqrt());
        2.0 * self.share * self.sample.leak.sqrt() * shear / pixel
    }

    /// Uploads the tables of this energy.
    pub(super) fn params(
        &self,
        device: &Arc<Device>,
        (optics, lattice): (&Optics, &Lattice),
        columns: &Columns,
        rays: u32,
        buffers: &mut Vec<Buffer>,
    ) -> Result<WaveParams> {
        let (of, sample) = (&self.frequencies, &self.sample);
        let leak = self.detector.map_or(0.0, |bars| bars.leak);
        let beamlets = device.upload("beamlets of lines", &self.beamlets(columns, lattice))?;
        let targets = device.upload("pixels of beamlets", &columns.windows_of)?;
        let responses = columns.responses(optics, of, rays, [self.share, leak]);
        let responses = device.upload("responses of pixels", &responses)?;
        let motions = device.upload("motions of the sample", &motions(optics, of))?;
        let params = WaveParams {
            beamlets: beamlets.address(),
            targets: targets.address(),
            responses: responses.address(),
            motions: motions.address(),
            laws: 0,
            rays,
            shears: of.count,
            pairs: of.pairs,
            turn: of.turn,
            target_stride: columns.most,
            neighbours: numbers::whole((of.largest_shear() / sample.bar()).min(8.0)),
            mask_shear: single(of.mask_shear / of.spacing),
            period: single(sample.period / of.spacing),
            cells: single(1.0 / of.spacing),
            frequency: single(of.at(1)),
            bars: single(sample.leak.sqrt()),
        };
        buffers.extend([beamlets, targets, responses, motions]);
        Ok(params)
    }
}

pub(super) fn refuse<T>(found: String) -> Result<T> {
    let allowed = "a larger tolerance, narrower apertures, less distance or a larger focal spot";
    Err(Error::scene("sampling.transport", format!("\"wave\" with {found}"), allowed))
}
