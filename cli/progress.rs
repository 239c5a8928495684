//! Progress on stderr: a bar with a clock for people, now and then a line for log files, or nothing.
//!
//! Content and time of the display are separate: a thread draws it each second, or writes a line,
//! whatever the work does meanwhile.

mod estimate;

use crate::args::Messages;
use crate::numbers;
use beamlet::cli_support::printed;
use beamlet::geometry::{LoadProgress, LoadStep};
use beamlet::{Progress, ViewProgress, scene::Exposure};
use estimate::Estimate;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt::Write as _;
use std::io::{IsTerminal, Write as _};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Time between two drawings on a terminal.
const TICK: Duration = Duration::from_secs(1);
/// Time between two lines elsewhere, unless `BEAMLET_PROGRESS_SECONDS` sets it.
const BETWEEN_LINES: Duration = Duration::from_secs(30);
const SECONDS: &str = "BEAMLET_PROGRESS_SECONDS";

/// Display of work with a known share.
const COUNTED: &str = "{bar:30} {percent:>3} %  {msg}  {clock}";
/// Display of work without a known share.
const UNCOUNTED: &str = "{spinner} {msg}  {clock}";
/// Positions of the bar.
const LENGTH: u64 = 1000;

/// Where the progress of a command goes.
pub(crate) struct Reporter {
    state: Arc<Mutex<State>>,
    to: Destination,
}

enum Destination {
    Nowhere,
    /// A bar that is drawn again and again.
    Bar(ProgressBar),
    /// Lines, from a thread that ends with the sender.
    Lines(Option<(Sender<()>, JoinHandle<()>)>),
}

/// The current work.
struct State {
    began: Instant,
    phase: Phase,
    message: String,
    /// The share of the work that is done, where it is known.
    share: Option<f64>,
    estimate: Estimate,
    /// Time and rays when the views began.
    views: Option<[f64; 2]>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Other,
    Loading,
    Flat,
    Views,
    Rows,
}

impl Reporter {
    /// Quiet: none. Log messages and a bar would overwrite each other: verbose takes lines.
    pub(crate) fn new(Messages { quiet, verbose }: Messages) -> Self {
        let state = Arc::new(Mutex::new(State {
            began: Instant::now(),
            phase: Phase::Other,
            message: "starting".to_owned(),
            share: None,
            estimate: Estimate::default(),
            views: None,
        }));
        let to = if quiet {
            Destination::Nowhere
        } else if verbose || !std::io::stderr().is_terminal() {
            Destination::Lines(lines(state.clone()))
        } else {
            let bar = ProgressBar::with_draw_target(Some(LENGTH), ProgressDrawTarget::stderr());
            bar.set_style(style(UNCOUNTED, &state));
            // Drawing looks at the state.
            let message = lock(&state).message.clone();
            bar.set_message(message);
            bar.enable_steady_tick(TICK);
            Destination::Bar(bar)
        };
        Self { state, to }
    }

    pub(crate) fn update(&mut self, progress: Progress) {
        match progress {
            Progress::Loading(loading) => {
                let counted = loading.total > 0;
                let share = counted.then(|| loading.done as f64 / loading.total as f64);
                self.show(Phase::Loading, share, |_| words(&loading));
            }
            Progress::Views(ViewProgress { view, rays, share, .. }) => {
                let (phase, view) = match view {
                    Exposure::Flat(0) => (Phase::Flat, "flat".to_owned()),
                    Exposure::Dark(0) => (Phase::Flat, "dark".to_owned()),
                    Exposure::Flat(index) => (Phase::Views, format!("flat {index}")),
                    Exposure::Dark(index) => (Phase::Views, format!("dark {index}")),
                    Exposure::Sample(index) => (Phase::Views, format!("view {index}")),
                };
                self.show(phase, Some(share), |state| {
                    let now = state.began.elapsed().as_secs_f64();
                    let rays = rays as f64;
                    let [began, before] = *state.views.get_or_insert([now, rays]);
                    match (rays - before) / 1e6 / (now - began) {
                        rate if rate.is_finite() && rate > 0.0 => {
                            format!("{view}  {rate:.2} Mray/s")
                        }
                        _ => view,
                    }
                });
            }
            _ => {}
        }
    }

    /// Progress that is counted in rows alone.
    pub(crate) fn rows(&mut self, done: u64, total: u64) {
        let share = done as f64 / total.max(1) as f64;
        self.show(Phase::Rows, Some(share), |_| format!("row {done} of {total}"));
    }

    /// Progress of a reconstruction, in parts of the whole.
    pub(crate) fn volumes(&mut self, done: u64, total: u64) {
        let share = done as f64 / total.max(1) as f64;
        self.show(Phase::Rows, Some(share), |_| "reconstructing".to_owned());
    }

