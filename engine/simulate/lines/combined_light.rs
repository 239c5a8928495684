//! Light of lines behind the masks of the designs by which they are judged: values of all, one after another, and the
//! largest of their errors.

use super::light::{Illumination, LitLine};
use super::line::{Piece, Source};
use super::window_light::WindowLight;
use crate::sampling::{ColumnOpenings, Opening, ViewContext};
use crate::trace::component_hash;
use beamlet_core::numbers;

/// Computes the light of lines of a view for all judges.
#[derive(Debug)]
pub(super) struct CombinedIllumination<'a> {
    judges: Vec<Illumination<'a>>,
    /// Numbers of the judges with windows of their own.
    distinct: &'a [usize],
}

impl<'a> CombinedIllumination<'a> {
    pub(super) fn new(view: &'a ViewContext<'a>) -> Self {
        let of_design = |response| Illumination::new(view, response);
        Self {
            judges: view.responses.judges().map(of_design).collect(),
            distinct: &view.responses.distinct,
        }
    }

    /// Light behind the masks of the first judge.
    pub(super) fn first(&self) -> &Illumination<'a> {
        &self.judges[0]
    }

    /// Light of a line of a column of the lattice at a row coordinate.
    pub(super) fn illuminate(
        &self,
        column: usize,
        row: f64,
        openings: &ColumnOpenings,
        pieces: Vec<Piece>,
    ) -> LitLine {
        let first = self.first();
        let recorded: Vec<&Piece> =
            pieces.iter().filter(|piece| first.is_recorded(row, piece)).collect();
        let pass = |(judge, openings): (&Illumination<'_>, &Vec<Opening>)| {
            judge.pass(column, openings, recorded.iter().map(|piece| (*piece, 1.0)))
        };
        let parts: Vec<LitLine> = self.judges.iter().zip(&openings.judges).map(pass).collect();
        let mut light = join(parts);
        let rays = pieces.iter().filter(|it| it.source != Source::FirstOrder).count();
        light.rays = numbers::count(rays);
        let refracted = pieces.iter().filter(|piece| piece.result.crossings > 0);
        light.farthest = refracted.map(|piece| first.down(piece).abs()).fold(0.0, f32::max);
        for same in pieces.chunk_by(|a, b| a.result.signature == b.result.signature) {
            light.is_cut |= same.len() < pieces.len();
            light.structure = component_hash(light.structure ^ same[0].result.signature);
        }
        let widest = &openings.widest;
        let squares =
            (0..pieces.len()).map(|at| self.error_of(column, widest, &pieces, at).powi(2));
        light.error = squares.sum::<f64>().sqrt();
        let draws = self.windows_apart().map(|it| it.draws(column, row, widest, &pieces));
        let worst = draws.max_by(|a, b| a.variance().total_cmp(&b.variance()));
        light.draws = worst.unwrap_or_default();
        light.pieces = pieces;
        light
    }

    /// Largest error of the light of a piece by its exact ray, of any design ([`Illumination::error_of`]).
    pub(super) fn error_of(
        &self,
        column: usize,
        openings: &[Opening],
        pieces: &[Piece],
        at: usize,
    ) -> f64 {
        let errors = self.windows_apart().map(|it| it.error_of(column, openings, pieces, at));
        errors.fold(0.0, f64::max)
    }

    fn windows_apart(&self) -> impl Iterator<Item = &Illumination<'a>> {
        self.distinct.iter().map(|judge| &self.judges[*judge])
    }
}

/// Light of one line behind the masks of several designs as one.
fn join(mut parts: Vec<LitLine>) -> LitLine {
    if parts.len() == 1 {
        return parts.pop().unwrap_or_default();
    }
    let lights: Vec<WindowLight> =
        parts.iter_mut().map(|part| std::mem::take(&mut part.light)).collect();
    let mut all = LitLine { light: WindowLight::join(&lights), ..LitLine::default() };
    for part in &parts {
        all.displaced.extend(&part.displaced);
        all.moved.extend(&part.moved);
    }
    all
}
