//! The parameters of the light stages, from the optics.

use super::heights;
use crate::sampling::{Lattice, beamlet_geometry};
use beamlet_core::Result;
use beamlet_core::numbers::{count, single};
use beamlet_gpu::{Buffer, Device, Upload};
use beamlet_interface::{
    Address, Aperture, BarLayer, BeamletGeometry, HeightParams, IlluminationParams, Mask, SpotPart,
};
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::{MaskShape, Optics};
use beamlet_model::scene::Scene;
use beamlet_model::spot::{PlacedPart, differ_along_z};
use std::ops::Range;
use std::sync::Arc;

/// Largest difference of the secant of the angle to the bars within a block of rows, from the middle.
const SAME_SECANT: f64 = 2e-5;
/// Largest difference of the leaked light within a block, share of the open beam.
const SAME_LEAK: f64 = 1e-7;
/// Numbers that the length of a list of mask offsets is a multiple of: shaders load 16 bytes at once.
pub(super) const LIST_ALIGNMENT: usize = 4;
/// At most 2 to the power of this many rows.
const MOST_ALIKE: u32 = 5;

/// Edges of the apertures of both masks, which kernels are made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ApertureEdges {
    /// Slits whose walls are parallel to the axis.
    Straight,
    /// Slits whose two edges differ: walls are slanted, or bars have several layers.
    Walls,
    /// Apertures that end along z.
    Heights,
}

impl ApertureEdges {
    /// Kind of the edges in a run.
    pub(crate) fn of(optics: &Optics) -> Self {
        match (optics.has_heights(), optics.has_walls()) {
            (true, _) => Self::Heights,
            (false, true) => Self::Walls,
            (false, false) => Self::Straight,
        }
    }
}

/// Which light a record is of.
#[derive(Debug, Clone, Copy)]
pub(crate) enum SpectralBand {
    /// Light of one energy (keV), with its share of the spectrum.
    Node {
        /// keV.
        energy: f64,
        /// Share of all light.
        weight: f64,
    },
    /// Light of all energies that took the same way through the masks: through the apertures of a mask
    /// with an edge variance; a mask without one is absent for it.
    Group {
        /// Variance of the edges of the sample mask and the detector mask, in squared shadow
        /// widths.
        edge_variance: [Option<f32>; 2],
    },
}

impl SpectralBand {
    /// Light of each energy of a scene.
    pub(crate) fn nodes(media: &MaterialTable) -> impl Iterator<Item = Self> {
        let nodes = media.energies.iter().zip(&media.weights);
        nodes.map(|(&energy, &weight)| Self::Node { energy, weight })
    }

    /// Energy at which bars of the sample mask (0) or detector mask (1) are, and the edge variance that energies
    /// share; `None` where the light does not see the mask.
    pub(super) fn seen(&self, mask: usize) -> Option<(Option<f64>, Option<f32>)> {
        match self {
            Self::Node { energy, .. } => Some((Some(*energy), None)),
            Self::Group { edge_variance } => Some((None, Some(edge_variance[mask]?))),
        }
    }
}

/// Rows of a block that may see the bars of masks under one angle, a power of two.
///
/// # Errors
/// As [`beamlet_model::material::constants_at_for`].
pub(crate) fn alike_rows(scene: &Scene, optics: &Optics, media: &MaterialTable) -> Result<u32> {
    // Change of the leaks, as a share of the open beam, over the change of the secant.
    let mut change: f64 = 0.0;
    for mask in optics.sample_mask.iter().chain(&optics.detector_mask) {
        let mut sum = 0.0;
        for (&energy, weight) in media.energies.iter().zip(&media.weights) {
            let shape = MaskShape::of(scene, mask, mask.distance(), Some(energy))?;
            sum += weight * shape.attenuation * shape.leak(1.0);
        }
        change = change.max(sum);
    }
    let slope = optics.detector.row_slope();
    // Masks with edges along z stand otherwise in each row.
    if optics.has_heights() {
        return Ok(1);
    }
    let highest = optics.detector.half(1) * slope;
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
    /// There is no sample mask: all mask steps are the same.
    pub(super) same_at_all_steps: bool,
    /// Edges of the apertures of the masks.
    edges: ApertureEdges,
    lights: Vec<IlluminationParams>,
    /// Address of the first list of mask offsets, and bytes from one to the next.
    list: (Address, u64),
    /// First record of heights, by list and part of the focal spot; none of slits.
    heights: Option<Address>,
    /// Tables that the records point to.
    buffers: Vec<Buffer>,
}

