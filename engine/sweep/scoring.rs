//! Scores of one design after another; designs whose light is the same share it, and scenes that differ in their apertures
//! and offsets alone are lit from one walk.

use super::outcome::Design;
use super::sample::{LightGroup, SampleLight, first_view};
use super::{Load, Outcome, SampleScore, Score, Sweep};
use crate::Engine;
use beamlet_core::{Cancel, Error, Result};
use beamlet_model::scene::Scene;
use beamlet_simulate::run::simulation::designs::WalkKey;
use rayon::prelude::*;
use std::ops::Range;
use std::panic::resume_unwind;
use std::sync::mpsc;
use std::thread;

/// Designs of a block. Blocks are the same whether a sweep is resumed or not, and so is the light that depends on the
/// designs that are lit together.
const BLOCK: usize = 64;
/// Designs without a sample that are scored at once.
const AT_ONCE_WITHOUT_SAMPLE: usize = 16;
/// Most scenes that are lit from one walk: each line has the light of all.
const TOGETHER: usize = 32;
/// Most bytes of their frames.
const TOGETHER_BYTES: u64 = 256 << 20;

/// Receives finished designs, and the number of designs whose light is computed meanwhile.
pub(super) type Each<'a> = &'a mut dyn FnMut(&[Outcome], f64) -> Result<()>;

/// The scoring of the designs of a sweep.
pub(super) struct Scoring<'a> {
    pub(super) sweep: &'a Sweep,
    pub(super) engine: &'a Engine,
    pub(super) load: &'a Load<'a>,
    pub(super) cancel: &'a Cancel,
}

/// A design of a block, or why it is refused; `light`: place of its light among the scenes of the block.
struct Waiting {
    design: Result<Design>,
    light: Option<usize>,
}

