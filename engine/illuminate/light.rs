//! The parameters of the light stages, from the scene.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

use crate::gpu::{Buffer, Device};
use crate::interface::{Address, Aperture, Column, IlluminationParams, Mask, SpotPart};
use crate::sampling::{Lattice, column};
use crate::scene::{MaskBody, MaskSpec, Scene};
use crate::spot::PlacedPart;
use crate::trace::MaterialTable;
use crate::{Result, material};
use std::ops::Range;
use std::sync::Arc;

/// Rows of a block see the bars under angles whose secants differ by this from that of its middle,
/// at most,
const SAME_SECANT: f64 = 2e-5;
/// and by so much that the light they leak differs by this share of the open beam.
const SAME_LEAK: f64 = 1e-7;
/// At most 2 to the power of this many rows.
const MOST_ALIKE: u32 = 5;

/// Which light a record is of.
#[derive(Debug, Clone, Copy)]
pub(crate) enum SpectralBand {
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
    /// Width of the bars.
    bar: f64,
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
        let bar = (mask.period - mask.aperture) * scale;
        let (thickness, attenuation, transmission) = match &mask.body {
            MaskBody::Bars { material, thickness } => {
                let key = format!("{name}.material");
                let mu = |energy| material::constants_at_for(scene, material, energy, &key);
                let mu = energy.map_or(Ok(f64::INFINITY), |energy| Ok(mu(energy)?.mu))?;
                (*thickness, mu * thickness, 0.0)
            }
            MaskBody::Sheet { transmission } => (0.0, 0.0, *transmission),
        };
        // Without bars there is nothing for any material to do.
        let (thickness, attenuation, transmission) =
            if bar > 0.0 { (thickness, attenuation, transmission) } else { (0.0, 0.0, 1.0) };
        Ok(Self {
            apertures: vec![Aperture { low: -half as f32, high: half as f32 }],
            period: mask.period * scale,
            bar,
            thickness: thickness * scale,
            attenuation,
            // Bars of a material that does not absorb are no mask at all.
            transmission: if thickness > 0.0 && attenuation <= 0.0 { 1.0 } else { transmission },
        })
    }

    /// Transmission of bars wider than their shadow, as `thick_bars` in light/mask.glsl.
    pub(super) fn leak(&self, secant: f64) -> f64 {
        if self.attenuation > 0.0 {
            libm::exp(-self.attenuation * secant)
        } else {
            self.transmission
        }
    }

    /// Share of the shadow width that narrows apertures, as `edge_mean` there tells, where bars
    /// leak so much.
    pub(super) fn shade(&self, secant: f64, leak: f64) -> f64 {
        let a = self.attenuation * secant;
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

    /// Whether bars do the same to light in the way of them; apertures do not count.
    pub(super) fn shades_like(&self, other: &Self) -> bool {
        let of =
            |mask: &Self| [mask.thickness, mask.attenuation, mask.transmission].map(f64::to_bits);
        of(self) == of(other)
    }

    /// Width of the narrowest aperture or bar, m in the plane of evaluation.
    pub(super) fn narrowest(&self) -> f64 {
        self.apertures.iter().map(|a| f64::from(a.high - a.low)).fold(self.bar, f64::min)
    }
}

/// Rows of a block that may see the bars of masks under one angle, a power of two.
///
/// # Errors
/// As [`material::constants_at_for`].
pub(crate) fn alike_rows(scene: &Scene, media: &MaterialTable) -> Result<u32> {
    let masks = [("sample_mask", &scene.sample_mask), ("detector_mask", &scene.detector_mask)];
    // Change of the leaks, as a share of the open beam, by that of the secant.
    let mut change: f64 = 0.0;
    for (name, mask) in masks {
        let Some(mask) = mask else { continue };
        let mut sum = 0.0;
        for (&energy, weight) in media.energies.iter().zip(&media.weights) {
            let shape = MaskShape::of(scene, name, mask, mask.distance, Some(energy))?;
            sum += weight * shape.attenuation * shape.leak(1.0);
        }
        change = change.max(sum);
    }
    let slope = scene.detector.pitch[1] / scene.detector.distance;
    let highest = f64::from(scene.detector.pixels[1]) / 2.0 * slope;
    let fits = |rows: u32| {
        let half = f64::from(rows) / 2.0 * slope;
        let turn = (highest + 2.0 * half) * half;
        turn <= SAME_SECANT && change * turn <= SAME_LEAK
    };
    Ok((1..=MOST_ALIKE).rev().map(|power| 1 << power).find(|rows| fits(*rows)).unwrap_or(1))
}

