//! Error of one rectangle of a patch, represented by one ray or by the best linear fit.
//!
//! Represented by a ray (`ray_error.rs`): the result is linear, with slopes from its neighbours. Its
//! error is the largest change of recorded light if the rectangle were like a neighbour, times 1 /
//! sqrt(12), the standard deviation of a place spread evenly over a step. Represented by a fit: the
//! standard deviation of the facets about the fit, and only if windows are not straight over the
//! rectangle, or edges of openings cut it. Errors of rectangles add as independent ones, errors of pieces
//! as sums: along a silhouette their outlines are alike.

use super::base_lattice::BaseLattice;
use super::edges_along_z::EdgesAlongZ;
use super::error_budget::ErrorBudget;
use super::lit_heights::LitHeights;
use super::patch::{Axis, Node, Patch, Residuals, Rule};
use super::piece::Piece;
use super::response::Response;
use super::row_spread::RowSpread;
use beamlet_core::numbers::single;
use beamlet_interface::RayResult;
use std::ops::Range;

/// Error of an edge through a triangular piece, relative to a uniform one.
const CUT: f32 = 0.1;
/// Change of the density of a triangle's light near its border, relative to an interval.
const DENSITY: f32 = 0.2;
/// Fraction of a change of light along z that a row's border shows in spite of correct mean and slope,
/// per square of height over blur.
const BEND: f32 = 0.1;
/// Fraction of a change of light along z that a row's border shows if the mean over the band beside it is
/// correct: a triangle is not a Gaussian.
const BAND: f32 = 0.05;
/// Fraction of the x residual attributed to variation along z.
const ALONG_Z: f32 = 0.5;
/// Light that a blur takes over a border, per standard deviation of it: 1 / sqrt(2 pi).
const BLURRED: f32 = 0.398_942_3;
/// Half of the steepest change of the density of a Gaussian, which is a change of light per variance:
/// e^(-1/2) / sqrt(8 pi).
const STEEPENS: f32 = 0.121;
/// Variance of a share of light that bows by one standard deviation over a height of 1: 1 / sqrt(180).
const BOWED: f32 = 0.074_5;
/// Part of a slope over z that the row beside does not have, and so does not make up for.
const CANCELLED: f32 = 0.25;
/// Rays that are off by more standard deviations are too few to count.
const FARTHEST: f32 = 100.0;
/// Errors of rows beside the detector add to the errors of its rows; they must be smaller by this factor.
const BESIDE: f32 = 4.0;
/// Weight of the errors of a patch below which its rectangles do not slant as its silhouettes do.
const LITTLE: f32 = 0.25;
/// Share of the light at a silhouette that may land in recorded rows from outside.
pub(super) const THROWN: f32 = 0.05;
/// Standard deviation of a place spread evenly over an interval, share of the interval.
pub(super) const SPREAD: f32 = 0.288_675_13;

/// Error of one rectangle, for a mask step that opens all of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellError {
    pub(crate) node: u32,
    /// Error of the recorded light, share of open beam.
    pub(crate) light: f32,
    /// Part of it by light that crosses a border of the row.
    pub(crate) over: f32,
    /// Share of it where all of the rectangle is open, of one that is known as a mean.
    pub(crate) whole: f32,
    /// Light that passes the sample times the error of its displacement, m.
    pub(crate) moment: f32,
    /// Light that passes the sample, share of open beam.
    pub(crate) through: f32,
    /// Part of its height that the sample mask opens, at most.
    pub(crate) height: f32,
    /// A silhouette crosses it, or a neighbour crossed other objects.
    pub(crate) silhouette: bool,
    pub(crate) axis: Axis,
    /// Errors and variance by its neighbours, where its ray draws normals.
    pub(crate) draws: Option<Draws>,
}

impl CellError {
    /// Reduces light and errors to this share. The error by light that crosses a border is the change of
    /// one row already: it counts in full where the border is one of the `detector`.
    fn weigh(&mut self, share: f32, detector: bool) {
        self.light *= share;
        if detector {
            self.light = self.light.max(self.over);
        }
        self.moment *= share;
        self.through *= share;
        if let Some(draws) = &mut self.draws {
            draws.area *= share;
            draws.others *= share;
        }
    }
}

/// A rectangle whose ray draws its normals at a rough surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Draws {
    /// Its light without the sample, share of open beam.
    pub(super) area: f32,
    /// Error by neighbours that do not draw, share of open beam.
    pub(super) others: f32,
    /// Mean variance of the light of a ray among its neighbours that draw, share of its light
    /// squared; nothing where it has none.
    pub(super) variance: Option<f32>,
}

