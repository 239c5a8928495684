//! Reading and checking of objects, watched from the calling thread: the current step, its progress, and
//! cancellation.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Sender};

use crate::cancel::Cancel;
use crate::error::{Error, Result};

/// A step of reading and checking the objects of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LoadStep {
    /// A file is read, or a shape made; counted in bytes of the file.
    Reading,
    /// Instances of the object are packed; random fibres are counted in fibres, others by an estimate
    /// of their work.
    Packing,
    /// Equal vertices are joined, and triangles sorted for search. Not counted.
    Joining,
    /// Triangles are looked at for what passes through what; counted in groups of triangles.
    Checking,
    /// Nesting of objects is computed; counted in pairs of objects. For all objects together.
    Nesting,
    /// What later objects cover is cut away; counted in parts of objects. Only where objects
    /// overlap or touch, and of all objects together.
    Cutting,
    /// The sample is compared with the masks, which it must not reach. Not counted.
    Clearance,
    /// Trees are built over triangles and instances, for rays to find them. Not counted.
    Building,
}

/// How far the reading and checking of objects is.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LoadProgress {
    /// The step in work; where objects are read side by side, the one with the most work left.
    pub step: LoadStep,
    /// Name of its object; empty from [`LoadStep::Nesting`] on.
    pub object: String,
    /// Objects that are read and checked.
    pub objects_done: usize,
    /// All objects.
    pub objects: usize,
    /// Work of the step that is done.
    pub done: u64,
    /// All work of the step; 0 where it is not known.
    pub total: u64,
}

impl LoadProgress {
    /// A step of all objects together, which is not counted.
    #[doc(hidden)]
    pub const fn of_all(step: LoadStep) -> Self {
        Self { step, object: String::new(), objects_done: 0, objects: 0, done: 0, total: 0 }
    }
}

/// Who watches, and who may stop it.
#[derive(Default)]
pub struct Watcher<'a> {
    /// Called at the beginning of each step and many times a second, from the calling thread.
    pub progress: Option<&'a mut dyn FnMut(LoadProgress)>,
    /// Ends it with [`Error::Interrupted`].
    pub cancel: Cancel,
}

impl std::fmt::Debug for Watcher<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watcher").finish_non_exhaustive()
    }
}

/// The step in work of one object, or of the nesting of all.
#[derive(Debug, Default)]
struct Slot {
    /// Number of the [`STEPS`] in work, from 1; 0: none yet; beyond them: done.
    step: AtomicU64,
    done: AtomicU64,
    total: AtomicU64,
}

const STEPS: [LoadStep; 8] = [
    LoadStep::Reading,
    LoadStep::Packing,
    LoadStep::Joining,
    LoadStep::Checking,
    LoadStep::Nesting,
    LoadStep::Cutting,
    LoadStep::Clearance,
    LoadStep::Building,
];
const FINISHED: u64 = STEPS.len() as u64 + 1;

/// A step that began.
#[derive(Debug)]
struct Begun {
    /// Number of the slot.
    number: usize,
    step: LoadStep,
    total: u64,
}

/// Where the threads that read objects say how far they are.
#[derive(Debug)]
pub struct Watch {
    cancel: Cancel,
    /// Steps that began; `None` where nobody listens.
    began: Option<Sender<Begun>>,
    /// Slots of each object, and of the nesting.
    slots: Vec<Slot>,
}

/// The part of a [`Watch`] that one object has, or the nesting.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a>(Option<(&'a Watch, usize)>);

impl Watch {
    /// Unwatched, for a number of objects.
    pub fn unwatched(objects: usize) -> Self {
        let slots = (0..=objects).map(|_| Slot::default()).collect();
        Self { cancel: Cancel::default(), began: None, slots }
    }

    /// Task of the object with this number.
    pub fn object(&self, number: usize) -> Task<'_> {
        Task(Some((self, number)))
    }

    /// Task of the nesting.
    pub fn nesting(&self) -> Task<'_> {
        Task(Some((self, self.slots.len() - 1)))
    }
}

impl Task<'_> {
    /// One that nobody watches.
    pub const fn unwatched() -> Self {
        Self(None)
    }

    /// Begins a step; `total`: its work, 0 where that is not known.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn begin(self, step: LoadStep, total: u64) -> Result<()> {
        let Some((watch, number)) = self.0 else { return Ok(()) };
        let slot = &watch.slots[number];
        slot.done.store(0, Ordering::Relaxed);
        slot.total.store(total, Ordering::Relaxed);
        slot.step.store(step as u64 + 1, Ordering::Relaxed);
        if let Some(began) = &watch.began {
            let _ = began.send(Begun { number, step, total });
        }
        self.check()
    }

    /// # Errors
    /// [`Error::Interrupted`] where it shall stop.
    pub fn check(self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Work of the step that is done by now.
    pub fn reach(self, done: u64) {
        if let Some((watch, number)) = self.0 {
            watch.slots[number].done.store(done, Ordering::Relaxed);
        }
    }

    /// At least this much work of the step is done by now.
    pub fn reach_at_least(self, done: u64) {
        if let Some((watch, number)) = self.0 {
            watch.slots[number].done.fetch_max(done, Ordering::Relaxed);
        }
    }

    /// The last step is done.
    pub fn finish(self) {
        if let Some((watch, number)) = self.0 {
            watch.slots[number].step.store(FINISHED, Ordering::Relaxed);
        }
    }

    /// True if the work is to stop.
    pub fn is_cancelled(self) -> bool {
        self.0.is_some_and(|(watch, _)| watch.cancel.is_cancelled())
    }
}

