//! Share of a run that is done, by the cost of its rows and not by their number.

use std::cell::Cell;
use std::ops::Range;

/// Cost of a row outside the shadow of the sample, over one inside.
const BLANK: f64 = 0.05;

/// Work of a run, in views with the sample: these cost about the same each.
#[derive(Debug, Default)]
pub(super) struct Share {
    /// Cost of views without sample.
    blank: f64,
    /// Cost of the views that are done, and of all.
    done: f64,
    all: f64,
    /// Cost of the current view, and of its rows.
    view: f64,
    shadow: Range<i64>,
    rows_done: f64,
    rows_all: f64,
    /// The greatest share so far: rows that are sampled twice, beside a band, take none back.
    most: Cell<f64>,
}

impl Share {
    /// For a run of `blank` views without and `sample` views with the sample, whose rays cost the more; without a
    /// sample to trace all cost as much.
    pub(super) fn new([blank, sample]: [usize; 2], is_traced: bool) -> Self {
        let cost = if is_traced { BLANK } else { 1.0 };
        Self { blank: cost, all: cost * blank as f64 + sample as f64, ..Self::default() }
    }

    /// Begins a view; `shadow`: rows that the shadow of the sample reaches. `groups`: rows that are sampled together,
    /// some of them several times.
    pub(super) fn begin(
        &mut self,
        is_sample: bool,
        shadow: Range<i64>,
        groups: impl Iterator<Item = Range<i64>>,
    ) {
        self.done += self.view;
        self.view = if is_sample { 1.0 } else { self.blank };
        self.shadow = shadow;
        self.rows_done = 0.0;
        self.rows_all = groups.map(|rows| self.cost(&rows)).sum();
    }

    fn cost(&self, rows: &Range<i64>) -> f64 {
        let shadow = rows.end.min(self.shadow.end) - rows.start.max(self.shadow.start);
        BLANK * (rows.end - rows.start) as f64 + shadow.max(0) as f64
    }

    /// These rows of the view are done.
    pub(super) fn finish(&mut self, rows: &Range<i64>) {
        self.rows_done += self.cost(rows);
    }

    /// The share of the run that is done, with this part of `rows` that are in work.
    pub(super) fn with(&self, rows: &Range<i64>, part: f64) -> f64 {
        let of_view = (self.rows_done + part * self.cost(rows)) / self.rows_all.max(1e-9);
        let share = (self.done + self.view * of_view.min(1.0)) / self.all.max(1e-9);
        self.most.set(self.most.get().max(share.min(1.0)));
        self.most.get()
    }
}