/// The light stages' parameters on the device. The band of rows varies, the rest stays.
#[derive(Debug)]
pub(crate) struct IlluminationBuffer {
    /// For cells one record for each part of the focal spot, for random rays one in all; rows of a
    /// band are set with [`IlluminationBuffer::set_band`].
    buffer: Buffer,
    /// No sample mask tells the mask steps apart.
    pub(super) same_at_all_steps: bool,
    /// Shares of rows that cells hold are not those of some part of the spot.
    pub(super) rows_apart: bool,
    lights: Vec<IlluminationParams>,
    _kept: Vec<Buffer>,
}

impl IlluminationBuffer {
    /// Uploads the parameters for `columns` (of the lattice, or of pixels).
    fn upload(
        device: &Arc<Device>,
        scene: &Scene,
        cell_plane: f64,
        columns: &[Column],
        offsets: &[f64],
        part: &SpectralBand,
        parts: &[PlacedPart],
    ) -> Result<Self> {
        let analyser = scene.analyser_distance();
        let detector = &scene.detector;
        let source = &scene.source;
        let mut kept = Vec::new();
        let mut mask = |index: usize, spec: Option<&MaskSpec>, plane: f64| -> Result<Mask> {
            let name = ["sample_mask", "detector_mask"][index];
            let Some(spec) = spec else { return Ok(bytemuck::Zeroable::zeroed()) };
            let (energy, softness) = match part {
                SpectralBand::Node { energy, .. } => (Some(*energy), None),
                SpectralBand::Group { softness } if softness[index].is_none() => {
                    return Ok(bytemuck::Zeroable::zeroed());
                }
                SpectralBand::Group { softness } => (None, softness[index]),
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
                first: shape.apertures.first().map_or(0.0, |a| a.low),
                last: shape.apertures.last().map_or(0.0, |a| a.high),
            };
            kept.push(apertures);
            Ok(record)
        };
        let sample_mask = mask(0, scene.sample_mask.as_ref(), cell_plane)?;
        let detector_mask = mask(1, scene.detector_mask.as_ref(), analyser)?;
        let columns = device.upload("columns", columns)?;
        let offsets: Vec<f32> = offsets.iter().map(|&f| f as f32).collect();
        let offsets = device.upload("mask offsets", &offsets)?;
        let share = match part {
            SpectralBand::Node { weight, .. } => *weight,
            SpectralBand::Group { .. } => 1.0,
        };
        let table = device.upload("focal spot", &table(&source.spot.placed()))?;
        let narrow = |value: f64| value as f32;
        // By how much what lies at a source offset (or its deviation) moves, m.
        let at_analyser = |offset: f64| offset * (analyser / source.distance - 1.0);
        let at_pixel = |offset: f64| {
            offset * (detector.distance / source.distance - 1.0) * analyser / detector.distance
        };
        let at_mask = |offset: f64| offset * (source.distance - cell_plane) / source.distance;
        let in_rows = |offset: f64| {
            offset * (detector.distance - source.distance) / source.distance / detector.pitch[1]
        };
        let base = parts.first().map_or(0.0, |part| part.deviation[1]);
        let of_part = |part: &PlacedPart| IlluminationParams {
            sample_mask,
            detector_mask,
            columns: columns.address(),
            offsets: offsets.address(),
            spot_parts: table.address(),
            magnification: (analyser / cell_plane) as f32,
            mask_move: narrow(at_mask(part.offset[0])),
            landing_move: narrow(at_analyser(part.offset[0])),
            pixel_move: narrow(at_pixel(part.offset[0])),
            slope_move: narrow(part.offset[0] / source.distance),
            row_move: narrow(in_rows(part.offset[1])),
            spot: narrow(at_analyser(part.deviation[0])),
            pixel_spot: narrow(at_pixel(part.deviation[0])),
            shift: narrow(at_mask(part.deviation[0])),
            cell_plane: cell_plane as f32,
            analyser: analyser as f32,
            ratio: (analyser / detector.distance) as f32,
            pixel: (detector.pitch[0] * analyser / detector.distance) as f32,
            weight: (share * part.share * detector.distance / (cell_plane * detector.pitch[0]))
                as f32,
            row_blur: narrow(in_rows(part.deviation[1])),
            row_pitch: detector.pitch[1] as f32,
            row_slope: (-detector.pitch[1] / detector.distance) as f32,
            alike_rows: 1.0,
            middle_row: (f64::from(detector.pixels[1]) / 2.0) as f32,
            row_count: 0,
            first_row: 0,
            column_count: detector.pixels[0],
            detector: detector.distance as f32,
            rotation: source.distance as f32,
            column_pitch: detector.pitch[0] as f32,
            part: share as f32,
        };
        let lights: Vec<IlluminationParams> = parts.iter().map(of_part).collect();
        let buffer = device.upload("light", &lights)?;
        kept.extend([columns, offsets, table]);
        let same_at_all_steps = sample_mask.present == 0;
        let apart = |part: &PlacedPart| {
            part.offset[1].abs() > 0.0 || (part.deviation[1] - base).abs() > 0.0
        };
        let rows_apart = parts.iter().any(apart);
        Ok(Self { buffer, same_at_all_steps, rows_apart, lights, _kept: kept })
    }

