//! One line: the laws of a beamlet along x at one row coordinate, refined until the linear law
//! holds in every segment (docs/physics.md, "Refinement").

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

mod run;

use crate::gpu::interface::{FLAG_EXACT, FLAG_GRAZING, FLAG_NOT_FINITE, FLAG_REFLECTED, Law};
pub(crate) use run::Integrals;
pub(super) use run::{Fit, Numbers, numbers};

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
    const fn new(low: Point, high: Point) -> Self {
        Self { low, high, fit: None }
    }

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

/// A place where the signature changes along a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edge {
    /// m from the beamlet's centre.
    pub(super) x: f32,
    /// Signatures below and above.
    pub(super) signatures: [u32; 2],
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

/// Intervals that must be cut finer than their law asks: they may hide a narrow component.
#[derive(Debug, Clone, Copy)]
pub(super) struct Narrow {
    /// From the beamlet's centre, m.
    pub(super) x: [f32; 2],
    /// Widest segment allowed there, m.
    pub(super) width: f32,
}

/// A line in work: rays asked for, laws given, until nothing more is asked.
#[derive(Debug, Default)]
pub(super) struct Line {
    /// Laws at the ends of the unrefined cells.
    pub(super) base: Vec<Point>,
    /// Finished segments, sorted by x once the line is done.
    pub(super) segments: Vec<Segment>,
    /// Segments cut.
    pub(super) splits: u64,
    /// Place of each ray traced, m from the beamlet's centre in the cell plane.
    pub(super) places: Vec<f32>,
    open: Vec<Segment>,
}

/// Places of the first rays of a line: cell ends and cell middles, m from the beamlet's centre.
pub(crate) fn first_places(period: f32, cells: u32) -> Vec<f32> {
    let n = 2 * cells;
    (0..=n).map(|i| period * ((i as f32) / (n as f32) - 0.5)).collect()
}

impl Line {
    /// Takes the laws of the first rays.
    pub(super) fn begin(&mut self, aim: &Aim, narrow: &[Narrow], laws: &[Law]) {
        self.places = first_places(aim.period, aim.cells);
        let points: Vec<Point> = (0..)
            .zip(&self.places)
            .zip(laws)
            .map(|((ray, &x), law)| Point { x, law: *law, ray })
            .collect();
        self.base = points.iter().step_by(2).copied().collect();
        for cell in points.windows(3).step_by(2) {
            self.judge(aim, narrow, cell[0], cell[1], cell[2]);
        }
    }

    /// Whether every ray of the line misses the sample.
    pub(super) fn is_empty(&self) -> bool {
        self.segments.iter().all(|s| s.low.law.crossings == 0 && s.high.law.crossings == 0)
    }

