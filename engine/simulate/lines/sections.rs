//! Lines through the surfaces of a sample: the plane through the source and a line cuts each surface in sections, and
//! between their ends rays cross the same surfaces. No ray is traced but near grazing incidence.

use super::by_facets::{Cut, EdgePlace, FacetCuts};
use super::by_shapes::{Crossing, ShapeCut, ShapeInBeam};
use super::line::{LinePlace, NARROWEST, Piece, Source, open_share};
use crate::sampling::{Opening, SurfaceStep, ViewContext};
use crate::trace::FIRST_ORDER_ERROR;
use beamlet_core::numbers::{self, single};
use beamlet_interface::{ROUGH_GRAZING, RayResult};
use glam::{DVec2, DVec3};
use std::ops::Range;

/// Narrower pieces, m, are left to those beside them; rays at the end of a section of a curved surface are computed this
/// far inside it.
const THINNEST: f64 = 1e-13;
/// Change of the optical depth over a piece: light is linear in a cell.
const STEEPEST: f64 = 0.1;
/// Most pieces of an interval between ends of facets to begin with, and rays of a piece that draw normals.
const MOST_PARTS: f64 = 64.0;
/// Error by light of a piece of curved surfaces that is straight, share of the budget.
const CURVED: f64 = 0.01;
/// Error by light of a displacement that leaves a straight line, over that of the displacement at most.
const MOVED: f64 = 0.25;
/// Error by light of the change of a variance over a piece, which has its mean, share of the budget.
const WIDENED: f64 = 0.1;
/// Least cosine of incidence at a smooth normal, as in `shaders/walk/smooth.glsl`.
const HORIZON: f64 = 1e-4;
/// Error by light of a piece near grazing that needs no exact ray, share of the budget.
const NEGLIGIBLE: f64 = 0.03;

/// Change of a ray by surfaces.
#[derive(Debug, Clone, Copy, Default)]
struct Change {
    depth: f64,
    /// Displacement on the analyser along x and z, m.
    displacement: DVec2,
    /// Of the slope along x and z.
    slope: DVec2,
    /// Variance of the displacement along x by rough surfaces, m2.
    roughness: f64,
    /// The same by materials that scatter, m2.
    scattering: f64,
}

impl Change {
    /// With a share of another.
    fn plus(self, other: &Self, share: f64) -> Self {
        Self {
            depth: self.depth + other.depth * share,
            displacement: self.displacement + other.displacement * share,
            slope: self.slope + other.slope * share,
            roughness: self.roughness + other.roughness * share,
            scattering: self.scattering + other.scattering * share,
        }
    }

    /// At a share of the way to another.
    fn towards(self, other: &Self, share: f64) -> Self {
        self.plus(&other.plus(&self, -1.0), share)
    }
}

/// Section of a surface by the plane of a line.
#[derive(Debug, Clone, Copy)]
struct Section<'a> {
    /// Ends, m from the centre of the beamlet.
    x: [f64; 2],
    /// Hash added to the signature of a ray.
    hash: u32,
    /// Crossings of a ray.
    crossings: u32,
    form: Form<'a>,
}

#[derive(Debug, Clone, Copy)]
enum Form<'a> {
    Flat {
        /// Effect on rays at both ends.
        ends: [Effect; 2],
        /// From the source along y at both ends, m.
        distance: [f64; 2],
    },
    /// A facet with the normals of a smooth surface.
    Smooth {
        ends: [EdgePlace; 2],
        /// x of both, m from the centre of the beamlet.
        x: [f64; 2],
        is_front: bool,
        component: u32,
    },
    Curved {
        shape: &'a ShapeInBeam,
        /// True for each end at which rays touch the surface.
        rims: [bool; 2],
    },
}

/// Effect of a surface on a ray.
#[derive(Debug, Clone, Copy, Default)]
struct Effect {
    change: Change,
    /// First-order remainder of the displacement, m; 0 where the first order is enough.
    remainder: f64,
    /// The ray draws the normal of a rough surface.
    draws: bool,
}

