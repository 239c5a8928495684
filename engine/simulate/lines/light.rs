//! Light of lines: what windows record of the pieces of a line, for each mask step.

use super::heights::{Draws, Judged, JudgedLight, Moved};
use super::line::{Neighbours, PER_BEND, PER_JUMP, Piece, Source, open_share};
use super::window_light::WindowLight;
use crate::sampling::{Landed, Opening, Response, ViewContext, linear_change, mean_passed};
use beamlet_core::numbers::single;
use beamlet_interface::{FLAG_NOT_FINITE, NO_LIGHT, RayResult};
use std::ops::Range;

/// Part of the light that materials spread: all parts of a piece move alike, so that pieces add up to the light of a
/// piece that they divide.
struct SpreadPart {
    /// Displacement, standard deviations.
    deviations: f32,
    /// Share of the light.
    share: f32,
}

/// Gauss-Hermite points: windows are of ninth degree at most over the spread.
const SPREAD: [SpreadPart; 5] = [
    SpreadPart { deviations: 0.0, share: 8.0 / 15.0 },
    SpreadPart { deviations: -1.355_626_2, share: 0.222_075_92 },
    SpreadPart { deviations: 1.355_626_2, share: 0.222_075_92 },
    SpreadPart { deviations: -2.856_97, share: 0.011_257_412 },
    SpreadPart { deviations: 2.856_97, share: 0.011_257_412 },
];

/// A line with its light.
#[derive(Debug, Clone, Default)]
pub(crate) struct LitLine {
    pub pieces: Vec<Piece>,
    /// Light that windows receive.
    pub light: WindowLight,
    /// Light times displacement along x, by mask step, as an error of light.
    pub(super) displaced: Vec<f32>,
    /// Light that is displaced along z, by mask step.
    pub(super) moved: Vec<Moved>,
    /// Largest displacement of its light along z, rows.
    pub farthest: f32,
    /// Estimated error by exact rays, of the worst mask step.
    pub error: f64,
    /// Rays that were traced.
    pub rays: u32,
    /// Hash of the surfaces that its rays cross, in their order.
    pub(super) structure: u32,
    /// Rays of the line cross different surfaces.
    pub is_cut: bool,
    /// Rays that draw normals.
    pub draws: Draws,
}

impl LitLine {
    /// Bytes that it holds.
    pub(crate) fn bytes(&self) -> u64 {
        let pieces = self.pieces.len() * size_of::<Piece>();
        let steps = size_of_val(&self.displaced[..]) + size_of_val(&self.moved[..]);
        (pieces + self.light.bytes() + steps + size_of::<Self>()) as u64
    }
}

impl Judged for std::sync::Arc<LitLine> {
    fn judged(&self) -> JudgedLight<'_> {
        JudgedLight {
            values: self.light.values(),
            displaced: &self.displaced,
            moved: &self.moved,
            farthest: self.farthest.into(),
            structure: self.structure,
            draws: Some(self.draws),
        }
    }
}

/// Computes the light of lines of a view.
#[derive(Debug, Clone)]
pub(crate) struct Illumination<'a> {
    view: &'a ViewContext<'a>,
    /// Light that masks and windows pass.
    response: &'a Response,
    /// Rows, beyond which light is not recorded.
    rows: Range<f64>,
    /// Value of light times displacement along x, over the same error of light.
    by_displacement: f32,
}

impl<'a> Illumination<'a> {
    /// Light behind the masks of a design.
    pub(super) fn new(view: &'a ViewContext<'a>, response: &'a Response) -> Self {
        let recorded = view.recorded_rows();
        // Light may land in the row beside between two lines.
        let beside = 1.0 + NO_LIGHT * view.lattice.row_blur();
        // An error of the mean displacement, times the light of the widest opening, counts as one of light.
        let open = response.openings(0);
        let widest = open.iter().map(|it| it.x[1] - it.x[0]).fold(0.0, f32::max);
        let through = f64::from(widest * response.weight);
        let by_displacement = if view.budget.displacement.is_finite() {
            single(view.budget.light / (view.budget.displacement * through))
        } else {
            0.0
        };
        Self {
            view,
            response,
            rows: recorded.start as f64 - beside..recorded.end as f64 + beside,
            by_displacement,
        }
    }

    /// The same by another response.
    pub(super) fn with_response(&self, response: &'a Response) -> Self {
        Self { response, ..self.clone() }
    }

    /// No light of a line.
    pub(super) fn no_light(&self) -> WindowLight {
        WindowLight::new(self.response.windows.len() * self.response.steps())
    }

