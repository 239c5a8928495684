//! Parameters of a group of patches, as kernels take them.

use super::buffers::{Buffers, Sizes};
use super::group::Group;
use super::tables::Tables;
use crate::sampling::ViewContext;
use crate::trace::{QUEUE_COUNT, Tracer};
use beamlet_core::numbers::{self, single};
use beamlet_interface::RefineParams;
use std::ops::Range;

/// Part of the budget of a patch that the sum of its errors may take, and the same of a patch with one mask step:
/// errors of several do not all have the same sign.
const SHARE: [f64; 2] = [0.45, 0.2];
/// Part of the budget of the displacement.
const DISPLACEMENT_SHARE: f64 = 0.45;
/// Least width of a rectangle, m: coordinates in f32 are as coarse across a detector; and as a share of the period.
const LEAST_WIDTH: f64 = 2e-9;
const LEAST_SHARE: f64 = 2e-5;
/// Least height of a rectangle, rows.
const LEAST_HEIGHT: f32 = 1.0 / 8192.0;
/// Steps of f32 coordinates beside a rectangle, share of the period and of a row.
const BESIDE: f32 = 2.4e-7;
/// Standard deviations that a blur reaches.
const BLURS: f64 = 6.5;

/// Parameters of a group, whose rays have `rays_of_group` in a workgroup. `lit`: rows whose light is wanted;
/// `spectrum`: address of the energies, 0 at one energy.
pub(super) fn of_group(
    view: &ViewContext<'_>,
    (tables, buffers, tracer): (&Tables, &Buffers, &Tracer),
    (group, lit): (&Group, &Range<i64>),
    (rays_of_group, spectrum): (u32, u64),
) -> RefineParams {
    RefineParams {
        spectrum,
        patch_count: group.own,
        all_patches: numbers::count(group.patches.len()),
        own_base: group.own_base,
        all_base: group.all_base,
        rays_of_group,
        queue_count: QUEUE_COUNT,
        steps: steps_of(view),
        first_row: group.rows().start,
        wanted: [lit.start, lit.end].map(numbers::narrow::<i32>),
        ..of_set_up(view, tables, buffers.params(tracer))
    }
}

/// Mask steps that errors are summed for.
pub(super) fn steps_of(view: &ViewContext<'_>) -> u32 {
    numbers::count(view.response.steps())
}

/// Words of the sums of errors of a group.
pub(super) fn sums_of(view: &ViewContext<'_>, group: &Group) -> u64 {
    Sizes::sums_of_patch(steps_of(view)) * group.patches.len() as u64
}

/// Parameters that follow from the set-up.
fn of_set_up(view: &ViewContext<'_>, tables: &Tables, of: RefineParams) -> RefineParams {
    let (optics, lattice, response) = (view.optics, view.lattice, view.response);
    let (detector, budget) = (&optics.detector, &view.budget);
    let period = single(lattice.period);
    let share = if response.steps() == 1 { SHARE[1] } else { SHARE[0] };
    let least = (LEAST_SHARE * lattice.period).min(LEAST_WIDTH);
    let recorded = view.recorded_rows();
    let [openings, windows, hardening] = tables.addresses();
    let at_analyser = optics.analyser / detector.distance;
    let [part_shares, part_ratios] = response.hardening.refraction();
    let half = 0.5 * detector.extent(0) * at_analyser + BLURS * f64::from(response.blur);
    RefineParams {
        columns: tables.columns.address(),
        heights: tables.heights(),
        hardening,
        openings,
        opening_count: tables.opening_count,
        windows,
        window_count: tables.window_count,
        pose: view.pose,
        max_rays: budget.max_rays,
        recorded: [recorded.start, recorded.end].map(numbers::narrow::<i32>),
        halo: lattice.halo as f32,
        period,
        inverse_plane: single(1.0 / lattice.plane),
        rotation: single(optics.rotation),
        row_slope: single(-detector.row_slope()),
        magnification: response.magnification,
        analyser: single(optics.analyser),
        half_width: single(half + optics.analyser_pixel()),
        gap: single(optics.gap()),
        ratio: single(at_analyser),
        row_pitch: single(detector.pitch[1]),
        row_height: single(detector.pitch_at(1, lattice.plane)),
        row_blur: single(lattice.row_blur()),
        weight: response.weight,
        leak: response.leak,
        steepest: single(response.steepest()),
        light_budget: single(share * budget.light),
        displacement_budget: match budget.displacement.is_finite() {
            true => single(DISPLACEMENT_SHARE * budget.displacement),
            false => 0.0,
        },
        part_shares,
        part_ratios,
        open_width: tables.open_width,
        least: [single(least), LEAST_HEIGHT],
        beside: [BESIDE * period, BESIDE],
        reported: single(1e9 * share * budget.light / budget.by_grid),
        tolerance: numbers::whole::<u32>(1e9 * budget.tolerance),
        ..of
    }
}