/// Sums over the surfaces that a ray crosses.
#[derive(Debug, Clone, Copy)]
struct Sums {
    change: Change,
    /// First-order remainder of the displacement, m.
    remainder: f64,
    /// The ray draws normals of rough surfaces.
    draws: bool,
    /// From the source along y to the first and to the last surface, m.
    distance: [f64; 2],
}

/// A ray enters or leaves an exact shape that others cross.
#[derive(Debug, Clone, Copy)]
struct Passage {
    crossing: Crossing,
    is_front: bool,
    component: u32,
}

impl Default for Sums {
    fn default() -> Self {
        let distance = [f64::INFINITY, 0.0];
        Self { change: Change::default(), remainder: 0.0, draws: false, distance }
    }
}

impl Sums {
    /// Adds a surface at a distance from the source along y, m.
    fn add(&mut self, effect: &Effect, distance: f64) {
        self.change = self.change.plus(&effect.change, 1.0);
        self.remainder += effect.remainder;
        self.draws |= effect.draws;
        self.distance = [self.distance[0].min(distance), self.distance[1].max(distance)];
    }
}

/// Interval between neighbouring ends of sections on a line.
#[derive(Debug, Clone, Copy)]
struct Interval<'a> {
    x: [f64; 2],
    crossed: &'a [&'a Section<'a>],
    /// Openings of the beamlet.
    openings: &'a [Opening],
    place: &'a LinePlace,
    /// Number of the interval on the line.
    number: u32,
}

impl Interval<'_> {
    fn is_curved(&self) -> bool {
        self.crossed.iter().any(|it| !matches!(it.form, Form::Flat { .. }))
    }

    /// True for each end at which rays touch a curved surface.
    fn rims(&self) -> [bool; 2] {
        [0, 1].map(|end| {
            self.crossed.iter().any(|it| {
                matches!(it.form, Form::Curved { rims, .. } if rims[end])
                    && (it.x[end] - self.x[end]).abs() <= THINNEST
            })
        })
    }

    /// Place of a share of the interval, such that depths are smooth in the share: they grow with the root of the
    /// distance from a rim.
    fn place(&self, share: f64, rims: [bool; 2]) -> f64 {
        let share = match rims {
            [true, true] => (0.5 * std::f64::consts::PI * share).sin().powi(2),
            [true, false] => share * share,
            [false, true] => share * (2.0 - share),
            [false, false] => share,
        };
        self.x[0] + (self.x[1] - self.x[0]) * share
    }
}

/// Makes lines through the surfaces of a view.
#[derive(Debug)]
pub(super) struct SurfaceLines<'a> {
    view: &'a ViewContext<'a>,
    facets: FacetCuts<'a>,
    /// Distance of the source before the rotation centre, m.
    source: f64,
    /// From the rotation centre to the analyser, m.
    analyser: f64,
}

impl<'a> SurfaceLines<'a> {
    pub(super) fn new(view: &'a ViewContext<'a>) -> Self {
        Self {
            view,
            facets: FacetCuts::new(view),
            source: view.optics.rotation,
            analyser: view.optics.analyser_place(),
        }
    }