    /// The record of random rays.
    pub(super) fn address(&self) -> Address {
        self.buffer.address()
    }

    /// The records of the parts of the focal spot.
    pub(super) fn addresses(&self) -> impl Iterator<Item = Address> {
        let first = self.buffer.address();
        (0..self.lights.len() as u64)
            .map(move |part| first + part * size_of::<IlluminationParams>() as u64)
    }

    /// For cells: one column per beamlet of the lattice.
    ///
    /// # Errors
    /// [`crate::Error::Memory`], or as [`material::constants`].
    pub(crate) fn of_cells(
        device: &Arc<Device>,
        scene: &Scene,
        lattice: &Lattice,
        offsets: &[f64],
        part: &SpectralBand,
    ) -> Result<Self> {
        let parts = scene.source.spot.placed();
        let columns = lattice.columns(scene);
        let mut record =
            Self::upload(device, scene, lattice.plane, &columns, offsets, part, &parts)?;
        for light in &mut record.lights {
            light.alike_rows = lattice.alike_rows as f32;
        }
        Ok(record)
    }

    /// For random rays: one column per pixel of `pixels`.
    ///
    /// # Errors
    /// As [`IlluminationBuffer::of_cells`].
    pub(crate) fn of_pixels(
        device: &Arc<Device>,
        scene: &Scene,
        pixels: &Range<i64>,
        part: &SpectralBand,
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
        // Rays draw their part: one record tells of all.
        let whole = PlacedPart { share: 1.0, offset: [0.0; 2], deviation: [0.0; 2] };
        let offsets = &scene.scan.mask_offsets;
        Self::upload(device, scene, plane, &columns, offsets, part, &[whole])
    }

    /// Sets the band of detector rows that sums are kept for.
    ///
    /// # Errors
    /// [`crate::Error::Device`].
    pub(crate) fn set_band(&mut self, rows: &Range<u32>) -> Result<()> {
        for light in &mut self.lights {
            light.first_row = rows.start as i32;
            light.row_count = rows.end - rows.start;
        }
        self.buffer.write(0, &self.lights)
    }
}

/// The parts of a focal spot for random draws.
fn table(parts: &[PlacedPart]) -> Vec<SpotPart> {
    let mut below = 0.0;
    let of_part = |part: &PlacedPart| {
        below += part.share;
        let [x, z] = part.offset.map(|offset| offset as f32);
        let [deviation_x, deviation_z] = part.deviation.map(|deviation| deviation as f32);
        SpotPart { below: below as f32, x, z, deviation_x, deviation_z }
    };
    let mut table: Vec<SpotPart> = parts.iter().map(of_part).collect();
    // Every draw ends there, whatever the shares round to.
    if let Some(last) = table.last_mut() {
        last.below = 2.0;
    }
    table
}
