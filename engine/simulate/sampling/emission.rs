//! Cells of patches: pieces of lines and rays as rectangles, and rows of cells made of these (`cell_rows.rs`).

use super::cell_batch::CellBatch;
use super::rectangle::{PatchPlace, Rectangle};
use super::view_context::ViewContext;
use crate::lines::Sampled;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::single;
use rayon::prelude::*;
use std::ops::Range;

/// Makes cells.
pub(super) struct Emitter<'a> {
    pub(crate) view: &'a ViewContext<'a>,
    /// Rows whose light is recorded.
    pub(super) recorded_rows: &'a Range<i64>,
    /// Analyser over detector distance.
    pub(crate) ratio: f32,
    /// Distance from analyser to detector, m.
    pub(super) gap: f32,
    /// Row pitch on the detector, m.
    pub(super) row_pitch: f32,
}

impl<'a> Emitter<'a> {
    pub(super) fn new(view: &'a ViewContext<'a>, recorded_rows: &'a Range<i64>) -> Self {
        let optics = view.optics;
        Self {
            view,
            recorded_rows,
            ratio: single(optics.analyser / optics.detector.distance),
            gap: single(optics.gap()),
            row_pitch: single(optics.detector.pitch[1]),
        }
    }

    /// The cells of patches, one for each piece of a line or ray, and the places (column, row) of patches that miss the
    /// sample, or whose light misses the recorded rows.
    pub(super) fn cells(
        &self,
        tracer: &mut Tracer,
        sampled: &Sampled,
    ) -> Result<(CellBatch, Vec<(i64, i64)>)> {
        let Sampled { lines, even, .. } = sampled;
        let of_lines = lines.iter().map(|it| PatchPlace { beamlet: it.beamlet, row: it.row });
        let of_even = even.iter().map(|it| PatchPlace { beamlet: it.beamlet, row: it.row });
        let patches: Vec<PatchPlace> = of_lines.chain(of_even).collect();
        let cancel = tracer.cancel().clone();
        let of_lines = lines.par_iter().map(|it| {
            cancel.check()?;
            Ok(self.landing(it.row, join_empty(self.rectangles_of_lines(it))))
        });
        let of_even = even
            .par_iter()
            .map(|it| Ok(self.landing(it.row, join_empty(self.rectangles_of_rays(it)))));
        let rectangles = of_lines.chain(of_even).collect::<Result<Vec<_>>>()?;
        let (rectangles, landed_off): (Vec<Vec<Rectangle>>, Vec<u64>) =
            rectangles.into_iter().unzip();
        let moments = match self.view.recording {
            Some(recording) => recording.record(tracer, &rectangles)?,
            None => vec![Vec::new(); patches.len()],
        };
        let mut empty = Vec::new();
        let first = self.view.lattice.beamlets.start;
        for (patch, rectangles) in patches.iter().zip(&rectangles) {
            if rectangles.is_empty() {
                empty.push((patch.beamlet - first, patch.row));
            }
        }
        let words = self.view.recording.as_ref().map_or(0, |recording| recording.words);
        let parts: Vec<CellBatch> = (patches, rectangles, moments)
            .into_par_iter()
            .map(|(patch, rectangles, moments)| self.cell_rows(patch, &rectangles, &moments, words))
            .collect();
        let landed_off = landed_off.iter().sum();
        Ok((CellBatch { landed_off, ..CellBatch::concat(parts) }, empty))
    }
}

/// Empty neighbours as one; none where all are empty.
fn join_empty(rectangles: Vec<Rectangle>) -> Vec<Rectangle> {
    if rectangles.iter().all(Rectangle::is_empty) {
        return Vec::new();
    }
    let mut joined: Vec<Rectangle> = Vec::with_capacity(rectangles.len());
    for rectangle in rectangles {
        match joined.last_mut() {
            Some(last) if rectangle.is_empty() && last.is_empty() && last.is_before(&rectangle) => {
                last.x[1] = rectangle.x[1];
            }
            _ => joined.push(rectangle),
        }
    }
    joined
}
