//! Designs of a set-up: a scene with values of its keys varied, and scores of each design without a sample.
//!
//! | file | holds |
//! |---|---|
//! | `vary.rs` | values of the varied keys, and the designs that they make |
//! | `score.rs` | scores, their units, and which is better |
//! | `fixed.rs` | the quantity that all designs have in common |
//! | `outcome.rs` | photons, exposure and scores of a design |
//! | `front.rs` | the best design, and the Pareto front of two scores |
//! | `results.rs` | designs with scores, front and best, for tables and programs |

mod fixed;
mod front;
mod outcome;
mod results;
mod score;
mod vary;

use crate::Engine;
use beamlet_core::{Cancel, Error, Result};
use beamlet_model::scene::Scene;
use rayon::prelude::*;

use fixed::Fixed;
pub use front::best;
pub use outcome::Outcome;
pub use results::{Results, SweepReport};
pub use score::Score;
pub use vary::{Designs, VariedKey};

/// Designs between two reports.
const AT_ONCE: usize = 16;

/// Reads the scene with these overrides, `key=value` each.
pub type Load<'a> = dyn Fn(&[String]) -> Result<Scene> + Sync + 'a;

/// A sweep: designs, their scores, and the quantity that they have in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    designs: Designs,
    scores: Vec<Score>,
    fixed: Option<Fixed>,
}

impl Sweep {
    /// A sweep over `vary`, texts `key=values` or paths of tables ([`Designs::of`]), with scores and the fixed quantity
    /// by their names.
    ///
    /// # Errors
    /// [`Error::Argument`] for a text that is wrong, a key that is varied twice, and too many designs;
    /// [`Error::File`] for a table that cannot be read.
    pub fn new(vary: &[String], scores: &[String], fixed: Option<&str>) -> Result<Self> {
        let designs = Designs::of(vary)?;
        let fixed = fixed.map(Fixed::of).transpose()?;
        if let Some(key) = designs.keys().find(|key| fixed.is_some() && Fixed::sets(&key.path)) {
            let found = format!("{} besides a fixed quantity", key.path);
            return Err(Error::argument("vary", found, "other keys: it follows from --fix"));
        }
        Ok(Self { designs, scores: Score::of_list(scores)?, fixed })
    }

    /// The designs.
    #[must_use]
    pub const fn designs(&self) -> &Designs {
        &self.designs
    }

    /// The scores, the one that decides first.
    #[must_use]
    pub fn scores(&self) -> &[Score] {
        &self.scores
    }

    /// Refuses keys that the scene has not, and a scene that cannot have the scores or the fixed quantity.
    /// A fixed quantity without a number gets the value of the scene.
    ///
    /// # Errors
    /// Errors of the scene and of its keys; [`Error::Argument`].
    pub fn prepare(&mut self, load: &Load<'_>) -> Result<()> {
        let scene = load(&[])?;
        self.designs.check_keys(load)?;
        let varies_photons = self.designs.keys().any(|key| Fixed::sets(&key.path));
        let has_photons = scene.detector.counts.is_some() || varies_photons;
        if let Some(score) = self.scores.iter().find(|score| score.needs_photons() && !has_photons)
        {
            let found = format!("{} of a scene without photons", score.name());
            let allowed =
                "detector.photons, or detector.exposure with source.current, in the scene";
            return Err(Error::argument("score", found, allowed));
        }
        if let Some(fixed) = &mut self.fixed {
            fixed.resolve(&scene)?;
        }
        Ok(())
    }

    /// Scores the designs behind those of `outcomes`, each on a thread, and appends them; `each` gets all outcomes now and
    /// then. A design that is refused has the reason in place of scores.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; errors of the device; those of `each`. Designs that are finished are in `outcomes`.
    pub fn complete(
        &self,
        engine: &Engine,
        load: &Load<'_>,
        outcomes: &mut Vec<Outcome>,
        cancel: &Cancel,
        each: &mut dyn FnMut(&[Outcome]) -> Result<()>,
    ) -> Result<()> {
        let one = |design: usize| {
            cancel.check()?;
            let made = load(&self.designs.sets(design))
                .and_then(|scene| Outcome::of(engine, scene, &self.scores, self.fixed.as_ref()));
            match made {
                Err(error @ (Error::Interrupted | Error::Device { .. })) => Err(error),
                Err(error) => Ok(Outcome::refused(&error, self.scores.len())),
                Ok(outcome) => Ok(outcome),
            }
        };
        let count = self.designs.count();
        while outcomes.len() < count {
            each(outcomes)?;
            let from = outcomes.len();
            let some: Vec<Result<Outcome>> =
                (from..(from + AT_ONCE).min(count)).into_par_iter().map(one).collect();
            for outcome in some {
                outcomes.push(outcome?);
            }
        }
        each(outcomes)
    }

    /// Overrides of the scene that make a design, with photons or exposure where a quantity is fixed.
    #[must_use]
    pub fn sets(&self, design: usize, outcome: &Outcome) -> Vec<String> {
        let mut sets = self.designs.sets(design);
        if self.fixed.is_some() {
            sets.extend(match (outcome.exposure, outcome.photons) {
                (Some(seconds), _) => Some(format!("detector.exposure={seconds:?} s")),
                (None, photons) => photons.map(|photons| format!("detector.photons={photons:?}")),
            });
        }
        sets
    }
}
