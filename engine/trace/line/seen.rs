//! A line seen coarsely: enough to tell whether neighbouring lines agree.

use super::{
    Aim, Asks, Narrow, Point, Rays, SHARP, SHARPEST, first_places, may_hide, middle, representable,
};
use crate::gpu::interface::{FLAG_NOT_FINITE, FLAG_REFLECTED, FLAG_SHARE_SHIFT, Law};

/// Silhouettes are bisected to this share of a period.
const COARSE_SHARE: f32 = 1.0 / 160.0;

/// A place where the signature changes along a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::trace) struct Edge {
    /// m from the beamlet's centre.
    pub(in crate::trace) x: f32,
    /// Signatures below and above.
    pub(in crate::trace) signatures: [u32; 2],
}

/// A line by its first rays and those that find its silhouettes.
#[derive(Debug, Clone, Default)]
pub(in crate::trace) struct Seen {
    /// Places where the signature changes, once the line is seen.
    pub(in crate::trace) edges: Vec<Edge>,
    pub(super) splits: u64,
    pub(super) rays: Rays,
    pub(super) narrow: Vec<Narrow>,
    /// Intervals of which a ray in the middle is known, and nothing shows that they need cutting.
    pub(super) unjudged: Vec<[u32; 3]>,
    /// Halves of intervals that were cut, as narrow as is wanted here.
    pub(super) halves: Vec<[u32; 2]>,
}

impl Asks for Seen {
    fn rays(&self) -> &Rays {
        &self.rays
    }

    fn give(&mut self, aim: &Aim, laws: &[Law]) {
        for rays in self.rays.take(laws) {
            self.look(aim, rays);
        }
        self.find_edges();
    }
}

impl Seen {
    /// Takes the laws of the first rays; `narrow`: where components may hide between them.
    pub(in crate::trace) fn begin(aim: &Aim, narrow: Vec<Narrow>, laws: &[Law]) -> Self {
        let places = first_places(aim.period, aim.cells);
        let rays = Rays { places, laws: laws.to_vec(), open: Vec::new() };
        let mut seen = Self { rays, narrow, ..Self::default() };
        for cell in 0..aim.cells {
            seen.look(aim, [2 * cell, 2 * cell + 1, 2 * cell + 2]);
        }
        seen.find_edges();
        seen
    }

    /// Whether every ray misses the sample.
    pub(in crate::trace) fn is_empty(&self) -> bool {
        self.rays.laws.iter().all(|law| law.crossings == 0)
    }

    /// How far up or down light lands on a detector `gap` behind the analyser, m, where the line
    /// meets nothing but smooth surfaces far from grazing; `None` elsewhere.
    pub(in crate::trace) fn smooth_reach(&self, gap: f32) -> Option<f32> {
        let all = (1 << FLAG_SHARE_SHIFT) - 1;
        let smooth = self.edges.is_empty() && self.rays.laws.iter().all(|l| l.flags & all == 0);
        let reach = |law: &Law| (law.displacement_z + law.slope_z * gap).abs();
        smooth.then(|| self.rays.laws.iter().map(reach).fold(0.0, f32::max))
    }

    /// Laws at the ends of the unrefined cells.
    pub(in crate::trace) fn base(&self, aim: &Aim) -> impl ExactSizeIterator<Item = &Law> {
        self.rays.laws[..=2 * aim.cells as usize].iter().step_by(2)
    }

    /// Leaves the interval between two rays for later, or cuts it where it has a silhouette.
    fn look(&mut self, aim: &Aim, rays: [u32; 3]) {
        let [low, mid, high] = rays.map(|ray| self.rays.point(ray));
        let alike = low.signature() == mid.signature() && mid.signature() == high.signature();
        let left_out = (low.law.flags | mid.law.flags | high.law.flags) & FLAG_NOT_FINITE != 0;
        if alike && (left_out || !may_hide(&self.narrow, &low, &high)) {
            self.unjudged.push(rays);
            return;
        }
        self.splits += 1;
        for (a, b) in [(&low, &mid), (&mid, &high)] {
            let (step, width) = (a.signature() != b.signature(), b.x - a.x);
            let wanted = step && width > aim.period * COARSE_SHARE;
            let least = if step { SHARP } else { SHARPEST };
            let cut = (wanted || may_hide(&self.narrow, a, b)) && width > least;
            if cut && representable(a.x, b.x) {
                self.rays.open.push([a.ray, b.ray]);
            } else {
                self.halves.push([a.ray, b.ray]);
            }
        }
    }

    /// Where the signature changes, once nothing more is asked. Total reflection is no silhouette:
    /// its strip is often narrower than anybody looks here.
    fn find_edges(&mut self) {
        if !self.rays.open.is_empty() {
            return;
        }
        let mut points: Vec<Point> =
            (0..).zip(&self.rays.laws).map(|(ray, _)| self.rays.point(ray)).collect();
        points.retain(|p| p.law.flags & (FLAG_REFLECTED | FLAG_NOT_FINITE) == 0);
        points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x));
        self.edges = points
            .windows(2)
            .filter(|w| w[0].signature() != w[1].signature())
            .map(|w| Edge {
                x: middle(w[0].x, w[1].x),
                signatures: [w[0].signature(), w[1].signature()],
            })
            .collect();
        // Lines wait in great numbers until their spans are judged.
        self.rays.open = Vec::new();
        self.rays.places.shrink_to_fit();
        self.rays.laws.shrink_to_fit();
    }
}

/// Edges with those as one that are too close for every line to tell them apart: whether a ray falls
/// between them is chance.
pub(in crate::trace) fn without_narrow(edges: &[Edge], period: f32) -> Vec<Edge> {
    let mut wide: Vec<Edge> = Vec::with_capacity(edges.len());
    let mut last = f32::NEG_INFINITY;
    for edge in edges {
        match wide.last_mut() {
            Some(one) if edge.x - last < 2.0 * COARSE_SHARE * period => {
                one.signatures[1] = edge.signatures[1];
            }
            _ => wide.push(*edge),
        }
        last = edge.x;
    }
    wide.retain(|edge| edge.signatures[0] != edge.signatures[1]);
    wide
}
