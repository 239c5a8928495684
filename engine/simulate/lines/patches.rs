//! Patches: heights of their lines, or rays of those whose bodies are many, and errors.

use super::audit::Auditor;
use super::combined_light::CombinedIllumination;
use super::even::{EvenPatch, EvenSampler, Next};
use super::heights::{Features, Heights, Limits, Uneven};
use super::light::LitLine;
use super::line::{LinePlace, MOST_PIECES, NARROWEST, Piece, Source, incline};
use super::patch_places::PatchPlaces;
use super::sections::SurfaceLines;
use super::work::{AwaitedLine, OpenLine, Patches, Work};
use crate::sampling::{ColumnOpenings, Room, ViewContext, safety, tally_of};
use crate::trace::Tracer;
use beamlet_core::tally::Tally;
use beamlet_core::{Cancel, Result, numbers};
use beamlet_interface::{Ray, RayResult};
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
    /// Lines that it waits for.
    awaited: Vec<AwaitedLine>,
    /// Bytes of the lines that it has.
    bytes: u64,
}

impl LinePatch {
    fn new(beamlet: i64, row: i64, heights: Heights<Arc<LitLine>>) -> Self {
        let awaited = Vec::new();
        Self { beamlet, row, heights, signature: None, is_cut: false, awaited, bytes: 0 }
    }

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

    /// Bytes of its lines, and of those lit that it waits for with others.
    pub(super) fn bytes(&self) -> u64 {
        let lit = self.awaited.iter().filter_map(|it| it.get());
        self.bytes + lit.map(|line| line.bytes()).sum::<u64>()
    }

    /// True if it wants no other line.
    pub(super) fn is_done(&self) -> bool {
        self.awaited.is_empty() && self.heights.wanted().next().is_none()
    }

    /// Takes the lines that it waits for, where each of them is lit, and wants others or is done. `most`: its rays.
    fn take(&mut self, most: usize) {
        let lines: Option<Vec<_>> = self.awaited.iter().map(|it| it.get().cloned()).collect();
        let Some(lines) = lines.filter(|it| !it.is_empty()) else { return };
        self.awaited.clear();
        self.look_for_silhouettes(&lines);
        self.bytes += lines.iter().map(|line| line.bytes()).sum::<u64>();
        let pieces = lines.iter().map(|line| line.pieces.len()).sum::<usize>() / lines.len();
        self.heights.limit(most / pieces.max(1));
        if self.is_cut {
            self.heights.judge_light_alone();
        }
        self.heights.add(lines.into_iter());
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
            beside: 0.0,
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

    /// Chooses the lines or rays that the light of patches needs, and passes the patches to `take` in parts.
    ///
    /// # Errors
    /// As [`Tracer::trace`]; [`beamlet_core::Error::Memory`] where a patch exceeds `room`; errors of `take`.
    pub(crate) fn sample(
        &self,
        tracer: &mut Tracer,
        places: &[(i64, i64)],
        of: &PatchPlaces,
        room: &Room,
        take: &mut dyn FnMut(&mut Tracer, Sampled) -> Result<()>,
    ) -> Result<()> {
        let (crowded, few) =
            places.iter().partition(|(beamlet, row)| of.is_crowded(*beamlet, *row));
        let mut work = Work::new([few, crowded], room.bytes());
        let cancel = tracer.cancel().clone();
        self.go_on(&cancel, &mut work, of)?;
        loop {
            let rays = self.rays(&work);
            let (even, open) = (work.begun.even.len(), work.open.len());
            // The device is waited for on this thread, and not on one that others share.
            let mut others = Ok(());
            let results = rayon::in_place_scope(|scope| {
                scope.spawn(|_| others = self.go_on(&cancel, &mut work, of));
                tracer.trace(&rays)
            });
            let results = results.and_then(|it| others.map(|()| it))?;
            let results = self.take_even(even, &results, &mut work, of);
            self.take_rays(open, results, &mut work);
            if work.done.count() > 0 && (work.is_full() || work.is_over()) {
                let sampled = self.finish(tracer, work.take_done())?;
                take(tracer, sampled)?;
            }
            if work.is_at_end() {
                return Ok(());
            }
            while work.is_over() {
                // Work that is lost comes to the same.
                if let Some(alone) = work.leave_half() {
                    return Err(room.too_small(alone));
                }
            }
        }
    }

    /// Errors and counts of patches that are done.
    fn finish(&self, tracer: &mut Tracer, patches: Patches) -> Result<Sampled> {
        let Patches { mut lines, mut even } = patches;
        // In an order that no number of rounds changes.
        lines.sort_by_key(|patch| (patch.row, patch.beamlet));
        even.sort_by_key(|patch| (patch.row, patch.beamlet));
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
        Ok(Sampled { lines, even, tally })
    }

    fn auditor(&self) -> Auditor<'_> {
        Auditor {
            view: self.view,
            illumination: self.illumination.first(),
            openings: &self.openings,
            scatters: self.view.facets.steps.iter().any(|step| step.scattering.abs() > 0.0),
        }
    }