    /// Progress of a sweep.
    pub(crate) fn designs(&mut self, done: usize, in_work: f64, total: usize) {
        let share = (done as f64 + in_work) / total.max(1) as f64;
        self.show(Phase::Rows, Some(share), |_| format!("design {done} of {total}"));
    }

    /// Progress of a join, in views.
    pub(crate) fn joined(&mut self, done: usize, total: usize) {
        let share = done as f64 / total.max(1) as f64;
        self.show(Phase::Rows, Some(share), |_| format!("joining view {done} of {total}"));
    }

    /// Work begins that is not counted.
    pub(crate) fn doing(&mut self, what: &str) {
        self.show(Phase::Other, None, |_| what.to_owned());
    }

    fn show(
        &mut self,
        phase: Phase,
        share: Option<f64>,
        message: impl FnOnce(&mut State) -> String,
    ) {
        let mut state = lock(&self.state);
        let now = state.began.elapsed();
        if state.phase != phase {
            state.phase = phase;
            state.estimate = Estimate::default();
        }
        // What loading takes is known of no step; the flat is quicker than the views.
        if let (Phase::Views | Phase::Rows, Some(share)) = (phase, share) {
            state.estimate.reach(now, share);
        }
        let changes = state.share.is_some() != share.is_some();
        state.share = share;
        state.message = message(&mut state);
        if let Destination::Bar(bar) = &self.to {
            let message = state.message.clone();
            drop(state);
            if changes {
                let template = if share.is_some() { COUNTED } else { UNCOUNTED };
                bar.set_style(style(template, &self.state));
            }
            if let Some(share) = share {
                bar.set_position(numbers::whole(share * LENGTH as f64));
            }
            bar.set_message(message);
        }
    }

    /// Takes the bar away, or ends the lines.
    pub(crate) fn finish(&mut self) {
        match &mut self.to {
            Destination::Nowhere => {}
            Destination::Bar(bar) => bar.finish_and_clear(),
            Destination::Lines(lines) => {
                if let Some((sender, thread)) = lines.take() {
                    drop(sender);
                    let _ = thread.join();
                }
            }
        }
    }
}

impl Drop for Reporter {
    fn drop(&mut self) {
        self.finish();
    }
}

impl State {
    /// The clock, and the remaining time if it is known.
    fn clock(&mut self) -> String {
        let now = self.began.elapsed();
        let seconds = now.as_secs();
        let mut text =
            format!("{}:{:02}:{:02} gone", seconds / 3600, seconds / 60 % 60, seconds % 60);
        if let Some(left) = self.estimate.left(now) {
            let _ = write!(text, ", {}", estimate::words(left));
        }
        text
    }
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes a line now and then.
fn lines(state: Arc<Mutex<State>>) -> Option<(Sender<()>, JoinHandle<()>)> {
    let seconds = std::env::var(SECONDS).ok().and_then(|text| text.parse::<f64>().ok());
    let seconds = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    let between = seconds.filter(|it| !it.is_zero()).unwrap_or(BETWEEN_LINES);
    let (sender, ended) = mpsc::channel::<()>();
    let job = move || {
        while ended.recv_timeout(between) == Err(RecvTimeoutError::Timeout) {
            let mut state = lock(&state);
            let (clock, message) = (state.clock(), &state.message);
            let line = match state.share {
                Some(share) => format!("{:5.1} %  {message}  {clock}", 100.0 * share),
                None => format!("{message}  {clock}"),
            };
            let _ = writeln!(std::io::stderr(), "{line}");
        }
    };
    // Without memory for a thread there are none.
    thread::Builder::new().spawn(job).ok().map(|thread| (sender, thread))
}

fn style(template: &str, state: &Arc<Mutex<State>>) -> ProgressStyle {
    let state = state.clone();
    let clock = move |_: &ProgressState, out: &mut dyn std::fmt::Write| {
        let _ = out.write_str(&lock(&state).clock());
    };
    ProgressStyle::with_template(template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .with_key("clock", clock)
}

/// The current step of loading, in words.
fn words(loading: &LoadProgress) -> String {
    let verb = match loading.step {
        LoadStep::Reading => "reading",
        LoadStep::Packing => "packing instances of",
        LoadStep::Joining => "joining vertices of",
        LoadStep::Checking => "checking",
        LoadStep::Nesting => return "finding objects that touch".to_owned(),
        LoadStep::Cutting => return "cutting objects that overlap".to_owned(),
        LoadStep::Clearance => return "comparing the sample with the masks".to_owned(),
        LoadStep::Building => return "sorting surfaces for rays".to_owned(),
        _ => "loading",
    };
    let name = printed::line(&loading.object);
    let place = match loading.objects {
        1 => String::new(),
        objects => format!(" ({} of {objects} done)", loading.objects_done),
    };
    format!("{verb} \"{name}\"{place}")
}
