//! Errors of leaves as mask steps see them: light, displacement, and how both add.

use super::error_estimate::CellError;
use super::patch::{Known, Node};
use super::response::Response;
use super::step_shares::StepRun;

/// Errors of the recorded value of a mask step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StepError {
    /// Of rectangles that err each in its own way, squared.
    pub(super) apart: f64,
    /// Of pieces: along a silhouette their outlines are alike, and so are their errors.
    pub(super) together: f64,
    /// Of the displacement, squared.
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
    /// The error of a rectangle that is open to a share.
    pub(super) fn of(&self, error: &CellError, known: &Known, open: f32) -> StepError {
        // Light that leaks through bars is the same at every step, and moves no angle.
        let through = f64::from(open * error.through);
        let squared = |part: f32| f64::from(part * error.moment).powi(2);
        let lit = self.response.lit(open);
        match known {
            Known::Ray(_) => StepError {
                apart: f64::from(lit * error.light).powi(2),
                together: 0.0,
                moment: squared(open),
                through,
            },
            // The mean over all of a rectangle is exact, and so is that over nearly all of it.
            Known::Mean(_) | Known::Pieces(_) => {
                let cut = self.response.cut(open);
                let light = f64::from(cut.max(lit * error.whole) * error.light);
                let [apart, together] = match (known, self.together) {
                    (Known::Pieces(_), Some(factor)) => [0.0, factor * light],
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

/// A leaf with its error, and the steps that light it.
#[derive(Clone, Copy)]
pub(super) struct LitLeaf<'a> {
    pub(super) error: &'a CellError,
    pub(super) node: &'a Node,
    pub(super) own: &'a [StepRun],
    /// Steps that light a neighbour, if none lights this leaf and a silhouette crosses it: the silhouette
    /// may enter the neighbour.
    pub(super) beside: Option<&'a [StepRun]>,
}

impl<'a> LitLeaf<'a> {
    /// Steps at which its error counts, each with the share that is open.
    pub(super) fn steps(&self) -> impl Iterator<Item = (u32, f32)> + use<'a> {
        self.beside.unwrap_or(self.own).iter().flat_map(StepRun::steps)
    }

    /// Its error at a step that opens a share of it, or of its neighbour.
    pub(super) fn weighed(&self, weighing: &Weighing<'_>, open: f32) -> StepError {
        let error = weighing.of(self.error, &self.node.known, open);
        match self.beside {
            Some(_) => StepError { moment: 0.0, through: 0.0, ..error },
            None => error,
        }
    }
}
