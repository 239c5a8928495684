//! The parameters of the light stages, from the scene.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

use crate::gpu::interface::{Aperture, Column, Light, Mask};
use crate::gpu::{Buffer, Device};
use crate::scene::{MaskBody, MaskSpec, Scene};
use crate::trace::{Lattice, column, deviation};
use crate::{Result, material};
use std::ops::Range;
use std::sync::Arc;

/// Which light a record is of.
#[derive(Debug, Clone, Copy)]
pub enum Part {
    /// That of one energy (keV), with its share of the spectrum.
    Node {
        /// keV.
        energy: f64,
        /// Of all light.
        weight: f64,
    },
    /// That of all energies which took the same way through the masks: where a mask has a
    /// softness, through its apertures; where not, the mask is not there for it.
    Group {
        /// Variance of the edges of the sample mask and the detector mask, in squared shadow
        /// widths.
        softness: [Option<f32>; 2],
    },
}

/// A mask as the light stages see it: apertures of one period, and its bars.
#[derive(Debug, Clone)]
pub(super) struct MaskShape {
    /// Sorted open intervals about the centre of the period, m in the plane of evaluation.
    apertures: Vec<Aperture>,
    period: f64,
    pub(super) thickness: f64,
    attenuation: f64,
    transmission: f64,
}

impl MaskShape {
    /// The mask seen from the source in the plane at `plane`, at an energy (keV) or opaque.
    pub(super) fn of(
        scene: &Scene,
        name: &str,
        mask: &MaskSpec,
        plane: f64,
        energy: Option<f64>,
    ) -> Result<Self> {
        let scale = plane / mask.distance;
        let half = mask.aperture * scale / 2.0;
        let (thickness, attenuation, transmission) = match &mask.body {
            MaskBody::Bars { material, thickness } => {
                let key = format!("{name}.material");
                let mu = |energy| material::constants_at_for(scene, material, energy, &key);
                let mu = energy.map_or(Ok(f64::INFINITY), |energy| Ok(mu(energy)?.mu))?;
                (*thickness, mu * thickness, 0.0)
            }
            MaskBody::Sheet { transmission } => (0.0, 0.0, *transmission),
        };
        Ok(Self {
            apertures: vec![Aperture { low: -half as f32, high: half as f32 }],
            period: mask.period * scale,
            thickness: thickness * scale,
            attenuation,
            // Bars of a material that does not absorb are no mask at all.
            transmission: if thickness > 0.0 && attenuation <= 0.0 { 1.0 } else { transmission },
        })
    }

    /// Transmission of the bars, as `bar_transmission` in light/mask.glsl.
    pub(super) fn leak(&self, secant: f64) -> f64 {
        if self.attenuation > 0.0 {
            libm::exp(-self.attenuation * secant)
        } else {
            self.transmission
        }
    }

    /// Share of the shadow width that narrows apertures, as `effective_width` there.
    pub(super) fn shade(&self, secant: f64) -> f64 {
        let (a, leak) = (self.attenuation * secant, self.leak(secant));
        if a <= 0.0 || 1.0 - leak < 1e-5 {
            return 0.0;
        }
        let mean = if a < 1e-3 { 1.0 - 0.5 * a } else { (1.0 - leak) / a };
        1.0 - 2.0 * (mean - leak) / (1.0 - leak)
    }

    /// Variance of an edge in squared shadow widths, as `edge_variance` there.
    pub(super) fn softness(&self) -> f64 {
        let (a, leak) = (self.attenuation, self.leak(1.0));
        if a <= 0.0 {
            return 0.0;
        }
        if a < 0.1 {
            return 1.0 / 12.0;
        }
        (1.0 / (a * a) - leak / ((1.0 - leak) * (1.0 - leak))).max(0.0)
    }

    /// Width of the narrowest aperture, m in the plane of evaluation.
    pub(super) fn narrowest(&self) -> f64 {
        self.apertures.iter().map(|a| f64::from(a.high - a.low)).fold(f64::INFINITY, f64::min)
    }
}

/// The light stages' parameters on the device. The band of rows varies, the rest stays.
#[derive(Debug)]
pub struct LightRecord {
    /// The record itself; rows of a band are set with [`LightRecord::set_band`].
    pub buffer: Buffer,
    /// No sample mask tells the mask steps apart.
    pub(super) same_at_all_steps: bool,
    light: Light,
    _kept: Vec<Buffer>,
}

