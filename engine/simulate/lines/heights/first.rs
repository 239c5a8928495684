//! Heights of the first lines of a row, before any light.

use super::Limits;
use super::features::{Crease, Features, Jumps};
use beamlet_core::random::GOLDEN;

/// Most lines of a row before its first light. Heights that are left out count in the estimate (`Heights::left`).
const MOST_FIRST: usize = 256;
/// Critical heights are one that are nearer to one another than this part of the height whose light may be lost.
const NEAR: f64 = 0.25;
/// Change of the slope of light at a crease that has a line of its own, limits of the error per row.
const STRONG: f64 = 60.0;
/// Most creases of a row with lines of their own: where light bends everywhere, lines show it.
const MOST_CREASES: usize = 12;

/// Heights of the first lines. Places are rows below the upper border.
#[derive(Debug)]
pub(super) struct FirstHeights {
    /// In the order of z.
    pub(super) heights: Vec<f64>,
    /// Pairs of these between which light jumps.
    jumps: Vec<[f64; 2]>,
    /// Heights that light may change at without a first line, in the order of z.
    pub(super) left: Vec<f64>,
}

impl FirstHeights {
    /// Borders of the row, jumps and critical heights, and middles between two of these.
    pub(super) fn new(features: &Features, limits: Limits) -> Self {
        if !features.varies {
            return Self { heights: vec![0.5], jumps: Vec::new(), left: Vec::new() };
        }
        let Jumps { pairs: mut jumps, ends } =
            Jumps::new(&features.jumps, limits.least, limits.thin);
        // Lines in the middle are as many again.
        let most = (MOST_FIRST.min(limits.lines) / 2).max(2) - 2;
        let mut left: Vec<f64> = Vec::new();
        if 2 * jumps.len() > most {
            left.extend(jumps.drain(most / 2..).flatten());
        }
        let is_apart = |z: &f64| jumps.iter().all(|[low, high]| z <= low || z >= high);
        let is_within = |z: &f64| *z > limits.least && *z < 1.0 - limits.least;
        let strong = strongest(&features.creases, limits);
        let mut critical = [features.critical.as_slice(), &ends, &strong].concat();
        critical.iter_mut().for_each(|z| *z += limits.beside);
        critical.retain(|z| is_within(z) && is_apart(z));
        critical.sort_unstable_by(f64::total_cmp);
        let near = (NEAR * limits.thin).max(limits.least);
        critical.dedup_by(|a, b| *a - *b < near);
        left.extend(stratify(&mut critical, most.saturating_sub(2 * jumps.len())));
        left.sort_unstable_by(f64::total_cmp);
        let borders = [0.0, 1.0].into_iter().filter(is_apart);
        let mut heights: Vec<f64> = borders.chain(critical).collect();
        heights.extend(jumps.iter().flatten().filter(|z| (0.0..=1.0).contains(*z)));
        heights.sort_unstable_by(f64::total_cmp);
        heights.dedup_by(|a, b| *a - *b < 0.5 * limits.least);
        let is_open =
            |it: &&[f64]| !begins(&jumps, it[0]) && it[1] - it[0] > near.max(4.0 * limits.least);
        let between = heights.windows(2).filter(is_open).map(|it| f64::midpoint(it[0], it[1]));
        heights.extend(between.collect::<Vec<f64>>());
        heights.sort_unstable_by(f64::total_cmp);
        Self { heights, jumps, left }
    }

    /// True if light jumps between the line at a height and the next one.
    pub(super) fn jumps_at(&self, z: f64) -> bool {
        begins(&self.jumps, z)
    }
}

/// True if one of some jumps begins at a height.
fn begins(jumps: &[[f64; 2]], z: f64) -> bool {
    jumps.iter().any(|[low, _]| low.to_bits() == z.to_bits())
}

/// Heights of the strongest creases.
fn strongest(creases: &[Crease], limits: Limits) -> Vec<f64> {
    let mut strong: Vec<&Crease> =
        creases.iter().filter(|it| it.weight > STRONG * limits.error).collect();
    strong.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.z.total_cmp(&b.z)));
    strong.into_iter().take(MOST_CREASES).map(|it| it.z).collect()
}

/// Puts at most `most` heights in the place of more, each anywhere in a stratum of as many: heights at which light changes
/// would not stand for those between. The heights that are left out.
fn stratify(heights: &mut Vec<f64>, most: usize) -> Vec<f64> {
    let count = heights.len();
    if count <= most {
        return Vec::new();
    }
    let border = |stratum: usize| match stratum * count / most.max(1) {
        0 => 0.0,
        at if at >= count => 1.0,
        at => f64::midpoint(heights[at - 1], heights[at]),
    };
    let place = |stratum: usize| {
        let share = (GOLDEN * stratum as f64 + 0.5).fract();
        border(stratum) + (border(stratum + 1) - border(stratum)) * share
    };
    let own = (0..most).map(place).collect();
    std::mem::replace(heights, own)
}
