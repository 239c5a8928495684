//! Rectangles that slant as the silhouettes of their patch do.

use super::super::alignment::Scanlines;
use super::super::patch::{Patch, no_silhouette_between};
use super::super::patch_error::KnownErrors;
use super::{PatchWork, Refiner};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use rayon::prelude::*;

/// Most silhouettes of a patch that its rectangles are aligned with.
const MOST_ALIGNED: u32 = 8;
/// Most that rectangles slant over a row, periods.
const MOST_SHEAR: f32 = 2.0;
/// Factor on the curvature of silhouettes that three scanlines show.
const BOW: f32 = 1.5;
/// Lines of rectangles that a patch with silhouettes begins with.
const LINES: u32 = 3;

impl Refiner<'_> {
    /// Lets the rectangles of patches with silhouettes slant as these do.
    pub(super) fn align(&self, tracer: &mut Tracer, work: &mut [PatchWork]) -> Result<()> {
        let period = single(self.view.lattice.period);
        let base = self.estimator.base.base;
        let slants = |work: &&mut PatchWork| {
            let few = |count: u32| count <= MOST_ALIGNED;
            work.narrow.is_empty()
                && !self.estimator.counts_little(&work.patch)
                && self.silhouettes(&work.patch).is_some_and(few)
        };
        let mut slanting: Vec<(&mut PatchWork, Scanlines)> = work
            .par_iter_mut()
            .filter(slants)
            .map(|work| (work, Scanlines::new(period, base[0])))
            .collect();
        self.trace_rounds(tracer, &mut slanting)?;
        // Patches with silhouettes begin on three lines whether these slant or not: narrow
        // rectangles learn nothing from the rows above and below.
        for (work, lines) in &mut slanting {
            let most = MOST_SHEAR * period;
            let slant = lines.slant().filter(|slant| slant.shear.abs() <= most);
            let shear = slant.map_or(0.0, |slant| slant.shear);
            let width = period + shear.abs();
            let columns =
                numbers::whole::<u32>(f64::from((width * base[0] as f32 / period).ceil()));
            let base = [columns, LINES * base[1]];
            let Patch { beamlet, row, .. } = work.patch;
            work.known_errors = KnownErrors::default();
            work.patch = Patch::sheared(beamlet, row, 0.5 * width, shear, base);
            work.patch.bow = slant.map_or(0.0, |slant| BOW * slant.bow);
            work.pending.extend(0..numbers::count(work.patch.nodes.len()));
        }
        self.trace_pending(tracer, work)
    }

    /// Silhouettes between base rays side by side, if any in the patch or around it.
    fn silhouettes(&self, patch: &Patch) -> Option<u32> {
        let mut count = None;
        for node in &patch.nodes {
            let neighbours = self.estimator.neighbours(patch, node);
            for (index, found) in neighbours.iter().enumerate() {
                if found
                    .as_ref()
                    .is_some_and(|found| !no_silhouette_between(&found.result, &node.result))
                {
                    count = Some(count.unwrap_or(0) + u32::from(index == 0));
                }
            }
        }
        count
    }
}
