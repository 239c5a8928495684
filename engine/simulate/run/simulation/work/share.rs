//! Share of a run that is done, by the cost of its rows and not by their number.

use crate::sampling::{Lattice, ProjectedBounds};
use beamlet_core::numbers;
use std::cell::Cell;
use std::ops::Range;

/// Cost of a patch outside the shadow of the sample, over one inside.
const BLANK: f64 = 0.05;

/// Work of a run, in views with the sample: these cost about the same each.
#[derive(Debug, Default)]
pub(super) struct Share {
    /// Cost of views without sample.
    blank: f64,
    done: f64,
    all: f64,
    /// Work of the current view, and of its rows.
    view: f64,
    rows: RowWeights,
    rows_done: f64,
    rows_all: f64,
    /// The greatest share so far: rows that are sampled twice, beside a band, take none back.
    most: Cell<f64>,
}

/// Cost of rows of a view, from the first of them on.
#[derive(Debug, Default)]
struct RowWeights {
    first: i64,
    weights: Vec<f64>,
}

impl RowWeights {
    fn of(lattice: &Lattice, shadows: &[ProjectedBounds], rows: Range<i64>) -> Self {
        let columns = (lattice.beamlets.end - lattice.beamlets.start) as f64;
        let mut reached = vec![[i64::MAX, i64::MIN]; numbers::narrow(rows.end - rows.start)];
        for shadow in shadows {
            let [own, beamlets] = shadow.patches(lattice);
            for row in own.start.max(rows.start)..own.end.min(rows.end) {
                let [first, end] = &mut reached[numbers::narrow::<usize>(row - rows.start)];
                (*first, *end) = ((*first).min(beamlets.start), (*end).max(beamlets.end));
            }
        }
        let weight = |[first, end]: [i64; 2]| {
            BLANK * columns + if first < end { (end - first) as f64 } else { 0.0 }
        };
        Self { first: rows.start, weights: reached.into_iter().map(weight).collect() }
    }

    fn sum(&self, rows: &Range<i64>) -> f64 {
        let at = |row: i64| usize::try_from(row - self.first).unwrap_or(0).min(self.weights.len());
        self.weights[at(rows.start)..at(rows.end)].iter().sum()
    }
}

impl Share {
    /// For a run of `blank` views without and `sample` views with the sample; `traced`: rays are traced
    /// for the latter.
    pub(super) fn new([blank, sample]: [usize; 2], traced: bool) -> Self {
        let cost = if traced { BLANK } else { 1.0 };
        Self { blank: cost, all: cost * blank as f64 + sample as f64, ..Self::default() }
    }

    /// Begins a view with these shadows, none where there is no sample. `bands`: the rows that are
    /// sampled together, some of them several times.
    pub(super) fn begin(
        &mut self,
        lattice: &Lattice,
        shadows: &[ProjectedBounds],
        sample: bool,
        bands: &[Range<i64>],
    ) {
        self.end_view();
        self.view = if sample { 1.0 } else { self.blank };
        let ends = bands.iter().fold([i64::MAX, i64::MIN], |[first, end], band| {
            [first.min(band.start), end.max(band.end)]
        });
        self.rows = RowWeights::of(lattice, shadows, ends[0]..ends[1].max(ends[0]));
        self.rows_all = bands.iter().map(|band| self.rows.sum(band)).sum();
    }

    fn end_view(&mut self) {
        self.done += self.view;
        (self.view, self.rows_done) = (0.0, 0.0);
    }

    /// These rows of the view are done.
    pub(super) fn finish(&mut self, rows: &Range<i64>) {
        self.rows_done += self.rows.sum(rows);
    }

    /// The share of the run that is done, with this part of `rows` that are in work.
    pub(super) fn with(&self, rows: &Range<i64>, part: f64) -> f64 {
        let of_view = (self.rows_done + part * self.rows.sum(rows)) / self.rows_all.max(1e-9);
        let share = (self.done + self.view * of_view.min(1.0)) / self.all.max(1e-9);
        self.most.set(self.most.get().max(share.min(1.0)));
        self.most.get()
    }
}
