//! Long work on a thread of its own, while the calling one looks after signals and progress.

use crate::errors::raised;
use beamlet::cli_support::{is_fork, start_threads};
use beamlet::{Cancel, Control, Error, Progress, RowsControl};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two looks at signals and progress.
const TICK: Duration = Duration::from_millis(50);
/// Most time that the end of the process waits for work.
const PATIENCE: Duration = Duration::from_secs(10);

/// Work that goes on, by its number.
static RUNNING: Mutex<BTreeMap<u64, Cancel>> = Mutex::new(BTreeMap::new());
static NEXT: AtomicU64 = AtomicU64::new(0);

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends all work, and waits until it has ended. Returns whether it has.
#[pyfunction]
pub(crate) fn stop(py: Python<'_>) -> bool {
    if is_fork() {
        return true;
    }
    locked(&RUNNING).values().for_each(Cancel::cancel);
    let began = Instant::now();
    py.detach(|| {
        while !locked(&RUNNING).is_empty() {
            if began.elapsed() > PATIENCE {
                return false;
            }
            thread::sleep(TICK / 10);
        }
        true
    })
}

/// An entry of the work that goes on; it ends with this.
struct Entry(u64);

impl Entry {
    fn new(cancel: &Cancel) -> Self {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        locked(&RUNNING).insert(number, cancel.clone());
        Self(number)
    }
}

impl Drop for Entry {
    fn drop(&mut self) {
        locked(&RUNNING).remove(&self.0);
    }
}

/// How far work is: its step, and the share that is done, where it is known.
type Report = (String, Option<f64>);

/// Parts of its caller that work sees.
#[derive(Default)]
pub(crate) struct Watch {
    cancel: Cancel,
    latest: Mutex<Option<Report>>,
}

impl Watch {
    /// # Errors
    /// [`Error::Interrupted`] where the work shall end.
    pub(crate) fn check(&self) -> beamlet::Result<()> {
        if self.cancel.is_cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// What ends the work.
    pub(crate) const fn cancel(&self) -> &Cancel {
        &self.cancel
    }

    /// Leaves a step by its name, and the share of the work that is done, for the callback.
    pub(crate) fn report(&self, step: impl Into<String>, share: Option<f64>) {
        *locked(&self.latest) = Some((step.into(), share));
    }

    /// Runs `work` with the control of a simulation.
    pub(crate) fn control<T>(&self, work: impl FnOnce(Control<'_>) -> T) -> T {
        let mut progress = |progress: Progress| match progress {
            Progress::Views(views) => self.report("views", Some(views.share)),
            Progress::Loading(loading) => {
                self.report(format!("{:?}", loading.step).to_lowercase(), None);
            }
            _ => {}
        };
        let control = Control::default().with_cancel(self.cancel.clone());
        work(control.with_progress(&mut progress))
    }

    /// Runs `work` with the control of a retrieval, `step` by its name.
    pub(crate) fn rows<T>(&self, step: &str, work: impl FnOnce(RowsControl<'_>) -> T) -> T {
        let mut progress =
            |done: u64, all: u64| self.report(step, Some(done as f64 / all.max(1) as f64));
        let control = RowsControl::default().with_cancel(self.cancel.clone());
        work(control.with_progress(&mut progress))
    }

    /// Hands the latest report to the callback.
    fn tell(&self, callback: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let latest = locked(&self.latest).take();
        match (callback, latest) {
            (Some(callback), Some(report)) => callback.call1(report).map(drop),
            _ => Ok(()),
        }
    }
}

/// Does `work` on a thread. The calling thread releases the interpreter, and every 50 ms looks for
/// signals and hands the progress to `callback`; an exception of either ends the work and is raised.
///
/// # Errors
/// Exceptions of signals and callback; those of `work`.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    callback: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> beamlet::Result<T> + Send,
) -> PyResult<T> {
    start_threads().map_err(|error| raised(py, &error))?;
    let watch = Watch::default();
    let outcome = thread::scope(|scope| {
        let (sender, mut receiver) = mpsc::sync_channel(1);
        let entry = Entry::new(&watch.cancel);
        let worker = thread::Builder::new().name("beamlet".into()).spawn_scoped(scope, || {
            let _entry = entry;
            // The receiver lives until this is done.
            let _ = sender.send(work(&watch));
            drop(sender);
        })?;
        let mut exception = None;
        loop {
            let receiver = &mut receiver;
            match py.detach(move || receiver.recv_timeout(TICK)) {
                Ok(done) => break exception.map_or(Ok(done), Err),
                Err(RecvTimeoutError::Timeout) => {}
                // It ended without a word: it panicked.
                Err(RecvTimeoutError::Disconnected) => match worker.join() {
                    Err(panic) => resume_unwind(panic),
                    Ok(()) => break Err(PyRuntimeError::new_err("work ended without a result")),
                },
            }
            if exception.is_none() {
                exception = py.check_signals().and_then(|()| watch.tell(callback)).err();
                if exception.is_some() {
                    watch.cancel.cancel();
                }
            }
        }
    })?;
    let done = outcome.map_err(|error| raised(py, &error))?;
    watch.tell(callback)?;
    Ok(done)
}
