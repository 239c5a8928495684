//! Lines of a scene on the device: frequencies of each energy, pixels and responses of each beamlet.

use super::columns::Columns;
use super::frequencies::{Frequencies, spacing, wavelength};
use crate::sampling::Lattice;
use beamlet_core::numbers::{self, single};
use beamlet_core::{Error, Result};
use beamlet_gpu::{Buffer, Device};
use beamlet_interface::{Address, WaveBeamlet, WaveMaterial, WaveParams};
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::{Mask, MaskShape, Optics};
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

/// Apertures of the sample mask in its plane, m.
#[derive(Debug, Clone, Copy)]
struct Apertures {
    period: f64,
    ends: [f64; 2],
    /// Width of the bars.
    bar: f64,
    /// Farthest edge from the centre of a beamlet at any offset.
    farthest: f64,
}

impl Apertures {
    fn of(optics: &Optics, mask: &Mask) -> Self {
        let openings = mask.openings(optics.cell_plane);
        let ends = openings.ends().next().unwrap_or([0.0; 2]);
        let offsets = optics.offsets.lists().iter().flatten();
        let farthest = |f: &f64| ends.map(|end| (end + f).abs()).into_iter().fold(0.0, f64::max);
        let farthest = offsets.map(farthest).fold(0.0, f64::max);
        Self { period: openings.period[0], ends, bar: openings.bar(), farthest }
    }

    /// Largest shear of pairs that pass, m.
    fn widest(&self, leaks: bool) -> f64 {
        if leaks { self.period } else { self.ends[1] - self.ends[0] }
    }

    /// Half of a line, m: pairs of a beamlet lie on it. `shear`: the largest.
    fn reach(&self, leaks: bool, shear: f64) -> f64 {
        match leaks {
            true => self.farthest.max(0.5 * self.period) + shear,
            false if shear > self.bar => self.farthest + shear,
            false => self.farthest,
        }
    }
}

impl WavePlan {
    /// Plans lines at a tolerance (share of open beam).
    ///
    /// # Errors
    /// [`Error::Scene`] where lines would have too many rays; as [`MaskShape::of`].
    pub(crate) fn new(
        device: &Arc<Device>,
        scene: &Scene,
        optics: &Optics,
        lattice: &Lattice,
        media: &MaterialTable,
    ) -> Result<Option<Self>> {
        let Some(mask) = &optics.sample_mask else { return Ok(None) };
        let tolerance = scene.sampling.tolerances().light;
        let apertures = Apertures::of(optics, mask);
        let spacing = spacing(optics, &media.energies, apertures.period, tolerance);
        let leaks: Vec<[f64; 2]> = media
            .energies
            .iter()
            .map(|energy| {
                let leak = |mask: &Option<Mask>| match mask {
                    None => Ok(0.0),
                    Some(mask) => MaskShape::of(scene, mask, mask.distance(), Some(*energy))
                        .map(|it| it.leak(1.0)),
                };
                Ok([leak(&optics.sample_mask)?, leak(&optics.detector_mask)?])
            })
            .collect::<Result<_>>()?;
        let frequencies: Vec<Frequencies> = media
            .energies
            .iter()
            .zip(&leaks)
            .map(|(energy, [leak, _])| {
                let widest = apertures.widest(*leak > 0.0);
                Frequencies::of(optics, spacing, wavelength(*energy), apertures.period, widest)
            })
            .collect();
        let rays = rays_of(&apertures, &frequencies, &leaks)?;
        let columns = Columns::of(optics, lattice);
        let mut buffers = vec![
            device.upload("beamlets of lines", &beamlets(&columns, &apertures, spacing))?,
            device.upload("pixels of beamlets", &columns.windows_of)?,
        ];
        let mut params = Vec::new();
        for ((of, leaks), share) in frequencies.iter().zip(&leaks).zip(&media.weights) {
            let responses = columns.responses(optics, of, rays, [*share, leaks[1]]);
            let responses = device.upload("responses of pixels", &responses)?;
            params.push(WaveParams {
                beamlets: buffers[0].address(),
                targets: buffers[1].address(),
                responses: responses.address(),
                rays,
                shears: of.count,
                pairs: of.pairs,
                turn: of.turn,
                target_stride: columns.most,
                neighbours: numbers::whole((of.largest_shear() / apertures.bar).min(8.0)),
                mask_shear: single(of.mask_shear / spacing),
                period: single(apertures.period / spacing),
                cells: single(1.0 / spacing),
                frequency: single(of.at(1)),
                bars: single(leaks[0].sqrt()),
            });
            buffers.push(responses);
        }
        Ok(Some(Self {
            beamlets: columns.beamlets,
            pixels: columns.pixels,
            most_pixels: columns.most,
            rays,
            spacing,
            energies: numbers::count(params.len()),
            materials: numbers::count(media.names.len()),
            lever: optics.lever_arm,
            row_shift: optics
                .spot
                .placed()
                .first()
                .map_or(0.0, |it| optics.rows_of_source(it.offset[1])),
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

/// Rays of a line, an even number.
fn rays_of(apertures: &Apertures, of: &[Frequencies], leaks: &[[f64; 2]]) -> Result<u32> {
    let refuse = |found: String| {
        let allowed =
            "a larger tolerance, narrower apertures, less distance or a larger focal spot";
        Err(Error::scene("sampling.transport", found, allowed))
    };
    let mut most = 0.0_f64;
    for (of, [leak, _]) in of.iter().zip(leaks) {
        if of.count > MOST_FREQUENCIES {
            return refuse(format!("\"wave\" with {} frequencies", of.count));
        }
        let half = apertures.reach(*leak > 0.0, of.largest_shear()) / of.spacing;
        most = most.max(2.0 * (half.ceil() + 1.0));
    }
    if most > MOST_RAYS {
        return refuse(format!("\"wave\" with {most:.0} rays in a line"));
    }
    Ok(numbers::whole(most))
}

/// Records of the beamlets.
fn beamlets(columns: &Columns, apertures: &Apertures, spacing: f64) -> Vec<WaveBeamlet> {
    let [low, high] = apertures.ends.map(|end| single(end / spacing));
    let mut first_target = 0;
    let record = |(_, target_count): &(u32, u32)| {
        let record = WaveBeamlet { low, high, first_target, target_count: *target_count };
        first_target += target_count;
        record
    };
    columns.pixels.iter().map(record).collect()
}

/// Records of the materials by energy.
fn materials(optics: &Optics, media: &MaterialTable) -> Vec<WaveMaterial> {
    let of_energy = |(energy, constants): (&f64, &Vec<beamlet_model::material::Constants>)| {
        let wavelength = wavelength(*energy);
        let of = |constants: &beamlet_model::material::Constants| {
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
