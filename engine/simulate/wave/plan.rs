//! Lines of a scene on the device: frequencies of each energy, pixels and responses of each beamlet.

use super::bars::Bars;
use super::columns::{Columns, motions};
use super::frequencies::{Frequencies, spacing, wavelength};
use crate::sampling::Lattice;
use beamlet_core::numbers::{self, single};
use beamlet_core::{Error, Result};
use beamlet_gpu::{Buffer, Device};
use beamlet_interface::{Address, WaveBeamlet, WaveMaterial, WaveParams};
use beamlet_model::material::Constants;
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::Optics;
use beamlet_model::scene::Scene;
use std::ops::Range;
use std::sync::Arc;

/// Most rays of a line: a wider period or aperture has too many.
const MOST_RAYS: f64 = 1e6;
/// Most frequencies of an energy.
const MOST_FREQUENCIES: u32 = 1 << 16;

/// Lines of a scene with the tables of their kernels.
#[derive(Debug)]
pub(crate) struct WavePlan {
    /// Beamlets whose light reaches a pixel.
    pub(super) beamlets: Range<i64>,
    /// First pixel of each beamlet, and the number of its pixels.
    pub(super) pixels: Vec<(u32, u32)>,
    /// Most pixels of a beamlet.
    pub(super) most_pixels: u32,
    /// Rays of a line.
    pub(super) rays: u32,
    /// Their spacing, m.
    pub(super) spacing: f64,
    /// Number of energies.
    pub(super) energies: u32,
    /// Number of materials.
    pub(super) materials: u32,
    /// Centre of the sample to the analyser, m.
    pub(super) lever: f64,
    /// Shift of light by the focal spot, rows downwards.
    pub(super) row_shift: f64,
    /// Mask offsets of each list, m.
    pub(super) offsets: Vec<Vec<f64>>,
    params: Buffer,
    media: Buffer,
    _buffers: Vec<Buffer>,
}

/// Masks and frequencies at an energy.
struct Energy {
    sample: Bars,
    detector: Option<Bars>,
    frequencies: Frequencies,
    /// Share of the light.
    share: f64,
}

impl Energy {
    fn of(
        scene: &Scene,
        optics: &Optics,
        (energy, share): (f64, f64),
        spacing: f64,
    ) -> Result<Option<Self>> {
        let Some(mask) = &optics.sample_mask else { return Ok(None) };
        let sample = Bars::of(scene, optics, mask, energy)?;
        let detector = optics.detector_mask.as_ref();
        let detector = detector.map(|mask| Bars::of(scene, optics, mask, energy)).transpose()?;
        let [low, high] = sample.ends;
        let widest = if sample.leak > 0.0 { sample.period } else { high - low };
        let wavelength = wavelength(energy);
        let frequencies = Frequencies::of(optics, spacing, wavelength, sample.period, widest);
        if frequencies.count > MOST_FREQUENCIES {
            return refuse(format!("{} frequencies", frequencies.count));
        }
        Ok(Some(Self { sample, detector, frequencies, share }))
    }

    /// Half of a line, m: pairs of a beamlet lie on it. `offsets`: of the sample mask.
    fn reach(&self, offsets: &[f64]) -> f64 {
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
    fn check(&self, optics: &Optics, tolerance: f64) -> Result<()> {
        let shrink = 1.0 - optics.cell_plane / optics.analyser;
        let blur = optics.spot.narrowest(0) * shrink;
        let farthest =
            0.5 * optics.detector.extent(0) * optics.cell_plane / optics.detector.distance;
        let masks = [Some(&self.sample), self.detector.as_ref()];
        masks.into_iter().flatten().try_for_each(|bars| bars.check(farthest, blur, tolerance))
    }

    /// Uploads the tables of this energy.
    fn params(
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

impl WavePlan {
    /// Plans the lines of a scene; none without a sample mask.
    ///
    /// # Errors
    /// [`Error::Scene`] where lines would have too many rays or masks are not described by waves.
    pub(crate) fn new(
        device: &Arc<Device>,
        scene: &Scene,
        optics: &Optics,
        lattice: &Lattice,
        media: &MaterialTable,
    ) -> Result<Option<Self>> {
        let tolerance = scene.sampling.tolerances().light;
        let spacing = spacing(optics, &media.energies, lattice.period, tolerance);
        let nodes = media.energies.iter().copied().zip(media.weights.iter().copied());
        let energies = nodes.map(|node| Energy::of(scene, optics, node, spacing));
        let energies: Option<Vec<Energy>> = energies.collect::<Result<_>>()?;
        let Some(energies) = energies else { return Ok(None) };
        let rays = rays_of(optics, &energies)?;
        let mut buffers = Vec::new();
        let mut params = Vec::new();
        for energy in &energies {
            energy.check(optics, tolerance)?;
            let columns = Columns::of(optics, lattice, energy.detector.as_ref());
            params.push(energy.params(device, (optics, lattice), &columns, rays, &mut buffers)?);
        }
        let columns = Columns::of(optics, lattice, None);
        let first = optics.spot.placed().first().map_or(0.0, |part| part.offset[1]);
        Ok(Some(Self {
            beamlets: columns.beamlets,
            pixels: columns.pixels,
            most_pixels: columns.most,
            rays,
            spacing,
            energies: numbers::count(params.len()),
            materials: numbers::count(media.names.len()),
            lever: optics.lever_arm,
            row_shift: optics.rows_of_source(first),
            offsets: optics.offsets.lists().to_vec(),
            params: device.upload("lines", &params)?,
            media: device.upload("phases of materials", &materials(optics, media))?,
            _buffers: buffers,
        }))
    }

    /// Parameters of an energy on the device.
    pub(super) fn params(&self, energy: u32) -> Address {
        self.params.address() + u64::from(energy) * size_of::<WaveParams>() as u64
    }

    /// Materials at an energy on the device.
    pub(super) fn media(&self, energy: u32) -> Address {
        let first = u64::from(energy * self.materials) * size_of::<WaveMaterial>() as u64;
        self.media.address() + first
    }
}

fn refuse<T>(found: String) -> Result<T> {
    let allowed = "a larger tolerance, narrower apertures, less distance or a larger focal spot";
    Err(Error::scene("sampling.transport", format!("\"wave\" with {found}"), allowed))
}

/// Rays of a line, an even number.
fn rays_of(optics: &Optics, energies: &[Energy]) -> Result<u32> {
    let offsets = optics.offsets.lists().concat();
    let of = |energy: &Energy| {
        let half = energy.reach(&offsets) / energy.frequencies.spacing;
        2.0 * (half.ceil() + 1.0)
    };
    let most = energies.iter().map(of).fold(0.0, f64::max);
    if most > MOST_RAYS {
        return refuse(format!("{most:.0} rays in a line"));
    }
    Ok(numbers::whole(most))
}

/// Records of the materials by energy.
fn materials(optics: &Optics, media: &MaterialTable) -> Vec<WaveMaterial> {
    let of_energy = |(energy, constants): (&f64, &Vec<Constants>)| {
        let wavelength = wavelength(*energy);
        let of = |constants: &Constants| {
            let cycles = constants.delta / wavelength;
            WaveMaterial {
                cycles: single(cycles),
                cycles_low: single(cycles - f64::from(single(cycles))),
                half_mu: single(0.5 * constants.mu),
                delta: single(constants.delta * optics.cell_plane / optics.analyser),
            }
        };
        constants.iter().map(of).collect::<Vec<_>>()
    };
    media.energies.iter().zip(&media.constants).flat_map(of_energy).collect()
}
