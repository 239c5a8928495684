//! Cells of rectangles that the device refined.

use super::base_lattice::ROWS_TOGETHER;
use super::cell_batch::CellBatch;
use super::emission::Emitter;
use super::moment_recording::LinearModel;
use super::patch::{PatchPlace, Slopes};
use super::rectangle::Rectangle;
use super::room::MOMENTS;
use super::view_context::ViewContext;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_interface::{Cell, CellRow, RefinedLeaf};
use rayon::prelude::*;
use std::ops::Range;

/// Bytes of the host for a rectangle of the device, with all that is made of it; `words`: of the moments of a ray.
pub(crate) const fn bytes_of_leaf(words: usize) -> usize {
    let made = 2 * (size_of::<Rectangle>() + size_of::<Cell>() + size_of::<CellRow>());
    2 * size_of::<RefinedLeaf>() + made + MOMENTS * 2 * words * size_of::<f32>()
}

/// The cells of all rectangles of some patches, in any order, and the places (column, row) of patches that miss the
/// sample. `lit`: rows whose light is wanted.
///
/// # Errors
/// As [`Tracer::trace`].
pub(crate) fn cells_of_leaves(
    view: &ViewContext<'_>,
    tracer: &mut Tracer,
    mut leaves: Vec<RefinedLeaf>,
    lit: &Range<i64>,
) -> Result<(CellBatch, Vec<(i64, i64)>)> {
    let block = |row: i32| i64::from(row).div_euclid(ROWS_TOGETHER);
    let patch = |leaf: &RefinedLeaf| (block(leaf.row), leaf.column, leaf.row);
    leaves.par_sort_unstable_by(|a, b| {
        let heights = a.z_low.total_cmp(&b.z_low).then(a.z_high.total_cmp(&b.z_high));
        patch(a).cmp(&patch(b)).then(heights).then(a.x_low.total_cmp(&b.x_low))
    });
    let emitter = Emitter::new(view, lit);
    let first = view.lattice.beamlets.start;
    let place = |leaf: &RefinedLeaf| PatchPlace {
        beamlet: first + i64::from(leaf.column),
        row: leaf.row.into(),
        shear: 0.0,
    };
    let of_patches: Vec<&[RefinedLeaf]> = leaves.chunk_by(|a, b| patch(a) == patch(b)).collect();
    let places: Vec<PatchPlace> = of_patches.iter().map(|own| place(&own[0])).collect();
    let rectangles = of_patches
        .par_iter()
        .map(|own| own.iter().map(|leaf| rectangle_of(leaf, &emitter)).collect::<Vec<_>>());
    let rectangles = rectangles.collect();
    let (mut cells, empty) = emitter.cells_of(tracer, &places, rectangles)?;
    cells.balance();
    Ok((cells, empty))
}

/// A rectangle with the result of its ray and slopes along x.
fn rectangle_of(leaf: &RefinedLeaf, emitter: &Emitter<'_>) -> Rectangle {
    let result = leaf.result;
    let slopes = Slopes {
        depth: [leaf.depth_slope, 0.0],
        displacement: [leaf.displacement_slope, 0.0],
        ..Slopes::default()
    };
    let x = [leaf.x_low, leaf.x_high];
    let landing = result.landing_z(emitter.gap);
    let half = 0.5 * leaf.growth * emitter.row_pitch;
    Rectangle {
        x,
        z: [leaf.z_low, leaf.z_high],
        ray: leaf.at,
        traced: Some(leaf.ray),
        ends: LinearModel::new(&result, x[1] - x[0], &slopes),
        displacement_variance: emitter.view.variance_of(&result),
        ends_z: [landing + half, landing - half],
        tilt: leaf.tilt,
        shares: None,
    }
}
