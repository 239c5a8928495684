//! Patches: heights of their lines, or rays of those whose bodies are many, and errors.

use super::audit::Auditor;
use super::combined_light::CombinedIllumination;
use super::even::{EvenPatch, EvenSampler, Next};
use super::heights::{Heights, Limits, Uneven};
use super::light::LitLine;
use super::line::{LinePlace, MOST_PIECES, NARROWEST, Piece, Source, incline};
use super::patch_places::PatchPlaces;
use super::sections::SurfaceLines;
use crate::sampling::{ColumnOpenings, ViewContext, safety, tally_of};
use crate::trace::Tracer;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers};
use beamlet_interface::Ray;
use beamlet_model::spot::differ_along_z;
use rayon::prelude::*;
use std::sync::Arc;

/// Least height between two lines through facets, rows: their places are exact in f64, and a jump that is missed errs by
/// 1.5e-5 of it; half the height over which a ray of an audit is spread.
pub(super) const LEAST: f64 = 1.0 / 65536.0;
/// Standard deviations of the blur over rows beside a border within which light crosses it; with 2 random scenes
/// erred by up to 1.2 times as much (`measured_errors_of_random_scenes_are_true_ones`).
const REACH: f64 = 1.5;
/// Error of a piece near grazing incidence, whose rays differ, that stays whole: share of the limit.
const BY_RAYS: f64 = 0.15;

/// Patches with their lines or rays, and their counts.
#[derive(Debug)]
pub(crate) struct Sampled {
    pub lines: Vec<LinePatch>,
    pub even: Vec<EvenPatch>,
    pub tally: Tally,
}

/// A patch with its lines.
#[derive(Debug)]
pub(crate) struct LinePatch {
    pub beamlet: i64,
    pub row: i64,
    pub heights: Heights<Arc<LitLine>>,
    /// Surfaces that the first piece of its first line crosses.
    signature: Option<u32>,
    /// True if silhouettes cross it.
    pub(super) is_cut: bool,
}

impl LinePatch {
    fn place(&self, z: f64) -> LinePlace {
        LinePlace { beamlet: self.beamlet, row: self.row as f64 + z }
    }

    /// Looks for silhouettes in lines.
    fn look_for_silhouettes(&mut self, lines: &[Arc<LitLine>]) {
        for line in lines {
            let first = line.pieces.first().map(|it| it.result.signature);
            // Mean angles of rays that draw normals have no bound.
            self.is_cut |= line.is_cut || line.draws.are_any();
            self.is_cut |= self.signature.is_some_and(|it| Some(it) != first);
            self.signature = self.signature.or(first);
        }
    }

    /// Estimated errors: of light, and by light and displacement, in the unit of light.
    fn errors(&mut self) -> [f64; 2] {
        let all = self.heights.error();
        self.heights.judge_light_alone();
        let light = self.heights.error();
        let of_line = |(at, line): (usize, &Arc<LitLine>)| {
            let [top, bottom] = self.heights.nearest(at);
            (bottom - top) * line.error
        };
        let by_rays: f64 = self.heights.light().enumerate().map(of_line).sum();
        [light.hypot(by_rays), all.hypot(by_rays)]
    }
}

/// Patches of many bodies.
struct Evenly {
    even: Vec<EvenPatch>,
    /// Places of those whose bodies rays resolve.
    resolved: Vec<(i64, i64)>,
}

/// Windows along z that take the light of a cell as even.
fn uneven(view: &ViewContext<'_>) -> Uneven {
    let apart = differ_along_z(&view.optics.spot.placed());
    if view.lattice.heights {
        Uneven::Apertures
    } else if apart || view.recording.is_some() || view.lattice.has_wide_row_blur() {
        Uneven::Rows { blur: view.lattice.row_blur().max(f64::MIN_POSITIVE) }
    } else {
        Uneven::Never
    }
}

/// True for places of one row side by side.
fn follows(a: &LinePlace, b: &LinePlace) -> bool {
    a.row.to_bits() == b.row.to_bits() && a.beamlet + 1 == b.beamlet
}

/// Chooses the heights of the lines of patches, and computes their light.
#[derive(Debug)]
pub(crate) struct LineSampler<'a> {
    view: &'a ViewContext<'a>,
    surfaces: SurfaceLines<'a>,
    illumination: CombinedIllumination<'a>,
    even: EvenSampler<'a>,
    limits: Limits,
    /// Openings of the beamlets of the lattice.
    openings: Vec<ColumnOpenings>,
}

impl<'a> LineSampler<'a> {
    pub(crate) fn new(view: &'a ViewContext<'a>) -> Self {
        let safety = safety(view.responses.fewest_steps());
        let limits = Limits {
            error: safety * view.budget.light,
            thin: safety * view.budget.tolerance,
            lines: view.budget.max_rays as usize,
            reach: REACH * view.lattice.row_blur(),
            uneven: uneven(view),
            least: LEAST,
        };
        let columns =
            numbers::narrow::<usize>(view.lattice.beamlets.end - view.lattice.beamlets.start);
        Self {
            view,
            surfaces: SurfaceLines::new(view),
            even: EvenSampler::new(view),
            illumination: CombinedIllumination::new(view),
            limits,
            openings: (0..columns).map(|column| view.responses.openings(column)).collect(),
        }
    }