impl LightRecord {
    /// Uploads the parameters for `columns` (of the lattice, or of pixels).
    fn upload(
        device: &Arc<Device>,
        scene: &Scene,
        cell_plane: f64,
        columns: &[Column],
        offsets: &[f64],
        part: &Part,
    ) -> Result<Self> {
        let analyser = scene.analyser_distance();
        let detector = &scene.detector;
        let source = &scene.source;
        let mut kept = Vec::new();
        let mut mask = |index: usize, spec: Option<&MaskSpec>, plane: f64| -> Result<Mask> {
            let name = ["sample_mask", "detector_mask"][index];
            let Some(spec) = spec else { return Ok(bytemuck::Zeroable::zeroed()) };
            let (energy, softness) = match part {
                Part::Node { energy, .. } => (Some(*energy), None),
                Part::Group { softness } if softness[index].is_none() => {
                    return Ok(bytemuck::Zeroable::zeroed());
                }
                Part::Group { softness } => (None, softness[index]),
            };
            let shape = MaskShape::of(scene, name, spec, plane, energy)?;
            let apertures = device.upload(name, &shape.apertures)?;
            let record = Mask {
                apertures: apertures.address(),
                count: shape.apertures.len() as u32,
                present: 1,
                period: shape.period as f32,
                thickness: shape.thickness as f32,
                attenuation: shape.attenuation as f32,
                transmission: shape.transmission as f32,
                averaged: softness.is_some().into(),
                softness: softness.unwrap_or(0.0),
            };
            kept.push(apertures);
            Ok(record)
        };
        let sample_mask = mask(0, scene.sample_mask.as_ref(), cell_plane)?;
        let detector_mask = mask(1, scene.detector_mask.as_ref(), analyser)?;
        let columns = device.upload("columns", columns)?;
        let offsets: Vec<f32> = offsets.iter().map(|&f| f as f32).collect();
        let offsets = device.upload("mask offsets", &offsets)?;
        let spot = source.spot.map(deviation);
        let share = match part {
            Part::Node { weight, .. } => *weight,
            Part::Group { .. } => 1.0,
        };
        let light = Light {
            sample_mask,
            detector_mask,
            columns: columns.address(),
            offsets: offsets.address(),
            magnification: (analyser / cell_plane) as f32,
            source_x: spot[0] as f32,
            spot: (spot[0] * (analyser / source.distance - 1.0)) as f32,
            pixel_spot: (spot[0] * (detector.distance / source.distance - 1.0) * analyser
                / detector.distance) as f32,
            shift: (spot[0] * (source.distance - cell_plane) / source.distance) as f32,
            cell_plane: cell_plane as f32,
            analyser: analyser as f32,
            ratio: (analyser / detector.distance) as f32,
            pixel: (detector.pitch[0] * analyser / detector.distance) as f32,
            weight: (share * detector.distance / (cell_plane * detector.pitch[0])) as f32,
            row_blur: (spot[1] * (detector.distance - source.distance)
                / source.distance
                / detector.pitch[1]) as f32,
            row_pitch: detector.pitch[1] as f32,
            row_slope: (-detector.pitch[1] / detector.distance) as f32,
            middle_row: (f64::from(detector.pixels[1]) / 2.0) as f32,
            row_count: 0,
            first_row: 0,
            column_count: detector.pixels[0],
            detector: detector.distance as f32,
            rotation: source.distance as f32,
            source_z: spot[1] as f32,
            column_pitch: detector.pitch[0] as f32,
            part: share as f32,
        };
        let buffer = device.upload("light", &[light])?;
        kept.extend([columns, offsets]);
        Ok(Self { buffer, same_at_all_steps: light.sample_mask.present == 0, light, _kept: kept })
    }

    /// For cells: one column per beamlet of the lattice.
    ///
    /// # Errors
    /// [`crate::Error::Memory`], or as [`material::constants`].
    pub fn of_cells(
        device: &Arc<Device>,
        scene: &Scene,
        lattice: &Lattice,
        offsets: &[f64],
        part: &Part,
    ) -> Result<Self> {
        Self::upload(device, scene, lattice.plane, &lattice.columns(scene), offsets, part)
    }

    /// For random rays: one column per pixel of `pixels`.
    ///
    /// # Errors
    /// As [`LightRecord::of_cells`].
    pub fn of_pixels(
        device: &Arc<Device>,
        scene: &Scene,
        pixels: &Range<i64>,
        part: &Part,
    ) -> Result<Self> {
        let detector = &scene.detector;
        let plane = scene.cell_plane_distance();
        let columns: Vec<Column> = pixels
            .clone()
            .map(|c| {
                let at = (c as f64 + 0.5 - f64::from(detector.pixels[0]) / 2.0) * detector.pitch[0];
                column(scene, at / detector.distance, scene.analyser_distance(), plane)
            })
            .collect();
        Self::upload(device, scene, plane, &columns, &scene.scan.mask_offsets, part)
    }

    /// Sets the band of detector rows that sums are kept for.
    ///
    /// # Errors
    /// [`crate::Error::Device`].
    pub fn set_band(&mut self, rows: &Range<u32>) -> Result<()> {
        self.light.first_row = rows.start as i32;
        self.light.row_count = rows.end - rows.start;
        self.buffer.write(0, &[self.light])
    }
}