/// Judges the patches of a view.
#[derive(Debug)]
pub(super) struct Estimator<'a> {
    pub(super) response: &'a Response,
    pub(super) budget: ErrorBudget,
    pub(super) base: &'a BaseLattice,
    /// First beamlet of the lattice.
    pub(super) first_beamlet: i64,
    /// Least width (m) and height (rows) of a rectangle.
    pub(super) least: [f32; 2],
    /// Height of a row in the cell plane, m: what counts as square.
    pub(super) row_height: f32,
    /// Row pitch on the detector, m, and distance from analyser to detector, m.
    pub(super) row_pitch: f32,
    pub(super) gap: f32,
    /// Standard deviation of the blur over rows, rows.
    pub(super) row_blur: f32,
    /// How far the parts of the spot take light along z, rows.
    pub(super) row_reach: f32,
    /// The blur takes light beyond the rows beside.
    pub(super) wide_blur: bool,
    /// Apertures of masks end along z.
    pub(super) heights: bool,
    /// Apertures of the sample mask along z.
    pub(super) lit_heights: Option<LitHeights>,
    /// Edges of the detector mask along z.
    pub(super) landing_edges: Option<EdgesAlongZ>,
    /// Edges of the sample mask along z.
    pub(super) lit_edges: Option<EdgesAlongZ>,
    /// True if cells serve several energies, whose displacements differ.
    pub(super) other_energies: bool,
    /// Parts of the spot take light to rows of their own; not behind apertures that end along z, where no cell has
    /// shares of rows.
    pub(super) rows_apart: bool,
    /// Correction factor of the summed error of pieces.
    pub(super) pieces: f64,
    /// No means over facets are taken: all rectangles are known by rays.
    pub(super) by_rays_alone: bool,
    /// Rows whose light may be recorded.
    pub(super) recorded_rows: Range<i64>,
    /// Rows of the detector.
    pub(super) detector_rows: Range<i64>,
}

/// The error of light whose displacement has a standard deviation and is off by `farthest` at most,
/// where all of it off by the same makes the error `of`. The share of light that is off by k
/// deviations is 1 / k^2 at most (Chebyshev): near a rim few rays are thrown far.
pub(super) fn tailed(deviation: f32, farthest: f32, of: impl Fn(f32) -> f32) -> f32 {
    let mut error = of(deviation);
    if farthest <= deviation || of(farthest) <= error {
        return error;
    }
    let mut off = 2.0 * deviation;
    while off < 2.0 * farthest && off < FARTHEST * deviation {
        let at = off.min(farthest);
        error = error.max((deviation / at).powi(2) * of(at));
        off *= 2.0;
    }
    error
}

