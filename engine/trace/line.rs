//! One line: the laws of a beamlet along x at one row coordinate, first seen coarsely, then refined
//! until the linear law holds in every segment (docs/physics.md, "Refinement").

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

mod run;
mod seen;

use crate::gpu::interface::{FLAG_EXACT, FLAG_GRAZING, FLAG_NOT_FINITE, FLAG_REFLECTED, Law};
pub(crate) use run::Integrals;
pub(super) use run::{Fit, Numbers, numbers};
pub(super) use seen::{Edge, Seen, without_narrow};

/// Silhouettes are bisected to this width at least, m in the cell plane.
const SHARP: f32 = 20e-9;
/// Nothing is bisected farther than this: outermost facets of a thin fibre are that narrow, and
/// deflect by more than an aperture.
const SHARPEST: f32 = 2e-9;
/// Flagged segments are split at least to this share of a period.
const FLAGGED_SHARE: f32 = 1.0 / 64.0;
/// Error of the optical depth of a whole beamlet that splits a segment.
pub(crate) const DEPTH_TOLERANCE: f32 = 2e-5;
/// A segment of this share of the period may deviate by the tolerance; narrower ones by more,
/// in proportion, since they carry less light.
pub(crate) const FULL_SHARE: f32 = 1.0 / 40.0;

/// Segments are joined up to this change of optical depth: light is linear in a cell.
const STEEPEST: f32 = 0.02;
/// Flags that rays of joined segments share.
const KIND: u32 = FLAG_EXACT | FLAG_GRAZING | FLAG_REFLECTED;

/// A traced point of a line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    /// From the beamlet's centre in the cell plane, m.
    pub(super) x: f32,
    /// Its law.
    pub(super) law: Law,
    /// Which ray of the line the law is of.
    pub(super) ray: u32,
}

impl Point {
    fn signature(&self) -> u32 {
        self.law.signature
    }

    /// Whether it is finite and met what another did, in the same way.
    fn is_like(&self, other: &Self) -> bool {
        self.signature() == other.signature()
            && self.law.flags & KIND == other.law.flags & KIND
            && self.law.flags & FLAG_NOT_FINITE == 0
    }
}

/// An interval of x in which the law is linear between its ends.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    /// Lower end.
    pub(super) low: Point,
    /// Upper end.
    pub(super) high: Point,
    /// For a run of such intervals the straight law that stands for them.
    pub(super) fit: Option<Box<Fit>>,
}

impl Segment {
    /// The law at its ends.
    pub(super) fn ends(&self) -> [Numbers; 2] {
        let own = || [numbers(&self.low.law), numbers(&self.high.law)];
        self.fit.as_ref().map_or_else(own, |fit| fit.ends)
    }

    /// The same as laws.
    pub(super) fn laws(&self) -> [Law; 2] {
        let law = |of: Law, ends: Numbers| {
            let [depth, x, z, slope_x, slope_z] = ends.map(|number| number as f32);
            Law {
                optical_depth: depth,
                displacement_x: x,
                displacement_z: z,
                slope_x,
                slope_z,
                ..of
            }
        };
        let ends = self.ends();
        [law(self.low.law, ends[0]), law(self.high.law, ends[1])]
    }
}

/// What refinement aims at.
#[derive(Debug, Clone)]
pub(super) struct Aim {
    /// Period of the lattice, m.
    pub(super) period: f32,
    /// Cells per period before refinement.
    pub(super) cells: u32,
    /// Displacement error at the detector that splits a cell, m.
    pub(super) tolerance: f32,
    /// Standard deviation of the displacement about a straight line that is blurred away, m.
    pub(super) residual: f64,
    /// Share of the grazing incidence of ordered walks below which they stand by themselves.
    pub(super) severe: f64,
}

/// The rays of a line, and those that it asks for.
#[derive(Debug, Clone, Default)]
pub(super) struct Rays {
    /// Place of each, m from the beamlet's centre in the cell plane.
    pub(super) places: Vec<f32>,
    laws: Vec<Law>,
    /// Intervals between rays whose middles are wanted next.
    pub(super) open: Vec<[u32; 2]>,
}

impl Rays {
    fn point(&self, ray: u32) -> Point {
        Point { x: self.places[ray as usize], law: self.laws[ray as usize], ray }
    }

    /// Where the middle between two rays lies.
    fn between(&self, [low, high]: [u32; 2]) -> f32 {
        middle(self.places[low as usize], self.places[high as usize])
    }

    /// Places of the rays wanted next.
    pub(super) fn wanted(&self) -> impl Iterator<Item = f32> {
        self.open.iter().map(|ends| self.between(*ends))
    }