impl IlluminationBuffer {
    /// Uploads the parameters for `beamlets` (of the lattice, or of pixels).
    fn upload(
        device: &Arc<Device>,
        scene: &Scene,
        optics: &Optics,
        beamlets: &[BeamletGeometry],
        band: &SpectralBand,
        parts: &[PlacedPart],
    ) -> Result<Self> {
        let mut buffers = Vec::new();
        let sample_mask = upload_mask(device, scene, optics, band, 0, &mut buffers)?;
        let detector_mask = upload_mask(device, scene, optics, band, 1, &mut buffers)?;
        let beamlets = device.upload("beamlets", beamlets)?;
        let lists = optics.offsets.lists();
        let stride = optics.mask_steps().next_multiple_of(LIST_ALIGNMENT);
        let mut offsets = vec![0.0; stride * lists.len()];
        for (of, list) in offsets.chunks_mut(stride).zip(lists) {
            of.iter_mut().zip(list).for_each(|(of, offset)| *of = single(*offset));
        }
        let offsets = device.upload("mask offsets", &offsets)?;
        let list = (offsets.address(), (stride * size_of::<f32>()) as u64);
        let table = device.upload("focal spot", &table(&optics.spot.placed()))?;
        let shared = IlluminationParams {
            rows_apart: u32::from(differ_along_z(parts)),
            sample_mask,
            detector_mask,
            beamlets: beamlets.address(),
            offsets: offsets.address(),
            spot_parts: table.address(),
            ..set_up(optics)
        };
        let share = match band {
            SpectralBand::Node { weight, .. } => *weight,
            SpectralBand::Group { .. } => 1.0,
        };
        let lights: Vec<IlluminationParams> =
            parts.iter().map(|part| of_part(optics, share, part, shared)).collect();
        let buffer = device.upload("light", &lights)?;
        buffers.extend([beamlets, offsets, table]);
        let same_at_all_steps = sample_mask.present == 0;
        let edges = ApertureEdges::of(optics);
        Ok(Self { buffer, same_at_all_steps, edges, lights, list, heights: None, buffers })
    }

    /// True if parts of the spot differ in the shares of rows that cells hold.
    pub(super) fn rows_apart(&self) -> bool {
        self.lights.iter().any(|light| light.rows_apart != 0)
    }

    /// Edges of the apertures of the masks.
    pub(super) const fn edges(&self) -> ApertureEdges {
        self.edges
    }

    /// Adds the heights of the masks in these rows.
    fn add_heights(&mut self, device: &Arc<Device>, of: heights::HeightsOf<'_>) -> Result<()> {
        self.heights = heights::upload(device, of, &mut self.buffers)?;
        Ok(())
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
    /// [`beamlet_core::Error::Memory`], or as [`beamlet_model::material::constants_at_for`].
    pub(crate) fn of_cells(
        device: &Arc<Device>,
        scene: &Scene,
        optics: &Optics,
        lattice: &Lattice,
        band: &SpectralBand,
    ) -> Result<Self> {
        let parts = optics.spot.placed();
        let beamlets = lattice.beamlet_geometry(optics);
        let mut record = Self::upload(device, scene, optics, &beamlets, band, &parts)?;
        for light in &mut record.lights {
            light.alike_rows = single(lattice.alike_rows.into());
        }
        let (rows, fineness) = (&lattice.rows(), heights::STRIPS_OF_CELLS);
        let of = heights::HeightsOf { scene, optics, band, parts: &parts, rows, fineness };
        record.add_heights(device, of)?;
        Ok(record)
    }

    /// For random rays: one column per pixel of `pixels`, in these rows.
    ///
    /// # Errors
    /// As [`IlluminationBuffer::of_cells`].
    pub(crate) fn of_pixels(
        device: &Arc<Device>,
        scene: &Scene,
        optics: &Optics,
        (pixels, rows): (&Range<i64>, &Range<i64>),
        band: &SpectralBand,
    ) -> Result<Self> {
        let beamlets: Vec<BeamletGeometry> = pixels
            .clone()
            .map(|pixel| beamlet_geometry(optics, optics.detector.slope_of_column(pixel)))
            .collect();
        // Rays draw their part: one record serves all.
        let whole = PlacedPart { share: 1.0, offset: [0.0; 2], deviation: [0.0; 2] };
        let parts = &[whole];
        let mut record = Self::upload(device, scene, optics, &beamlets, band, parts)?;
        let fineness = heights::STRIPS_OF_RAYS;
        record.add_heights(
            device,
            heights::HeightsOf { scene, optics, band, parts, rows, fineness },
        )?;
        Ok(record)
    }

    /// Sets the band of detector rows that sums are buffers for, and the list of mask offsets; returns what
    /// the device is to know.
    pub(crate) fn set_band(&mut self, rows: &Range<u32>, list: usize) -> Upload<'_> {
        let (first, stride) = self.list;
        let record = list * self.lights.len();
        for (part, light) in self.lights.iter_mut().enumerate() {
            light.offsets = first + list as u64 * stride;
            light.heights = self
                .heights
                .map_or(0, |first| first + ((record + part) * size_of::<HeightParams>()) as u64);
            light.first_row = rows.start.cast_signed();
            light.row_count = rows.end - rows.start;
        }
        Upload::new(&self.buffer, 0, &self.lights)
    }
}