    /// Rows that a ray is displaced by, downwards.
    pub(crate) fn down(&self, piece: &Piece) -> f32 {
        self.view.down(&piece.result)
    }

    /// True if light of a piece at a row coordinate may land where it is recorded.
    pub(super) fn is_recorded(&self, row: f64, piece: &Piece) -> bool {
        let down = f64::from(self.down(piece));
        let farthest = down * self.view.delta_ratio();
        self.rows.contains(&(row + farthest)) || self.rows.contains(&(row + down))
    }

    /// Values of the light of shares of pieces of a column of the lattice that passes masks and windows; nothing else of
    /// a line.
    pub(super) fn pass<'p>(
        &self,
        column: usize,
        openings: &[Opening],
        pieces: impl Iterator<Item = (&'p Piece, f32)>,
    ) -> LitLine {
        let response = self.response;
        let steps = response.steps();
        let none = || LitLine {
            light: self.no_light(),
            displaced: vec![0.0; steps],
            moved: vec![Moved::default(); steps],
            ..LitLine::default()
        };
        let half = single(0.5 * self.view.lattice.period);
        // What bars let through is the same at all steps.
        let bars = Opening { step: 0, x: [-half, half] };
        let mut light = none();
        let mut leaked = (response.leak > 0.0).then(none);
        for (piece, share) in pieces {
            for opening in openings {
                self.add(column, piece, share, opening, &mut light);
            }
            if let Some(leaked) = &mut leaked {
                self.add(column, piece, share, &bars, leaked);
            }
        }
        if let Some(leaked) = leaked {
            let [open, leak] = [1.0 - response.leak, response.leak];
            light.light.scale(open);
            for (number, of_kinds) in leaked.light.windows() {
                let to = light.light.window(number).chunks_exact_mut(steps);
                for (to, of_kind) in to.zip(of_kinds.chunks_exact(steps)) {
                    to.iter_mut().for_each(|it| *it += leak * of_kind[0]);
                }
            }
            light.displaced.iter_mut().for_each(|it| *it = open * *it + leak * leaked.displaced[0]);
            light.moved.iter_mut().for_each(|it| it.mix(open, leak, &leaked.moved[0]));
        }
        light
    }

    /// Rays that draw normals on a line.
    pub(super) fn draws(
        &self,
        column: usize,
        row: f64,
        openings: &[Opening],
        pieces: &[Piece],
    ) -> Draws {
        let response = self.response;
        let mut draws = Draws::default();
        let landed = |piece: &Piece| {
            let lands = self.rows.contains(&(row + f64::from(self.down(piece))));
            let passed =
                if lands { response.hardening.light(piece.result.optical_depth) } else { 0.0 };
            let x = single(piece.middle());
            Landed { light: passed, at: response.landing(column, x, piece.result.displacement_x) }
        };
        let is_drawn = |piece: &Piece| piece.draws && piece.source != Source::FirstOrder;
        for (at, piece) in pieces.iter().enumerate().filter(|(_, piece)| is_drawn(piece)) {
            let open = response.lit(single(open_share(openings, piece.x)));
            let area = piece.width() * f64::from(response.weight * open);
            let next =
                pieces.get(at + 1).filter(|it| is_drawn(it) && it.interval == piece.interval);
            let half = 0.5 * response.magnification * single(piece.width());
            let own = landed(piece);
            let change = next.map(|it| {
                let other = landed(it);
                // Light that lands in another row is lost to this one.
                let rows = (self.down(piece) - self.down(it)).abs().min(1.0);
                let moved = own.light.max(other.light) * rows;
                f64::from(response.change(column, [own, other], half).max(moved))
            });
            draws.add(area, own.light.into(), change);
        }
        draws
    }