/// The interval that holds two others.
fn union([a, b]: [[f32; 2]; 2]) -> [f32; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

impl Estimator<'_> {
    /// Column of a beamlet in the lattice.
    pub(super) fn column(&self, beamlet: i64) -> usize {
        usize::try_from(beamlet - self.first_beamlet).unwrap_or(0)
    }

    pub(super) fn cell_error(&self, patch: &Patch, index: u32) -> CellError {
        let node = &patch.nodes[index as usize];
        let mut error = match (node.rule, patch.pieces(node)) {
            (Rule::Means(residuals), _) => self.mean_error(patch, index, &residuals),
            (_, Some(pieces)) => self.pieces_error(patch, index, pieces),
            _ => self.ray_error(patch, index),
        };
        if let Some(lit) = &self.lit_heights {
            error.height = lit.open(patch.row, node.z);
        }
        if !self.counts_in_full(patch.row) {
            let least = if error.silhouette { THROWN } else { 0.0 };
            let detector = self.may_enter(patch.row, node);
            error.weigh(self.weight_beside(patch, node).max(least), detector);
        }
        error
    }

    /// True if an edge of the sample mask along z cuts an interval of a row.
    fn is_cut(&self, row: i64, ends: [f32; 2]) -> bool {
        self.lit_edges.as_ref().is_some_and(|edges| edges.crossed(row, ends))
    }

    /// Heights of the cell of a piece.
    pub(super) fn cell_heights(&self, piece: &Piece) -> [f32; 2] {
        // A tilt would follow the depth at each energy; parts of a spot in rows of their own have none.
        if self.other_energies || self.rows_apart { piece.about_centroid() } else { piece.z }
    }

    /// True if errors of a patch beside the detector count so little that its rectangles need no care.
    pub(super) fn counts_little(&self, patch: &Patch) -> bool {
        !self.counts_in_full(patch.row)
            && patch.nodes.iter().all(|node| self.weight_beside(patch, node) <= LITTLE)
    }

    /// True if light of a rectangle, or of one of its height beside it, crosses a border of the detector.
    fn may_enter(&self, row: i64, node: &Node) -> bool {
        let (down, height) = (self.down(&node.result), node.height());
        let lands = [node.z[0] + down - height, node.z[1] + down + height];
        let rows = &self.detector_rows;
        [rows.start, rows.end].iter().any(|border| {
            let border = (border - row) as f32;
            lands[0] <= border && border <= lands[1]
        })
    }

    /// Weight of the error of a rectangle beside the detector.
    fn weight_beside(&self, patch: &Patch, node: &Node) -> f32 {
        let of = |result: &RayResult| self.weight(patch.row, node.z, self.down(result));
        let neighbours = self.neighbours(patch, node);
        let pieces = patch.pieces(node).unwrap_or_default().iter().map(|piece| of(&piece.result));
        let beside = neighbours.iter().flatten().map(|found| of(&found.result));
        pieces.chain(beside).fold(of(&node.result), f32::max)
    }

    /// Share of the light that passes the sample along a ray.
    pub(super) fn light(&self, result: &RayResult) -> f32 {
        self.response.hardening.light(result.optical_depth)
    }

    /// How far light lands below its place, rows.
    pub(super) fn down(&self, result: &RayResult) -> f32 {
        -result.landing_z(self.gap) / self.row_pitch
    }

    /// Error of a rectangle that is known by its pieces. Their areas, centroids, variances and results are
    /// exact; the outline of a piece that an edge cuts is not.
    fn pieces_error(&self, patch: &Patch, index: u32, pieces: &[Piece]) -> CellError {
        let node = &patch.nodes[index as usize];
        let column = self.column(patch.beamlet);
        let (mut cut, mut where_open, mut over, mut all) = (0.0_f32, 0.0_f32, 0.0_f32, 0.0);
        let rectangle = node.width() * node.height() * self.response.weight;
        for piece in pieces {
            let light = rectangle * piece.share * self.light(&piece.result);
            let at = self.response.landing(column, piece.centroid[0], piece.result.displacement_x);
            let half = self.response.magnification * (3.0 * piece.variance).sqrt();
            let apart = piece.centroid[0] - 0.5 * (piece.x[0] + piece.x[1]);
            let aside = (apart.abs() / node.width()).min(1.0);
            // A Gaussian replaces a piece that is wider than its rectangle.
            let width = piece.x[1] - piece.x[0];
            let wider = (1.0 - width * width / (12.0 * piece.variance).max(f32::MIN_POSITIVE))
                .abs()
                .min(1.0);
            let unlike = piece.outline[0].max(wider);
            let mut along = unlike * self.response.outline(column, at, half);
            if self.other_energies {
                // The piece is not moved.
                along += self.response.change(
                    column,
                    [1.0, 0.0],
                    [1.0, self.response.magnification * apart],
                    half,
                );
            }
            let mut down = self.beyond_border(patch.row, piece);
            if self.is_cut(patch.row, union([piece.bounds[1], self.cell_heights(piece)])) {
                down += CUT * piece.outline[1] + Self::misplaced(piece);
            }
            cut += (light * (CUT * piece.outline[0] + aside + down)).powi(2);
            where_open += (light * (along + down)).powi(2);
            over += (light * down).powi(2);
            all += light;
        }
        let [width, height] = [node.width(), node.height() * self.row_height];
        CellError {
            node: index,
            light: cut.sqrt(),
            over: over.sqrt(),
            whole: if cut > 0.0 { (where_open / cut).sqrt() } else { 0.0 },
            moment: 0.0,
            through: all,
            height: 1.0,
            silhouette: node.has_silhouette(),
            axis: if height > width { Axis::Z } else { Axis::X },
            draws: None,
        }
    }

    /// Share of the light of a piece that an edge along z may have on its wrong side: its cell is higher or lower.
    fn misplaced(piece: &Piece) -> f32 {
        let [own, cell] = [piece.bounds[1], piece.z].map(|[top, bottom]| bottom - top);
        0.5 * (own - cell).abs() / own.max(cell).max(f32::MIN_POSITIVE)
    }

    /// True if all light of a row counts: in rows of the detector, and where the effect of other energies
    /// is not known.
    fn counts_in_full(&self, row: i64) -> bool {
        self.other_energies || self.detector_rows.contains(&row)
    }

    /// Weight of errors of the light of these heights of a row that lands `down` rows below its place:
    /// from rows beside the detector [`BESIDE`] times the share that lands in it.
    pub(super) fn weight(&self, row: i64, [top, bottom]: [f32; 2], down: f32) -> f32 {
        if self.counts_in_full(row) {
            return 1.0;
        }
        let rows = &self.detector_rows;
        let [low, high] = [top + down, bottom + down].map(f64::from);
        let spread = RowSpread { blur: self.row_blur.into() };
        let before = |border: i64| spread.share_below((border - row) as f64, low, high);
        (BESIDE * single(before(rows.end) - before(rows.start))).min(1.0)
    }

    /// True if cells know their shares of the rows beside; else their rectangles say where light lands.
    fn has_shares(&self) -> bool {
        !self.other_energies && !self.heights && !self.rows_apart
    }

    /// Share of the light of a piece that its outline, or the rectangle of its cell, may have on the wrong side
    /// of the border of a row.
    fn beyond_border(&self, row: i64, piece: &Piece) -> f32 {
        let down = self.down(&piece.result);
        let by_outline = || piece.rows.by_outline(down.into(), self.row_blur.into());
        if self.has_shares() && by_outline().is_some() {
            return 0.0;
        }
        let [low, high] = piece.rows.whole.map(|z| single(z) + down);
        let height = high - low;
        // A border cuts off the lesser part of it, or its blur reaches one beside it.
        let border = high.floor();
        let cut = if border > low { (border - low).min(high - border) / height } else { 0.0 };
        let apart = (low - low.floor()).min(high.ceil() - high);
        // The mean part of it beside an edge of an aperture.
        let cut = if self.lands_at_edge(row, [low, high]) { 0.5 } else { cut };
        let near = cut > 0.0 || apart < 2.0 * self.row_blur;
        let leak = if near { BLURRED * self.row_blur / height } else { 0.0 };
        // A blur hides outlines that are smaller.
        let hidden = (1.0 - self.row_blur / height).clamp(0.0, 1.0);
        let by_outline = piece.outline[1] * DENSITY * hidden * (cut + leak).min(0.5);
        let [low, high] = union([piece.bounds[1], self.cell_heights(piece)]).map(|z| z + down);
        let ends = [low - self.row_reach, high + self.row_reach];
        let crosses = ends[0].floor() < ends[1].floor() || self.lands_at_edge(row, ends);
        let by_rectangle = self.wide_blur || !self.has_shares();
        by_outline + if crosses && by_rectangle { Self::misplaced(piece) } else { 0.0 }
    }

    /// Error of a rectangle that is known as a mean.
    fn mean_error(&self, patch: &Patch, index: u32, residuals: &Residuals) -> CellError {
        let node = &patch.nodes[index as usize];
        let result = &node.result;
        let column = self.column(patch.beamlet);
        let area = node.width() * node.height() * self.response.weight;
        let passed = self.light(result);
        let at =
            self.response.landing(column, patch.place(node.centre())[0], result.displacement_x);
        let growth = (self.response.magnification + residuals.slope).abs();
        let half = 0.5 * growth * node.width();
        let [along, across] = self.along_x(residuals, column, [passed, at], half);
        let whole = self.response.curvature(node.width())
            + self.response.skew(residuals.displacement, residuals.farthest[0]);
        let off = [residuals.displacement_z, residuals.farthest[1]];
        let known = self.has_shares() && residuals.borders.iter().any(Option::is_some);
        let down = passed * self.over_borders((patch.row, node), known, result, off);
        // A Gaussian stands for the slope over z, and what crosses the border of the row lands
        // along x like all of the rectangle.
        let aside = self.leak(node) * (ALONG_Z * along + CANCELLED * across);
        let down = down.hypot(aside).hypot(passed * self.response.flat(residuals.across));
        let mut down = down.hypot(passed * self.bent(node, residuals));
        if self.is_cut(patch.row, node.z) {
            down = down.hypot(passed * residuals.bow);
        }
        if self.rows_apart {
            // A cell has no slope of its light along z.
            down = down.hypot(passed * self.leak(node) * 0.5 * residuals.rise.abs());
        }
        let all = along + down;
        let where_open = along * whole.min(1.0);
        CellError {
            node: index,
            light: area * all,
            over: area * down,
            whole: if all > 0.0 { (where_open + down) / all } else { 0.0 },
            moment: area * passed * residuals.displacement,
            through: area * passed,
            height: 1.0,
            silhouette: false,
            axis: if down > where_open { Axis::Z } else { residuals.narrower },
            draws: None,
        }
    }

    /// Change of the light in any pixel if it became `light` and landed so far off, either way: a window
    /// may end at one side alone. Light of the beamlet at `column` that passes and its landing point are
    /// given, spread over 2 `half`.
    pub(super) fn either_way(
        &self,
        column: usize,
        [passed, at]: [f32; 2],
        light: f32,
        half: f32,
    ) -> impl Fn(f32) -> f32 {
        let own = self.response.landed(column, [passed, at], half);
        let change = move |off: f32| self.response.change_from(&own, [light, at + off]);
        move |off| change(off).max(change(-off))
    }

    /// Largest change of light in a window by the residual of a mean along x, and by its slope over z
    /// there. Light and landing point of the mean are spread over 2 `half`.
    fn along_x(
        &self,
        residuals: &Residuals,
        column: usize,
        [passed, at]: [f32; 2],
        half: f32,
    ) -> [f32; 2] {
        let light = passed * (-residuals.depth).exp();
        let either = self.either_way(column, [passed, at], light, half);
        let along = tailed(residuals.displacement, residuals.farthest[0], &either);
        let across = if residuals.across > 0.0 { either(residuals.across) } else { 0.0 };
        [along, across]
    }

    /// True if an edge of the detector mask along z lies between two places of a row.
    pub(super) fn lands_at_edge(&self, row: i64, ends: [f32; 2]) -> bool {
        self.landing_edges.as_ref().is_some_and(|edges| edges.crossed(row, ends))
    }

    /// Share of the light of a rectangle that may land in another row than its result says, where
    /// displacements along z have this standard deviation from it and are off by as much at most, m.
    /// `known`: what crosses the borders of the row is known.
    pub(super) fn over_borders(
        &self,
        (row, node): (i64, &Node),
        known: bool,
        result: &RayResult,
        [deviation, farthest]: [f32; 2],
    ) -> f32 {
        let skewed = deviation * farthest.max(deviation);
        tailed(deviation, farthest, |off| self.over_border((row, node), known, result, off, skewed))
    }

    /// Share of the light of a rectangle that may land in another row than its mean result says,
    /// where that is off by `residual` along z, m. `known`: what crosses the borders of the row is
    /// known. `skewed`: variance of the displacement times its farthest over its deviation, m2, which
    /// bounds the third moment.
    fn over_border(
        &self,
        (row, node): (i64, &Node),
        known: bool,
        result: &RayResult,
        residual: f32,
        skewed: f32,
    ) -> f32 {
        let down = self.down(result);
        let off = residual / self.row_pitch;
        let skewed = skewed / (self.row_pitch * self.row_pitch);
        let reach = off + self.row_blur;
        let [top, bottom] = [node.z[0] + down - reach, node.z[1] + down + reach];
        if bottom.floor() - top.floor() < 0.5 && !self.lands_at_edge(row, [top, bottom]) {
            return 0.0;
        }
        // Mean and slope are right: a wide blur shows little more.
        let height = node.height();
        let blur2 = self.row_blur.powi(2).max(1e-12);
        let curvature = (BEND * height * height / blur2).min(if known { BAND } else { 1.0 });
        let visible = (curvature + BEND * skewed / blur2).min(1.0);
        // Neighbours along x that are thinner than high err together.
        let together = (height * self.row_height / node.width()).max(1.0).sqrt();
        visible * together * (off / height).min(1.0)
    }

    /// Share of the light of a rectangle that rows may record more or less under a wide blur: a line replaces
    /// its light over z, or its mean at other energies.
    fn bent(&self, node: &Node, residuals: &Residuals) -> f32 {
        if !self.wide_blur {
            return 0.0;
        }
        let height = node.height() / self.row_blur;
        let squared = residuals.rise * residuals.rise;
        let mut error = STEEPENS * height * height * (squared / 360.0 + BOWED * residuals.bow);
        if self.other_energies {
            error += squared / 24.0 + BLURRED * height * residuals.rise.abs() / 12.0;
        }
        // Neighbours along x err together.
        let together = (node.height() * self.row_height / node.width()).max(1.0).sqrt();
        (together * error).min(1.0)
    }

    /// Share of the light of a rectangle that the blur takes over the borders of the row that it
    /// touches: 1 / sqrt(2 pi) standard deviations over each.
    fn leak(&self, node: &Node) -> f32 {
        let borders = f32::from(u8::from(node.z[0] <= 0.0) + u8::from(node.z[1] >= 1.0));
        (borders * BLURRED * self.row_blur / node.height()).min(1.0)
    }
}