    /// Takes the laws of the rays wanted: the intervals that asked, with the ray between their ends.
    fn take(&mut self, laws: &[Law]) -> Vec<[u32; 3]> {
        let open = std::mem::take(&mut self.open);
        self.laws.extend_from_slice(laws);
        self.places.reserve(laws.len());
        let halved = |ends: [u32; 2]| {
            let ray = self.places.len() as u32;
            self.places.push(self.between(ends));
            [ends[0], ray, ends[1]]
        };
        open.into_iter().map(halved).collect()
    }
}

/// A line that asks for rays until it knows enough.
pub(super) trait Asks {
    /// Its rays so far.
    fn rays(&self) -> &Rays;
    /// Takes the laws of the rays wanted.
    fn give(&mut self, aim: &Aim, laws: &[Law]);
}

/// An interval of x in which a law holds.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// Lower and upper end.
    x: [f32; 2],
    /// Rays whose laws hold there.
    rays: [u32; 2],
}

impl Piece {
    const fn between(low: &Point, high: &Point) -> Self {
        Self { x: [low.x, high.x], rays: [low.ray, high.ray] }
    }

    fn ends(&self, laws: &[Law]) -> [Point; 2] {
        [0, 1].map(|end| {
            let ray = self.rays[end];
            Point { x: self.x[end], law: laws[ray as usize], ray }
        })
    }
}

/// Intervals that must be cut finer than their law asks: they may hide a narrow component.
#[derive(Debug, Clone, Copy)]
pub(super) struct Narrow {
    /// From the beamlet's centre, m.
    pub(super) x: [f32; 2],
    /// Widest segment allowed there, m.
    pub(super) width: f32,
}

/// A line in refinement, and what becomes of it.
#[derive(Debug, Default)]
pub(super) struct Line {
    /// Segments, sorted by x once the line is done.
    pub(super) segments: Vec<Segment>,
    /// Segments cut.
    pub(super) splits: u64,
    /// Its rays; without their laws once it is done.
    pub(super) rays: Rays,
    narrow: Vec<Narrow>,
    /// Intervals in which the law is linear, in any order.
    pieces: Vec<Piece>,
}

/// Places of the first rays of a line: cell ends and cell middles, m from the beamlet's centre.
pub(crate) fn first_places(period: f32, cells: u32) -> Vec<f32> {
    let n = 2 * cells;
    (0..=n).map(|i| period * ((i as f32) / (n as f32) - 0.5)).collect()
}

impl Asks for Line {
    fn rays(&self) -> &Rays {
        &self.rays
    }

    fn give(&mut self, aim: &Aim, laws: &[Law]) {
        for [low, middle, high] in self.rays.take(laws) {
            self.judge(aim, low, middle, high);
        }
        if self.rays.open.is_empty() {
            self.finish(aim);
        }
    }
}

impl Line {
    /// Begins to refine a line that was seen.
    pub(super) fn refine(aim: &Aim, seen: Seen) -> Self {
        let Seen { rays, narrow, unjudged, halves, .. } = seen;
        let mut line = Self { rays, narrow, splits: seen.splits, ..Self::default() };
        for [low, middle, high] in unjudged {
            line.judge(aim, low, middle, high);
        }
        for [low, high] in halves {
            line.half(aim, &line.rays.point(low), &line.rays.point(high));
        }
        // Rays that are neighbours are traced side by side.
        let Rays { places, open, .. } = &mut line.rays;
        let place = |ends: &[u32; 2]| places[ends[0] as usize];
        open.sort_unstable_by(|a, b| place(a).total_cmp(&place(b)));
        if open.is_empty() {
            line.finish(aim);
        }
        line
    }

    /// Sorts the segments and joins neighbours that need not be apart.
    fn finish(&mut self, aim: &Aim) {
        let mut pieces = std::mem::take(&mut self.pieces);
        let laws = std::mem::take(&mut self.rays.laws);
        pieces.sort_unstable_by(|a, b| a.x[0].total_cmp(&b.x[0]));
        let segment = |pieces: &[Piece]| {
            let [low, _] = pieces[0].ends(&laws);
            let [_, high] = pieces[pieces.len() - 1].ends(&laws);
            Segment { low, high, fit: None }
        };
        let misses = |piece: &Piece| piece.rays.iter().all(|r| laws[*r as usize].crossings == 0);
        let segments = if pieces.iter().all(misses) {
            vec![segment(&pieces)]
        } else {
            joined(aim, &pieces, &laws).map(segment).collect()
        };
        self.segments = run::runs(aim, &segments);
    }

    /// Accepts the interval between two rays, or opens its halves.
    fn judge(&mut self, aim: &Aim, low: u32, middle: u32, high: u32) {
        let [low, middle, high] = [low, middle, high].map(|ray| self.rays.point(ray));
        if is_linear(aim, &self.narrow, &low, &middle, &high) {
            self.pieces.push(Piece::between(&low, &high));
            return;
        }
        self.splits += 1;
        self.half(aim, &low, &middle);
        self.half(aim, &middle, &high);
    }

