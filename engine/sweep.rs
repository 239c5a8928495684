//! Designs of a set-up: a scene with values of its keys varied, and scores of each.
//!
//! | file | holds |
//! |---|---|
//! | `vary.rs` | values of the varied keys, and the designs that they make |
//! | `score.rs` | scores, their units, and which is better |
//! | `fixed.rs` | the quantity that all designs have in common |
//! | `sample.rs` | the image of the sample of a design, and its scores |
//! | `outcome.rs` | photons, exposure and scores of a design |
//! | `scoring.rs` | scores of one design after another, with shared light |
//! | `front.rs` | the best design, and the Pareto front of two scores |
//! | `results.rs` | designs with scores, front and best, for tables and programs |
//! | `record.rs` | finished designs on disk, from which a sweep is resumed |

mod fixed;
mod front;
mod outcome;
mod record;
mod results;
mod sample;
mod score;
mod scoring;
mod vary;

use crate::Engine;
use beamlet_core::{Cancel, Error, Result};
use beamlet_model::scene::Scene;

use fixed::Fixed;
pub use front::best;
pub use outcome::Outcome;
pub use record::SweepRecord;
pub use results::{Results, SweepReport};
use sample::object_index;
pub use score::{SampleScore, Score};
use scoring::Scoring;
pub use vary::{Designs, VariedKey};

/// Reads the scene with these overrides, `key=value` each.
pub type Load<'a> = dyn Fn(&[String]) -> Result<Scene> + Sync + 'a;

/// A sweep: designs, their scores, and the quantity that they have in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    designs: Designs,
    scores: Vec<Score>,
    fixed: Option<Fixed>,
    /// Values and fixed quantity as they were given.
    vary: Vec<String>,
    fix: Option<String>,
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
        let (vary, fix) = (vary.to_vec(), fixed.map(str::to_owned));
        let fixed = fixed.map(Fixed::of).transpose()?;
        if let Some(key) = designs.keys().find(|key| fixed.is_some() && Fixed::sets(&key.path)) {
            let found = format!("{} besides a fixed quantity", key.path);
            return Err(Error::argument("vary", found, "other keys: it follows from --fix"));
        }
        Ok(Self { designs, scores: Score::of_list(scores)?, fixed, vary, fix })
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
        self.check_sample(&scene)?;
        if let Some(fixed) = &mut self.fixed {
            fixed.resolve(&scene)?;
        }
        Ok(())
    }

    /// Refuses scores at a sample of a scene that cannot have them.
    fn check_sample(&self, scene: &Scene) -> Result<()> {
        for score in &self.scores {
            let Some(own) = score.sample_score() else { continue };
            let wrong = |what: &str, allowed: &str| {
                let found = format!("{}, a score at a sample, of a scene {what}", score.name());
                Error::argument("score", found, format!("{allowed}, or scores without a sample"))
            };
            if scene.objects.is_empty() {
                return Err(wrong("without objects", "an object in the scene"));
            }
            if scene.has_heights() {
                return Err(wrong("whose apertures end along z", "slits"));
            }
            if let Some(name) = &own.object {
                object_index(scene, name)?;
            }
        }
        Ok(())
    }

    /// Scores the designs behind those of `outcomes` and appends them; `each` gets all outcomes now and
    /// then, and the number of further designs that the work in progress amounts to. A design that is refused has the
    /// reason in place of scores.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; errors of the device; those of `each`. Designs that are finished are in `outcomes`.
    pub fn complete(
        &self,
        engine: &Engine,
        load: &Load<'_>,
        outcomes: &mut Vec<Outcome>,
        cancel: &Cancel,
        each: &mut dyn FnMut(&[Outcome], f64) -> Result<()>,
    ) -> Result<()> {
        let scoring = Scoring { sweep: self, engine, load, cancel };
        while outcomes.len() < self.designs.count() {
            each(outcomes, 0.0)?;
            scoring.score_block(outcomes, each)?;
        }
        each(outcomes, 0.0)
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
