//! Scores of one design after another; designs whose light is the same share it.

use super::outcome::Design;
use super::sample::{SampleLight, first_view};
use super::{Load, Outcome, SampleScore, Score, Sweep};
use crate::Engine;
use beamlet_core::{Cancel, Error, Result};
use beamlet_model::scene::Scene;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::ops::Range;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::thread::{self, ScopedJoinHandle};

/// Designs that are scored at once.
const AT_ONCE: usize = 64;
/// The same without a sample.
const AT_ONCE_WITHOUT_SAMPLE: usize = 16;
/// Most bytes of light that is kept for later designs.
const KEPT_BYTES: usize = 256 << 20;

/// The scoring of the designs of a sweep.
pub(super) struct Scoring<'a> {
    pub(super) sweep: &'a Sweep,
    pub(super) engine: &'a Engine,
    pub(super) load: &'a Load<'a>,
    pub(super) cancel: &'a Cancel,
    /// Light of earlier designs, the latest last.
    pub(super) cache: VecDeque<Arc<SampleLight>>,
}

/// Light of a scene, or why it is refused.
type SceneLight = (Scene, Result<Arc<SampleLight>>);

impl Scoring<'_> {
    /// Scores of some designs from `from` on, in their order. A design that is refused has the reason
    /// in place of scores.
    pub(super) fn score(&mut self, from: usize) -> Vec<Result<Outcome>> {
        let count = self.sweep.designs.count();
        let scores: Vec<&SampleScore> =
            self.sweep.scores.iter().filter_map(Score::sample_score).collect();
        if scores.is_empty() {
            let designs = (from..count.min(from + AT_ONCE_WITHOUT_SAMPLE)).into_par_iter();
            return designs.map(|design| self.outcome(self.design(design), &[])).collect();
        }
        let (designs, scenes) = self.next_designs(from..count.min(from + AT_ONCE));
        let lights = self.light(scenes, &scores);
        let outcomes = designs.into_iter().map(|design| self.outcome(design, &lights)).collect();
        self.keep(lights);
        outcomes
    }

    /// Light of scenes, each on a thread of its own: loading a sample waits for the threads of rayon.
    fn light(&self, scenes: Vec<Scene>, scores: &[&SampleScore]) -> Vec<SceneLight> {
        let light = &|scene: &Scene| {
            let kept = self.cache.iter().find(|light| light.is_of(scene)).cloned();
            let simulate = || SampleLight::of(self.engine, scene.clone(), scores, self.cancel);
            kept.map_or_else(|| simulate().map(Arc::new), Ok)
        };
        let lights: Vec<_> = thread::scope(|scope| {
            let begin = |scene| thread::Builder::new().spawn_scoped(scope, move || light(scene));
            let running: Vec<_> = scenes.iter().map(begin).collect();
            let end = |(running, scene): (std::io::Result<ScopedJoinHandle<'_, _>>, &Scene)| {
                match running {
                    Ok(thread) => thread.join().unwrap_or_else(|panic| resume_unwind(panic)),
                    // Without memory for a thread.
                    Err(_) => light(scene),
                }
            };
            running.into_iter().zip(&scenes).map(end).collect()
        });
        scenes.into_iter().zip(lights).collect()
    }

    /// The first of some designs, and the scenes of their light: no more than one for each thread that is not kept.
    fn next_designs(&self, range: Range<usize>) -> (Vec<Result<Design>>, Vec<Scene>) {
        let (mut designs, mut scenes, mut new) = (Vec::new(), Vec::new(), 0);
        for number in range {
            let design = self.design(number);
            if let Ok(design) = &design {
                let scene = first_view(&design.scene);
                if !scenes.contains(&scene) {
                    new += usize::from(!self.cache.iter().any(|light| light.is_of(&scene)));
                    if new > rayon::current_num_threads() {
                        break;
                    }
                    scenes.push(scene);
                }
            }
            designs.push(design);
        }
        (designs, scenes)
    }

    fn design(&self, number: usize) -> Result<Design> {
        self.cancel.check()?;
        let scene = (self.load)(&self.sweep.designs.sets(number))?;
        Design::of(scene, self.sweep.fixed.as_ref())
    }

    fn outcome(&self, design: Result<Design>, lights: &[SceneLight]) -> Result<Outcome> {
        let refused = |error: &Error| Outcome::refused(error, self.sweep.scores.len());
        let design = match design {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(error) => return Ok(refused(&error)),
            Ok(design) => design,
        };
        let is_own = |(scene, _): &&SceneLight| *scene == first_view(&design.scene);
        let light = match lights.iter().find(is_own) {
            None => None,
            Some((_, Ok(light))) => Some(&**light),
            Some((_, Err(error))) => return fatal(error).map_or_else(|| Ok(refused(error)), Err),
        };
        let scores = &self.sweep.scores;
        match Outcome::of(self.engine, &design, scores, light, self.cancel) {
            Ok(outcome) => Ok(outcome),
            Err(error) => fatal(&error).map_or_else(|| Ok(refused(&error)), Err),
        }
    }

    fn keep(&mut self, lights: Vec<SceneLight>) {
        for light in lights.into_iter().filter_map(|(_, light)| light.ok()) {
            if !self.cache.iter().any(|kept| Arc::ptr_eq(kept, &light)) {
                self.cache.push_back(light);
            }
        }
        while self.cache.iter().map(|light| light.bytes()).sum::<usize>() > KEPT_BYTES {
            self.cache.pop_front();
        }
    }
}

/// The error that ends a sweep and refuses no design.
fn fatal(error: &Error) -> Option<Error> {
    match error {
        Error::Interrupted => Some(Error::Interrupted),
        Error::Device { wanted, found, remedy, .. } => {
            Some(Error::device(wanted.clone(), found.clone(), remedy.clone()))
        }
        _ => None,
    }
}
