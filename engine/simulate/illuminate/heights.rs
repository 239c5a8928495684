//! Masks whose apertures end along z, for the light stages: their strips, and where they are in each row.

use super::light::{LIST_ALIGNMENT, SpectralBand};
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use beamlet_gpu::{Buffer, Device};
use beamlet_interface::{Address, Aperture, HeightParams, MaskHeights, MaskStrip, RowGeometry};
use beamlet_model::optics::{Mask, MaskShape, Optics, Strips};
use beamlet_model::scene::Scene;
use beamlet_model::spot::PlacedPart;
use std::ops::Range;
use std::sync::Arc;

/// Strips of a round aperture of the sample mask and of the detector mask for cells. The light of a pixel errs by the
/// square of their height: with 64, circles of 15 um before pixels of 11 um by 1.3e-4 of the open beam.
pub(super) const STRIPS_OF_CELLS: [u32; 2] = [64, 32];
/// The same for single rays.
pub(super) const STRIPS_OF_RAYS: [u32; 2] = [256; 2];

/// Inputs of the records of heights of a scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeightsOf<'a> {
    pub(super) scene: &'a Scene,
    pub(super) optics: &'a Optics,
    pub(super) band: &'a SpectralBand,
    /// Parts of the focal spot, with a record for each.
    pub(super) parts: &'a [PlacedPart],
    /// Rows of light.
    pub(super) rows: &'a Range<i64>,
    /// Strips of a round aperture of each mask.
    pub(super) fineness: [u32; 2],
}

/// Uploads the records, by list of mask offsets and part of the focal spot; address of the first. `None` where no
/// aperture ends along z.
pub(super) fn upload(
    device: &Arc<Device>,
    of: HeightsOf<'_>,
    buffers: &mut Vec<Buffer>,
) -> Result<Option<Address>> {
    let HeightsOf { optics, parts, rows, .. } = of;
    if !optics.has_heights() {
        return Ok(None);
    }
    let sample_mask = upload_mask(device, of, 0, buffers)?;
    let detector_mask = upload_mask(device, of, 1, buffers)?;
    let strips = [0, 1].map(|index| {
        let (mask, plane) = mask_of(optics, index);
        mask.and_then(|mask| mask.strips(plane, 1)).map(|strips| (strips, plane))
    });
    let table: Vec<RowGeometry> =
        rows.clone().map(|row| row_geometry(optics, &strips, row)).collect();
    let table = device.upload("rows of masks", &table)?;
    let down = optics.sample_mask.as_ref().map_or(0.0, |mask| -in_rows(optics, mask.distance()));
    let lists = optics.offsets.lists_z();
    let steps = optics.mask_steps().next_multiple_of(LIST_ALIGNMENT);
    let in_list = |list: &Vec<f64>| -> Vec<f32> {
        (0..steps).map(|step| single(list.get(step).map_or(0.0, |at| at * down))).collect()
    };
    let offsets: Vec<f32> = lists.iter().flat_map(in_list).collect();
    let offsets = device.upload("mask offsets along z", &offsets)?;
    let shared = HeightParams {
        sample_mask,
        detector_mask,
        rows: table.address(),
        offsets: 0,
        first_row: numbers::narrow::<i32>(rows.start),
        ..bytemuck::Zeroable::zeroed()
    };
    let of_list = |list: usize| {
        let first = (list * steps * size_of::<f32>()) as u64;
        let shared = HeightParams { offsets: offsets.address() + first, ..shared };
        parts.iter().map(move |part| of_part(optics, part, shared))
    };
    let records: Vec<HeightParams> = (0..lists.len()).flat_map(of_list).collect();
    let records = device.upload("heights of masks", &records)?;
    let first = records.address();
    buffers.extend([table, offsets, records]);
    Ok(Some(first))
}

/// Rows of the detector that a metre along z at `plane` covers as seen from the source.
fn in_rows(optics: &Optics, plane: f64) -> f64 {
    optics.detector.distance / plane / optics.detector.pitch[1]
}

/// The sample mask (0) or detector mask (1), with the plane where it is evaluated.
fn mask_of(optics: &Optics, index: usize) -> (Option<&Mask>, f64) {
    match index {
        0 => (optics.sample_mask.as_ref(), optics.cell_plane),
        _ => (optics.detector_mask.as_ref(), optics.analyser),
    }
}