/// Uploads the apertures of the sample mask (0) or the detector mask (1), and gives its record;
/// one that is not there where the scene has no such mask, or the band does not see it.
fn upload_mask(
    device: &Arc<Device>,
    scene: &Scene,
    optics: &Optics,
    band: &SpectralBand,
    index: usize,
    buffers: &mut Vec<Buffer>,
) -> Result<Mask> {
    let (mask, plane) =
        [(&optics.sample_mask, optics.cell_plane), (&optics.detector_mask, optics.analyser)][index];
    let Some(mask) = mask else { return Ok(bytemuck::Zeroable::zeroed()) };
    let Some((energy, edge_variance)) = band.seen(index) else {
        return Ok(bytemuck::Zeroable::zeroed());
    };
    let shape = MaskShape::of(scene, mask, plane, energy)?;
    let apertures = shape.apertures();
    let record = |low_high: &[f32; 2]| Aperture { low: low_high[0], high: low_high[1] };
    let records: Vec<Aperture> = apertures.iter().map(record).collect();
    let buffer = device.upload(mask.name(), &records)?;
    let layer = |of: &[f64; 2]| {
        let [thickness, attenuation] = of.map(single);
        BarLayer { thickness, attenuation }
    };
    let layers: Vec<BarLayer> = shape.layers.iter().map(layer).collect();
    let layers = device.upload("layers of bars", &layers)?;
    let record = Mask {
        apertures: buffer.address(),
        bar_layers: layers.address(),
        bar_layer_count: count(shape.layers.len()),
        count: count(records.len()),
        present: 1,
        period: single(shape.openings.period[0]),
        thickness: single(shape.thickness),
        attenuation: single(shape.attenuation),
        transmission: single(shape.transmission),
        averaged: edge_variance.is_some().into(),
        edge_variance: edge_variance.unwrap_or(0.0),
        first: apertures.first().map_or(0.0, |a| a[0]),
        last: apertures.last().map_or(0.0, |a| a[1]),
        narrowest_aperture: single(shape.openings.narrowest(0)),
        narrowest_bar: single(shape.openings.bar()),
        substrate: single(shape.substrate),
        taper: single(shape.wall_slope),
    };
    buffers.extend([buffer, layers]);
    Ok(record)
}

/// Parameters that follow from distances and pixels; the rest is zero.
fn set_up(optics: &Optics) -> IlluminationParams {
    let Optics { rotation, cell_plane, analyser, detector, .. } = optics;
    IlluminationParams {
        magnification: single(analyser / cell_plane),
        cell_plane: single(*cell_plane),
        analyser: single(*analyser),
        ratio: single(analyser / detector.distance),
        pixel_pitch: single(optics.analyser_pixel()),
        row_pitch: single(detector.pitch[1]),
        row_slope: single(-detector.row_slope()),
        alike_rows: 1.0,
        middle_row: single(detector.half(1)),
        column_count: detector.pixels[0],
        detector: single(detector.distance),
        rotation_distance: single(*rotation),
        column_pitch: single(detector.pitch[0]),
        ..bytemuck::Zeroable::zeroed()
    }
}

/// The parameters of a part of the focal spot; `share`: its spectral band's of all light.
fn of_part(
    optics: &Optics,
    share: f64,
    part: &PlacedPart,
    shared: IlluminationParams,
) -> IlluminationParams {
    let Optics { rotation, cell_plane, analyser, detector, .. } = optics;
    // By how much what lies at a source offset (or its deviation) moves, m.
    let at_analyser = |offset: f64| offset * (analyser / rotation - 1.0);
    let at_pixel =
        |offset: f64| offset * (detector.distance / rotation - 1.0) * analyser / detector.distance;
    let at_mask = |offset: f64| offset * (rotation - cell_plane) / rotation;
    let weight = share * part.share * detector.distance / (cell_plane * detector.pitch[0]);
    IlluminationParams {
        mask_shift: single(at_mask(part.offset[0])),
        landing_shift: single(at_analyser(part.offset[0])),
        pixel_shift: single(at_pixel(part.offset[0])),
        slope_shift: single(part.offset[0] / rotation),
        row_shift: single(optics.rows_of_source(part.offset[1])),
        spot: single(at_analyser(part.deviation[0])),
        pixel_spot: single(at_pixel(part.deviation[0])),
        mask_blur: single(at_mask(part.deviation[0])),
        weight: single(weight),
        row_blur: single(optics.rows_of_source(part.deviation[1])),
        spectral_weight: single(share),
        ..shared
    }
}

/// The parts of a focal spot for random draws.
fn table(parts: &[PlacedPart]) -> Vec<SpotPart> {
    let mut below = 0.0;
    let of_part = |part: &PlacedPart| {
        below += part.share;
        let [x, z] = part.offset.map(single);
        let [deviation_x, deviation_z] = part.deviation.map(single);
        SpotPart { below: single(below), x, z, deviation_x, deviation_z }
    };
    let mut table: Vec<SpotPart> = parts.iter().map(of_part).collect();
    // Every draw ends there, whatever the shares round to.
    if let Some(last) = table.last_mut() {
        last.below = 2.0;
    }
    table
}
