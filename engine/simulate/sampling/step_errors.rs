//! Errors of the recorded values of a patch at every mask step.

use super::error_estimate::CellError;
use super::response::Response;

/// Errors of the recorded value of a mask step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StepError {
    /// Error of the light, squared.
    pub(super) light: f64,
    /// Error of the displacement, squared.
    moment: f64,
    through: f64,
}

impl StepError {
    /// The error of a rectangle of which this part of its width is open.
    pub(super) fn of(response: &Response, error: &CellError, width: f32) -> Self {
        let open = width * error.height;
        let lit = response.lit(open);
        // Light that leaks through bars is the same at every step, and moves no angle.
        Self {
            light: f64::from(lit * error.light).powi(2),
            moment: f64::from(open * error.moment).powi(2),
            through: f64::from(open * error.through),
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.light += other.light;
        self.moment += other.moment;
        self.through += other.through;
    }
}

/// Errors of the rectangles of a patch summed at every mask step, and their limits.
pub(super) struct StepSums {
    pub(super) steps: Vec<StepError>,
    /// Rectangles.
    pub(super) count: u32,
    /// Rectangles with a silhouette.
    pub(super) silhouettes: u32,
    /// Limit of the error of the light of a step, squared.
    pub(super) light: f64,
    /// Limit of the error of the displacement.
    pub(super) displacement: f64,
    /// The displacement has a limit.
    pub(super) bounded: bool,
}

impl StepSums {
    /// An error at a step in shares of the budget of the step; 0 where the step holds its budget.
    pub(super) fn excess(&self, step: u32, error: &StepError) -> f64 {
        let all = &self.steps[step as usize];
        let moment = (self.displacement * all.through).powi(2);
        let of_light = if all.light > self.light { error.light / self.light } else { 0.0 };
        if self.bounded && all.moment > moment {
            of_light.max(error.moment / moment)
        } else {
            of_light
        }
    }

    /// Largest error of the displacement of a step, share of its budget.
    pub(super) fn displacement_share(&self, budget: f64) -> f64 {
        let off = |step: &StepError| step.moment.sqrt() / (budget * step.through);
        let lit = self.steps.iter().filter(|step| self.bounded && step.through > 0.0);
        lit.map(off).fold(0.0, f64::max)
    }
}
