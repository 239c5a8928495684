//! Lines through the surfaces of a sample: the plane through the source and a line cuts each surface in sections, and
//! between their ends rays cross the same surfaces. No ray is traced but near grazing incidence.

mod effects;
mod pieces;

use super::by_facets::{Cut, EdgePlace, FacetCuts};
use super::by_shapes::{Crossing, ShapeCut, ShapeInBeam};
use super::line::{LinePlace, Piece};
use crate::sampling::{Opening, ViewContext};
use beamlet_core::numbers;
use effects::{Effect, distance_on_plane};
use glam::DVec3;
use std::ops::Range;

/// Narrower pieces, m, are left to those beside them; rays at the end of a section of a curved surface are computed this
/// far inside it.
const THINNEST: f64 = 1e-13;

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

    /// Change of the place over that of the share, up to a factor; at a rim where rays are computed, [`THINNEST`] inside.
    fn density(&self, share: f64, rims: [bool; 2]) -> f64 {
        let least = (THINNEST / (self.x[1] - self.x[0])).sqrt();
        let of_end = |is_rim: bool, share: f64| if is_rim { share.max(least) } else { 1.0 };
        match rims {
            [true, true] => (std::f64::consts::PI * share).sin().max(2.0 * least),
            [low, high] => of_end(low, share) * of_end(high, 1.0 - share),
        }
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
    /// Directions of the sample that are x, y and z of the beam frame.
    axes: [DVec3; 3],
}

impl<'a> SurfaceLines<'a> {
    pub(super) fn new(view: &'a ViewContext<'a>) -> Self {
        Self {
            view,
            facets: FacetCuts::new(view),
            source: view.optics.rotation,
            analyser: view.optics.analyser_place(),
            axes: view.motion.rows(),
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
                self.add_flat_pieces(piece, openings, &mut pieces);
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
}