impl Scoring<'_> {
    /// Appends the outcomes of designs up to the end of a block. A design that is refused has the reason in place of scores.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; errors of the device; those of `each`.
    pub(super) fn score_block(&self, outcomes: &mut Vec<Outcome>, each: Each<'_>) -> Result<()> {
        let (from, count) = (outcomes.len(), self.sweep.designs.count());
        let scores: Vec<&SampleScore> =
            self.sweep.scores.iter().filter_map(Score::sample_score).collect();
        if scores.is_empty() {
            let designs = (from..count.min(from + AT_ONCE_WITHOUT_SAMPLE)).into_par_iter();
            let scored: Vec<_> =
                designs.map(|design| self.outcome(self.design(design), None)).collect();
            for outcome in scored {
                outcomes.push(outcome?);
            }
            return Ok(());
        }
        let first = from - from % BLOCK;
        let (mut waiting, scenes) = self.block(first..count.min(first + BLOCK));
        let mut lights: Vec<Option<Result<SampleLight>>> = scenes.iter().map(|_| None).collect();
        // Number of the last design with each light.
        let mut last_use = vec![0; scenes.len()];
        for (number, design) in (first..).zip(&waiting) {
            design.light.into_iter().for_each(|light| last_use[light] = number);
        }
        waiting.drain(..from - first);
        let group = |Group { key, places, .. }: Group| {
            let left = places.iter().filter(|light| last_use[**light] >= from).count();
            WalkGroup { places, left, is_walked: key.is_some() }
        };
        let mut groups: Vec<WalkGroup> = self.groups(&scenes)?.into_iter().map(group).collect();
        groups.retain(|group| group.left > 0);
        let mut waiting = waiting.into_iter().peekable();
        let mut groups = groups.chunks(rayon::current_num_threads().max(1));
        loop {
            let is_lit = |it: &Waiting, lights: &[Option<Result<SampleLight>>]| {
                it.light.is_none_or(|light| lights[light].is_some())
            };
            while let Some(Waiting { design, light }) = waiting.next_if(|it| is_lit(it, &lights)) {
                let own = light.and_then(|light| lights[light].as_ref());
                outcomes.push(self.outcome(design, own)?);
                if let Some(light) = light.filter(|light| last_use[*light] < outcomes.len()) {
                    lights[light] = None;
                }
                each(outcomes, 0.0)?;
            }
            let Some(some) = groups.next() else { return Ok(()) };
            let mut report = |in_work| each(outcomes, in_work);
            self.light(some, &scenes, &scores, &mut lights, &mut report)?;
        }
    }

    /// The designs of a block, and the scenes of their light.
    fn block(&self, range: Range<usize>) -> (Vec<Waiting>, Vec<Scene>) {
        let mut scenes: Vec<Scene> = Vec::new();
        let place = |number| {
            let design = self.design(number);
            let light = design.as_ref().ok().map(|design| {
                let scene = first_view(&design.scene);
                scenes.iter().position(|known| *known == scene).unwrap_or_else(|| {
                    scenes.push(scene);
                    scenes.len() - 1
                })
            });
            Waiting { design, light }
        };
        let waiting = range.map(place).collect();
        (waiting, scenes)
    }

    /// Computes the light of some groups of scenes, each on a thread of its own: loading a sample waits for the threads of
    /// rayon.
    fn light(
        &self,
        groups: &[WalkGroup],
        scenes: &[Scene],
        scores: &[&SampleScore],
        lights: &mut [Option<Result<SampleLight>>],
        report: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<()> {
        let (sender, shares) = mpsc::channel();
        let light = &|number: usize, group: &WalkGroup, sender: mpsc::Sender<(usize, f64)>| {
            let mut send = |share: f64| {
                // Nobody receives once a report failed.
                let _ = sender.send((number, share * group.left as f64));
            };
            self.light_of_group(group, scenes, scores, &mut send)
        };
        let found = thread::scope(|scope| {
            let begin = |(number, group)| {
                let sender = sender.clone();
                thread::Builder::new().spawn_scoped(scope, move || light(number, group, sender))
            };
            let running: Vec<_> = groups.iter().enumerate().map(begin).collect();
            drop(sender);
            let mut in_work = vec![0.0; groups.len()];
            let mut reported = Ok(());
            for (number, share) in shares {
                in_work[number] = share;
                if reported.is_ok() {
                    reported = report(in_work.iter().sum());
                }
            }
            let end = |running: std::io::Result<thread::ScopedJoinHandle<'_, _>>| match running {
                Ok(thread) => Ok(thread.join().unwrap_or_else(|panic| resume_unwind(panic))),
                Err(error) => {
                    Err(Error::argument("sweep", error.to_string(), "memory for threads"))
                }
            };
            let found = running.into_iter().map(end).collect::<Result<Vec<_>>>()?;
            reported.map(|()| found)
        })?;
        for (group, found) in groups.iter().zip(found) {
            for (light, found) in group.places.iter().zip(found) {
                lights[*light] = Some(found);
            }
        }
        Ok(())
    }

    /// Light of scenes from one walk; where one of them is refused each has its own.
    fn light_of_group(
        &self,
        WalkGroup { places: group, is_walked, .. }: &WalkGroup,
        scenes: &[Scene],
        scores: &[&SampleScore],
        report: &mut dyn FnMut(f64),
    ) -> Vec<Result<SampleLight>> {
        let light = |places: &[usize], report: &mut dyn FnMut(f64)| {
            let scenes: Vec<Scene> = places.iter().map(|place| scenes[*place].clone()).collect();
            let group = LightGroup { scenes, is_walked: *is_walked };
            group.light(self.engine, scores, self.cancel, report)
        };
        let error = match light(group, report) {
            Ok(lights) => return lights.into_iter().map(Ok).collect(),
            Err(error) if group.len() == 1 => return vec![Err(error)],
            Err(error) => error,
        };
        let alone = |(done, place): (usize, &usize)| {
            if let Some(error) = fatal(&error) {
                return Err(error);
            }
            let mut part = |share: f64| report((done as f64 + share) / group.len() as f64);
            let lights = light(std::slice::from_ref(place), &mut part)?;
            lights.into_iter().next().ok_or(Error::Interrupted)
        };
        group.iter().enumerate().map(alone).collect()
    }

    /// Scenes that are lit together, in the order of their first ones.
    fn groups(&self, scenes: &[Scene]) -> Result<Vec<Group>> {
        let mut groups: Vec<Group> = Vec::new();
        for (place, scene) in scenes.iter().enumerate() {
            self.cancel.check()?;
            // A scene that is refused has its reason where its light is computed.
            let key = WalkKey::of(scene).ok().flatten();
            let [columns, rows] = scene.detector.pixels.map(u64::from);
            let frames = 8 * columns * rows * scene.mask_steps() as u64;
            let most = usize::try_from(TOGETHER_BYTES / frames.max(1)).unwrap_or(TOGETHER);
            let most = most.clamp(1, TOGETHER);
            let is_open = |group: &&mut Group| {
                let full = most.min(group.most);
                key.is_some() && group.key == key && group.places.len() < full
            };
            match groups.iter_mut().find(is_open) {
                Some(group) => {
                    group.most = most.min(group.most);
                    group.places.push(place);
                }
                None => groups.push(Group { key, most, places: vec![place] }),
            }
        }
        Ok(groups)
    }

    fn design(&self, number: usize) -> Result<Design> {
        self.cancel.check()?;
        let scene = (self.load)(&self.sweep.designs.sets(number))?;
        Design::of(scene, self.sweep.fixed.as_ref())
    }

    fn outcome(
        &self,
        design: Result<Design>,
        light: Option<&Result<SampleLight>>,
    ) -> Result<Outcome> {
        let refused = |error: &Error| Outcome::refused(error, self.sweep.scores.len());
        let design = match design {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(error) => return Ok(refused(&error)),
            Ok(design) => design,
        };
        let light = match light {
            None => None,
            Some(Ok(light)) => Some(light),
            Some(Err(error)) => return fatal(error).map_or_else(|| Ok(refused(error)), Err),
        };
        let scores = &self.sweep.scores;
        match Outcome::of(self.engine, &design, scores, light, self.cancel) {
            Ok(outcome) => Ok(outcome),
            Err(error) => fatal(&error).map_or_else(|| Ok(refused(&error)), Err),
        }
    }
}

/// Scenes that are lit together, by their places.
struct WalkGroup {
    places: Vec<usize>,
    /// Number of those with designs that are not finished.
    left: usize,
    /// True if one walk lights them.
    is_walked: bool,
}

/// Scenes that are lit together, as they are found.
struct Group {
    key: Option<WalkKey>,
    /// Most scenes of it.
    most: usize,
    /// Places of its scenes.
    places: Vec<usize>,
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
