//! The table of `--profile`: the work that the device was given.

use crate::args::ProfileArguments;
use crate::printed::Printed;
use beamlet::{Engine, Profile, RunProfile, Traffic};
use std::io::Write;

/// Rows of the traffic, by name.
fn traffic_rows(all: &Profile, run: Option<&RunProfile>) -> Vec<(String, Traffic)> {
    let mut rows = Vec::new();
    if let Some(run) = run {
        rows.push(("before the views".to_owned(), run.before_views));
        rows.push(("first view".to_owned(), run.first_view));
        let later = run.views.saturating_sub(1);
        if later > 0 {
            rows.push((format!("{later} later views"), run.later_views));
        }
    }
    rows.push(("in all".to_owned(), all.traffic));
    rows
}

/// The table as text: submissions and bytes, then dispatches by kernel, those with most time or most
/// groups first.
fn table(all: &Profile, run: Option<&RunProfile>) -> String {
    let mut text = format!(
        "{:<24}{:>12}{:>10}{:>14}{:>14}{:>10}{:>14}\n",
        "device", "submissions", "waits", "MB to it", "MB from it", "buffers", "MB of them"
    );
    for (name, traffic) in traffic_rows(all, run) {
        text += &format!(
            "{name:<24}{:>12}{:>10}{:>14.3}{:>14.3}{:>10}{:>14.3}\n",
            traffic.submissions,
            traffic.waits,
            traffic.bytes_to_device as f64 * 1e-6,
            traffic.bytes_to_host as f64 * 1e-6,
            traffic.buffers,
            traffic.buffer_bytes as f64 * 1e-6
        );
    }
    text += &format!(
        "{:<24}{:>12}{:>10}{:>14}{:>14}\n",
        "kernel", "dispatches", "s", "mean groups", "most groups"
    );
    let mut kernels: Vec<_> = all.kernels.iter().collect();
    kernels.sort_by(|(_, a), (_, b)| {
        let time = |of: &beamlet::KernelProfile| of.seconds.unwrap_or(0.0);
        time(b).total_cmp(&time(a)).then(b.groups.cmp(&a.groups))
    });
    for (name, of) in kernels {
        let seconds = of.seconds.map_or("unknown".to_owned(), |seconds| format!("{seconds:.3}"));
        text += &format!(
            "{name:<24}{:>12}{seconds:>10}{:>14.1}{:>14}\n",
            of.dispatches,
            of.mean(),
            of.largest
        );
    }
    text
}

impl ProfileArguments {
    /// Writes the table of a device to stderr, where it is wanted.
    pub(crate) fn show(self, engine: &Engine, run: Option<&RunProfile>) {
        if self.profile {
            let _ = write!(Printed::new(std::io::stderr()), "{}", table(&engine.profile(), run));
        }
    }
}
