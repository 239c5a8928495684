//! Views side by side: while the host samples one view, the device traces or illuminates another and
//! a third is written. Each lane is a thread with a tracer and sums of its own; the views are handed
//! to the sink by the calling thread, in their order.

use super::seconds::Seconds;
use super::work::ViewWork;
use crate::run::{Control, Progress, ViewProgress};
use beamlet_core::cancel::{Cancel, TICK};
use beamlet_core::tally::Tally;
use beamlet_core::{Error, Result};
use beamlet_files::{RunRecord, RunStart, Sink};
use beamlet_gpu::{Device, Traffic};
use beamlet_model::scene::{Exposure, Scene};
use ndarray::{Array3, ArrayView3};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Instant;

/// Finished views that may wait for an earlier one.
const WAITING: usize = 1;

/// Rows of a view with all steps, `[step][row][column]`: intensities, and detector numbers.
type Band = (Range<u32>, [Option<Array3<f32>>; 2]);

/// A sink that keeps the bands of one view.
#[derive(Debug, Default)]
struct Held(Vec<Band>);

impl Held {
    fn keep(&mut self, rows: Range<u32>, kind: usize, data: ArrayView3<'_, f32>) {
        if self.0.last().is_none_or(|(last, _)| *last != rows) {
            self.0.push((rows, [None, None]));
        }
        if let Some((_, kept)) = self.0.last_mut() {
            kept[kind] = Some(data.to_owned());
        }
    }

    fn hand_over(self, view: Exposure, sink: &mut dyn Sink) -> Result<()> {
        for (rows, [intensities, numbers]) in self.0 {
            if let Some(data) = intensities {
                sink.write(view, rows.clone(), data.view())?;
            }
            if let Some(data) = numbers {
                sink.write_counts(view, rows, data.view())?;
            }
        }
        Ok(())
    }
}

impl Sink for Held {
    fn begin(&mut self, _scene: &Scene, _start: &RunStart) -> Result<()> {
        Ok(())
    }

    fn write(&mut self, _: Exposure, rows: Range<u32>, data: ArrayView3<'_, f32>) -> Result<()> {
        self.keep(rows, 0, data);
        Ok(())
    }

    fn write_counts(
        &mut self,
        _: Exposure,
        rows: Range<u32>,
        numbers: ArrayView3<'_, f32>,
    ) -> Result<()> {
        self.keep(rows, 1, numbers);
        Ok(())
    }

    fn commit(&mut self, _view: Exposure) -> Result<()> {
        Ok(())
    }

    fn finish(&mut self, _record: &RunRecord) -> Result<()> {
        Ok(())
    }
}

/// A finished view.
struct Made {
    bands: Held,
    tally: Tally,
    /// Progress of the view at its end, counted from its beginning.
    part: Part,
}

/// Progress within one view.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    rows: u64,
    share: f64,
}

impl std::ops::Add for Part {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { rows: self.rows + other.rows, share: self.share + other.share }
    }
}

/// State that lanes and the calling thread share.
struct Lanes<'v> {
    views: &'v [Exposure],
    /// Most views that are begun and not handed over.
    most: usize,
    state: Mutex<State>,
    changed: Condvar,
    end: Cancel,
}

#[derive(Default)]
struct State {
    /// Index of the view to begin next.
    next: usize,
    /// Number of views handed over.
    handed: usize,
    made: BTreeMap<usize, Result<Made>>,
    /// Progress of the views that are not handed over, by index.
    parts: BTreeMap<usize, Part>,
    /// Rays traced by each lane.
    rays: Vec<u64>,
    /// True if a lane has panicked.
    lost: bool,
}

