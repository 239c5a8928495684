//! Lines through facets: the plane through the source and a line cuts each facet in a section, and between ends of
//! sections rays cross the same facets. No ray is traced but near grazing incidence.

use super::line::{Piece, Source, open_share};
use crate::accel::Fan;
use crate::sampling::{Opening, SurfaceStep, ViewContext};
use crate::trace::FIRST_ORDER_ERROR;
use beamlet_core::numbers::{self, single};
use beamlet_geometry::{FacetOf, Place, Placed};
use beamlet_interface::RayResult;
use glam::{DMat3, DVec3};
use std::ops::Range;

/// Narrower pieces, m, are left to those beside them.
const THINNEST: f64 = 1e-13;
/// Change of the optical depth over a piece: light is linear in a cell.
const STEEPEST: f64 = 0.1;
/// Most pieces of an interval between ends of facets, to begin with.
const MOST_PARTS: f64 = 64.0;
/// Narrower pieces, m, get no ray of their own: places of rays are as coarse in f32 across a detector.
const NARROWEST: f64 = 2e-9;
/// Error by light of a piece near grazing that needs no exact ray, share of the budget.
const NEGLIGIBLE: f64 = 0.03;

/// Numbers of a ray: optical depth, displacement on the analyser and change of slope along x and z.
type Numbers = [f64; 5];

/// A facet that the plane of lines cuts.
#[derive(Debug, Clone, Copy)]
struct Cut {
    /// x in the cell plane, m, and distance from the source along y, m, at both ends of the section.
    ends: [(f64, f64); 2],
    /// Rays enter its object.
    is_front: bool,
    component: u32,
    /// Unit normal in the beam frame.
    normal: DVec3,
}

/// Section of a facet by the plane of a line.
#[derive(Debug, Clone, Copy)]
struct Section {
    /// Ends, m from the centre of the beamlet.
    x: [f64; 2],
    /// Effect on rays at both ends.
    ends: [Numbers; 2],
    /// From the source along y at both ends, m.
    distance: [f64; 2],
    /// Hash of its component.
    hash: u32,
    /// First-order remainder of the displacement, m; 0 where the first order is enough.
    remainder: f64,
}

/// Makes lines through the facets of a view.
#[derive(Debug)]
pub(crate) struct FacetLines<'a> {
    view: &'a ViewContext<'a>,
    source: DVec3,
    /// From the sample's frame to the beam's.
    rotation: DMat3,
    /// From the rotation centre to the analyser, m.
    analyser: f64,
}

impl<'a> FacetLines<'a> {
    pub(crate) fn new(view: &'a ViewContext<'a>) -> Self {
        Self {
            view,
            source: DVec3::new(0.0, -view.optics.rotation, 0.0),
            rotation: {
                let [x, y, z] = view.motion.rows();
                DMat3::from_cols(x, y, z).transpose()
            },
            analyser: view.optics.analyser_place(),
        }
    }

