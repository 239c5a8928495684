//! Features of a row that are known before its first line.

use super::LEAST_OF_RAYS;
use crate::sampling::ProjectedBounds;

/// Most height of the end of a body that counts as a jump, rows: its light is linear there, or halved as any other.
const FLAT: f64 = 1.0 / 32.0;
/// Most flat ends in a row with lines of their own, or jumps that may hide light: light that jumps more often swings, and
/// its bends tell its error.
pub(super) const MOST_JUMPS: usize = 4;

/// Bodies of a beamlet and row, before its first line.
#[derive(Debug, Clone)]
pub(crate) struct Features {
    /// Height of intervals that hides no body, rows; infinite where light is the same at all heights.
    pub height: f64,
    /// Flat ends of bodies: ranges of z, rows below the upper border.
    pub(super) ends: Vec<[f64; 2]>,
    /// Ends and middles of ends of bodies that are not flat, rows below the upper border: light may be deflected there
    /// alone.
    pub(super) lids: Vec<f64>,
    /// True if surfaces are rough: light differs from line to line, whatever edges there are.
    pub rough: bool,
}

impl Features {
    /// Adds a body whose shadow falls on a row.
    pub(crate) fn add(&mut self, shadow: &ProjectedBounds, row: i64) {
        // Upright bodies are the same at all heights, unless they are rough.
        if shadow.throws(row) || shadow.rough {
            self.height = self.height.min(shadow.height);
        }
        self.rough |= shadow.rough;
        for lid in shadow.lids {
            self.add_end(lid.map(|z| z - row as f64));
        }
    }

    /// Adds a range of z over which a body ends, rows below the upper border, if it is flat and near the row.
    pub(super) fn add_end(&mut self, [low, high]: [f64; 2]) {
        let is_flat = low <= high && high - low <= FLAT;
        if !is_flat && high - low < 1.0 {
            let heights = [low, f64::midpoint(low, high), high];
            self.lids.extend(
                heights.into_iter().filter(|z| *z > LEAST_OF_RAYS && *z < 1.0 - LEAST_OF_RAYS),
            );
        }
        if is_flat && low < 1.0 + FLAT && high > -FLAT {
            self.ends.push([low, high]);
        }
    }
}

impl Default for Features {
    /// No body that ends or leans.
    fn default() -> Self {
        Self { height: f64::INFINITY, ends: Vec::new(), lids: Vec::new(), rough: false }
    }
}

/// Heights of the two lines at each jump of light within a row; none if there are too many. Both borders of an end that
/// is higher than `thin`, rows, are jumps: all light between them may be deflected.
pub(super) fn jumps(ends: &[[f64; 2]], least: f64, thin: f64) -> Vec<[f64; 2]> {
    let near = |[low, high]: &[f64; 2]| *low < 1.0 + least && *high > -least;
    let ranges = ends.iter().filter(|range| near(range));
    let mut ranges: Vec<[f64; 2]> = ranges.map(|[low, high]| [low - least, high + least]).collect();
    ranges.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut joined: Vec<[f64; 2]> = Vec::new();
    for range in ranges {
        match joined.last_mut().filter(|last| range[0] <= last[1]) {
            Some(last) => last[1] = last[1].max(range[1]),
            None => joined.push(range),
        }
    }
    joined.retain(|[low, high]| high - low <= FLAT + 2.0 * least);
    if joined.len() > MOST_JUMPS {
        return Vec::new();
    }
    let of_end = |[low, high]: [f64; 2]| {
        let is_one = high - low < thin + 4.0 * least;
        let parts = [[low, low + 2.0 * least], [high - 2.0 * least, high]];
        if is_one { vec![[low, high]] } else { parts.to_vec() }
    };
    joined.into_iter().flat_map(of_end).collect()
}
