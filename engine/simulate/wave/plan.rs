//! Lines of a scene on the device: frequencies of each energy, pixels and responses of each beamlet.

use super::columns::Columns;
use super::energy::{Energy, refuse};
use super::frequencies::{spacing, wavelength};
use crate::sampling::Lattice;
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use beamlet_gpu::{Buffer, Device};
use beamlet_interface::{Address, WaveMaterial, WaveParams};
use beamlet_model::material::Constants;
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::Optics;
use beamlet_model::scene::Scene;
use std::ops::Range;
use std::sync::Arc;

/// Most rays of a line: a wider period or aperture has too many.
const MOST_RAYS: f64 = 1e6;

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

impl WavePlan {
    /// Plans the lines of a scene, and of half their spacing; none without a sample mask.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Scene`] where lines would have too many rays or masks are not described by waves.
    pub(crate) fn new(
        device: &Arc<Device>,
        scene: &Scene,
        optics: &Optics,
        lattice: &Lattice,
        media: &MaterialTable,
    ) -> Result<Option<[Arc<Self>; 2]>> {
        let tolerance = scene.sampling.tolerances().light;
        let spacing = spacing(optics, &media.energies, lattice.period, tolerance);
        let own = Self::with_spacing(device, (scene, optics), lattice, media, spacing)?;
        let finer = Self::with_spacing(device, (scene, optics), lattice, media, 0.5 * spacing)?;
        Ok(own.zip(finer).map(|(own, finer)| [Arc::new(own), Arc::new(finer)]))
    }

    fn with_spacing(
        device: &Arc<Device>,
        (scene, optics): (&Scene, &Optics),
        lattice: &Lattice,
        media: &MaterialTable,
        spacing: f64,
    ) -> Result<Option<Self>> {
        let tolerance = scene.sampling.tolerances().light;
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
