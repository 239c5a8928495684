//! Where objects overlap, touch or nearly do, in numbers: for whoever checks an assembly.

use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeSet;

use super::super::body::Body;
use super::super::distance::{closest_on_triangle, distance};
use super::super::search::Search;
use super::super::surface::{Surface, bounds_of, near};
use super::super::topology;
use super::super::tree::Query;
use super::super::watch::{LoadStep, Task};
use super::meeting::{self, Around, Meetings, tolerance};
use super::parts::Parts;
use super::{Contact, ContactKind, Operands, overlap_area};
use crate::error::{Error, Result};
use crate::{numbers, reserve};

/// Width below which gaps are reported, m.
pub(in crate::geometry) const THIN: f64 = 1e-6;
/// Largest height of an arc over facets that counts, of the size of the body.
const ARC: f64 = 0.01;
/// Bytes per triangle while that is measured.
const PER_ARC: u64 = 100;
/// Points on an overlap whose depth is measured, about.
pub(in crate::geometry) const SOUNDINGS: usize = 4000;

/// Inputs of the search for contacts.
#[derive(Clone, Copy)]
pub(in crate::geometry) struct Assembly<'a> {
    pub(in crate::geometry) bodies: &'a [Body],
    pub(in crate::geometry) parts: &'a Parts,
    pub(in crate::geometry) searches: &'a [Option<Search>],
    pub(in crate::geometry) meetings: &'a Meetings,
    pub(in crate::geometry) around: &'a Around,
    pub(in crate::geometry) names: &'a [String],
}

