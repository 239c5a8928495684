//! Cost and errors of the light of lines, from a sparse sample of the scene: patches spread over views, rows and columns
//! are sampled and illuminated as in a run, and represent the others.

use super::Pose;
use super::blank::STEPS;
use super::lines::Lines;
use crate::lines::cells_at_once;
use crate::run::RunEstimate;
use crate::sampling::{self, CellBatch, Responses, RowsCost};
use crate::trace::Tracer;
use beamlet_core::random::GOLDEN;
use beamlet_core::{Result, numbers};
use beamlet_files::AuditedError;
use std::collections::HashMap;
use std::ops::Range;
use std::time::Instant;

/// Rows of a view that are surveyed together: as many share lines at their borders in a run.
const ROWS: i64 = 4;
/// Largest number of looks.
const MOST_LOOKS: u32 = 24;
/// Least number of looks, whatever the time.
const LEAST_LOOKS: u32 = 10;
/// Seconds after which no further look is taken, and no further block is audited.
const SECONDS: f64 = 1.0;
/// Patches that the first look samples.
const FIRST_PATCHES: f64 = 64.0;
/// Fewest and most patches of a look.
const PATCHES: [f64; 2] = [64.0, 256.0];
/// Seconds in which as many patches of few bodies are sampled, and patches of a block are audited.
const SECONDS_OF_A_LOOK: f64 = 0.15;
/// Most blocks of rows of which patches are audited, and least number, whatever the time.
const AUDITED_BLOCKS: u32 = 8;
const LEAST_AUDITED: u32 = 4;
/// Fewest and most audited patches of a block of rows. A block has at most twice as many as the one before, whose patches
/// may have been faster.
const AUDITED_PATCHES: [f64; 2] = [2.0, 8.0];

/// Look at a view.
struct Look {
    /// Seconds for finding the shadows of a view.
    once: f64,
    /// Cost of all rows that a shadow reaches.
    cost: RowsCost,
}

/// Block of rows that stands for a part of a view.
struct Block {
    rows: Range<i64>,
    /// Rows of the part, for each of the block.
    share: f64,
}

impl Block {
    /// The block of a part of a view that a look takes; none of no rows.
    fn of(part: Range<i64>, look: u32) -> Option<Self> {
        let count = part.end - part.start;
        let blocks = (count + ROWS - 1) / ROWS;
        let number = numbers::whole::<i64>(radical_inverse(look) * blocks as f64);
        let first = part.start + number * ROWS;
        let rows = first..(first + ROWS).min(part.end);
        let share = count as f64 / (rows.end - rows.start) as f64;
        (count > 0).then_some(Self { rows, share })
    }
}

/// Patches of a look.
#[derive(Debug, Clone, Copy)]
struct Choice {
    /// Most of them.
    most: f64,
    /// Place of the first, as a share of their distance.
    start: f64,
    /// Mask steps that are not illuminated, for each that is.
    steps_left_out: f64,
}