    /// Opens a half of an interval that was cut, or accepts it.
    fn half(&mut self, aim: &Aim, a: &Point, b: &Point) {
        let step = a.signature() != b.signature();
        let width = b.x - a.x;
        let open = if step {
            width > SHARP || (width > SHARPEST && !jump_is_small(aim, a, b))
        } else {
            width > SHARPEST
        };
        if open && representable(a.x, b.x) {
            self.rays.open.push([a.ray, b.ray]);
        } else if step {
            // Across a silhouette the law is constant on each side, never interpolated.
            let x = middle(a.x, b.x);
            self.push_constant([a.x, x], a.ray);
            self.push_constant([x, b.x], b.ray);
        } else {
            self.pieces.push(Piece::between(a, b));
        }
    }

    fn push_constant(&mut self, x: [f32; 2], ray: u32) {
        if x[1] > x[0] {
            self.pieces.push(Piece { x, rays: [ray; 2] });
        }
    }
}

/// Groups of neighbours that are linear as one: bisecting towards a jump leaves many pieces of one
/// straight law, and every cell costs light.
fn joined<'p>(
    aim: &'p Aim,
    pieces: &'p [Piece],
    laws: &'p [Law],
) -> impl Iterator<Item = &'p [Piece]> {
    let mut rest = pieces;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let mut count = 1;
        while count < rest.len() && is_one(aim, &rest[..=count], laws) {
            count += 1;
        }
        let (group, after) = rest.split_at(count);
        rest = after;
        Some(group)
    })
}

/// Whether pieces that follow one another, alike but perhaps for the last, are linear as one, at
/// every ray between them.
fn is_one(aim: &Aim, pieces: &[Piece], laws: &[Law]) -> bool {
    let [low, first_high] = pieces[0].ends(laws);
    let [last_low, high] = pieces[pieces.len() - 1].ends(laws);
    if ![first_high, last_low, high].iter().all(|point| point.is_like(&low))
        || (high.law.optical_depth - low.law.optical_depth).abs() > STEEPEST
    {
        return false;
    }
    let width = high.x - low.x;
    let room = (aim.period * FULL_SHARE / width).max(1.0);
    let law = |f: fn(&Law) -> f32, limit: f32| {
        let slope = (f(&high.law) - f(&low.law)) / width;
        let off = |x: f32, ray: u32| {
            (f(&low.law) + slope * (x - low.x) - f(&laws[ray as usize])).abs() <= limit
        };
        let between = |w: &[Piece]| off(w[0].x[1], w[0].rays[1]) && off(w[1].x[0], w[1].rays[0]);
        pieces.windows(2).rev().all(between)
    };
    law(|l| l.displacement_x, aim.tolerance * room)
        && law(|l| l.displacement_z, 100.0 * aim.tolerance * room)
        && law(|l| l.optical_depth, DEPTH_TOLERANCE * room)
}

fn middle(a: f32, b: f32) -> f32 {
    a + 0.5 * (b - a)
}

/// Whether there is a number between the two to cut at.
fn representable(a: f32, b: f32) -> bool {
    let m = middle(a, b);
    m > a && m < b
}

/// Whether it does not matter where between the two the law jumps.
fn jump_is_small(aim: &Aim, a: &Point, b: &Point) -> bool {
    let room = aim.period * FULL_SHARE / (b.x - a.x);
    let jump = |f: fn(&Law) -> f32| (f(&a.law) - f(&b.law)).abs();
    jump(|l| l.displacement_x) <= aim.tolerance * room
        && jump(|l| l.optical_depth) <= DEPTH_TOLERANCE * room
}

/// Whether a narrow component may hide between two rays.
fn may_hide(narrow: &[Narrow], low: &Point, high: &Point) -> bool {
    narrow.iter().any(|n| n.x[0] < high.x && n.x[1] > low.x && high.x - low.x > n.width)
}

fn is_linear(aim: &Aim, narrow: &[Narrow], low: &Point, mid: &Point, high: &Point) -> bool {
    let width = high.x - low.x;
    if low.signature() != mid.signature() || mid.signature() != high.signature() {
        return false;
    }
    let flags = low.law.flags | mid.law.flags | high.law.flags;
    if flags & FLAG_GRAZING != 0 && width > aim.period * FLAGGED_SHARE {
        return false;
    }
    if flags & FLAG_NOT_FINITE != 0 {
        return true; // its light is left out whole
    }
    if may_hide(narrow, low, high) {
        return false;
    }
    let bend = |f: fn(&Law) -> f32| (f(&mid.law) - 0.5 * (f(&low.law) + f(&high.law))).abs();
    let room = (aim.period * FULL_SHARE / width).max(1.0);
    bend(|l| l.displacement_x) <= aim.tolerance * room
        && bend(|l| l.displacement_z) <= 100.0 * aim.tolerance * room
        && bend(|l| l.optical_depth) <= DEPTH_TOLERANCE * room
}
