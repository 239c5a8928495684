//! What a caller may steer while a run goes on, and what it learns of its progress.

use crate::geometry::{LoadProgress, Watcher};
use crate::moments::MomentWriter;
use crate::scene::Exposure;
use crate::trace::Tally;
use std::fmt;
use std::sync::atomic::AtomicBool;

/// What a caller may steer while a run goes on. `Control::default()` runs every view to its end
/// without a word; what differs from it is set in a chain.
///
/// ```no_run
/// use beamlet::stack::ArraySink;
/// use beamlet::{Control, Engine, EngineOptions, Progress, scene::Scene};
/// use std::sync::atomic::AtomicBool;
///
/// let cancel = AtomicBool::new(false);
/// let mut report = |progress: Progress| println!("{progress:?}");
/// let control = Control::default().with_progress(&mut report).with_cancel(&cancel);
/// let engine = Engine::open(&EngineOptions::default())?;
/// let record = engine.run(&Scene::load("scene.toml")?, &mut ArraySink::new(), control)?;
/// # Ok::<(), beamlet::Error>(())
/// ```
#[derive(Default)]
#[non_exhaustive]
pub struct Control<'a> {
    /// Called from the calling thread: at each step of the loading of objects and ten times a
    /// second while it lasts, then now and then while views are made.
    pub progress: Option<&'a mut dyn FnMut(Progress)>,
    /// Set to true to end the run with [`crate::Error::Interrupted`].
    pub cancel: Option<&'a AtomicBool>,
    /// Views that are committed already and are not computed again.
    pub skip: Vec<Exposure>,
    /// What was counted while those were made ([`crate::stack::RunDirectory::counted`]); it is
    /// added to the run's own tally.
    pub counted: Tally,
    /// Keeps the moments of the rays, for [`crate::Engine::reilluminate`]; the engine must have
    /// been opened with [`crate::EngineOptions::keep_moments`]. Cells only; refused where the scene
    /// is itself made from kept moments.
    pub keep: Option<&'a mut MomentWriter>,
}

impl<'a> Control<'a> {
    setters! {
        /// Sets what is called with the progress.
        with_progress(progress: &'a mut dyn FnMut(Progress));
        /// Sets the flag that ends the run.
        with_cancel(cancel: &'a AtomicBool);
        /// Sets the views that are committed already.
        with_skip(skip: Vec<Exposure>);
        /// Sets what was counted while those were made.
        with_counted(counted: Tally);
        /// Sets what keeps the moments of the rays.
        with_keep(keep: impl Into<Option<&'a mut MomentWriter>>);
    }
}

/// What steers a retrieval or a comparison while it goes on; set in a chain as [`Control`] is.
#[derive(Default)]
#[non_exhaustive]
pub struct RowsControl<'a> {
    /// Called now and then with rows done and rows in all, over all images and the flat.
    pub progress: Option<&'a mut dyn FnMut(u64, u64)>,
    /// Set to true to end with [`crate::Error::Interrupted`].
    pub cancel: Option<&'a AtomicBool>,
}

impl<'a> RowsControl<'a> {
    setters! {
        /// Sets what is called with the progress.
        with_progress(progress: &'a mut dyn FnMut(u64, u64));
        /// Sets the flag that ends the work.
        with_cancel(cancel: &'a AtomicBool);
    }
}

impl fmt::Debug for RowsControl<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RowsControl").finish_non_exhaustive()
    }
}

/// Calls `work` with a watcher of the loading of objects that reports to `progress`.
pub(crate) fn watching<T>(
    progress: Option<&mut (dyn FnMut(Progress) + '_)>,
    cancel: Option<&AtomicBool>,
    work: impl FnOnce(Watcher<'_>) -> T,
) -> T {
    match progress {
        None => work(Watcher { progress: None, cancel }),
        Some(progress) => {
            let mut report = |loading| progress(Progress::Loading(loading));
            work(Watcher { progress: Some(&mut report), cancel })
        }
    }
}

impl fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control").field("skip", &self.skip).finish_non_exhaustive()
    }
}

/// How far a run is.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Progress {
    /// Objects are read and checked, before the first ray.
    Loading(LoadProgress),
    /// Views are made.
    Views(ViewProgress),
}

/// How far the views of a run are.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ViewProgress {
    /// Work done, in pixel rows (over all views, the flat included).
    pub rows_done: u64,
    /// All work of this run.
    pub rows_total: u64,
    /// The view in work.
    pub view: Exposure,
    /// Rays traced so far.
    pub rays: u64,
}