/// Strips of a mask in rows, downwards: no strip where the mask has no edges along z, or the band does not see it.
fn upload_mask(
    device: &Arc<Device>,
    of: HeightsOf<'_>,
    index: usize,
    buffers: &mut Vec<Buffer>,
) -> Result<MaskHeights> {
    let (mask, plane) = mask_of(of.optics, index);
    let none = bytemuck::Zeroable::zeroed();
    let Some((mask, strips)) = mask.and_then(|m| Some((m, m.strips(plane, of.fineness[index])?)))
    else {
        return Ok(none);
    };
    let Some((energy, shared_variance)) = of.band.seen(index) else { return Ok(none) };
    let shape = MaskShape::of(of.scene, mask, plane, energy)?;
    let rows = in_rows(of.optics, plane);
    let apertures: Vec<Aperture> = strips
        .strips
        .iter()
        .flat_map(|strip| &strip.x)
        .map(|[low, high]| Aperture { low: single(*low), high: single(*high) })
        .collect();
    let apertures = device.upload("apertures of strips", &apertures)?;
    let mut address = apertures.address();
    let records = strips.strips.iter().rev().map(|strip| strip.x.len());
    // Upper strips first: rows go downwards.
    address += strips.strips.iter().map(|strip| strip.x.len() as u64).sum::<u64>() * APERTURE;
    let mut record = |(strip, count): (&beamlet_model::optics::Strip, usize)| {
        address -= count as u64 * APERTURE;
        MaskStrip {
            apertures: address,
            count: numbers::count(count),
            last: single(strip.x.last().map_or(0.0, |[_, high]| *high)),
            top: single(-strip.z[1] * rows),
            bottom: single(-strip.z[0] * rows),
            middle: single(-strip.middle * rows),
        }
    };
    let records: Vec<MaskStrip> =
        strips.strips.iter().rev().zip(records).map(&mut record).collect();
    let buffer = device.upload("strips of masks", &records)?;
    let narrowing = shape.narrowing(1.0, shape.leak(1.0));
    let record = MaskHeights {
        strips: buffer.address(),
        count: numbers::count(records.len()),
        period: single(strips.period * rows),
        thickness: single(shape.thickness * rows),
        inset: single(0.5 * narrowing),
        variance: shared_variance.unwrap_or_else(|| single(shape.edge_variance())),
        open: single(strips.open_share()),
    };
    buffers.extend([apertures, buffer]);
    Ok(record)
}

/// Bytes of an aperture.
const APERTURE: u64 = size_of::<Aperture>() as u64;

/// Where periods of the masks are below the upper end of a row; `strips` of each mask with the plane where they are.
fn row_geometry(optics: &Optics, strips: &[Option<(Strips, f64)>; 2], row: i64) -> RowGeometry {
    let offset = |index: usize| {
        strips[index].as_ref().map_or(0.0, |(strips, plane)| {
            let centre = optics.detector.row_at(strips.centre, *plane) - row as f64;
            libm::remainder(centre, strips.period * in_rows(optics, *plane))
        })
    };
    RowGeometry { sample_offset: single(offset(0)), aperture_offset: single(offset(1)) }
}

/// The record of a part of the focal spot.
fn of_part(optics: &Optics, part: &PlacedPart, shared: HeightParams) -> HeightParams {
    let Optics { rotation, cell_plane, analyser, detector, .. } = optics;
    let at_mask =
        |offset: f64| offset * (rotation - cell_plane) / rotation * in_rows(optics, *cell_plane);
    let at_analyser =
        |offset: f64| offset * (analyser / rotation - 1.0) * in_rows(optics, *analyser);
    let axis = analyser - optics.lever_arm;
    let share = (analyser - axis) / (detector.distance - axis) * detector.distance / analyser;
    HeightParams {
        mask_shift: single(at_mask(part.offset[1])),
        analyser_shift: single(at_analyser(part.offset[1])),
        mask_blur: single(at_mask(part.deviation[1])),
        analyser_blur: single(at_analyser(part.deviation[1])),
        analyser_share: single(share),
        ..shared
    }
}