    /// Places of the rays wanted next, one for each open segment.
    pub(super) fn wanted(&self) -> impl Iterator<Item = f32> + '_ {
        self.open.iter().map(|s| middle(s.low.x, s.high.x))
    }

    /// Number of rays wanted next.
    pub(super) fn wanted_count(&self) -> usize {
        self.open.len()
    }

    /// Takes the laws of the rays wanted; sorts the segments when the line is done.
    pub(super) fn give(&mut self, aim: &Aim, narrow: &[Narrow], laws: &[Law]) {
        for (segment, law) in std::mem::take(&mut self.open).into_iter().zip(laws) {
            let x = middle(segment.low.x, segment.high.x);
            let point = Point { x, law: *law, ray: self.places.len() as u32 };
            self.places.push(x);
            self.judge(aim, narrow, segment.low, point, segment.high);
        }
        if self.open.is_empty() {
            self.finish(aim);
        }
    }

    /// Sorts the segments and joins neighbours that need not be apart.
    pub(super) fn finish(&mut self, aim: &Aim) {
        self.segments.sort_by(|a, b| a.low.x.total_cmp(&b.low.x));
        if self.is_empty() {
            let (first, last) = (self.segments[0].low, self.segments[self.segments.len() - 1].high);
            self.segments = vec![Segment::new(first, last)];
        }
        self.segments = run::runs(aim, &joined(aim, &self.segments));
        // Lines wait in great numbers until their strips are done.
        self.segments.shrink_to_fit();
        self.places.shrink_to_fit();
        self.open = Vec::new();
    }

    /// Accepts the segment, or opens its halves.
    fn judge(&mut self, aim: &Aim, narrow: &[Narrow], low: Point, mid: Point, high: Point) {
        if is_linear(aim, narrow, &low, &mid, &high) {
            self.segments.push(Segment::new(low, high));
            return;
        }
        self.splits += 1;
        for (a, b) in [(low, mid), (mid, high)] {
            let step = a.signature() != b.signature();
            let width = b.x - a.x;
            let open = if step {
                width > SHARP || (width > SHARPEST && !jump_is_small(aim, &a, &b))
            } else {
                width > SHARPEST
            };
            if open && representable(a.x, b.x) {
                self.open.push(Segment::new(a, b));
            } else if step {
                // Across a silhouette the law is constant on each side, never interpolated.
                let x = middle(a.x, b.x);
                self.push_constant(a.x, x, a);
                self.push_constant(x, b.x, b);
            } else {
                self.segments.push(Segment::new(a, b));
            }
        }
    }

    fn push_constant(&mut self, from: f32, to: f32, of: Point) {
        if to > from {
            self.segments.push(Segment::new(Point { x: from, ..of }, Point { x: to, ..of }));
        }
    }

    /// Places where the signature changes.
    pub(super) fn edges(&self) -> Vec<Edge> {
        self.segments
            .windows(2)
            .filter(|w| w[0].high.signature() != w[1].low.signature())
            .map(|w| Edge {
                x: w[1].low.x,
                signatures: [w[0].high.signature(), w[1].low.signature()],
            })
            .collect()
    }
}

/// Segments with those neighbours joined that are linear as one: bisecting towards a jump leaves
/// many pieces of one straight law, and every cell costs light.
fn joined(aim: &Aim, segments: &[Segment]) -> Vec<Segment> {
    let mut joined = Vec::new();
    let mut rest = segments;
    while let Some(first) = rest.first() {
        let mut count = 1;
        while count < rest.len() && is_one(aim, &rest[..=count]) {
            count += 1;
        }
        joined.push(Segment::new(first.low, rest[count - 1].high));
        rest = &rest[count..];
    }
    joined
}

/// Whether segments that follow one another, alike but perhaps for the last, are linear as one, at
/// every ray between them.
fn is_one(aim: &Aim, segments: &[Segment]) -> bool {
    let (low, last) = (&segments[0].low, &segments[segments.len() - 1]);
    let high = &last.high;
    if ![&segments[0].high, &last.low, high].into_iter().all(|point| point.is_like(low))
        || (high.law.optical_depth - low.law.optical_depth).abs() > STEEPEST
    {
        return false;
    }
    let width = high.x - low.x;
    let room = (aim.period * FULL_SHARE / width).max(1.0);
    let law = |f: fn(&Law) -> f32, limit: f32| {
        let slope = (f(&high.law) - f(&low.law)) / width;
        let off = |p: &Point| (f(&low.law) + slope * (p.x - low.x) - f(&p.law)).abs();
        segments.windows(2).rev().all(|w| off(&w[0].high) <= limit && off(&w[1].low) <= limit)
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
    if narrow.iter().any(|n| n.x[0] < high.x && n.x[1] > low.x && width > n.width) {
        return false;
    }
    let bend = |f: fn(&Law) -> f32| (f(&mid.law) - 0.5 * (f(&low.law) + f(&high.law))).abs();
    let room = (aim.period * FULL_SHARE / width).max(1.0);
    bend(|l| l.displacement_x) <= aim.tolerance * room
        && bend(|l| l.displacement_z) <= 100.0 * aim.tolerance * room
        && bend(|l| l.optical_depth) <= DEPTH_TOLERANCE * room
}
