//! Progress on stderr: a bar for people, now and then a line for log files, or nothing.

use crate::args::Messages;
use beamlet::geometry::{LoadProgress, LoadStep};
use beamlet::{Progress, ViewProgress, printed, scene::Exposure};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Time between lines where stderr is not a terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// The bar of a run as a whole,
const WHOLE: &str = "{bar:30} {percent:>3} %  {msg}  {elapsed} gone, {eta} left";
/// and of one step of many.
const PART: &str = "{bar:30} {percent:>3} %  {msg}  {elapsed} gone";

/// Where the progress of a run goes.
#[derive(Debug)]
pub(crate) struct Reporter {
    to: Destination,
    /// Whether objects are loaded, and not yet views made: each has a time of its own.
    loading: bool,
}

#[derive(Debug)]
enum Destination {
    Nowhere,
    /// A bar that is drawn again and again.
    Bar(ProgressBar),
    /// Lines.
    Lines {
        began: Instant,
        last: Instant,
    },
}

impl Reporter {
    /// Quiet: none. Log messages and a bar would overwrite each other: verbose takes lines.
    pub(crate) fn new(Messages { quiet, verbose }: Messages) -> Self {
        let now = Instant::now();
        let to = if quiet {
            Destination::Nowhere
        } else if verbose || !std::io::stderr().is_terminal() {
            Destination::Lines { began: now, last: now }
        } else {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            bar.set_style(style(WHOLE));
            Destination::Bar(bar)
        };
        Self { to, loading: false }
    }

    pub(crate) fn update(&mut self, progress: Progress) {
        match progress {
            Progress::Loading(loading) => {
                self.turn_to(true);
                let message = words(&loading);
                // Where the work is not known, the bar stays empty.
                self.show(loading.done, loading.total.max(1), |_| message.clone());
            }
            Progress::Views(ViewProgress { rows_done, rows_total, view, rays, .. }) => {
                self.turn_to(false);
                let view = match view {
                    Exposure::Flat => "flat".to_owned(),
                    Exposure::Dark => "dark".to_owned(),
                    Exposure::Sample(index) => format!("view {index}"),
                };
                let message = |elapsed| format!("{view}  {}", rate(rays, elapsed));
                self.show(rows_done, rows_total, message);
            }
            _ => {}
        }
    }

    /// Progress that is counted in rows alone.
    pub(crate) fn rows(&mut self, done: u64, total: u64) {
        self.show(done, total, |_| format!("row {done} of {total}"));
    }

    /// Starts the time again where views follow the loading of objects.
    fn turn_to(&mut self, loading: bool) {
        if self.loading == loading {
            return;
        }
        self.loading = loading;
        match &mut self.to {
            Destination::Nowhere => {}
            Destination::Bar(bar) => {
                bar.reset();
                bar.set_style(style(if loading { PART } else { WHOLE }));
            }
            Destination::Lines { began, .. } => *began = Instant::now(),
        }
    }

    fn show(&mut self, done: u64, total: u64, message: impl Fn(Duration) -> String) {
        match &mut self.to {
            Destination::Nowhere => {}
            Destination::Bar(bar) => {
                bar.set_length(total);
                bar.set_position(done);
                bar.set_message(message(bar.elapsed()));
            }
            Destination::Lines { began, last } => {
                if last.elapsed() < BETWEEN_LINES {
                    return;
                }
                *last = Instant::now();
                let gone = began.elapsed();
                let share = done as f64 / total.max(1) as f64;
                let left = match self.loading {
                    true => String::new(),
                    false => format!(", {:.0} s left", left(gone, share)),
                };
                let _ = writeln!(
                    std::io::stderr(),
                    "{:5.1} %  {}  {:.0} s gone{left}",
                    100.0 * share,
                    message(gone),
                    gone.as_secs_f64(),
                );
            }
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if let Destination::Bar(bar) = &self.to {
            bar.finish_and_clear();
        }
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// What is in work of the objects.
fn words(loading: &LoadProgress) -> String {
    let verb = match loading.step {
        LoadStep::Reading => "reading",
        LoadStep::Joining => "joining vertices of",
        LoadStep::Checking => "checking",
        LoadStep::Nesting => return "looking for objects that meet".to_owned(),
        LoadStep::Comparing => return "measuring where objects meet".to_owned(),
        LoadStep::Cutting => return "cutting objects that overlap".to_owned(),
        _ => "loading",
    };
    let name = printed::line(&loading.object);
    let place = match loading.objects {
        1 => String::new(),
        objects => format!(" ({} of {objects} done)", loading.objects_done),
    };
    format!("{verb} \"{name}\"{place}")
}

/// Seconds that are left if what is to come goes as fast as what is done.
fn left(gone: Duration, share: f64) -> f64 {
    if share > 0.0 { gone.as_secs_f64() * (1.0 / share - 1.0) } else { 0.0 }
}

fn rate(rays: u64, elapsed: Duration) -> String {
    format!("{:.2} Mray/s", rays as f64 / 1e6 / elapsed.as_secs_f64().max(1e-3))
}