impl Lanes<'_> {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next view to begin; waits while too many are ahead of the one to be handed over.
    fn take(&self) -> Option<usize> {
        let mut state = self.state();
        loop {
            if self.end.is_cancelled() || state.next == self.views.len() {
                return None;
            }
            if state.next < state.handed + self.most {
                state.next += 1;
                return Some(state.next - 1);
            }
            state = self
                .changed
                .wait_timeout(state, TICK)
                .map_or_else(|poisoned| poisoned.into_inner().0, |(state, _)| state);
        }
    }

    /// Makes views until none remains, one fails, or a stop is requested.
    fn work(&self, lane: usize, mut work: ViewWork<'_>) -> Seconds {
        let _watch = Watch(self);
        let mut before = Tally::default();
        while let Some(index) = self.take() {
            let made = self.make(lane, index, &mut work, &mut before);
            let failed = made.is_err();
            self.state().made.insert(index, made);
            self.changed.notify_all();
            if failed {
                break;
            }
        }
        // The calling thread counts the writing.
        Seconds { write: 0.0, ..work.seconds() }
    }

    fn make(
        &self,
        lane: usize,
        index: usize,
        work: &mut ViewWork<'_>,
        before: &mut Tally,
    ) -> Result<Made> {
        let mut first: Option<Part> = None;
        let mut part = Part::default();
        let mut report = |progress: Progress| {
            if let Progress::Views(ViewProgress { rows_done, share, rays, .. }) = progress {
                let first = first.get_or_insert(Part { rows: rows_done, share });
                part = Part { rows: rows_done - first.rows, share: share - first.share };
                let mut state = self.state();
                state.parts.insert(index, part);
                state.rays[lane] = rays;
            }
        };
        let mut control =
            Control::default().with_progress(&mut report).with_cancel(self.end.clone());
        let mut bands = Held::default();
        work.view(self.views[index], &mut bands, &mut control)?;
        let tally = work.tally();
        let own = tally.since(*before);
        *before = tally;
        Ok(Made { bands, tally: own, part })
    }

    /// Waits for a view, and reports progress meanwhile.
    fn wait(
        &self,
        index: usize,
        (done, rows_total): (Part, u64),
        control: &mut Control<'_>,
    ) -> Result<Made> {
        loop {
            let state = self.state();
            let part = state.parts.get(&index).copied().unwrap_or_default() + done;
            let rays = state.rays.iter().sum();
            drop(state);
            if let Some(progress) = control.progress.as_mut() {
                progress(Progress::Views(ViewProgress {
                    rows_done: part.rows,
                    rows_total,
                    view: self.views[index],
                    rays,
                    share: part.share.min(1.0),
                }));
            }
            control.cancel.check()?;
            let mut state = self.state();
            if let Some(made) = state.made.remove(&index) {
                return made;
            }
            if state.lost {
                return Err(Error::Interrupted);
            }
            drop(self.changed.wait_timeout(state, TICK));
        }
    }
}

/// Ends the work of all lanes where one panics.
struct Watch<'l, 'v>(&'l Lanes<'v>);

impl Drop for Watch<'_, '_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.end.cancel();
            self.0.state().lost = true;
            self.0.changed.notify_all();
        }
    }
}

/// Views that the sink has received.
#[derive(Debug, Default)]
pub(super) struct Handed {
    /// Number of views.
    pub(crate) views: usize,
    pub(crate) tally: Tally,
    pub(super) seconds: Seconds,
    /// The device, whose work is counted up to the end of the first view.
    pub(super) device: Option<Arc<Device>>,
    pub(super) first: Traffic,
}

impl Handed {
    /// One more view with these counts.
    pub(super) fn add(&mut self, tally: Tally) {
        if let (0, Some(device)) = (self.views, &self.device) {
            self.first = device.traffic();
        }
        self.views += 1;
        self.tally = self.tally + tally;
    }
}

/// Makes views in one lane for each `work`, and hands them to the sink in their order. Returns
/// before the last view where memory does not suffice for several at a time.
///
/// # Errors
/// The first error in the order of the views; [`Error::Interrupted`] where `control.cancel` was set.
pub(super) fn side_by_side(
    work: Vec<ViewWork<'_>>,
    views: &[Exposure],
    end: &Cancel,
    sink: &mut dyn Sink,
    control: &mut Control<'_>,
    handed: &mut Handed,
) -> Result<()> {
    let rows_total = work.first().map_or(0, ViewWork::rows_total);
    let lanes = Lanes {
        views,
        most: work.len() + WAITING,
        state: Mutex::new(State { rays: vec![0; work.len()], ..State::default() }),
        changed: Condvar::new(),
        end: end.clone(),
    };
    thread::scope(|scope| {
        let lanes = &lanes;
        let mut threads = Vec::new();
        for (lane, work) in work.into_iter().enumerate() {
            let thread = thread::Builder::new().name(format!("views {lane}"));
            // Without a thread the other lanes, or the calling thread, make the views.
            if let Ok(thread) = thread.spawn_scoped(scope, move || lanes.work(lane, work)) {
                threads.push(thread);
            }
        }
        let done = match threads.is_empty() {
            true => Ok(()),
            false => hand_over(lanes, rows_total, sink, control, handed),
        };
        lanes.end.cancel();
        lanes.changed.notify_all();
        for thread in threads {
            match thread.join() {
                Ok(own) => handed.seconds += own,
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        done
    })
}

/// Hands views to the sink in their order, until memory does not suffice.
fn hand_over(
    lanes: &Lanes<'_>,
    rows_total: u64,
    sink: &mut dyn Sink,
    control: &mut Control<'_>,
    handed: &mut Handed,
) -> Result<()> {
    let mut done = Part::default();
    for (index, view) in lanes.views.iter().enumerate() {
        let made = match lanes.wait(index, (done, rows_total), control) {
            Err(Error::Memory { purpose, .. }) => {
                log::info!(
                    "one view at a time from here on: no memory for {purpose} beside another"
                );
                return Ok(());
            }
            made => made?,
        };
        done = done + made.part;
        let begin = Instant::now();
        made.bands.hand_over(*view, sink)?;
        sink.tally(*view, &made.tally)?;
        sink.commit(*view)?;
        handed.seconds.write += begin.elapsed().as_secs_f64();
        handed.add(made.tally);
        let mut state = lanes.state();
        state.handed += 1;
        state.parts.remove(&index);
        drop(state);
        lanes.changed.notify_all();
    }
    Ok(())
}
