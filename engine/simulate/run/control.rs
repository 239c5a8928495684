//! Control of a running simulation, and its progress.

use beamlet_core::cancel::Cancel;
use beamlet_core::error::Result;
use beamlet_core::setters;
use beamlet_core::tally::Tally;
use beamlet_files::{RunDirectory, ViewRange};
use beamlet_geometry as geometry;
use beamlet_geometry::{LoadProgress, LoadStep, Sample, Watcher};
use beamlet_model::scene::{Exposure, Scene};
use std::fmt;
use std::sync::Arc;

/// Control of a running simulation. `Control::default()` runs every view to its end without a report;
/// other settings are chained.
///
/// ```no_run
/// use beamlet::stack::ArraySink;
/// use beamlet::{Cancel, Control, Engine, EngineOptions, Progress, scene::Scene};
///
/// // A clone of it, on another thread, ends the run.
/// let cancel = Cancel::default();
/// let mut report = |progress: Progress| println!("{progress:?}");
/// let control = Control::default().with_progress(&mut report).with_cancel(cancel.clone());
/// let engine = Engine::open(&EngineOptions::default())?;
/// let record = engine.run(&Scene::load("scene.toml")?, &mut ArraySink::new(), control)?;
/// # Ok::<(), beamlet::Error>(())
/// ```
#[derive(Default)]
#[non_exhaustive]
pub struct Control<'a> {
    /// Called from the calling thread: at each step of the preparation and many times a second
    /// while it lasts, then at each part of a view that is done. What takes long between two calls
    /// is for the caller to bridge, with a clock of its own.
    pub progress: Option<&'a mut dyn FnMut(Progress)>,
    /// Ends the run with [`beamlet_core::Error::Interrupted`].
    pub cancel: Cancel,
    /// Views of the part of the run that is computed; `None`: all.
    pub views: Option<ViewRange>,
    /// Views that are committed already and are not computed again.
    pub skip: Vec<Exposure>,
    /// Counts of the views made earlier ([`beamlet_files::RunDirectory::counted`]), which are added to the
    /// run's own tally.
    pub counted: Tally,
}

impl<'a> Control<'a> {
    setters! {
        /// Sets the callback for the progress.
        with_progress(progress: &'a mut dyn FnMut(Progress));
        /// Sets what ends the run.
        with_cancel(cancel: Cancel);
        /// Sets the views of the part of the run that is computed.
        with_views(views: impl Into<Option<ViewRange>>);
        /// Sets the views that are committed already.
        with_skip(skip: Vec<Exposure>);
        /// Sets the counts of the views made earlier.
        with_counted(counted: Tally);
    }
}

impl Control<'_> {
    /// Takes the views that a run directory has already, with their counts, and its part of the views.
    #[must_use]
    pub fn going_on(self, directory: &RunDirectory) -> Self {
        self.with_skip(directory.committed().to_vec())
            .with_counted(directory.counted())
            .with_views(directory.part())
    }

    /// Does one step of the preparation, which cannot look whether to stop, as
    /// [`Cancel::leaving`] does it.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`].
    #[doc(hidden)]
    pub fn step<T: Send + 'static>(
        &mut self,
        step: LoadStep,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T> {
        let progress = &mut self.progress;
        let mut look = || {
            if let Some(progress) = progress {
                progress(Progress::Loading(LoadProgress::of_all(step)));
            }
        };
        look();
        self.cancel.leaving(&mut look, work)
    }
}

/// Calls `work` with a watcher of the loading of objects that reports to `progress`.
pub fn watching<T>(
    progress: Option<&mut (dyn FnMut(Progress) + '_)>,
    cancel: &Cancel,
    work: impl FnOnce(Watcher<'_>) -> T,
) -> T {
    let cancel = cancel.clone();
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

/// The objects of a scene, read, checked and cut as a run has them: `beamlet_geometry::load` with
/// progress and an end.
///
/// # Errors
/// As `beamlet_geometry::load`; [`beamlet_core::Error::Interrupted`] when `control.cancel` was set.
pub fn load_sample(scene: &Scene, control: &mut Control<'_>) -> Result<Sample> {
    let scene = Arc::new(scene.clone());
    watching(control.progress.as_deref_mut(), &control.cancel, |watcher| {
        geometry::load_watched(&scene, watcher)
    })
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
    /// Rows of light done in all poses of all views, the flat included. A pixel row is one, or several where
    /// light is blurred; margins beside the detector count.
    pub rows_done: u64,
    /// All work of this run.
    pub rows_total: u64,
    /// The view in work.
    pub view: Exposure,
    /// Rays traced so far.
    pub rays: u64,
    /// The share of the run's work that is done, from 0 to 1: rows with the sample weigh more than
    /// those without, and the flat little. Views with the sample count as alike.
    pub share: f64,
}
