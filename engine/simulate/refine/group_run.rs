//! The refinement of a group of patches: submissions until nothing is left to split, or no room.

use super::buffers::Buffers;
use super::group::Group;
use super::kernels::Stages;
use super::spectrum::Spectrum;
use crate::sampling::CellBatch;
use crate::trace::{MadeRays, Tracer};
use beamlet_core::Result;
use beamlet_core::tally::Tally;
use beamlet_gpu::{Buffer, Device, Download, Recorder, Upload};
use beamlet_interface::{
    HEAD_BASE, HEAD_CELLS, HEAD_EXACT, HEAD_FAR, HEAD_LANDED_OFF, HEAD_LEFT, HEAD_LISTED,
    HEAD_LOST, HEAD_NEAR, HEAD_PHASE, HEAD_RAYS, HEAD_RECTANGLES, HEAD_REPEATED, HEAD_ROOM,
    HEAD_WORDS, PHASE_DONE, PHASE_FULL, REPORT_BEYOND, REPORT_MOST, REPORT_PATCHES, REPORT_RAYS,
    REPORT_SQUARES, REPORT_WORDS, REPORT_WORST, RefineParams, RefinedLeaf, RefinedRow,
    RepeatedRectangle, TALLY_COUNTERS,
};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Turns of a submission.
const TURNS: u32 = 16;

/// Cells that are on the device.
#[derive(Debug, Clone)]
pub(crate) struct MadeCells<'b> {
    pub(crate) parts: &'b Buffer,
    pub(crate) cell_rows: &'b Buffer,
    pub(crate) cells: &'b Buffer,
    /// Parts whose light lands near, and parts whose light lands farther off, by list.
    pub(crate) lists: Vec<[Range<u32>; 2]>,
    /// Cells of rays that were traced exactly at each energy, by list.
    pub(crate) repeated: Vec<CellBatch>,
}

/// Counts of refinement, besides light.
#[derive(Debug, Default)]
pub(crate) struct Refined {
    pub(crate) tally: Tally,
    /// Cells whose light lands too far off to follow.
    pub(crate) landed_off: u64,
}

/// Inputs of a group, for the device.
pub(super) struct GroupInputs<'g> {
    pub(super) group: &'g Group,
    pub(super) params: [RefineParams; 1],
    pub(super) rows: Vec<RefinedRow>,
    /// Words of the sums of errors.
    pub(super) sums: u64,
    /// Bytes of the sums of leaked light.
    pub(super) merged: u64,
}

/// A group in refinement: counts as the device left them.
pub(super) struct GroupRun<'b> {
    buffers: &'b Buffers,
    /// Energies, under a spectrum.
    spectrum: Option<&'b Spectrum<'b>>,
    /// Cells of the last submission by list, and of all.
    counts: Vec<u32>,
    landed_off: u64,
    /// Rays of the last submission were traced again.
    repeats: bool,
    head: [u32; HEAD_WORDS as usize],
    report: [u32; REPORT_WORDS as usize],
    begun: bool,
}

impl<'b> GroupRun<'b> {
    pub(super) fn new(
        buffers: &'b Buffers,
        spectrum: Option<&'b Spectrum<'b>>,
        group: &Group,
    ) -> Self {
        let mut head = [0_u32; HEAD_WORDS as usize];
        head[HEAD_RECTANGLES as usize] = group.all_base;
        head[HEAD_LISTED as usize] = group.own_base;
        head[HEAD_RAYS as usize] = group.own_base;
        let counts = vec![0; spectrum.map_or(0, Spectrum::count_words)];
        Self {
            buffers,
            spectrum,
            counts,
            landed_off: 0,
            repeats: false,
            head,
            report: [0; REPORT_WORDS as usize],
            begun: false,
        }
    }

    fn at(&self, word: u32) -> u32 {
        self.head[word as usize]
    }

    /// True if there was no room for all rectangles.
    pub(super) fn is_full(&self) -> bool {
        self.at(HEAD_PHASE) == PHASE_FULL
    }

    pub(super) fn is_over(&self) -> bool {
        self.is_full() || self.at(HEAD_PHASE) == PHASE_DONE
    }

    /// Rectangles so far.
    pub(super) fn rectangles(&self) -> u32 {
        self.at(HEAD_RECTANGLES)
    }

