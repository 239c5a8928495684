//! Designs with their scores, the best of them, and the Pareto front.

use super::front::front;
use super::{Outcome, Sweep, VariedKey, best};
use serde::Serialize;
use std::collections::BTreeMap;

/// Error of a flat by rays over its peak, beyond which a sweep warns.
const OFF: f64 = 0.03;

/// A sweep whose designs have outcomes.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Results<'a> {
    /// The sweep.
    pub sweep: &'a Sweep,
    /// Outcome of each design.
    pub outcomes: &'a [Outcome],
    /// For each design, true if it is on the Pareto front of the first two scores; empty with one score.
    pub front: Vec<bool>,
    /// The best design by the first score; `None` where no design has it.
    pub best: Option<usize>,
}

/// Results for programs: values in SI units, designs counted from 1.
#[derive(Debug, Serialize)]
pub struct SweepReport {
    best: Option<usize>,
    keys: Vec<VariedKey>,
    /// Number of values of each axis of the designs; the last axis changes first.
    shape: Vec<usize>,
    /// SI units by the names of the scores.
    units: BTreeMap<String, String>,
    designs: Vec<DesignReport>,
}

/// A design of a report.
#[derive(Debug, Serialize)]
struct DesignReport {
    design: usize,
    /// Overrides of the scene, with those of the fixed quantity.
    set: Vec<String>,
    /// Values of the varied keys without their units.
    values: Vec<String>,
    photons: Option<f64>,
    visibility: Option<f64>,
    leak: Option<[f64; 2]>,
    ray_error: Option<f64>,
    exposure: Option<f64>,
    scores: BTreeMap<String, Option<f64>>,
    pareto: Option<bool>,
    refused: Option<String>,
}

impl<'a> Results<'a> {
    /// Results of all designs.
    #[must_use]
    pub fn of(sweep: &'a Sweep, outcomes: &'a [Outcome]) -> Self {
        let scores = sweep.scores();
        Self { sweep, outcomes, front: front(outcomes, scores), best: best(outcomes, scores) }
    }

    /// Overrides of the scene that make a design, with those of the fixed quantity.
    #[must_use]
    pub fn sets(&self, design: usize) -> Vec<String> {
        self.sweep.sets(design, &self.outcomes[design])
    }

    /// Doubts about the designs: those that rays do not describe, and ranges whose end is best.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let is_off = |outcome: &&Outcome| outcome.ray_error.is_some_and(|error| error > OFF);
        let off = self.outcomes.iter().filter(is_off).count();
        let mut warnings = Vec::new();
        if off > 0 {
            let best = self.best.and_then(|best| self.outcomes[best].ray_error);
            let best = best.map_or_else(String::new, |error| {
                format!(", of the best design {:.1} %", 100.0 * error)
            });
            warnings.push(format!(
                "{off} of {} designs are outside ray optics: by waves their flats differ by more than {:.0} % of the \
                 peak{best} (ray_error); sampling.transport = \"wave\" gives scores by waves",
                self.outcomes.len(),
                100.0 * OFF
            ));
        }
        let designs = self.sweep.designs();
        let ends = self.best.map(|best| designs.best_ends(best)).unwrap_or_default();
        if !ends.is_empty() {
            warnings.push(format!(
                "the best design is at the end of the range of {}: a better one may lie beyond it",
                ends.join(", ")
            ));
        }
        warnings
    }

    /// The results for programs.
    #[must_use]
    pub fn report(&self) -> SweepReport {
        let (designs, scores) = (self.sweep.designs(), self.sweep.scores());
        let reported = |(design, outcome): (usize, &Outcome)| {
            let named = scores.iter().zip(&outcome.values);
            DesignReport {
                design: design + 1,
                set: self.sets(design),
                values: designs.values(design).into_iter().map(str::to_owned).collect(),
                photons: outcome.photons,
                visibility: outcome.visibility,
                leak: outcome.leak,
                ray_error: outcome.ray_error,
                exposure: outcome.exposure,
                scores: named.map(|(score, value)| (score.name(), *value)).collect(),
                pareto: self.front.get(design).copied(),
                refused: outcome.refused.clone(),
            }
        };
        let unit = |score: &super::Score| (score.name(), score.si_unit().to_owned());
        SweepReport {
            best: self.best.map(|best| best + 1),
            keys: designs.keys().cloned().collect(),
            shape: designs.shape(),
            units: scores.iter().map(unit).collect(),
            designs: self.outcomes.iter().enumerate().map(reported).collect(),
        }
    }
}