    /// Pieces of the lines of some beamlets side by side at a row coordinate, from one end of each beamlet to the other.
    /// `openings`: of a beamlet.
    pub(super) fn lines<'o>(
        &self,
        row: f64,
        beamlets: &Range<i64>,
        openings: impl Fn(i64) -> &'o [Opening],
    ) -> Vec<Vec<Piece>> {
        let (cuts, shapes) = self.facets.of(row, beamlets);
        let lattice = self.view.lattice;
        let shapes: Vec<ShapeInBeam> = shapes.into_iter().filter_map(|at| self.shape(at)).collect();
        let slopes = |x: f64| lattice.slopes_at(x, row);
        let of_shape = |shape: &'_ ShapeInBeam| shape.cuts(self.source, lattice.plane, slopes);
        let curved: Vec<(usize, ShapeCut)> = (0..)
            .zip(&shapes)
            .flat_map(|(at, shape)| of_shape(shape).into_iter().map(move |cut| (at, cut)))
            .collect();
        let count = numbers::narrow(beamlets.end - beamlets.start);
        let of_beamlets = |ends: &mut dyn Iterator<Item = [f64; 2]>| {
            let mut of_beamlets: Vec<Vec<u32>> = vec![Vec::new(); count];
            for (number, ends) in (0..).zip(ends) {
                let [first, last] = ends.map(|x| lattice.beamlet_at(x));
                for beamlet in first.max(beamlets.start)..(last + 1).min(beamlets.end) {
                    of_beamlets[numbers::narrow::<usize>(beamlet - beamlets.start)].push(number);
                }
            }
            of_beamlets
        };
        let flat_of = of_beamlets(&mut cuts.iter().map(|cut| cut.ends.map(|end| end.x)));
        let curved_of = of_beamlets(&mut curved.iter().map(|(_, cut)| cut.x));
        let line = |((beamlet, flat), own): ((i64, &Vec<u32>), &Vec<u32>)| {
            let flat =
                flat.iter().filter_map(|cut| self.flat_section(&cuts[*cut as usize], beamlet, row));
            let own = own.iter().filter_map(|cut| {
                let (shape, cut) = &curved[*cut as usize];
                self.curved_section(&shapes[*shape], cut, beamlet)
            });
            self.line(&LinePlace { beamlet, row }, flat.chain(own).collect(), openings(beamlet))
        };
        beamlets.clone().zip(&flat_of).zip(&curved_of).map(line).collect()
    }

    /// The exact shape at an index among the placed surfaces.
    fn shape(&self, at: usize) -> Option<ShapeInBeam> {
        let sample = self.view.sample;
        let placed = &sample.placed[at];
        let shape = sample.prototypes[placed.prototype as usize].shape?;
        let centre = self.view.motion.at(placed.place.position);
        let mut shape = ShapeInBeam::new(shape, placed, &self.facets.rotation, centre);
        shape.is_crossed = sample.partners.of(numbers::count(at)).is_some();
        Some(shape)
    }

    /// Pieces of a line, of its sections.
    fn line(
        &self,
        place: &LinePlace,
        mut sections: Vec<Section<'_>>,
        openings: &[Opening],
    ) -> Vec<Piece> {
        let half = 0.5 * self.view.lattice.period;
        let mut ends: Vec<f64> = sections.iter().flat_map(|it| it.x).chain([-half, half]).collect();
        ends.sort_unstable_by(f64::total_cmp);
        ends.dedup();
        sections.sort_by(|a, b| a.x[0].total_cmp(&b.x[0]));
        let mut pieces = Vec::with_capacity(ends.len());
        let mut crossed: Vec<&Section<'_>> = Vec::new();
        let mut next = 0;
        let mut from = -half;
        for (number, pair) in (0..).zip(ends.windows(2)) {
            crossed.retain(|it| it.x[1] > pair[0]);
            while let Some(section) = sections.get(next).filter(|it| it.x[0] <= pair[0]) {
                if section.x[1] > pair[0] {
                    crossed.push(section);
                }
                next += 1;
            }
            if pair[1] - from < THINNEST && pair[1] < half {
                continue;
            }
            let x = [from, pair[1]];
            let interval = Interval { x, crossed: &crossed, openings, place, number };
            if interval.is_curved() {
                self.curved_pieces(&interval, &mut pieces);
            } else {
                let [low, high] = x.map(|x| self.sums(&interval, x));
                let piece = self.piece(&interval, x, &[low, high], None);
                let change = f64::from((piece.depth[1] - piece.depth[0]).abs());
                let parts = (change / STEEPEST).ceil().clamp(1.0, MOST_PARTS);
                let parts = numbers::whole::<u32>(parts)
                    .max(self.draws_of(&piece, openings))
                    .max(self.parts_by_scattering(&piece, openings));
                pieces.extend(piece.parts(parts));
            }
            from = pair[1];
        }
        pieces
    }

    /// The section of a cut facet in a beamlet.
    fn flat_section(&self, cut: &Cut, beamlet: i64, row: f64) -> Option<Section<'_>> {
        let lattice = self.view.lattice;
        let centre = lattice.centre(beamlet);
        let ends = cut.ends.map(|end| end.x - centre);
        let x = self.within(ends)?;
        let Cut { is_front, component, .. } = *cut;
        let step = &self.view.facets.steps[component as usize];
        let form = if cut.is_smooth {
            Form::Smooth { ends: cut.ends, x: ends, is_front, component }
        } else {
            let distance =
                x.map(|x| distance_on_plane(&cut.ends, (x - ends[0]) / (ends[1] - ends[0])));
            let normal = cut.ends[0].normal;
            let effects = [0, 1].map(|end| {
                let crossing = Crossing { distance: distance[end], normal };
                self.effect(step, crossing, is_front, lattice.slopes(beamlet, x[end], row))
            });
            Form::Flat { ends: effects, distance }
        };
        Some(Section { x, hash: step.hash, crossings: 1, form })
    }

    /// The section of a shape in a beamlet.
    fn curved_section<'s>(
        &self,
        shape: &'s ShapeInBeam,
        cut: &ShapeCut,
        beamlet: i64,
    ) -> Option<Section<'s>> {
        let centre = self.view.lattice.centre(beamlet);
        let x = self.within(cut.x.map(|x| x - centre))?;
        let step = &self.view.facets.steps[shape.component as usize];
        let crossings = 2 * cut.chords;
        let form = Form::Curved { shape, rims: cut.rims };
        Some(Section { x, hash: step.hash.wrapping_mul(crossings), crossings, form })
    }

    /// The part of an interval of x (m from the centre of a beamlet) within the beamlet.
    fn within(&self, [low, high]: [f64; 2]) -> Option<[f64; 2]> {
        let half = 0.5 * self.view.lattice.period;
        let x = [low.max(-half), high.min(half)];
        (x[1] > x[0]).then_some(x)
    }

    /// Sums of the ray at x.
    fn sums(&self, interval: &Interval<'_>, x: f64) -> Sums {
        let mut sums = Sums::default();
        let mut crossed: Vec<Passage> = Vec::new();
        let LinePlace { beamlet, row } = *interval.place;
        let slopes_at = |x: f64| self.view.lattice.slopes(beamlet, x, row);
        let step = |component: u32| &self.view.facets.steps[component as usize];
        for section in interval.crossed {
            let width = section.x[1] - section.x[0];
            match &section.form {
                Form::Flat { ends: [low, high], distance } => {
                    let share = (x - section.x[0]) / width;
                    let effect = Effect {
                        change: low.change.towards(&high.change, share),
                        remainder: low.remainder.max(high.remainder),
                        draws: low.draws || high.draws,
                    };
                    // The extent of a piece reaches over both ends of a section.
                    sums.add(&effect, distance[0]);
                    sums.add(&Effect::default(), distance[1]);
                }
                Form::Smooth { ends, x: of_ends, is_front, component } => {
                    let slopes = slopes_at(x);
                    let share = (x - of_ends[0]) / (of_ends[1] - of_ends[0]);
                    let distance = distance_on_plane(ends, share);
                    let normal = ends[0].normal + (ends[1].normal - ends[0].normal) * share;
                    let normal = before_horizon(normal.normalize_or_zero(), *is_front, slopes);
                    let crossing = Crossing { distance, normal };
                    let effect = self.effect(step(*component), crossing, *is_front, slopes);
                    sums.add(&effect, distance);
                }
                Form::Curved { shape, .. } => {
                    let within = (0.5 * width).min(THINNEST);
                    let x = x.clamp(section.x[0] + within, section.x[1] - within);
                    let slopes = slopes_at(x);
                    let component = shape.component;
                    for (crossing, is_front) in
                        shape.chords(self.source, slopes).flat_map(|[a, b]| [(a, true), (b, false)])
                    {
                        if shape.is_crossed {
                            crossed.push(Passage { crossing, is_front, component });
                            continue;
                        }
                        let effect = self.effect(step(component), crossing, is_front, slopes);
                        sums.add(&effect, crossing.distance);
                    }
                }
            }
        }
        if !crossed.is_empty() {
            self.add_crossed(&mut crossed, slopes_at(x), &mut sums);
        }
        sums
    }

    /// Adds the surfaces of exact shapes that cross: of the objects that contain a point the last one fills it.
    fn add_crossed(&self, passages: &mut [Passage], slopes: [f64; 2], sums: &mut Sums) {
        let components = &self.view.sample.components;
        let object = |it: &Passage| components[it.component as usize].object;
        passages.sort_by(|a, b| a.crossing.distance.total_cmp(&b.crossing.distance));
        // Objects around the ray, once for each body.
        let mut around: Vec<u32> = Vec::new();
        for it in passages.iter() {
            let own = object(it);
            if !it.is_front
                && let Some(at) = around.iter().position(|other| *other == own)
            {
                around.swap_remove(at);
            }
            if around.iter().all(|other| *other < own) {
                let last = around.iter().max().copied();
                let outside = last.max(components[it.component as usize].outside);
                let step = self.view.facets.step_in(it.component, own, outside);
                let effect = self.effect(step, it.crossing, it.is_front, slopes);
                sums.add(&effect, it.crossing.distance);
            }
            if it.is_front {
                around.push(own);
            }
        }
    }

    /// Pieces of an interval of curved surfaces, halved until they are straight.
    fn curved_pieces(&self, interval: &Interval<'_>, pieces: &mut Vec<Piece>) {
        let rims = interval.rims();
        let place = |share: f64| interval.place(share, rims);
        let sums = |share: f64| self.sums(interval, place(share));
        let [low, middle, high] = [0.0, 0.5, 1.0].map(sums);
        let mut waiting = vec![([0.5, 1.0], [middle, high]), ([0.0, 0.5], [low, middle])];
        while let Some((shares, ends)) = waiting.pop() {
            let half = f64::midpoint(shares[0], shares[1]);
            let x = shares.map(place);
            let middle = sums(half);
            if self.bends(interval, x, [&ends[0], &middle, &ends[1]]) {
                waiting.push(([half, shares[1]], [middle, ends[1]]));
                waiting.push(([shares[0], half], [ends[0], middle]));
            } else {
                let piece = self.piece(interval, x, &ends, Some(&middle));
                pieces.extend(piece.parts(self.draws_of(&piece, interval.openings)));
            }
        }
    }

    /// True if light is not straight enough in a part of an interval.
    fn bends(&self, interval: &Interval<'_>, x: [f64; 2], at: [&Sums; 3]) -> bool {
        let response = self.view.response;
        let width = x[1] - x[0];
        if width < NARROWEST {
            return false;
        }
        let share = response.lit(single(open_share(interval.openings, x)));
        let whole = width * f64::from(response.weight * share);
        let passed =
            at.map(|it| f64::from(response.hardening.light(single(it.change.depth.max(0.0)))));
        let off = |[low, middle, high]: [f64; 3]| (middle - f64::midpoint(low, high)).abs();
        let most = passed.into_iter().fold(0.0, f64::max);
        let moved = if self.matters(whole * most, at[1].remainder) {
            // Rays go on from here, where all of it is near grazing.
            f64::from(u8::from(at.iter().any(|it| it.remainder <= 0.0)))
        } else {
            MOVED * off(at.map(|it| it.change.displacement.x)) * response.steepest()
        };
        let error = whole * (off(passed) + most * moved.min(1.0));
        let widened = self.widening([0, 2].map(|end| at[end].change.scattering));
        error > CURVED * self.view.budget.light
            || whole * most * widened > WIDENED * self.view.budget.light
    }

    /// Largest change of light, share of it, by a change of the variance of the displacement between two values.
    fn widening(&self, [low, high]: [f64; 2]) -> f64 {
        ((high - low).abs() * self.view.response.steepest().powi(2)).min(1.0)
    }

    /// Number of parts of a piece whose variances by materials are constant: the error falls with its square, since
    /// light and variance both belong to a part.
    fn parts_by_scattering(&self, piece: &Piece, openings: &[Opening]) -> u32 {
        let widened = self.widening(piece.scattering.map(f64::from));
        if widened <= 0.0 {
            return 1;
        }
        let error = self.light(piece, openings) * widened;
        let parts = (error / (WIDENED * self.view.budget.light)).sqrt().ceil();
        numbers::whole(parts.clamp(1.0, MOST_PARTS))
    }

    /// The piece between two ends, with the sums of the rays there and, of curved surfaces, in the middle.
    fn piece(
        &self,
        interval: &Interval<'_>,
        x: [f64; 2],
        ends: &[Sums; 2],
        middle: Option<&Sums>,
    ) -> Piece {
        let mut changes = ends.map(|it| it.change);
        let remainder = middle.unwrap_or(&ends[0]).remainder;
        if ends.iter().any(|it| it.remainder > 0.0) {
            self.bound(&mut changes);
        }
        if let Some(middle) = middle {
            // The mean by Simpson's rule; a ray has the displacement in the middle.
            let off = middle.change.plus(&changes[0].towards(&changes[1], 0.5), -1.0);
            changes = changes.map(|end| {
                let mean = end.plus(&off, 2.0 / 3.0);
                if remainder > 0.0 { Change { depth: mean.depth, ..middle.change } } else { mean }
            });
        }
        // Rounded.
        let depth = changes.map(|end| single(end.depth.max(0.0)));
        let scattering = changes.map(|end| single(end.scattering.max(0.0)));
        let mean = changes[0].towards(&changes[1], 0.5);
        let crossed = || interval.crossed.iter();
        let result = RayResult {
            optical_depth: 0.5 * (depth[0] + depth[1]),
            displacement_x: single(mean.displacement.x),
            displacement_z: single(mean.displacement.y),
            slope_x: single(mean.slope.x),
            slope_z: single(mean.slope.y),
            signature: crossed().fold(0, |all, it| all.wrapping_add(it.hash)),
            flags: 0,
            crossings: crossed().map(|it| it.crossings).sum(),
            displacement_variance: single(mean.roughness) + 0.5 * (scattering[0] + scattering[1]),
        };
        let displacement = changes.map(|end| single(end.displacement.x));
        let nearest = ends[0].distance[0].min(ends[1].distance[0]);
        let extent = single(ends[0].distance[1].max(ends[1].distance[1]) - nearest);
        let mut piece = Piece {
            x,
            depth,
            displacement,
            scattering,
            result,
            source: Source::FirstOrder,
            extent,
            interval: interval.number,
            is_curved: middle.is_some(),
            draws: middle.is_none_or(|it| it.draws) && ends.iter().any(|it| it.draws),
        };
        let is_exact = self.view.facets.is_exact && !interval.crossed.is_empty();
        let remainder = if is_exact { f64::INFINITY } else { remainder };
        if remainder > 0.0 && self.counts(&piece, interval.openings, remainder) {
            piece.source = Source::Wanted;
        }
        piece
    }

    /// Number of rays of a piece: of one whose rays draw normals about the root of those that its light needs, so
    /// that as many lines are.
    fn draws_of(&self, piece: &Piece, openings: &[Opening]) -> u32 {
        if !piece.draws || piece.source != Source::Wanted {
            return 1;
        }
        let light = self.light(piece, openings) / self.view.budget.light;
        numbers::whole(light.ceil().clamp(1.0, MOST_PARTS))
    }

    /// Effect of a surface on the ray of a slope that crosses it. `is_front`: the ray enters.
    fn effect(
        &self,
        step: &SurfaceStep,
        Crossing { distance, normal }: Crossing,
        is_front: bool,
        slope: [f64; 2],
    ) -> Effect {
        let y = distance - self.source;
        let along = normal.x * slope[0] + normal.y + normal.z * slope[1];
        let square = 1.0 + slope[0] * slope[0] + slope[1] * slope[1];
        let length = square.sqrt();
        let sign = if is_front { 1.0 } else { -1.0 };
        let lever = self.analyser - y;
        let bend = step.delta * square / along.abs().max(1e-9);
        // Against the normal that faces the source.
        let facing = if along > 0.0 { -sign } else { sign };
        let across = DVec2::new(normal.x - normal.y * slope[0], normal.z - normal.y * slope[1]);
        let bends = facing * bend * across;
        let share = along.abs() / length / step.least_cosine.max(1e-30);
        let draws = step.delta != 0.0 && along.abs() < ROUGH_GRAZING * step.roughness * length;
        let remainder = if step.is_open || draws {
            f64::INFINITY
        } else if share < 1.0 {
            FIRST_ORDER_ERROR * lever / (share * share * share)
        } else {
            0.0
        };
        let depth = -sign * step.mu * length * y;
        let roughness = if step.roughness > 0.0 && !draws {
            // As `shaders/walk/cross_rough.glsl`.
            let spread = DVec3::new(1.0, -slope[0], 0.0) / along
                - DVec3::new(slope[0], 1.0, slope[1]) * (across.x / (along * along));
            (step.roughness * square * step.delta * lever).powi(2) * spread.length_squared()
        } else {
            0.0
        };
        // As `squared_arm` of `shaders/walk/moments.glsl`.
        let arm = self.analyser;
        let squared_arm = y * (arm * (arm - y) + y * y / 3.0) * length * square;
        let scattering = -sign * step.scattering * squared_arm * (1.0 + slope[0] * slope[0]);
        let displacement = bends * lever;
        let change = Change { depth, displacement, slope: bends, roughness, scattering };
        Effect { change, remainder, draws }
    }

    /// Reduces displacements by the first order near grazing incidence to what total reflection makes.
    fn bound(&self, ends: &mut [Change; 2]) {
        let (lattice, pitch) = (self.view.lattice, self.view.optics.detector.pitch);
        let farthest = [lattice.halo_columns, lattice.halo].map(|halo| halo as f64);
        for end in ends {
            let over = |axis: usize| {
                let most = (farthest[axis] - 1.0).max(0.5) * pitch[axis];
                (end.displacement[axis].abs() / most).max(1.0)
            };
            let factor = over(0).max(over(1)).recip();
            end.displacement *= factor;
            end.slope *= factor;
        }
    }

    /// True if a first-order remainder of the displacement matters in a piece.
    fn counts(&self, piece: &Piece, openings: &[Opening], remainder: f64) -> bool {
        piece.width() >= NARROWEST && self.matters(self.light(piece, openings), remainder)
    }

    /// Light of a piece at the mask step that opens it most, share of open beam.
    fn light(&self, piece: &Piece, openings: &[Opening]) -> f64 {
        let response = self.view.response;
        let share = response.lit(single(open_share(openings, piece.x)));
        let passed = response.weight * response.hardening.light(piece.result.optical_depth) * share;
        piece.width() * f64::from(passed)
    }

    /// True if light with this first-order remainder of its displacement errs by more than needs no exact ray.
    fn matters(&self, light: f64, remainder: f64) -> bool {
        let moved = (remainder * self.view.response.steepest()).min(1.0);
        light * moved > NEGLIGIBLE * self.view.budget.light
    }
}

/// Distance from the source along y at a share of the way between two points on a plane, as x goes: there
/// 1 / distance is linear in x.
fn distance_on_plane(ends: &[EdgePlace; 2], share: f64) -> f64 {
    let [low, high] = ends.map(|end| 1.0 / end.distance);
    1.0 / (low + (high - low) * share)
}

/// A smooth normal that faces the ray of a slope as its facet does: one that turns away is moved to the horizon.
fn before_horizon(normal: DVec3, is_front: bool, [slope_x, slope_z]: [f64; 2]) -> DVec3 {
    let direction = DVec3::new(slope_x, 1.0, slope_z).normalize();
    let side = if is_front { -1.0 } else { 1.0 };
    let lacks = HORIZON - side * normal.dot(direction);
    if lacks > 0.0 { (normal + side * lacks * direction).normalize() } else { normal }
}
