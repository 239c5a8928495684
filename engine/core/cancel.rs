//! Ending work early: a flag that whoever does long work looks at, and work that is left behind.

use crate::{Error, Result};
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Time between two looks at a flag, and between two reports of one step.
pub const TICK: Duration = Duration::from_millis(50);

/// Ends a run, a retrieval or another long work from any thread: whatever got a clone of it
/// returns [`Error::Interrupted`] within a second, and leaves nothing half done behind.
///
/// ```
/// use beamlet::Cancel;
///
/// let cancel = Cancel::default();
/// let handle = cancel.clone();
/// std::thread::spawn(move || handle.cancel()).join().unwrap();
/// assert!(cancel.is_cancelled());
/// ```
#[derive(Debug, Clone, Default)]
pub struct Cancel {
    flag: Arc<AtomicBool>,
}

impl Cancel {
    /// Asks the work to end. It cannot be taken back.
    pub fn cancel(&self) {
        self.flag.store(true, Ordering::Relaxed);
    }

    /// True if the work shall end.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.flag.load(Ordering::Relaxed)
    }

    /// # Errors
    /// [`Error::Interrupted`] where the work shall end.
    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Does `work` on a thread of its own, while the calling one calls `look` every [`TICK`]. This is for
    /// work that cannot check for cancellation, such as sorting, and the building of trees: if it is
    /// cancelled the thread is left behind, and its result is dropped.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    #[doc(hidden)]
    pub fn leaving<T: Send + 'static>(
        &self,
        look: &mut dyn FnMut(),
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T> {
        self.check()?;
        Aside::begin(|_| work()).wait(self, look)
    }
}

/// Work on a thread of its own, which is ended if nobody waits for it any more.
#[derive(Debug)]
pub struct Aside<T> {
    end: Cancel,
    made: Receiver<T>,
    /// `None` where there was no memory for a thread: then it is done already.
    worker: Option<JoinHandle<()>>,
}

impl<T: Send + 'static> Aside<T> {
    /// Begins the work; where no thread can be had, it is done before this returns.
    pub fn begin(work: impl FnOnce(&Cancel) -> T + Send + 'static) -> Self {
        let (sender, made) = mpsc::sync_channel(1);
        let end = Cancel::default();
        let work = Arc::new(Mutex::new(Some((work, sender))));
        let job = {
            let (work, end) = (work.clone(), end.clone());
            move || {
                let taken = work.lock().unwrap_or_else(PoisonError::into_inner).take();
                if let Some((work, sender)) = taken {
                    // Nobody listens to a thread that was left behind.
                    let _ = sender.send(work(&end));
                }
            }
        };
        let worker = thread::Builder::new().spawn(job.clone()).ok();
        if worker.is_none() {
            job();
        }
        Self { end, made, worker }
    }

    /// Waits for it.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; the thread continues until it checks, and its result is dropped.
    pub fn wait(mut self, cancel: &Cancel, look: &mut dyn FnMut()) -> Result<T> {
        loop {
            match self.made.recv_timeout(TICK) {
                Ok(made) => return Ok(made),
                Err(RecvTimeoutError::Timeout) => {
                    look();
                    cancel.check()?;
                }
                // It ended without a word: it panicked.
                Err(RecvTimeoutError::Disconnected) => {
                    if let Some(Err(panic)) = self.worker.take().map(JoinHandle::join) {
                        resume_unwind(panic);
                    }
                    return Err(Error::Interrupted);
                }
            }
        }
    }
}

impl<T> Drop for Aside<T> {
    fn drop(&mut self) {
        self.end.cancel();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_does_not_look_is_left_behind() {
        let (cancel, go_on) = (Cancel::default(), Arc::new(AtomicBool::new(false)));
        let (handle, ended) = (cancel.clone(), go_on.clone());
        let mut looks = 0;
        let mut look = || {
            looks += 1;
            if looks == 3 {
                handle.cancel();
            }
        };
        // It ends only when this test allows it, after the call below came back.
        let made = cancel.leaving(&mut look, move || {
            while !ended.load(Ordering::Relaxed) {
                thread::sleep(TICK);
            }
        });
        assert!(matches!(made, Err(Error::Interrupted)), "{made:?}");
        go_on.store(true, Ordering::Relaxed);
        assert_eq!(looks, 3);
        assert!(matches!(cancel.leaving(&mut || {}, || 1), Err(Error::Interrupted)));
        assert_eq!(Cancel::default().leaving(&mut || {}, || 42).unwrap(), 42);
    }

    #[test]
    fn work_that_nobody_waits_for_is_told_to_end() {
        let (sender, ended) = mpsc::channel();
        let aside = Aside::begin(move |end| {
            while !end.is_cancelled() {
                thread::sleep(TICK);
            }
            sender.send(()).unwrap();
        });
        drop(aside);
        ended.recv().unwrap();
    }
}