/// Does `work` on the objects of these names, on a thread of its own that is left behind where the
/// work is cancelled; the calling thread reports.
///
/// # Errors
/// Errors of `work`; [`Error::Interrupted`].
pub fn watched<T: Send + 'static>(
    names: &[String],
    watcher: Watcher<'_>,
    work: impl FnOnce(&Watch) -> Result<T> + Send + 'static,
) -> Result<T> {
    let Watcher { mut progress, cancel } = watcher;
    let (began, beginnings) = mpsc::channel();
    let unwatched = Watch::unwatched(names.len());
    let watch = Arc::new(Watch { cancel: cancel.clone(), began: Some(began), ..unwatched });
    let mut report = |also: Option<LoadProgress>| {
        let Some(progress) = &mut progress else { return };
        let begun = beginnings.try_iter().map(|begun| watch.beginning(&begun, names));
        begun.chain(also).for_each(progress);
    };
    let at_work = watch.clone();
    let made = cancel.leaving(&mut || report(watch.in_work(names)), move || work(&at_work));
    report(None);
    made?
}

impl Watch {
    /// A step as it began.
    fn beginning(&self, begun: &Begun, names: &[String]) -> LoadProgress {
        let Begun { number, step, total } = *begun;
        self.report(number, step, [0, total], names)
    }

    /// The step in work that has the most left.
    fn in_work(&self, names: &[String]) -> Option<LoadProgress> {
        let load = |value: &AtomicU64| value.load(Ordering::Relaxed);
        let in_work = |(number, slot): (usize, &Slot)| {
            let at = usize::try_from(load(&slot.step)).ok()?.checked_sub(1)?;
            let (step, total) = (*STEPS.get(at)?, load(&slot.total));
            Some((number, step, [load(&slot.done).min(total), total]))
        };
        self.slots
            .iter()
            .enumerate()
            .filter_map(in_work)
            .max_by_key(|(_, _, [done, total])| total - done)
            .map(|(number, step, work)| self.report(number, step, work, names))
    }

    fn report(
        &self,
        number: usize,
        step: LoadStep,
        [done, total]: [u64; 2],
        names: &[String],
    ) -> LoadProgress {
        let finished = |slot: &&Slot| slot.step.load(Ordering::Relaxed) == FINISHED;
        LoadProgress {
            step,
            object: names.get(number).cloned().unwrap_or_default(),
            objects_done: self.slots[..names.len()].iter().filter(finished).count(),
            objects: names.len(),
            done,
            total,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    #[test]
    fn every_step_is_reported_as_it_began_and_again_while_it_lasts() {
        let names = ["a".to_owned(), "b".to_owned()];
        let mut reports = Vec::new();
        let (sender, seen) = mpsc::channel();
        let mut take = |report: LoadProgress| {
            if report.done > 0 {
                let _ = sender.send(());
            }
            reports.push((report.object, report.step, report.done, report.total));
        };
        let watcher = Watcher { progress: Some(&mut take), ..Watcher::default() };
        let made = watched(&names, watcher, move |watch| {
            watch.object(0).begin(LoadStep::Reading, 10)?;
            watch.object(0).finish();
            watch.object(1).begin(LoadStep::Checking, 7)?;
            watch.object(1).reach(3);
            // The step lasts until it is reported once more.
            let _ = seen.recv();
            watch.object(1).finish();
            watch.nesting().begin(LoadStep::Nesting, 0)?;
            Ok(42)
        });
        assert_eq!(made.unwrap(), 42);
        let name = |name: &str| name.to_owned();
        assert_eq!(reports[0], (name("a"), LoadStep::Reading, 0, 10));
        assert_eq!(reports[1], (name("b"), LoadStep::Checking, 0, 7));
        assert_eq!(reports[2], (name("b"), LoadStep::Checking, 3, 7));
        assert_eq!(reports[reports.len() - 1], (name(""), LoadStep::Nesting, 0, 0));
    }

    #[test]
    fn who_cancels_ends_the_next_step() {
        let cancel = Cancel::default();
        let mut stop = |report: LoadProgress| {
            if report.step == LoadStep::Joining {
                cancel.cancel();
            }
        };
        let watcher = Watcher { progress: Some(&mut stop), cancel: cancel.clone() };
        let (sender, seen) = mpsc::channel();
        let ended = watched(&["a".to_owned()], watcher, move |watch| {
            watch.object(0).begin(LoadStep::Reading, 1)?;
            watch.object(0).begin(LoadStep::Joining, 1)?;
            while !watch.object(0).is_cancelled() {
                thread::yield_now();
            }
            let next = watch.object(0).begin(LoadStep::Checking, 1);
            let _ = sender.send(next.is_err());
            next
        });
        assert!(matches!(ended, Err(Error::Interrupted)), "{ended:?}");
        assert!(seen.recv().unwrap(), "the work that was left behind ends, too");
    }
}