    /// Patches with the lines or rays that their light needs; nothing where they would hold more than `room` bytes
    /// together.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(crate) fn sample(
        &self,
        tracer: &mut Tracer,
        places: &[(i64, i64)],
        of: &PatchPlaces,
        room: u64,
    ) -> Result<Option<Sampled>> {
        let (crowded, mut of_lines): (Vec<_>, Vec<_>) =
            places.iter().partition(|(beamlet, row)| of.is_crowded(*beamlet, *row));
        let Some(Evenly { even, resolved }) = self.sample_evenly(tracer, &crowded, of, room)?
        else {
            return Ok(None);
        };
        of_lines.extend(resolved);
        let held: u64 = even.iter().map(EvenPatch::bytes).sum();
        let patch = |&(beamlet, row): &(i64, i64)| {
            let heights = Heights::new(&of.at(beamlet, row)?.features, self.limits);
            Some(LinePatch { beamlet, row, heights, signature: None, is_cut: false })
        };
        let mut lines: Vec<LinePatch> = of_lines.iter().filter_map(patch).collect();
        if !self.choose_heights(tracer, &mut lines, room.saturating_sub(held))? {
            return Ok(None);
        }
        let budget = &self.view.budget;
        let errors: Vec<[f64; 2]> = lines.par_iter_mut().map(LinePatch::errors).collect();
        let of_lines = lines.iter().zip(&errors).map(|(patch, [light, all])| {
            let rays = patch.heights.light().map(|line| line.rays).sum();
            let lines = patch.heights.count() as u64;
            Tally { lines, ..tally_of([*light, all / budget.light], rays, budget) }
        });
        let of_even = even.iter().map(|patch| tally_of([patch.error, 0.0], patch.rays, budget));
        let mut tally = of_lines.chain(of_even).fold(Tally::default(), |a, b| a + b);
        if budget.audit > 0.0 {
            let lines = lines.iter().zip(errors.iter().map(|[light, _]| light / budget.by_grid));
            let lines: Vec<(&LinePatch, f64)> = lines.collect();
            tally.audit = tracer.leave_out(|it| self.auditor().audit(it, &lines, &even))?;
        }
        Ok(Some(Sampled { lines, even, tally }))
    }

    fn auditor(&self) -> Auditor<'_> {
        Auditor {
            view: self.view,
            illumination: self.illumination.first(),
            openings: &self.openings,
            scatters: self.view.facets.steps.iter().any(|step| step.scattering.abs() > 0.0),
        }
    }

    /// Patches of many bodies with rays that are spread evenly; nothing where they hold more than `room` bytes.
    fn sample_evenly(
        &self,
        tracer: &mut Tracer,
        places: &[(i64, i64)],
        of: &PatchPlaces,
        room: u64,
    ) -> Result<Option<Evenly>> {
        let column = |beamlet: i64| self.view.lattice.column(beamlet);
        let begin = |(beamlet, row): &(i64, i64)| {
            self.even.begin(*beamlet, *row, &self.openings[column(*beamlet)])
        };
        let mut waiting: Vec<EvenPatch> = places.iter().map(begin).collect();
        let (mut done, mut resolved) = (Vec::new(), Vec::new());
        while !waiting.is_empty() {
            tracer.cancel().check()?;
            let held = done.iter().chain(&waiting).map(EvenPatch::bytes).sum::<u64>();
            if held > room {
                return Ok(None);
            }
            let rays = |patch: &EvenPatch| {
                let ray = |[x, z]: [f32; 2]| self.view.ray(patch.beamlet, patch.row, x, z);
                patch.rays().map(ray).collect::<Vec<Ray>>()
            };
            let rays = waiting.par_iter().map(rays).collect::<Vec<_>>().concat();
            let results = tracer.trace(&rays)?;
            let mut rest = &results[..];
            let own = |patch: EvenPatch| {
                let (own, after) = rest.split_at(patch.count() as usize);
                rest = after;
                (patch, own)
            };
            let with_results: Vec<_> = std::mem::take(&mut waiting).into_iter().map(own).collect();
            let judged = with_results.into_par_iter().map(|(mut patch, results)| {
                let openings = &self.openings[column(patch.beamlet)];
                let bodies =
                    of.at(patch.beamlet, patch.row).map(|it| it.bodies).unwrap_or_default();
                let next = self.even.take(&mut patch, results, openings, &bodies);
                (patch, next)
            });
            for (patch, next) in judged.collect::<Vec<_>>() {
                match next {
                    Next::Done => done.push(patch),
                    Next::Lines => resolved.push((patch.beamlet, patch.row)),
                    Next::Rays { .. } => waiting.push(patch),
                }
            }
        }
        // In an order that no number of trials changes.
        done.sort_by_key(|patch| (patch.row, patch.beamlet));
        Ok(Some(Evenly { even: done, resolved }))
    }

    /// Adds lines to patches until their light is within the limits. Rows side by side share the line at their border.
    /// False if the patches hold more than `room` bytes.
    fn choose_heights(
        &self,
        tracer: &mut Tracer,
        patches: &mut [LinePatch],
        room: u64,
    ) -> Result<bool> {
        let mut held = 0;
        loop {
            tracer.cancel().check()?;
            let of_patch = |patch: &LinePatch| -> Vec<LinePlace> {
                patch.heights.wanted().map(|z| patch.place(z)).collect()
            };
            let wanted: Vec<Vec<LinePlace>> = patches.iter().map(of_patch).collect();
            let places = LinePlace::distinct(wanted.concat());
            if places.is_empty() {
                return Ok(true);
            }
            let lines = self.lines(tracer, &places)?;
            held += lines.iter().map(|line| line.bytes()).sum::<u64>();
            if held > room {
                return Ok(false);
            }
            let undone = patches.par_iter_mut().zip(wanted).filter(|(_, own)| !own.is_empty());
            undone.for_each(|(patch, own)| {
                let line = |place: &LinePlace| Some(lines[place.index(&places)?].clone());
                let own: Vec<Arc<LitLine>> = own.iter().filter_map(line).collect();
                patch.look_for_silhouettes(&own);
                let pieces =
                    own.iter().map(|line| line.pieces.len()).sum::<usize>() / own.len().max(1);
                patch.heights.limit(self.view.budget.max_rays as usize / pieces.max(1));
                if patch.is_cut {
                    patch.heights.judge_light_alone();
                }
                patch.heights.add(own.into_iter());
            });
        }
    }

    /// Lines at some places, sorted by row, then beamlet.
    fn lines(&self, tracer: &mut Tracer, places: &[LinePlace]) -> Result<Vec<Arc<LitLine>>> {
        let view = self.view;
        let column = |place: &LinePlace| self.view.lattice.column(place.beamlet);
        let openings = |beamlet: i64| &self.openings[self.view.lattice.column(beamlet)].widest[..];
        let cancel = tracer.cancel().clone();
        let of_run = |run: &&[LinePlace]| {
            cancel.check()?;
            let beamlets = run[0].beamlet..run[run.len() - 1].beamlet + 1;
            Ok(self.surfaces.lines(run[0].row, &beamlets, openings))
        };
        let runs: Vec<&[LinePlace]> = places.chunk_by(follows).collect();
        let runs = runs.par_iter().map(of_run).collect::<Result<Vec<_>>>()?;
        let mut lines: Vec<Vec<Piece>> = runs.into_iter().flatten().collect();
        loop {
            tracer.cancel().check()?;
            let wanted = |(place, pieces): (&LinePlace, &Vec<Piece>)| {
                let wanted = pieces.iter().filter(|it| it.source == Source::Wanted);
                let ray =
                    |it: &Piece| view.lattice.ray(place.beamlet, it.middle(), place.row, view.pose);
                wanted.map(ray).collect::<Vec<Ray>>()
            };
            let wanted: Vec<Vec<Ray>> = places.par_iter().zip(&lines).map(wanted).collect();
            let rays = wanted.concat();
            if rays.is_empty() {
                break;
            }
            let results = tracer.trace(&rays)?;
            let mut results = results.iter();
            for pieces in &mut lines {
                for (piece, ray) in
                    pieces.iter_mut().filter(|it| it.source == Source::Wanted).zip(&mut results)
                {
                    piece.take(ray);
                }
            }
            // A line without new rays stays as it is.
            let all = lines.par_iter_mut().zip(places).zip(wanted);
            let traced = all.filter(|(_, rays)| !rays.is_empty());
            traced.for_each(|((pieces, place), _)| {
                incline(pieces);
                self.split(column(place), pieces);
            });
        }
        let light = lines.into_par_iter().zip(places).map(|(pieces, place)| {
            cancel.check()?;
            let openings = &self.openings[column(place)];
            let light = self.illumination.illuminate(column(place), place.row, openings, pieces);
            Ok(Arc::new(light))
        });
        light.collect()
    }

    /// Splits pieces whose rays do not say enough.
    fn split(&self, column: usize, pieces: &mut Vec<Piece>) {
        let openings = &self.openings[column].widest;
        let limit = BY_RAYS * self.limits.error;
        let is_split = |at: &usize| {
            let piece = &pieces[*at];
            piece.width() > 3.0 * NARROWEST
                && self.illumination.error_of(column, openings, pieces, *at) > limit
        };
        let split: Vec<usize> = (0..pieces.len()).filter(is_split).collect();
        if split.is_empty() || pieces.len() + 2 * split.len() > MOST_PIECES {
            return;
        }
        for at in split.into_iter().rev() {
            let thirds = pieces[at].parts(3);
            pieces.splice(at..=at, thirds);
        }
    }
}
