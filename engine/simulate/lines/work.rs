//! Patches in work. The lines or rays of such a patch are still being chosen, and it waits for its own ones only. A batch has
//! the rays that all patches in work wait for. A patch that is done makes room for a new one.

use super::even::EvenPatch;
use super::light::LitLine;
use super::line::{LinePlace, Piece, Source};
use super::patches::LinePatch;
use std::sync::{Arc, OnceLock};

/// Most patches that are in memory together, by weight.
pub(crate) const PATCHES_AT_ONCE: usize = 1 << 12;
/// Most patches that begin together: lines at borders of these are made once.
const BEGUN_TOGETHER: usize = 1 << 10;
/// Bytes of lines and rays above which no others begin: rays at rims stay in work longest.
const ENOUGH: u64 = 16 << 20;
/// Patches of many bodies, which may have many rays, count as some.
const OF_CROWDED: usize = 64;
/// Pieces of these bytes.
pub(crate) const PIECES_AT_ONCE: u64 = ENOUGH / size_of::<Piece>() as u64;

/// Cells in memory together, of a number of patches with this many each: few patches may have more than is enough, for
/// those at rims stay in work and grow.
pub(crate) fn cells_at_once(patches: f64, each: f64) -> f64 {
    let most = (2.0 * PIECES_AT_ONCE as f64).max((PATCHES_AT_ONCE / OF_CROWDED) as f64 * each);
    (patches.min(PATCHES_AT_ONCE as f64) * each).min(most)
}

/// Light of a line that patches wait for.
pub(super) type AwaitedLine = Arc<OnceLock<Arc<LitLine>>>;

/// A line without its light.
#[derive(Debug)]
pub(super) struct OpenLine {
    pub place: LinePlace,
    pub pieces: Vec<Piece>,
    pub light: AwaitedLine,
}

impl OpenLine {
    /// Places of the rays that it wants, m from the centre of its beamlet.
    pub(super) fn wanted(&self) -> impl Iterator<Item = f64> {
        self.pieces.iter().filter(|it| it.source == Source::Wanted).map(Piece::middle)
    }
}

/// Patches with their lines or rays.
#[derive(Debug, Default)]
pub(super) struct Patches {
    pub lines: Vec<LinePatch>,
    pub even: Vec<EvenPatch>,
}

impl Patches {
    pub(super) const fn count(&self) -> usize {
        self.lines.len() + self.even.len()
    }

    /// Number of them, as they count in memory.
    const fn weight(&self) -> usize {
        self.lines.len() + OF_CROWDED * self.even.len()
    }

    fn bytes(&self) -> u64 {
        let of_lines: u64 = self.lines.iter().map(LinePatch::bytes).sum();
        of_lines + self.even.iter().map(EvenPatch::bytes).sum::<u64>()
    }
}

/// Patches of a part of a view, from the first to the last.
#[derive(Debug)]
pub(super) struct Work {
    /// Places (beamlet, row) of patches that are not begun, the next one last, of few and of many bodies.
    waiting: [Vec<(i64, i64)>; 2],
    pub begun: Patches,
    /// Lines of these that want rays.
    pub open: Vec<OpenLine>,
    /// Lines of these that want none.
    pub ready: Vec<OpenLine>,
    pub done: Patches,
    /// Most patches in memory, by weight.
    most: usize,
    /// Bytes that lines and rays may have.
    room: u64,
}

impl Work {
    /// Patches of few and of many bodies; `room`: bytes of lines and rays.
    pub(super) fn new(mut places: [Vec<(i64, i64)>; 2], room: u64) -> Self {
        places.iter_mut().for_each(|it| it.reverse());
        let (begun, done) = (Patches::default(), Patches::default());
        let (open, ready) = (Vec::new(), Vec::new());
        Self { waiting: places, begun, open, ready, done, most: PATCHES_AT_ONCE, room }
    }

    /// Places of the patches to begin now, of few and of many bodies.
    pub(super) fn next(&mut self) -> [Vec<(i64, i64)>; 2] {
        let free = self.most.saturating_sub(self.begun.weight() + self.done.weight());
        let free = free.min(BEGUN_TOGETHER);
        if 4 * free < self.most.min(BEGUN_TOGETHER) || self.bytes() > self.enough() {
            return Default::default();
        }
        let mut take = |kind: usize, most: usize| {
            let waiting: &mut Vec<_> = &mut self.waiting[kind];
            let mut taken = waiting.split_off(waiting.len().saturating_sub(most));
            taken.reverse();
            taken
        };
        let few = take(0, free);
        let left = free - few.len();
        // A limit may leave room for less than one.
        let alone = usize::from(few.is_empty() && self.begun.count() == 0);
        let many = take(1, (left / OF_CROWDED).max(alone));
        [few, many]
    }

    /// Adds lines: to `open` if they want rays, else to `ready`.
    pub(super) fn add(&mut self, lines: impl Iterator<Item = OpenLine>) {
        for line in lines {
            let wants = line.wanted().next().is_some();
            if wants { &mut self.open } else { &mut self.ready }.push(line);
        }
    }

    /// Moves the patches that want no more lines to `done`.
    pub(super) fn settle(&mut self) {
        let begun = std::mem::take(&mut self.begun.lines);
        let (done, begun): (Vec<_>, Vec<_>) = begun.into_iter().partition(LinePatch::is_done);
        self.begun.lines = begun;
        self.done.lines.extend(done);
    }

    /// True if all patches are done.
    pub(super) fn is_at_end(&self) -> bool {
        self.begun.count() == 0 && self.waiting.iter().all(Vec::is_empty)
    }

    /// True if enough patches are done to hand them over, or all.
    pub(super) fn is_full(&self) -> bool {
        self.is_at_end()
            || 2 * self.done.weight() >= self.most
            || 4 * self.done.bytes() >= self.enough()
    }

    /// Bytes of lines and rays above which no others begin.
    fn enough(&self) -> u64 {
        ENOUGH.min(self.room / 2)
    }

    /// True if lines and rays have more bytes than there is room for.
    pub(super) fn is_over(&self) -> bool {
        self.bytes() > self.room
    }

    /// Bytes of lines and rays in memory.
    fn bytes(&self) -> u64 {
        let lines = self.open.iter().chain(&self.ready);
        let pieces: usize = lines.map(|line| size_of_val(&line.pieces[..])).sum();
        self.begun.bytes() + self.done.bytes() + pieces as u64
    }

    /// Takes the patches that are done. Where a limit has lowered the number that may be in memory, it doubles.
    pub(super) fn take_done(&mut self) -> Patches {
        self.most = (2 * self.most).min(PATCHES_AT_ONCE);
        std::mem::take(&mut self.done)
    }

    /// Leaves half of the patches to later; the place of a patch that is alone.
    pub(super) fn leave_half(&mut self) -> Option<(i64, i64)> {
        let Patches { lines, even } = &mut self.begun;
        let count = lines.len() + even.len();
        if count == 1 {
            let of_lines = lines.iter().map(|it| (it.beamlet, it.row));
            return of_lines.chain(even.iter().map(|it| (it.beamlet, it.row))).next();
        }
        let kept = (count / 2).min(even.len());
        let later = even.drain(kept..).rev().map(|it| (it.beamlet, it.row));
        self.waiting[1].extend(later);
        let later = lines.drain(count / 2 - kept..).rev().map(|it| (it.beamlet, it.row));
        self.waiting[0].extend(later);
        for lines in [&mut self.open, &mut self.ready] {
            lines.retain(|line| Arc::strong_count(&line.light) > 1);
        }
        self.most = (self.begun.weight()).max(1);
        None
    }
}