impl Lines<'_> {
    /// Estimates rays, time and errors of a run.
    pub(super) fn survey(&mut self) -> Result<RunEstimate> {
        let left_out = self.cells.leave_out_steps(STEPS);
        let blank = self.cells.blank_seconds(self.simulation, left_out)?;
        let looks = self.looks(left_out)?;
        let views = self.simulation.pose_count();
        let all = looks.iter().fold(RowsCost::default(), |sum, look| sum.and(&look.cost));
        let once: f64 = looks.iter().map(|look| look.once).sum();
        let mean = all.times(1.0 / looks.len().max(1) as f64);
        let seconds = once / looks.len().max(1) as f64 + mean.seconds;
        let cells_per_patch = all.cells / all.patches.max(1.0);
        Ok(RunEstimate {
            rays_per_view: mean.rays,
            rays: mean.rays * views,
            lines: views * mean.lines,
            seconds: views * seconds + (views + 1.0) * blank,
            cells_at_once: cells_at_once(mean.patches, cells_per_patch),
            patches_sampled: all.sampled,
            sampling_error: self.audit()?,
        })
    }

    /// Measured error of sampling of some patches of recorded rows, spread over views and rows.
    fn audit(&mut self) -> Result<Option<AuditedError>> {
        // Sums of squared errors, in squared tolerances, and patches of each block.
        let mut blocks: Vec<[f64; 2]> = Vec::new();
        let begin = Instant::now();
        let [mut most, _] = AUDITED_PATCHES;
        for number in 0..AUDITED_BLOCKS {
            if number >= LEAST_AUDITED && begin.elapsed().as_secs_f64() > SECONDS {
                break;
            }
            let turn = (f64::from(number) * GOLDEN + 0.5).fract();
            let pose = numbers::whole::<u32>(turn * self.simulation.pose_count());
            let pose = self.simulation.pose(pose);
            let all = self.simulation.shadow_rows(&pose.shadows);
            let [low, high] = [all.start.max(0), all.end.min(self.simulation.grid_rows())];
            let first = low + numbers::whole::<i64>(turn * (high - low).max(0) as f64);
            let rows = first..(first + ROWS).min(high);
            if rows.is_empty() {
                continue;
            }
            let band = self.begin_band(rows.start)?;
            let Self { tracer, simulation, .. } = self;
            let responses = Responses::new(vec![simulation.response(pose.view)]);
            let mut view = simulation.pose_context(&pose, &responses);
            view.budget.audit = 1.0;
            let block = Instant::now();
            let chosen = (most, turn);
            let audited = sampling::count_patches(&view, tracer, rows, &band, chosen)?.audit.all();
            if audited.patches > 0 {
                blocks.push([audited.squares()[0], audited.patches as f64]);
                let each = block.elapsed().as_secs_f64() / audited.patches as f64;
                let [fewest, all] = AUDITED_PATCHES;
                most = (SECONDS_OF_A_LOOK / each).clamp(fewest, all.min(2.0 * most));
            }
        }
        let sum = |of: &dyn Fn(&[f64; 2]) -> f64| blocks.iter().map(of).sum::<f64>();
        let patches = sum(&|[_, patches]| *patches);
        let of_squares = sum(&|[_, patches]| patches * patches);
        let square = sum(&|[squares, _]| *squares) / patches;
        // Blocks differ by their patches, and by the places of rays.
        let apart = sum(&|[squares, patches]| (squares - square * patches).powi(2));
        let error = (apart / (patches * patches - of_squares)).sqrt();
        let tolerance = self.simulation.budget.tolerance;
        Ok((blocks.len() > 1)
            .then(|| AuditedError::of([square, error], numbers::whole(patches), tolerance)))
    }

    /// Looks at rows of views, spread over both.
    fn looks(&mut self, steps_left_out: f64) -> Result<Vec<Look>> {
        let mut looks = Vec::new();
        // Costs of parts of views by their blocks: view and first row.
        let mut known: HashMap<(u32, i64), RowsCost> = HashMap::new();
        let begin = Instant::now();
        let mut patches = FIRST_PATCHES;
        for number in 0..MOST_LOOKS {
            if number >= LEAST_LOOKS && begin.elapsed().as_secs_f64() > SECONDS {
                break;
            }
            let view = (f64::from(number) * GOLDEN + 0.5).fract() * self.simulation.pose_count();
            let view = numbers::whole::<u32>(view);
            let shadow = Instant::now();
            let pose = self.simulation.pose(view);
            let shadow_seconds = shadow.elapsed().as_secs_f64();
            let all = self.simulation.shadow_rows(&pose.shadows);
            // Rows beside the detector take few rays: they are looked at apart.
            let inner = all.start.max(0)..all.end.min(self.simulation.grid_rows());
            let inner = if inner.is_empty() { all.start..all.start } else { inner };
            let parts = [inner.clone(), all.start..inner.start, inner.end..all.end];
            let blocks: Vec<Block> =
                parts.into_iter().filter_map(|part| Block::of(part, number)).collect();
            if blocks.is_empty() {
                continue;
            }
            let are_known = blocks.iter().all(|it| known.contains_key(&(view, it.rows.start)));
            let start = (f64::from(number) * GOLDEN).fract();
            let mut cost = RowsCost::default();
            for Block { rows, share } in blocks {
                let place = (view, rows.start);
                // Beside a new block known ones are looked at again, at other patches, while there is time.
                let is_enough = are_known || begin.elapsed().as_secs_f64() > SECONDS;
                if let Some(of_rows) = known.get(&place).filter(|_| is_enough) {
                    cost = cost.and(of_rows);
                    continue;
                }
                let choice = Choice { most: patches, start, steps_left_out };
                let of_rows = self.look(&pose, rows, choice)?.times(share);
                cost = cost.and(&of_rows);
                known.insert(place, RowsCost { sampled: 0.0, spent: 0.0, ..of_rows });
            }
            if cost.sampled > 0.0 {
                let each = (cost.spent / cost.sampled).max(1e-9);
                patches = (SECONDS_OF_A_LOOK / each).clamp(PATCHES[0], PATCHES[1]);
            }
            looks.push(Look { once: shadow_seconds, cost });
        }
        Ok(looks)
    }

    fn look(&mut self, pose: &Pose, rows: Range<i64>, choice: Choice) -> Result<RowsCost> {
        let band = self.begin_band(rows.start)?;
        let Self { cells, tracer, simulation, .. } = self;
        let blur_rows = simulation.lattice.blur_rows;
        let lit = band.start - blur_rows..band.end + blur_rows;
        let responses = Responses::new(vec![simulation.response(pose.view)]);
        let mut view = simulation.pose_context(pose, &responses);
        view.budget.audit = 0.0;
        let mut add = |tracer: &mut Tracer, batch: &CellBatch| {
            let before = cells.illumination;
            cells.add(Some(tracer), batch)?;
            Ok(choice.steps_left_out * (cells.illumination - before))
        };
        let Choice { most, start, .. } = choice;
        sampling::survey_rows(&view, tracer, rows, &lit, (most, start), &mut add)
    }

    /// Begins the sums of the band with a row of the grid; rows of the band.
    fn begin_band(&mut self, row: i64) -> Result<Range<i64>> {
        let band = self.simulation.band_of(row);
        self.cells.begin(&band, &[0])?;
        Ok(band.start.into()..band.end.into())
    }
}

/// Van der Corput's sequence in base 2: evenly spread over [0, 1) from the first numbers on.
fn radical_inverse(number: u32) -> f64 {
    f64::from(number.reverse_bits()) / 2_f64.powi(32)
}
