//! Progress on stderr: a bar for people, now and then a line for log files, or nothing.

use beamlet::{Progress, stack::View};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Time between lines where stderr is not a terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// Where the progress of a run goes.
#[derive(Debug)]
pub(crate) enum Reporter {
    /// Nowhere.
    Silent,
    /// A bar that is drawn again and again.
    Bar(ProgressBar),
    /// Lines.
    Lines { began: Instant, last: Instant },
}

impl Reporter {
    /// `quiet` for none; log messages and a bar would overwrite each other, so `verbose`
    /// takes lines.
    pub(crate) fn new(quiet: bool, verbose: bool) -> Self {
        if quiet {
            return Self::Silent;
        }
        if verbose || !std::io::stderr().is_terminal() {
            let now = Instant::now();
            return Self::Lines { began: now, last: now };
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let template = "{bar:30} {percent:>3} %  {msg}  {elapsed} gone, {eta} left";
        bar.set_style(
            ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        Self::Bar(bar)
    }

    pub(crate) fn update(&mut self, progress: Progress) {
        let Progress { rows_done, rows_total, view, rays } = progress;
        let view = match view {
            View::Flat => "flat".to_owned(),
            View::Dark => "dark".to_owned(),
            View::Sample(index) => format!("view {index}"),
        };
        self.show(rows_done, rows_total, |elapsed| format!("{view}  {}", rate(rays, elapsed)));
    }

    /// Progress that is counted in rows alone.
    pub(crate) fn rows(&mut self, done: u64, total: u64) {
        self.show(done, total, |_| format!("row {done} of {total}"));
    }

    fn show(&mut self, done: u64, total: u64, message: impl Fn(Duration) -> String) {
        match self {
            Self::Silent => {}
            Self::Bar(bar) => {
                bar.set_length(total);
                bar.set_position(done);
                bar.set_message(message(bar.elapsed()));
            }
            Self::Lines { began, last } => {
                if last.elapsed() < BETWEEN_LINES {
                    return;
                }
                *last = Instant::now();
                let gone = began.elapsed();
                let share = done as f64 / total.max(1) as f64;
                let left = if share > 0.0 { gone.as_secs_f64() * (1.0 / share - 1.0) } else { 0.0 };
                let _ = writeln!(
                    std::io::stderr(),
                    "{:5.1} %  {}  {:.0} s gone, {left:.0} s left",
                    100.0 * share,
                    message(gone),
                    gone.as_secs_f64(),
                );
            }
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

fn rate(rays: u64, elapsed: Duration) -> String {
    format!("{:.2} Mray/s", rays as f64 / 1e6 / elapsed.as_secs_f64().max(1e-3))
}