    /// Pieces of the lines of some beamlets side by side at a row coordinate, from one end of each beamlet to the other.
    /// `openings`: of a beamlet.
    pub(crate) fn lines<'o>(
        &self,
        row: f64,
        beamlets: &Range<i64>,
        openings: impl Fn(i64) -> &'o [Opening],
    ) -> Vec<Vec<Piece>> {
        let cuts = self.cuts(row, beamlets);
        let lattice = self.view.lattice;
        let mut of_beamlets: Vec<Vec<u32>> =
            vec![Vec::new(); numbers::narrow(beamlets.end - beamlets.start)];
        for (number, cut) in (0..).zip(&cuts) {
            let [first, last] = cut.ends.map(|(x, _)| lattice.beamlet_at(x));
            for beamlet in first.max(beamlets.start)..(last + 1).min(beamlets.end) {
                of_beamlets[numbers::narrow::<usize>(beamlet - beamlets.start)].push(number);
            }
        }
        let line = |(beamlet, own): (i64, &Vec<u32>)| {
            let sections =
                own.iter().filter_map(|cut| self.section(&cuts[*cut as usize], beamlet, row));
            self.line(sections.collect(), openings(beamlet))
        };
        beamlets.clone().zip(&of_beamlets).map(line).collect()
    }

    /// Pieces of a line, of its sections.
    fn line(&self, mut sections: Vec<Section>, openings: &[Opening]) -> Vec<Piece> {
        let half = 0.5 * self.view.lattice.period;
        let mut ends: Vec<f64> = sections.iter().flat_map(|it| it.x).chain([-half, half]).collect();
        ends.sort_unstable_by(f64::total_cmp);
        ends.dedup();
        sections.sort_by(|a, b| a.x[0].total_cmp(&b.x[0]));
        let mut pieces = Vec::with_capacity(ends.len());
        let mut crossed: Vec<&Section> = Vec::new();
        let mut next = 0;
        let mut from = -half;
        for pair in ends.windows(2) {
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
            let piece = self.piece([from, pair[1]], &crossed, openings);
            let interval = numbers::count(pieces.len());
            let change = f64::from((piece.depth[1] - piece.depth[0]).abs());
            let parts = (change / STEEPEST).ceil().clamp(1.0, MOST_PARTS);
            pieces.extend(Piece { interval, ..piece }.parts(numbers::whole(parts)));
            from = pair[1];
        }
        pieces
    }

    /// Facets that the plane of the lines at a row coordinate cuts, over some beamlets.
    fn cuts(&self, row: f64, beamlets: &Range<i64>) -> Vec<Cut> {
        let (view, lattice) = (self.view, self.view.lattice);
        let half = 0.5 * lattice.period;
        let slope = |beamlet: i64, x: f64| lattice.slopes(beamlet, x, row);
        let [[low, slope_z], [high, _]] =
            [slope(beamlets.start, -half), slope(beamlets.end - 1, half)];
        let beam = Fan::new(self.source, [low, high], slope_z);
        let fan = beam.in_frame(&self.rotation, view.motion.offset());
        let mut cuts = Vec::new();
        view.facets.tree.each(view.sample, &fan, &mut |facet, fan| {
            let corners = self.corners(facet);
            let heights = corners.own.map(|corner| fan.height(corner));
            let Some(crossed) = crossed_edges(heights) else { return };
            let at = |[from, to]: [usize; 2]| {
                // In the order of the corners' numbers: both facets at an edge find the same place.
                let [from, to] = if corners.numbers[from] < corners.numbers[to] {
                    [from, to]
                } else {
                    [to, from]
                };
                let share = heights[from] / (heights[from] - heights[to]);
                let own = corners.own[from] + (corners.own[to] - corners.own[from]) * share;
                let point = view.motion.at(corners.world(own));
                let distance = point.y - self.source.y;
                (point.x / distance * lattice.plane, distance)
            };
            let [up, down] = crossed.map(at);
            let is_front = down.0 < up.0;
            let ends = if is_front { [down, up] } else { [up, down] };
            if ends[1].0 <= low * lattice.plane
                || ends[0].0 >= high * lattice.plane
                || ends[1].0 <= ends[0].0
            {
                return;
            }
            let component = view.sample.component_of(facet);
            let normal = self.normal(facet);
            cuts.push(Cut { ends, is_front, component, normal });
        });
        cuts
    }

    /// The section of a cut facet in a beamlet.
    fn section(&self, cut: &Cut, beamlet: i64, row: f64) -> Option<Section> {
        let lattice = self.view.lattice;
        let (half, centre) = (0.5 * lattice.period, lattice.centre(beamlet));
        let [low, high] = cut.ends.map(|(x, distance)| (x - centre, distance));
        let x = [low.0.max(-half), high.0.min(half)];
        if x[1] <= x[0] {
            return None;
        }
        // On a plane 1 / distance is linear in x.
        let distance = |x: f64| {
            let share = (x - low.0) / (high.0 - low.0);
            1.0 / (1.0 / low.1 + (1.0 / high.1 - 1.0 / low.1) * share)
        };
        let step = &self.view.facets.steps[cut.component as usize];
        let effect = |x: f64| self.effect(step, cut, lattice.slopes(beamlet, x, row), distance(x));
        let ends = x.map(effect);
        Some(Section {
            x,
            ends: ends.map(|(numbers, _)| numbers),
            distance: x.map(distance),
            hash: step.hash,
            remainder: ends[0].1.max(ends[1].1),
        })
    }

    /// Effect of a facet on the ray of a slope that crosses it at a distance from the source along y: its numbers, and
    /// the first-order remainder of the displacement.
    fn effect(
        &self,
        step: &SurfaceStep,
        cut: &Cut,
        slope: [f64; 2],
        distance: f64,
    ) -> (Numbers, f64) {
        let Cut { normal, is_front, .. } = *cut;
        let y = distance + self.source.y;
        let along = normal.x * slope[0] + normal.y + normal.z * slope[1];
        let square = 1.0 + slope[0] * slope[0] + slope[1] * slope[1];
        let length = square.sqrt();
        let sign = if is_front { 1.0 } else { -1.0 };
        let lever = self.analyser - y;
        let bend = step.delta * square / along.abs().max(1e-9);
        // Against the normal that faces the source.
        let facing = if along > 0.0 { -sign } else { sign };
        let bends = [
            facing * bend * (normal.x - normal.y * slope[0]),
            facing * bend * (normal.z - normal.y * slope[1]),
        ];
        let share = along.abs() / length / step.least_cosine.max(1e-30);
        let remainder =
            if share < 1.0 { FIRST_ORDER_ERROR * lever / (share * share * share) } else { 0.0 };
        let depth = -sign * step.mu * length * y;
        ([depth, bends[0] * lever, bends[1] * lever, bends[0], bends[1]], remainder)
    }

    /// The piece between two ends.
    fn piece(&self, x: [f64; 2], crossed: &[&Section], openings: &[Opening]) -> Piece {
        let mut ends = [[0.0; 5]; 2];
        let (mut signature, mut remainder) = (0_u32, 0.0);
        for section in crossed {
            let width = section.x[1] - section.x[0];
            for (sum, x) in ends.iter_mut().zip(x) {
                let share = (x - section.x[0]) / width;
                for ((sum, low), high) in sum.iter_mut().zip(section.ends[0]).zip(section.ends[1]) {
                    *sum += low + (high - low) * share;
                }
            }
            signature = signature.wrapping_add(section.hash);
            remainder += section.remainder;
        }
        if remainder > 0.0 {
            self.bound(&mut ends);
        }
        // Rounded.
        let depth = ends.map(|end| single(end[0].max(0.0)));
        let [_, displacement_x, displacement_z, slope_x, slope_z] =
            std::array::from_fn(|of| single(f64::midpoint(ends[0][of], ends[1][of])));
        let result = RayResult {
            optical_depth: 0.5 * (depth[0] + depth[1]),
            displacement_x,
            displacement_z,
            slope_x,
            slope_z,
            signature,
            flags: 0,
            crossings: numbers::count(crossed.len()),
            displacement_variance: 0.0,
        };
        let displacement = ends.map(|end| single(end[1]));
        let ends = || crossed.iter().flat_map(|it| it.distance);
        let extent = ends().fold(0.0, f64::max) - ends().fold(f64::INFINITY, f64::min);
        let mut piece = Piece {
            x,
            depth,
            displacement,
            result,
            source: Source::FirstOrder,
            extent: single(extent),
            interval: 0,
        };
        let is_exact = self.view.facets.is_exact && !crossed.is_empty();
        let remainder = if is_exact { f64::INFINITY } else { remainder };
        if remainder > 0.0 && self.counts(&piece, openings, remainder) {
            piece.source = Source::Wanted;
        }
        piece
    }

    /// Reduces displacements by the first order near grazing incidence to what total reflection makes.
    fn bound(&self, ends: &mut [Numbers; 2]) {
        let (lattice, pitch) = (self.view.lattice, self.view.optics.detector.pitch);
        let farthest = [lattice.halo_columns, lattice.halo].map(|halo| halo as f64);
        for end in ends {
            let over = |axis: usize| {
                let most = (farthest[axis] - 1.0).max(0.5) * pitch[axis];
                (end[1 + axis].abs() / most).max(1.0)
            };
            let factor = over(0).max(over(1)).recip();
            end[1..].iter_mut().for_each(|it| *it *= factor);
        }
    }

    /// True if a first-order remainder of the displacement matters in a piece.
    fn counts(&self, piece: &Piece, openings: &[Opening], remainder: f64) -> bool {
        let response = self.view.response;
        if piece.width() < NARROWEST {
            return false;
        }
        let share = response.lit(single(open_share(openings, piece.x)));
        let passed = response.weight * response.hardening.light(piece.result.optical_depth) * share;
        let light = piece.width() * f64::from(passed);
        light * (remainder * response.steepest()).min(1.0) > NEGLIGIBLE * self.view.budget.light
    }

    fn corners(&self, facet: FacetOf) -> Corners<'a> {
        let sample = self.view.sample;
        match facet {
            FacetOf::Sample(triangle) => {
                let numbers = sample.triangles[triangle];
                let own = numbers.map(|v| DVec3::from_array(sample.vertices[v as usize]));
                Corners { numbers, own, place: None }
            }
            FacetOf::Placed(at, triangle) => {
                let Placed { prototype, place, .. } = &sample.placed[at];
                let prototype = &sample.prototypes[*prototype as usize];
                let numbers = prototype.triangles[triangle];
                let own = numbers.map(|v| prototype.vertices[v as usize]);
                Corners { numbers, own, place: Some(place) }
            }
        }
    }

    /// Unit normal of a facet in the beam frame.
    fn normal(&self, facet: FacetOf) -> DVec3 {
        let [a, b, c] = self.view.sample.corners(facet);
        self.rotation * (b - a).cross(c - a).normalize_or_zero()
    }
}

/// Corners of a facet in the frame of its mesh, with their numbers.
struct Corners<'a> {
    numbers: [u32; 3],
    own: [DVec3; 3],
    /// Place of a mesh that is placed.
    place: Option<&'a Place>,
}

impl Corners<'_> {
    /// A point of the mesh in the sample, m.
    fn world(&self, point: DVec3) -> DVec3 {
        self.place.map_or(point, |place| place.world_from_own(point))
    }
}

/// Edges of a facet whose corners have these heights above a plane, in the order of its corners: the one that goes
/// upwards through the plane and the one that goes downwards.
fn crossed_edges(heights: [f64; 3]) -> Option<[[usize; 2]; 2]> {
    // Half open: a corner belongs to one side.
    let above = heights.map(|height| height >= 0.0);
    let edge = |rises: bool| {
        (0..3)
            .map(|at| [at, (at + 1) % 3])
            .find(|[from, to]| above[*from] != rises && above[*to] == rises)
    };
    Some([edge(true)?, edge(false)?])
}