    /// Openings of a beamlet.
    fn openings_of(&self, beamlet: i64) -> &ColumnOpenings {
        &self.openings[self.view.lattice.column(beamlet)]
    }

    /// Works on patches until each of them waits for rays or is done, and begins new ones while memory allows it.
    fn go_on(&self, cancel: &Cancel, work: &mut Work, of: &PatchPlaces) -> Result<()> {
        loop {
            let [few, crowded] = work.next();
            work.begun.lines.extend(few.into_iter().filter_map(|(beamlet, row)| {
                Some(self.patch_of_lines((beamlet, row), of.features_of_few(beamlet, row)?))
            }));
            work.begun.even.extend(crowded.into_iter().filter_map(|(beamlet, row)| {
                let bodies = of.bodies(beamlet, row)?;
                Some(self.even.begin(beamlet, row, self.openings_of(beamlet), bodies))
            }));
            self.begin_lines(cancel, work)?;
            if work.ready.is_empty() || work.is_over() {
                return Ok(());
            }
            self.light_lines(cancel, work)?;
        }
    }

    /// Begins the lines that patches want. Rows side by side share the line at their border.
    fn begin_lines(&self, cancel: &Cancel, work: &mut Work) -> Result<()> {
        let wanted = |patch: &LinePatch| -> Vec<LinePlace> {
            let wanted = patch.heights.wanted().filter(|_| patch.awaited.is_empty());
            wanted.map(|z| patch.place(z)).collect()
        };
        let wanted: Vec<Vec<LinePlace>> = work.begun.lines.par_iter().map(wanted).collect();
        let places = LinePlace::distinct(wanted.concat());
        let light: Vec<AwaitedLine> = places.iter().map(|_| AwaitedLine::default()).collect();
        let own = work.begun.lines.par_iter_mut().zip(wanted);
        own.filter(|(_, wanted)| !wanted.is_empty()).for_each(|(patch, wanted)| {
            let line = |place: &LinePlace| Some(light[place.index(&places)?].clone());
            patch.awaited = wanted.iter().filter_map(line).collect();
        });
        let openings = |beamlet: i64| &self.openings_of(beamlet).widest[..];
        let of_run = |run: &[LinePlace]| {
            cancel.check()?;
            let beamlets = run[0].beamlet..run[run.len() - 1].beamlet + 1;
            Ok(self.surfaces.lines(run[0].row, &beamlets, openings))
        };
        let runs: Vec<&[LinePlace]> = places.chunk_by(follows).collect();
        let pieces = runs.into_par_iter().map(of_run).collect::<Result<Vec<_>>>()?;
        let lines = pieces.into_iter().flatten().zip(places).zip(light);
        work.add(lines.map(|((pieces, place), light)| OpenLine { place, pieces, light }));
        Ok(())
    }