    /// One submission of at most `work` rays and rectangles; the time that it took, and its work.
    pub(super) fn submit(
        &mut self,
        device: &Arc<Device>,
        inputs: &GroupInputs<'_>,
        (stages, tracer, made): (&Stages<'_>, &Tracer, &MadeRays<'_>),
        work: u32,
    ) -> Result<(Duration, u32)> {
        let buffers = self.buffers;
        self.head[HEAD_ROOM as usize] = work;
        for word in [HEAD_NEAR, HEAD_FAR, HEAD_CELLS, HEAD_LANDED_OFF, HEAD_REPEATED] {
            self.head[word as usize] = 0;
        }
        let sent = self.head;
        let is_first = !self.begun;
        // Another walk leaves its counts there.
        let clears_queues = is_first || self.repeats;
        let mut uploads = vec![Upload::new(&buffers.head, 0, &sent)];
        if is_first {
            uploads.push(Upload::new(&buffers.params, 0, &inputs.params));
            uploads.push(Upload::new(&buffers.patches, 0, &inputs.group.patches));
            uploads.push(Upload::new(&buffers.rows, 0, &inputs.rows));
            if !inputs.group.walls.is_empty() {
                uploads.push(Upload::new(&buffers.walls, 0, &inputs.group.walls));
            }
            uploads.extend(self.spectrum.iter().flat_map(|spectrum| spectrum.uploads()));
        }
        let record = |r: &mut Recorder<'_>| {
            if is_first {
                r.fill(&buffers.sums, 0, 4 * inputs.sums, 0);
                r.fill(&buffers.report, 0, u64::from(REPORT_WORDS) * 4, 0);
                buffers.merged.iter().for_each(|merged| r.fill(merged, 0, inputs.merged, 0));
            }
            if clears_queues {
                r.fill(tracer.queues(), 0, tracer.queues().len(), 0);
            }
            let of = (buffers.params.address(), &buffers.head);
            if let Some(spectrum) = self.spectrum {
                r.fill(spectrum.counts(), 0, spectrum.counts().len(), 0);
            }
            for _ in 0..TURNS {
                stages.record_turn(r, of, tracer, made);
            }
            stages.record_end(r, of, self.spectrum.is_some());
        };
        let mut tally = [0; TALLY_COUNTERS];
        let mut downloads = vec![
            Download::new(&buffers.head, 0, &mut self.head),
            Download::new(&buffers.report, 0, &mut self.report),
            tracer.read_tally(&mut tally),
        ];
        if let Some(spectrum) = self.spectrum {
            downloads.push(Download::new(spectrum.counts(), 0, &mut self.counts));
        }
        let time = device.run_with(&uploads, record, &mut downloads)?;
        tracer.take_tally(&tally);
        self.begun = true;
        self.landed_off += u64::from(self.at(HEAD_LANDED_OFF));
        Ok((time, work - self.at(HEAD_ROOM)))
    }

    /// Rectangles of the last submission whose rays are to be traced at each energy.
    pub(super) fn repeated(&mut self, device: &Arc<Device>) -> Result<Vec<RepeatedRectangle>> {
        let count = self.at(HEAD_REPEATED) as usize;
        self.repeats = count > 0;
        let mut found = bytemuck::zeroed_vec(count);
        if let Some(buffer) = self.buffers.repeated.as_ref().filter(|_| count > 0) {
            device.run_with(&[], |_| {}, &mut [Download::new(buffer, 0, &mut found)])?;
        }
        Ok(found)
    }

    /// Adds the rectangles that the last submission listed for the host to `leaves`.
    pub(super) fn add_leaves(
        &self,
        device: &Arc<Device>,
        leaves: &mut Vec<RefinedLeaf>,
    ) -> Result<()> {
        let count = self.at(HEAD_CELLS) as usize;
        if let Some(buffer) = self.buffers.leaves.as_ref().filter(|_| count > 0) {
            let first = leaves.len();
            leaves.resize(first + count, bytemuck::Zeroable::zeroed());
            device.run_with(&[], |_| {}, &mut [Download::new(buffer, 0, &mut leaves[first..])])?;
        }
        Ok(())
    }

    /// The cells that the last submission made, if any, besides `repeated` ones.
    pub(super) fn cells(&self, repeated: Vec<CellBatch>) -> Option<MadeCells<'b>> {
        let (near, far) = (self.at(HEAD_NEAR), self.at(HEAD_FAR));
        let first = self.buffers.sizes.cells;
        let mut lists = vec![[0..near, first..first + far]];
        if self.spectrum.is_some() {
            let (by_list, _) = self.counts.split_at(self.counts.len() - 1);
            let mut end = 0;
            let mut next = |count: u32| {
                end += count;
                end - count..end
            };
            lists = by_list.chunks(2).map(|of| [next(of[0]), next(of[1])]).collect();
        }
        let parts: u32 = lists.iter().flatten().map(|part| part.end - part.start).sum();
        (parts > 0 || !repeated.is_empty()).then_some(MadeCells {
            parts: &self.buffers.parts,
            cell_rows: &self.buffers.cell_rows,
            cells: &self.buffers.cells,
            lists,
            repeated,
        })
    }

    /// Hands the counts of rays to the tracer, and returns the others.
    pub(super) fn finish(&self, tracer: &Tracer) -> Refined {
        let rays = if self.is_full() { self.at(HEAD_BASE) } else { self.at(HEAD_RAYS) };
        let left = self.at(HEAD_LEFT) + self.at(HEAD_LOST);
        tracer.count_made([rays, self.at(HEAD_EXACT), left]);
        let of = |word: u32| u64::from(self.report[word as usize]);
        let pair = |word: u32| of(word) | of(word + 1) << 32;
        Refined {
            tally: Tally {
                patches: of(REPORT_PATCHES),
                patch_rays: pair(REPORT_RAYS),
                most_patch_rays: of(REPORT_MOST),
                error_squares: pair(REPORT_SQUARES),
                worst_error: of(REPORT_WORST),
                beyond_tolerance: of(REPORT_BEYOND),
                ..Tally::default()
            },
            landed_off: self.landed_off,
        }
    }
}
