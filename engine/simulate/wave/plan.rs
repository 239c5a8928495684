//! Lines of a scene on the device: frequencies of each energy, pixels and responses of each beamlet.

use super::columns::Columns;
use super::energy::{Energy, Spacing, refuse};
use super::frequencies::{Kind, spacing};
use super::inline;
use super::laws::Laws;
use crate::sampling::Lattice;
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use beamlet_gpu::{Buffer, Device};
use beamlet_interface::{Address, WaveMaterial, WaveParams};
use beamlet_model::material::Constants;
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::Optics;
use beamlet_model::optics::waves::wavelength;
use beamlet_model::scene::Scene;
use std::f64::consts::{PI, SQRT_2};
use std::ops::Range;
use std::sync::Arc;

/// Most rays of a line: a wider period or aperture has too many.
const MOST_RAYS: f64 = 1e6;

/// Spread by propagation between mask and sample over the blur of the focal spot, from which on it is warned of.
const PROPAGATED: f64 = 0.25;

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
    /// Number of laws by which contrast depends on the shear; 0 where nothing scatters.
    pub(super) laws: u32,
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

/// Lines of a scene of each kind.
#[derive(Debug)]
pub(crate) struct WavePlans {
    /// Beamlets of the lines: of the scene, or groups of pixels without a sample mask.
    pub(crate) lattice: Lattice,
    /// Lines of rays.
    pub(super) rays: Arc<WavePlan>,
    /// Lines of half their spacing, for estimates.
    pub(super) finer: Arc<WavePlan>,
    /// Lines without rays.
    pub(super) flat: Arc<WavePlan>,
    /// Width of fringes √(λz) at the lowest energy, m.
    pub(crate) fringe: f64,
}

impl WavePlans {
    /// Plans the lines of a scene.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Scene`] where lines would have too many rays or masks are not described by waves.
    pub(crate) fn new(
        device: &Arc<Device>,
        scene: &Scene,
        optics: &Optics,
        lattice: &Lattice,
        media: &MaterialTable,
    ) -> Result<Self> {
        let tolerance = scene.sampling.tolerances().light;
        let lattice = inline::lattice(lattice, optics, &media.energies, tolerance);
        let spacing = spacing(scene, optics, &media.energies, lattice.period);
        log::info!("waves: rays {:.0} nm apart", 1e9 * spacing);
        let plan = |rays, kind| {
            let spacing = Spacing { rays, beamlets: lattice.period, kind };
            WavePlan::of(device, (scene, optics), &lattice, media, spacing).map(Arc::new)
        };
        let rays = plan(spacing, Kind::Rays)?;
        let finer = plan(0.5 * spacing, Kind::Rays)?;
        let flat = plan(spacing, Kind::Flat)?;
        let fringe = inline::fringe(optics, &media.energies);
        Ok(Self { lattice, rays, finer, flat, fringe })
    }
}

