//! Errors of the recorded values of a patch at every mask step.

use super::error_estimate::CellError;
use super::patch::Rule;
use super::response::Response;

/// Errors of the recorded value of a mask step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StepError {
    /// Error of rectangles that err each in its own way, squared.
    pub(super) apart: f64,
    /// Error of pieces: along a silhouette their outlines are alike, and so are their errors.
    pub(super) together: f64,
    /// Error of the displacement, squared.
    pub(super) moment: f64,
    pub(super) through: f64,
}

/// How errors of rectangles count at a mask step.
#[derive(Clone, Copy)]
pub(super) struct Weighing<'a> {
    pub(super) response: &'a Response,
    /// Correction factor of pieces that err together.
    pub(super) together: Option<f64>,
}

impl Weighing<'_> {
    /// The error of a rectangle of which this part of its width is open.
    pub(super) fn of(&self, error: &CellError, rule: &Rule, width: f32) -> StepError {
        let open = width * error.height;
        // Light that leaks through bars is the same at every step, and moves no angle.
        let through = f64::from(open * error.through);
        let squared = |part: f32| f64::from(part * error.moment).powi(2);
        let lit = self.response.lit(open);
        match rule {
            Rule::Rays(_) | Rule::Even => StepError {
                apart: f64::from(lit * error.light).powi(2),
                together: 0.0,
                moment: squared(open),
                through,
            },
            // The mean over all of a rectangle is exact, and so is that over nearly all of it.
            Rule::Means(_) | Rule::Overlay(_) => {
                let cut = error.height * self.response.cut(width);
                let light = f64::from(cut.max(lit * error.whole) * error.light);
                let [apart, together] = match (rule, self.together) {
                    (Rule::Overlay(_), Some(factor)) => [0.0, factor * light],
                    _ => [light * light, 0.0],
                };
                StepError { apart, together, moment: squared(cut), through }
            }
        }
    }
}

impl StepError {
    pub(super) fn add(&mut self, other: &Self) {
        self.apart += other.apart;
        self.together += other.together;
        self.moment += other.moment;
        self.through += other.through;
    }

    /// The error of the light, squared.
    pub(super) fn light(&self) -> f64 {
        self.part(self)
    }

    /// Its contribution to the square of the sum.
    pub(super) fn part(&self, all: &Self) -> f64 {
        self.apart + self.together * all.together
    }
}

/// Errors of the rectangles of a patch summed at every mask step, and their limits.
pub(super) struct StepSums<'a> {
    pub(super) weighing: Weighing<'a>,
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

impl StepSums<'_> {
    /// An error at a step in shares of the budget of the step; 0 where the step holds its budget.
    pub(super) fn excess(&self, step: u32, error: &StepError) -> f64 {
        let all = &self.steps[step as usize];
        let moment = (self.displacement * all.through).powi(2);
        let of_light = if all.light() > self.light { error.part(all) / self.light } else { 0.0 };
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
