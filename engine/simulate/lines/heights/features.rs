//! Features of a row that are known before its first line.

use crate::lines::critical::Change;
use crate::sampling::ProjectedBounds;
use beamlet_core::numbers;

/// Most height of a jump, rows: light over a higher one is linear, or halved as any other.
const FLAT: f64 = 1.0 / 32.0;
/// Bins of a row in which bends of creases add.
const BINS: usize = 64;
/// Most facets of a chain of steep ones whose ends count each.
const MOST_OF_CHAIN: usize = 8;

/// What changes the light of a beamlet and row along z, before its first line. Places are rows below the upper border.
#[derive(Debug, Clone, Default)]
pub(crate) struct Features {
    /// Light may differ from height to height.
    pub varies: bool,
    /// Surfaces are rough: light differs from line to line, whatever edges there are.
    pub rough: bool,
    /// Heights at which surfaces begin, end, join or part.
    pub(super) critical: Vec<f64>,
    /// Ranges over which steep facets let light jump.
    pub(super) jumps: Vec<[f64; 2]>,
    pub(super) creases: Vec<Crease>,
}

/// Place at which light bends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crease {
    pub z: f64,
    /// Change of the slope of light, per row, over the light of the beamlet.
    pub weight: f64,
}

impl Features {
    /// Adds a body whose shadow falls on a row.
    pub(crate) fn add_body(&mut self, shadow: &ProjectedBounds, row: i64) {
        // Upright bodies are the same at all heights, unless they are rough.
        self.varies |= shadow.throws(row) || shadow.rough;
        self.rough |= shadow.rough;
    }

    /// Adds a change of light in a row.
    pub(crate) fn add(&mut self, change: Change, row: i64) {
        let row = row as f64;
        match change {
            Change::Critical(z) => self.critical.push(z - row),
            Change::Jump(ends) => self.jumps.push(ends.map(|z| z - row)),
            Change::Crease { row: z, weight } => {
                self.creases.push(Crease { z: z - row, weight });
                if self.creases.len() > 4 * BINS {
                    self.join_creases();
                }
            }
        }
    }

    /// Adds creases in one bin of the row.
    pub(crate) fn join_creases(&mut self) {
        let bin = |it: &Crease| numbers::whole::<i64>((it.z * BINS as f64).floor());
        self.creases.sort_by(|a, b| a.z.total_cmp(&b.z).then(a.weight.total_cmp(&b.weight)));
        let bins = self.creases.chunk_by(|a, b| bin(a) == bin(b));
        let sum = |of: &[Crease]| {
            let weight: f64 = of.iter().map(|it| it.weight).sum();
            Crease { z: of.iter().map(|it| it.weight * it.z).sum::<f64>() / weight, weight }
        };
        self.creases = bins.map(sum).collect();
    }
}

/// Jumps of light within a row.
#[derive(Debug, Default)]
pub(super) struct Jumps {
    /// Heights of the two lines at each jump.
    pub pairs: Vec<[f64; 2]>,
    /// Ends of ranges that are too high for a jump, and of facets within.
    pub ends: Vec<f64>,
}

impl Jumps {
    /// Jumps of some ranges of z, of which those that touch are one. Both ends of a jump that is higher than `thin`, rows,
    /// are jumps: all light between them may be deflected.
    pub(super) fn new(ranges: &[[f64; 2]], least: f64, thin: f64) -> Self {
        let near = |[low, high]: &&[f64; 2]| *low < 1.0 + least && *high > -least;
        let mut ranges: Vec<[f64; 2]> = ranges.iter().filter(near).copied().collect();
        ranges.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        let mut jumps = Self::default();
        let mut at = 0;
        while at < ranges.len() {
            let [low, mut high] = ranges[at];
            let first = at;
            while at < ranges.len() && ranges[at][0] - least <= high + least {
                high = high.max(ranges[at][1]);
                at += 1;
            }
            let [below, above] = [low - least, high + least];
            if high - low > FLAT {
                jumps.ends.extend([low, high]);
            } else if high - low < thin + 2.0 * least {
                jumps.pairs.push([below, above]);
            } else {
                jumps.pairs.extend([[below, below + 2.0 * least], [above - 2.0 * least, above]]);
            }
            if at - first <= MOST_OF_CHAIN {
                jumps.ends.extend(ranges[first..at].iter().flatten());
            }
        }
        jumps
    }
}