    /// A patch of lines.
    fn patch_of_lines(&self, (beamlet, row): (i64, i64), features: &Features) -> LinePatch {
        LinePatch::new(beamlet, row, Heights::new(features, self.limits))
    }

    /// Lights the lines that want no rays, and patches take them.
    fn light_lines(&self, cancel: &Cancel, work: &mut Work) -> Result<()> {
        let ready = std::mem::take(&mut work.ready).into_par_iter();
        ready.try_for_each(|OpenLine { place, pieces, light }| {
            cancel.check()?;
            let column = self.view.lattice.column(place.beamlet);
            let openings = self.openings_of(place.beamlet);
            let lit = self.illumination.illuminate(column, place.row, openings, pieces);
            // Each line is lit once.
            let _ = light.set(Arc::new(lit));
            Ok(())
        })?;
        let most = self.view.budget.max_rays as usize;
        work.begun.lines.par_iter_mut().for_each(|patch| patch.take(most));
        work.settle();
        Ok(())
    }

    /// Rays that patches and lines wait for.
    fn rays(&self, work: &Work) -> Vec<Ray> {
        let view = self.view;
        let of_even = |patch: &EvenPatch| {
            let ray = |[x, z]: [f32; 2]| view.ray(patch.beamlet, patch.row, x, z);
            patch.rays().map(ray).collect::<Vec<Ray>>()
        };
        let of_line = |line: &OpenLine| {
            let LinePlace { beamlet, row } = line.place;
            let ray = |x: f64| view.lattice.ray(beamlet, x, row, view.pose);
            line.wanted().map(ray).collect::<Vec<Ray>>()
        };
        let even = work.begun.even.par_iter().map(of_even);
        even.chain(work.open.par_iter().map(of_line)).collect::<Vec<_>>().concat()
    }

    /// The first patches of many bodies take their rays; results that are left.
    fn take_even<'r>(
        &self,
        count: usize,
        mut results: &'r [RayResult],
        work: &mut Work,
        of: &PatchPlaces,
    ) -> &'r [RayResult] {
        let with_results = |patch: EvenPatch| {
            let (own, rest) = results.split_at(patch.count() as usize);
            results = rest;
            (own, patch)
        };
        let patches: Vec<_> = work.begun.even.drain(..count).map(with_results).collect();
        let judged = patches.into_par_iter().map(|(results, mut patch)| {
            let openings = self.openings_of(patch.beamlet);
            let next = self.even.take(&mut patch, results, openings);
            (patch, next)
        });
        let mut of_lines = Vec::new();
        for (patch, next) in judged.collect::<Vec<_>>() {
            match next {
                Next::Done => work.done.even.push(patch),
                Next::Lines => of_lines.push((patch.beamlet, patch.row)),
                Next::Rays { .. } => work.begun.even.push(patch),
            }
        }
        if !of_lines.is_empty() {
            let features = of.features_of_many(self.view, &of_lines);
            let patches = of_lines.into_iter().zip(&features);
            work.begun
                .lines
                .extend(patches.map(|(at, features)| self.patch_of_lines(at, features)));
        }
        results
    }

    /// The first lines that want rays take theirs.
    fn take_rays(&self, count: usize, mut results: &[RayResult], work: &mut Work) {
        let with_results = |line: OpenLine| {
            let (own, rest) = results.split_at(line.wanted().count());
            results = rest;
            (own, line)
        };
        let lines: Vec<_> = work.open.drain(..count).map(with_results).collect();
        let take = |(results, mut line): (&[RayResult], OpenLine)| {
            let pieces = &mut line.pieces;
            let wanted = pieces.iter_mut().filter(|it| it.source == Source::Wanted);
            wanted.zip(results).for_each(|(piece, ray)| piece.take(ray));
            incline(pieces);
            self.split(self.view.lattice.column(line.place.beamlet), pieces);
            line
        };
        let lines: Vec<OpenLine> = lines.into_par_iter().map(take).collect();
        work.add(lines.into_iter());
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