    /// Adds a share of the light of a piece through an opening, parts of a spectrum apart.
    fn add(&self, column: usize, piece: &Piece, share: f32, opening: &Opening, to: &mut LitLine) {
        let response = self.response;
        let steps = response.steps();
        let width = piece.width();
        let x = [piece.x[0].max(opening.x[0].into()), piece.x[1].min(opening.x[1].into())];
        if x[1] <= x[0] {
            return;
        }
        let shares = x.map(|x| single((x - piece.x[0]) / width));
        let between = |[low, high]: [f32; 2]| shares.map(|share| low + (high - low) * share);
        // Light falls exponentially over a piece.
        let [first, last] = between(piece.depth).map(|depth| response.hardening.depth(depth));
        let mean = mean_passed(0.5 * (first + last), last - first);
        let slope = -0.5 * linear_change(last - first);
        let light = share * mean * response.weight * single(x[1] - x[0]);
        let displacement = between(piece.displacement);
        let [low, high] = between(piece.scattering);
        let deviation = (0.5 * (low + high)).max(0.0).sqrt();
        let spread = if deviation > 0.0 {
            &SPREAD[..]
        } else {
            &[SpreadPart { deviations: 0.0, share: 1.0 }]
        };
        let step = opening.step as usize;
        let down = self.down(piece);
        let [shares, ratios] = response.hardening.refraction;
        for (part, ratio) in shares.into_iter().zip(ratios).filter(|(part, _)| *part > 0.0) {
            let [low, high] = [0, 1]
                .map(|end| response.landing(column, single(x[end]), ratio * displacement[end]));
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low).abs());
            let slope = slope.copysign(slope * (high - low));
            for (kind, windows) in response.windows.iter().enumerate() {
                let at = windows.landing(column, middle);
                for spread in spread {
                    let at = at + spread.deviations * deviation;
                    for number in windows.numbers(column, at, half) {
                        let aside = at - number as f32 * windows.period;
                        let passed = windows.passed(aside, half, slope);
                        let passed = spread.share * (part * light * windows.share * passed);
                        to.light.window(number)[kind * steps + step] += passed;
                        to.moved[step].add(passed, ratio * down);
                    }
                }
            }
        }
        let mean = 0.5 * (displacement[0] + displacement[1]);
        to.displaced[step] += self.by_displacement * light * mean;
    }

    /// Error of the light of a piece that has the exact ray through its middle alone: by the bend of the displacement
    /// against the rays beside through the same surfaces, and under exact transport at the edges of facets as far as
    /// refraction moves them.
    pub(crate) fn error_of(
        &self,
        column: usize,
        openings: &[Opening],
        pieces: &[Piece],
        at: usize,
    ) -> f64 {
        let own = &pieces[at];
        let Source::Ray { displacement } = own.source else { return 0.0 };
        if own.draws {
            return 0.0;
        }
        let response = self.response;
        let open = response.lit(single(open_share(openings, own.x)));
        if open <= 0.0 {
            return 0.0;
        }
        if own.result.flags & FLAG_NOT_FINITE != 0 {
            // Its light is lost.
            return own.width() * f64::from(response.weight * open);
        }
        let middle = single(own.middle());
        let landed = |depth: f32, displacement: f32| Landed {
            light: response.hardening.light(depth),
            at: response.landing(column, middle, displacement),
        };
        let half = 0.5 * response.magnification * single(own.width());
        let depth = own.result.optical_depth;
        let of_own = landed(depth, own.result.displacement_x);
        let beside =
            [at.checked_sub(1), Some(at + 1)].into_iter().flatten().filter_map(|at| pieces.get(at));
        let change = |depth: f32, displacement: f32| {
            f64::from(response.change(column, [of_own, landed(depth, displacement)], half))
        };
        // Edges behind the first surface lie aside by as much as refraction moves the path.
        let aside = |it: &Piece| f64::from((it.result.slope_x * it.extent).abs()).min(own.width());
        let is_ray = |it: &&Piece| matches!(it.source, Source::Ray { .. });
        let of_bend = |displacement: f32| {
            let bend = f64::from((displacement - own.result.displacement_x).abs());
            own.width() * f64::from(of_own.light) * self.most_moved(bend)
        };
        let of_other = |it: &Piece| {
            let RayResult { optical_depth, displacement_x, .. } = it.result;
            match it.interval == own.interval {
                true if it.is_like(own) => 0.0,
                true => PER_JUMP * of_bend(displacement_x),
                false if self.view.facets.is_exact => {
                    PER_JUMP * aside(own).max(aside(it)) * change(optical_depth, displacement_x)
                }
                false => 0.0,
            }
        };
        let same = match Neighbours::of(pieces, at).predict(own) {
            Some(predicted) => PER_BEND * of_bend(predicted),
            None => PER_JUMP * aside(own) * change(depth, displacement),
        };
        let most = beside.filter(is_ray).map(of_other).fold(same, f64::max);
        most * f64::from(response.weight * open)
    }

    /// Most of the light that windows may lose or gain by an error of the displacement at the mean constants, m, share of
    /// it: at other energies it grows with the square of the refraction, as the second order does.
    fn most_moved(&self, displacement: f64) -> f64 {
        let response = self.response;
        let [shares, ratios] = response.hardening.refraction.map(|it| it.map(f64::from));
        let moved = |ratio: f64| (displacement * ratio * ratio * response.steepest()).min(1.0);
        shares.into_iter().zip(ratios).map(|(share, ratio)| share * moved(ratio)).sum()
    }
}