impl WavePlan {
    fn of(
        device: &Arc<Device>,
        (scene, optics): (&Scene, &Optics),
        lattice: &Lattice,
        media: &MaterialTable,
        spacing: Spacing,
    ) -> Result<Self> {
        let tolerance = scene.sampling.tolerances().light;
        let nodes = media.energies.iter().copied().zip(media.weights.iter().copied());
        let energies = nodes.map(|node| Energy::of(scene, optics, node, spacing));
        let energies: Vec<Energy> = energies.collect::<Result<_>>()?;
        let rays = rays_of(optics, &energies)?;
        if spacing.kind == Kind::Flat {
            warn(optics, &energies, media, tolerance);
        }
        let mut buffers = Vec::new();
        let mut params = Vec::new();
        let laws = Laws::of(scene, media)?;
        for (node, energy) in energies.iter().enumerate() {
            energy.check(optics, tolerance)?;
            let columns = Columns::of(optics, lattice, energy.detector.as_ref());
            let mut made =
                energy.params(device, (optics, lattice), &columns, rays, &mut buffers)?;
            let factors = laws.factors(media, node, &energy.frequencies);
            if !factors.is_empty() {
                let factors = device.upload("contrasts of media", &factors)?;
                made.laws = factors.address();
                buffers.push(factors);
            }
            params.push(made);
        }
        let columns = Columns::of(optics, lattice, None);
        let first = optics.spot.placed().first().map_or(0.0, |part| part.offset[1]);
        Ok(Self {
            beamlets: columns.beamlets,
            pixels: columns.pixels,
            most_pixels: columns.most,
            rays,
            spacing: spacing.rays,
            energies: numbers::count(params.len()),
            materials: numbers::count(media.names.len()),
            laws: laws.count(),
            lever: optics.lever_arm,
            row_shift: optics.rows_of_source(first),
            offsets: optics.offsets.lists().to_vec(),
            params: device.upload("lines", &params)?,
            media: device.upload("phases of materials", &materials(optics, media, &laws))?,
            _buffers: buffers,
        })
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

/// Refuses masks that waves do not describe, and lines of too many rays. `nodes`: energies (keV) and their weights.
pub(super) fn refuse_masks(scene: &Scene, optics: &Optics, nodes: &[(f64, f64)]) -> Result<()> {
    let tolerance = scene.sampling.tolerances().light;
    let energies: Vec<f64> = nodes.iter().map(|(energy, _)| *energy).collect();
    let pixels = inline::pixels_of_beamlet(optics, &energies, tolerance);
    let beamlets = f64::from(pixels) * optics.beamlets().period[0];
    let rays = 0.5 * spacing(scene, optics, &energies, beamlets);
    let finer = Spacing { rays, beamlets, kind: Kind::Rays };
    let energies = nodes.iter().map(|node| Energy::of(scene, optics, *node, finer));
    let energies: Vec<Energy> = energies.collect::<Result<_>>()?;
    rays_of(optics, &energies)?;
    energies.iter().try_for_each(|energy| energy.check(optics, tolerance))
}

/// Warns of phases of bars, and of propagation between mask and sample, that change light.
fn warn(optics: &Optics, energies: &[Energy], media: &MaterialTable, tolerance: f64) {
    let by_phase: f64 = energies.iter().map(|energy| energy.by_phase_of_bars(optics)).sum();
    if by_phase > tolerance {
        log::warn!(
            "waves: the phase of the bars of sample_mask changes light by up to {by_phase:.1e} of the open beam; \
             it is taken as 0"
        );
    }
    let apart = (optics.analyser - optics.lever_arm - optics.cell_plane).abs();
    let spreads = media.energies.iter().map(|energy| (wavelength(*energy) * apart).sqrt());
    let spread: f64 = spreads.zip(&media.weights).map(|(spread, weight)| spread * weight).sum();
    let blur = optics.spot.narrowest(0) * (1.0 - optics.cell_plane / optics.analyser);
    if spread > PROPAGATED * blur {
        let motion = optics.spot.narrowest(0) * apart / (optics.analyser - optics.lever_arm);
        // Light beyond the image of a straight edge: √(λd/2)/(2π) of its intensity by Fresnel, σ/√(2π) by a motion.
        let beyond = (spread / (2.0 * SQRT_2 * PI)).hypot(motion / (2.0 * PI).sqrt());
        log::warn!(
            "waves: propagation between sample_mask and sample is neglected: √(λd) = {:.1} um exceeds a quarter of \
             the blur of the focal spot, {:.1} um; with the motion of the sample against the mask by the focal spot, \
             {:.1} um, it changes light by up to {:.1e} of the open beam, where an opaque edge covers that of an \
             aperture",
            1e6 * spread,
            1e6 * blur,
            1e6 * motion,
            beyond / optics.detector.pitch_at(0, optics.cell_plane)
        );
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
fn materials(optics: &Optics, media: &MaterialTable, laws: &Laws) -> Vec<WaveMaterial> {
    let of_energy = |(energy, constants): (&f64, &Vec<Constants>)| {
        let wavelength = wavelength(*energy);
        let of = |(material, constants): (usize, &Constants)| {
            let cycles = constants.delta / wavelength;
            WaveMaterial {
                cycles: single(cycles),
                cycles_low: single(cycles - f64::from(single(cycles))),
                half_mu: single(0.5 * constants.mu),
                delta: single(constants.delta * optics.cell_plane / optics.analyser),
                scattering: single(
                    constants.scattering * (optics.cell_plane / optics.analyser).powi(2),
                ),
                law: laws.of_material(material),
            }
        };
        constants.iter().enumerate().map(of).collect::<Vec<_>>()
    };
    media.energies.iter().zip(&media.constants).flat_map(of_energy).collect()
}