impl Assembly<'_> {
    /// Lists every pair of objects that touch or nearly touch, in their order.
    ///
    /// # Errors
    /// As of cuts.
    pub(in crate::geometry) fn contacts(
        self,
        pairs: &[NearPair],
        task: Task<'_>,
    ) -> Result<Vec<Contact>> {
        if pairs.is_empty() {
            return Ok(Vec::new());
        }
        task.begin(LoadStep::Comparing, pairs.len() as u64)?;
        let operands = Operands::new(self.bodies, self.parts);
        let mut contacts = Vec::new();
        for (number, NearPair { objects, limit }) in pairs.iter().enumerate() {
            if task.is_cancelled() {
                return Err(Error::Interrupted);
            }
            task.reach(number as u64);
            let objects = *objects;
            let met = self.meetings.between(self.parts, objects);
            let covered = self.covered(objects);
            let found = if !met.is_empty() || !covered.is_empty() {
                Some(self.overlap(objects, (&covered, &met), &operands, task)?)
            } else {
                self.gap(objects, *limit)
            };
            contacts.extend(found.map(|(kind, place)| Contact {
                objects: objects.map(numbers::count),
                kind,
                place: place.to_array(),
                pairs: 1,
            }));
        }
        Ok(contacts)
    }

    /// Parts of the earlier of two objects that lie in the later one without contact.
    fn covered(self, [a, b]: [usize; 2]) -> BTreeSet<u32> {
        let in_later = |containers: &Vec<u32>| {
            containers.iter().any(|it| self.parts.all[*it as usize].object == b)
        };
        let components = self.around[a].iter().zip(&self.parts.of[a]);
        components.filter(|(it, _)| in_later(it)).map(|(_, part)| *part).collect()
    }

    /// Volume and depth of what two objects share; where that is nothing but rounding, the area
    /// where they lie on each other.
    fn overlap(
        self,
        [a, b]: [usize; 2],
        (covered, met): (&BTreeSet<u32>, &[[u32; 2]]),
        operands: &Operands<'_>,
        task: Task<'_>,
    ) -> Result<(ContactKind, DVec3)> {
        let (mut volume, mut shared) = (0.0, Vec::new());
        for part in covered {
            let solid = operands.solid(*part as usize);
            volume += solid.volume();
            shared.push(solid.surface());
        }
        for pair in met {
            let failed =
                |problem| self.parts.failed(pair.map(|it| it as usize), self.names, problem);
            let [first, second] = pair.map(|part| operands.solid(part as usize));
            let both = first.and(second, task, failed)?;
            volume += both.volume();
            shared.push(both.surface());
        }
        let soundings: Vec<DVec3> = shared.iter().flat_map(points_on).collect();
        let limit = tolerance(self.bodies[a].bounds(), self.bodies[b].bounds());
        let size = |body: usize| {
            let [low, high] = self.bodies[body].bounds();
            (high - low).max_element()
        };
        let of_size = 1e-12 * size(a).min(size(b)).powi(3);
        let is_rounding = |area: f64| volume <= 2.0 * limit * area + of_size;
        let surface = |body: usize| self.bodies[body].components.iter().map(|it| it.area).sum();
        if is_rounding(f64::min(surface(a), surface(b))) {
            let (area, place) = self.touching_area([a, b], limit);
            if is_rounding(area) {
                let place = place.or_else(|| soundings.first().copied());
                let place = place.or_else(|| self.nearest([a, b], limit).map(|(_, place)| place));
                let place = place.unwrap_or(self.bodies[a].bounds()[0]);
                return Ok((ContactKind::Touch { area }, place));
            }
        }
        let every = soundings.len().div_ceil(SOUNDINGS).max(1);
        let depth_in = |object: usize, point: DVec3| {
            let surface = &self.bodies[object].surface;
            self.searches[object].as_ref().map_or(0.0, |it| distance_of(point, surface, it))
        };
        let depth = |point: DVec3| depth_in(a, point).max(depth_in(b, point));
        let depths: Vec<(f64, DVec3)> =
            soundings.par_iter().step_by(every).map(|point| (depth(*point), *point)).collect();
        let (depth, place) = depths
            .into_iter()
            .fold((0.0, DVec3::ZERO), |deepest, it| if it.0 > deepest.0 { it } else { deepest });
        Ok((ContactKind::Overlap { volume, depth }, place))
    }

    /// The one of two objects that has fewer triangles, then the other.
    fn few_and_many(self, [a, b]: [usize; 2]) -> [usize; 2] {
        let count = |object: usize| self.bodies[object].surface.triangles.len();
        if count(a) > count(b) { [b, a] } else { [a, b] }
    }

    /// Area where two objects lie on each other, and a place there.
    fn touching_area(self, objects: [usize; 2], limit: f64) -> (f64, Option<DVec3>) {
        let [few, many] = self.few_and_many(objects);
        let Some(search) = self.searches[many].as_ref() else { return (0.0, None) };
        let [asks, asked] = [few, many].map(|it| &self.bodies[it].surface);
        let areas: Vec<(f64, DVec3)> = (0..asks.triangles.len())
            .into_par_iter()
            .map(|triangle| {
                let corners = asks.corners(triangle);
                let mut area = 0.0;
                search.near(&Query::new(corners, None, limit), |other| {
                    area += overlap_area(corners, asked.corners(other), limit);
                    true
                });
                (area, (corners[0] + corners[1] + corners[2]) / 3.0)
            })
            .collect();
        let largest = areas.iter().max_by(|a, b| a.0.total_cmp(&b.0)).filter(|it| it.0 > 0.0);
        (areas.iter().map(|it| it.0).sum(), largest.map(|it| it.1))
    }

    /// Least distance of two surfaces, where it is within the limit, and where.
    fn nearest(self, objects: [usize; 2], limit: f64) -> Option<(f64, DVec3)> {
        let [few, many] = self.few_and_many(objects);
        let search = self.searches[many].as_ref()?;
        let [asks, asked] = [few, many].map(|it| &self.bodies[it].surface);
        let all = asked.bounds();
        let nearest = |triangle: usize| {
            let corners = asks.corners(triangle);
            let mut least = (f64::INFINITY, DVec3::ZERO);
            if near(bounds_of(corners.into_iter()), all, limit) {
                search.near(&Query::new(corners, None, limit), |other| {
                    let found = distance(corners, asked.corners(other));
                    least = if found.0 < least.0 { found } else { least };
                    true
                });
            }
            least
        };
        let all: Vec<_> = (0..asks.triangles.len()).into_par_iter().map(nearest).collect();
        all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).filter(|it| it.0 <= limit)
    }

    /// A gap between objects that do not contain each other.
    fn gap(self, objects: [usize; 2], limit: f64) -> Option<(ContactKind, DVec3)> {
        let [a, b] = objects;
        let stands_in = |inner: usize, outer: usize| {
            self.around[inner]
                .iter()
                .flatten()
                .any(|it| self.parts.all[*it as usize].object == outer)
        };
        if stands_in(a, b) || stands_in(b, a) {
            return None;
        }
        let (width, place) = self.nearest(objects, limit)?;
        Some((ContactKind::Gap { width }, place))
    }
}

