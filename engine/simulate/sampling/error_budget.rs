//! Error budget of recorded values, and the estimated error.

use beamlet_core::numbers;
use beamlet_core::tally::Tally;

/// Fraction of the budget that lines aim at for the worst mask step, and that an estimated error by waves may take; with it
/// silhouettes hold 1e-4 with uneven steps (`values_are_within_the_tolerance_of_much_finer_stacks`).
pub(crate) const SAFETY: f64 = 0.45;
/// The same with a single step, where the root mean square should be a third of the budget
/// (`tight_tolerances_hold_without_a_sample_mask`).
const SAFETY_OF_ONE: f64 = 0.2;

/// Part of the budget of light that sampling aims at, for this number of mask steps.
pub(crate) fn safety(steps: usize) -> f64 {
    if steps > 1 { SAFETY } else { SAFETY_OF_ONE }
}

/// Errors that sampling may leave and rays that it may take, by patch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ErrorBudget {
    /// Error of a value of the grid that takes the light, share of open beam.
    pub light: f64,
    /// Error of a grid value over the error of a recorded one: parts of a pixel err more than the pixel.
    pub by_grid: f64,
    /// Error of a recorded value, share of open beam.
    pub tolerance: f64,
    /// Error of the mean displacement on the analyser where no silhouette crosses, m; infinite
    /// without a sample mask.
    pub displacement: f64,
    /// Most rays of a patch.
    pub max_rays: u32,
    /// Share of the patches that are audited.
    pub audit: f64,
}

/// Counts of a patch that was sampled by `rays` rays and whose values of the grid may be wrong by
/// `light`, share of open beam. `displacement`: error of the displacement, share of the budget.
pub(crate) fn tally_of([light, displacement]: [f64; 2], rays: u32, budget: &ErrorBudget) -> Tally {
    let error = light / budget.by_grid;
    let parts = 1e9 * error;
    Tally {
        patches: 1,
        patch_rays: rays.into(),
        most_patch_rays: rays.into(),
        error_squares: numbers::whole::<u64>(parts * parts),
        worst_error: numbers::whole::<u64>(parts),
        beyond_tolerance: u64::from(error > budget.tolerance || displacement > 1.0),
        ..Tally::default()
    }
}