/// Distance of a point from a surface, m.
pub(in crate::geometry) fn distance_of(point: DVec3, surface: &Surface, search: &Search) -> f64 {
    let [low, high] = surface.bounds();
    let size = (high - low).max_element();
    let mut limit = 1e-6 * size;
    while limit < 16.0 * size {
        let mut least = f64::INFINITY;
        search.near(&Query::new([point; 3], None, limit), |triangle| {
            let nearest = closest_on_triangle(point, surface.corners(triangle));
            least = least.min(nearest.distance(point));
            true
        });
        if least <= limit {
            return least;
        }
        limit *= 8.0;
    }
    0.0
}

/// Corners of triangles, the middles of their sides, and their own: where an overlap of bodies with
/// flat faces is deepest.
fn points_on(surface: &Surface) -> impl Iterator<Item = DVec3> {
    let middles = (0..surface.triangles.len()).flat_map(|triangle| {
        let [a, b, c] = surface.corners(triangle);
        [a.midpoint(b), b.midpoint(c), c.midpoint(a), (a + b + c) / 3.0]
    });
    surface.vertices.iter().copied().chain(middles)
}

/// Two objects that may overlap, touch or nearly do.
pub(in crate::geometry) struct NearPair {
    pub(in crate::geometry) objects: [usize; 2],
    /// Wider gaps between them are not listed, m.
    limit: f64,
}

/// Pairs of objects that may overlap, touch or nearly do.
///
/// # Errors
/// [`Error::Memory`].
pub(in crate::geometry) fn pairs_to_compare(bodies: &[Body]) -> Result<Vec<NearPair>> {
    let bounds: Vec<[DVec3; 2]> = bodies.iter().map(Body::bounds).collect();
    let most = |body: usize| most_arc(bounds[body]);
    let pairs = meeting::pairs_within(&bounds, |a, b| THIN.max(most(a)).max(most(b)));
    let arcs = arcs(bodies, &pairs)?;
    let near_pair = |(a, b): (usize, usize)| {
        let limit = THIN.max(arcs[a]).max(arcs[b]);
        near(bounds[a], bounds[b], limit).then_some(NearPair { objects: [a, b], limit })
    };
    Ok(pairs.into_iter().filter_map(near_pair).collect())
}

/// Heights of arcs over the facets of bodies that are in pairs; 0 for the others.
///
/// # Errors
/// [`Error::Memory`].
fn arcs(bodies: &[Body], pairs: &[(usize, usize)]) -> Result<Vec<f64>> {
    let mut arcs = vec![0.0; bodies.len()];
    let used: BTreeSet<usize> = pairs.iter().flat_map(|(a, b)| [*a, *b]).collect();
    for body in used {
        let surface = &bodies[body].surface;
        let needed = PER_ARC * surface.triangles.len() as u64;
        reserve::ask(needed, "measuring contacts of objects", reserve::REMEDY)?;
        arcs[body] = arc(surface);
    }
    Ok(arcs)
}

/// The height of an arc over facets that counts at most, of a body of these bounds, m.
pub(in crate::geometry) fn most_arc([low, high]: [DVec3; 2]) -> f64 {
    ARC * (high - low).max_element()
}

/// Greatest height of an arc over the facets that stand for it, m: of facets that lean against
/// their neighbours by up to 30 degrees.
pub(in crate::geometry) fn arc(surface: &Surface) -> f64 {
    let edges = topology::edges(surface);
    let height = edges
        .par_windows(2)
        .filter(|pair| pair[0].key == pair[1].key)
        .map(|pair| {
            let [from, to] = pair[0].ends().map(|vertex| surface.vertices[vertex as usize]);
            let along = (to - from).normalize_or_zero();
            // Of each triangle the normal, and its height over the edge.
            let sides = [0, 1].map(|k| {
                let [a, b, c] = surface.corners(pair[k].triangle as usize);
                let normal = (b - a).cross(c - a);
                let height = normal.length() / (to - from).length().max(f64::MIN_POSITIVE);
                (normal.normalize_or_zero(), height)
            });
            let turn = sides[0].0.cross(sides[1].0).dot(along).abs().min(1.0).asin();
            let width = sides[0].1.min(sides[1].1);
            let smooth = sides[0].0.dot(sides[1].0) > 0.86;
            if smooth && turn > 1e-6 { width * turn / 8.0 } else { 0.0 }
        })
        .reduce(|| 0.0, f64::max);
    height.min(most_arc(surface.bounds()))
}
