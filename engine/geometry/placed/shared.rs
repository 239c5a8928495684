//! What exact shapes that cross share: its volume and depth.

use std::collections::HashSet;
use std::f64::consts::{PI, TAU};

use arrayvec::ArrayVec;
use glam::{DMat3, DVec3};

use super::covered::Outer;
use super::nesting::Group;
use super::{Place, Placed};
use crate::geometry::Sample;
use crate::geometry::analytic::{AnalyticShape, Form};
use crate::geometry::surface::near;

/// Lines along a shape across its radius, and around it.
const LINES: [u32; 2] = [48, 64];
/// Lines along a shape that find a point of it, or the volume that it shares with one of more than [`MANY`].
const FEWER_LINES: [u32; 2] = [24, 32];
const MANY: usize = 8;
/// Lines across a region that is searched for the deepest point, along each of two sides.
const ACROSS: u32 = 8;
/// Searches about it, each in a region of 0.3 of the size of the one before.
const SEARCHES: u32 = 6;

/// A shape in its place.
#[derive(Clone, Copy)]
pub(super) struct Solid<'a> {
    shape: AnalyticShape,
    place: &'a Place,
    /// Linear part of the way from the world to the own frame.
    inverse: DMat3,
}

/// Parts of a line in a shape, by its parameter.
type Parts = ArrayVec<[f64; 2], 2>;

impl<'a> Solid<'a> {
    /// A place of a group of exact shapes; `None` of a mesh.
    pub(super) fn of(group: &Group, place: &'a Place) -> Option<Self> {
        group.prototype.shape.map(|shape| Self::new(shape, place))
    }

    fn new(shape: AnalyticShape, place: &'a Place) -> Self {
        Self { shape, place, inverse: place.linear().inverse() }
    }

    fn bounds(self) -> [DVec3; 2] {
        self.place.bounds(self.shape.bounds())
    }

    fn volume(self) -> f64 {
        self.shape.volume() * self.place.volume()
    }

    /// Lines along z in its own frame through a point at z = 0, with the area that each stands for, m2.
    fn lines(self, [rings, spokes]: [u32; 2]) -> impl Iterator<Item = (DVec3, f64)> {
        let [_, half] = self.shape.bounds();
        let hole = match self.shape.form() {
            Form::Frustum(_) | Form::Ellipsoid(_) => 0.0,
            Form::Tube(it) => it.inner / it.outer,
        };
        let step = 1.0 / f64::from(rings);
        let wide = 1.0 - hole * hole;
        (0..rings).flat_map(move |ring| {
            // Evenly in area, but denser at the edge, where chords grow as the root of the distance.
            let left = 1.0 - (f64::from(ring) + 0.5) * step;
            let radius = (1.0 - wide * left * left).sqrt();
            let area = 2.0 * left * step * wide * PI * half.x * half.y / f64::from(spokes);
            (0..spokes).map(move |spoke| {
                let (sin, cos) = (TAU * (f64::from(spoke) + 0.5) / f64::from(spokes)).sin_cos();
                (DVec3::new(radius * half.x * cos, radius * half.y * sin, 0.0), area)
            })
        })
    }

    /// A point of the world in its material.
    fn inner_point(self) -> DVec3 {
        let across = match self.shape.form() {
            Form::Frustum(_) | Form::Ellipsoid(_) => 0.0,
            Form::Tube(it) => it.inner.midpoint(it.outer),
        };
        self.place.world_from_own(DVec3::new(across, 0.0, 0.0))
    }

    fn contains(self, point: DVec3) -> bool {
        let along = self.place.linear() * DVec3::Z;
        self.parts(point, along).iter().any(|[from, to]| *from < 0.0 && *to > 0.0)
    }

    /// The parts of a line that it has outside others.
    fn parts_outside(self, winners: &[Self], origin: DVec3, direction: DVec3) -> Vec<[f64; 2]> {
        let mut parts = self.parts(origin, direction).to_vec();
        for part in winners.iter().flat_map(|it| it.parts(origin, direction)) {
            without(&mut parts, part);
        }
        parts
    }

    /// Volume that lies in others, m3, within 0.3 % of its own by lines along it.
    fn lost_to(self, winners: &[Self]) -> f64 {
        let along = self.place.linear() * DVec3::Z;
        let of_line = |(at, area): (DVec3, f64)| {
            let origin = self.place.world_from_own(at);
            let whole = length(&self.parts(origin, along));
            let left = length(&self.parts_outside(winners, origin, along));
            [area * (whole - left), area * whole]
        };
        self.volume() * share(self.lines(LINES).map(of_line))
    }

    /// The parts of a line of the world that lie in it.
    fn parts(self, origin: DVec3, direction: DVec3) -> Parts {
        let own = self.place.own_from_world(origin);
        let crossings = self.shape.crossings(own, self.inverse * direction);
        crossings.chunks_exact(2).map(|pair| [pair[0].t, pair[1].t]).collect()
    }
}

/// What two lists of parts have in common.
fn common(a: &Parts, b: &Parts) -> f64 {
    let both = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (b.min(d) - a.max(c)).max(0.0);
    a.iter().map(|first| b.iter().map(|second| both(*first, *second)).sum::<f64>()).sum()
}

/// Takes a part out of all parts.
fn without(parts: &mut Vec<[f64; 2]>, [from, to]: [f64; 2]) {
    let left = parts.iter().flat_map(|[a, b]| [[*a, b.min(from)], [a.max(to), *b]]);
    *parts = left.filter(|[a, b]| a < b).collect();
}

fn length(parts: &[[f64; 2]]) -> f64 {
    parts.iter().map(|[a, b]| b - a).sum()
}

/// Volume that two shapes share, m3: in closed form for two balls, to rounding for cylinders and cones on
/// one axis, else within 0.3 % by lines along the smaller shape.
pub(super) fn shared_volume(a: Solid<'_>, b: Solid<'_>) -> f64 {
    shared_by_lines(a, b, LINES)
}

/// As [`shared_volume`], by some lines.
fn shared_by_lines(a: Solid<'_>, b: Solid<'_>, lines: [u32; 2]) -> f64 {
    if let (Some(first), Some(second)) = (radius_of_ball(a), radius_of_ball(b)) {
        return lens(first, second, a.place.position.distance(b.place.position));
    }
    let (thin, other) = if a.volume() < b.volume() { (a, b) } else { (b, a) };
    let along = thin.place.linear() * DVec3::Z;
    let of_line = |(at, area): (DVec3, f64)| {
        let origin = thin.place.world_from_own(at);
        let own = thin.parts(origin, along);
        [common(&own, &other.parts(origin, along)), length(&own)].map(|it| area * it)
    };
    thin.volume() * share(thin.lines(lines).map(of_line))
}

/// The share of first in second numbers.
fn share(of: impl Iterator<Item = [f64; 2]>) -> f64 {
    let [part, whole] = of.fold([0.0; 2], |sum, it| [sum[0] + it[0], sum[1] + it[1]]);
    if whole > 0.0 { part / whole } else { 0.0 }
}

fn radius_of_ball(solid: Solid<'_>) -> Option<f64> {
    let even = solid.place.stretch.to_bits() == 1.0_f64.to_bits();
    match solid.shape {
        AnalyticShape::Sphere { radius } if even => Some(radius * solid.place.scale),
        _ => None,
    }
}

/// What two balls share, m3.
fn lens(a: f64, b: f64, apart: f64) -> f64 {
    if apart >= a + b {
        return 0.0;
    }
    if apart <= (a - b).abs() {
        return 4.0 / 3.0 * PI * a.min(b).powi(3);
    }
    let ends = a + b - apart;
    let sizes = apart * apart + 2.0 * apart * (a + b) - 3.0 * (a - b) * (a - b);
    PI * ends * ends * sizes / (12.0 * apart)
}

/// A point in the middle of the longest line along the smaller of two shapes that lies in both.
fn common_point(a: Solid<'_>, b: Solid<'_>) -> Option<DVec3> {
    let (thin, other) = if a.volume() < b.volume() { (a, b) } else { (b, a) };
    let along = thin.place.linear() * DVec3::Z;
    let mut longest: Option<(f64, DVec3)> = None;
    for (at, _) in thin.lines(FEWER_LINES) {
        let origin = thin.place.world_from_own(at);
        let others = other.parts(origin, along);
        for [from, to] in thin.parts(origin, along) {
            for [low, high] in &others {
                let [low, high] = [low.max(from), high.min(to)];
                if high - low > longest.map_or(0.0, |it| it.0) {
                    longest = Some((high - low, origin + low.midpoint(high) * along));
                }
            }
        }
    }
    longest.map(|it| it.1)
}

/// How deep the surface of one of two shapes lies in the other at most, m, and where: by lines along
/// their axes through the region of both. `None` where no line finds a point in both.
pub(super) fn depth(
    [(group, place), (others, there)]: [(&Group, &Place); 2],
) -> Option<(f64, DVec3)> {
    let solids = [Solid::of(group, place)?, Solid::of(others, there)?];
    let outers = [Outer::of_place(group, place), Outer::of_place(others, there)];
    let middle = common_point(solids[0], solids[1])?;
    let [first, second] = solids.map(Solid::bounds);
    let whole = [first[0].max(second[0]), first[1].min(second[1])];
    let mut deepest = (0.0, middle);
    let search = |region: [DVec3; 2], deepest: &mut (f64, DVec3)| {
        for (origin, direction) in lines_through(region, place).chain(lines_through(region, there))
        {
            let parts = solids.map(|it| it.parts(origin, direction));
            for (own, other) in [(0, 1), (1, 0)] {
                for t in parts[own].iter().flatten() {
                    if !parts[other].iter().any(|[a, b]| a < t && t < b) {
                        continue;
                    }
                    let point = origin + *t * direction;
                    let inside = outers[other].depth(point);
                    if inside > deepest.0 {
                        *deepest = (inside, point);
                    }
                }
            }
        }
    };
    search(whole, &mut deepest);
    let narrow = |it: Solid<'_>| {
        let [low, high] = it.shape.bounds();
        it.place.least_scale() * (high - low).min_element()
    };
    let width = narrow(solids[0]).min(narrow(solids[1]));
    search([middle - width, middle + width], &mut deepest);
    let mut half = 0.5 * (whole[1] - whole[0]).abs();
    for _ in 0..SEARCHES {
        half *= 0.3;
        let about = deepest.1;
        search([about - half, about + half], &mut deepest);
    }
    Some(deepest)
}

/// Lines along the axes of a place, through a box.
fn lines_through([low, high]: [DVec3; 2], place: &Place) -> impl Iterator<Item = (DVec3, DVec3)> {
    let middle = low.midpoint(high);
    let half = 0.5 * (high - low).length();
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| place.rotation * axis);
    (0..3_usize).flat_map(move |axis| {
        let [u, v] = [axes[(axis + 1) % 3], axes[(axis + 2) % 3]];
        let at = move |k: u32| half * (2.0 * (f64::from(k) + 0.5) / f64::from(ACROSS) - 1.0);
        (0..ACROSS * ACROSS)
            .map(move |k| (middle + at(k % ACROSS) * u + at(k / ACROSS) * v, axes[axis]))
    })
}

impl Sample {
    fn solid_at(&self, at: u32) -> Option<(Solid<'_>, u32)> {
        let Placed { prototype, component, place } = &self.placed[at as usize];
        let shape = self.prototypes[*prototype as usize].shape?;
        Some((Solid::new(shape, place), self.components[*component as usize].object))
    }

    /// Volume of a placed shape that later ones of its partners hold, or earlier ones of its own object,
    /// m3. A shape inside it that crosses one of these crosses the surface that they leave, and counts, too.
    pub(super) fn lost_to(&self, at: u32) -> f64 {
        let Some((own, object)) = self.solid_at(at) else { return 0.0 };
        let wins = |it: u32| {
            let (solid, other) = self.solid_at(it)?;
            let is_near = near(solid.bounds(), own.bounds(), 0.0);
            (is_near && (other, at) > (object, it)).then_some(solid)
        };
        let partners = |it: u32| self.partners.of(it).unwrap_or_default();
        let mut found: Vec<u32> = partners(at).to_vec();
        let mut known: HashSet<u32> = found.iter().copied().chain([at]).collect();
        let mut winners: Vec<(u32, Solid<'_>)> = Vec::new();
        let mut next = 0;
        while let Some(it) = found.get(next).copied() {
            next += 1;
            let Some(solid) = wins(it) else { continue };
            winners.push((it, solid));
            for other in partners(it) {
                let inside = |solid: Solid<'_>| own.contains(solid.inner_point());
                if known.insert(*other) && wins(*other).is_some_and(inside) {
                    found.push(*other);
                }
            }
        }
        let meet = |(a, first): (u32, Solid<'_>), (b, second): (u32, Solid<'_>)| {
            a != b
                && near(first.bounds(), second.bounds(), 0.0)
                && (partners(a).contains(&b)
                    || first.contains(second.inner_point())
                    || second.contains(first.inner_point()))
        };
        let (together, alone): (Vec<_>, Vec<_>) =
            winners.iter().copied().partition(|it| winners.iter().any(|other| meet(*it, *other)));
        let lines = if alone.len() > MANY { FEWER_LINES } else { LINES };
        let mut lost: f64 = alone.iter().map(|it| shared_by_lines(own, it.1, lines)).sum();
        if !together.is_empty() {
            let together: Vec<Solid<'_>> = together.iter().map(|it| it.1).collect();
            lost += own.lost_to(&together);
        }
        lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn place(rotation: DQuat, position: DVec3) -> Place {
        Place { rotation, position, ..Place::ORIGIN }
    }

    fn solid(shape: AnalyticShape, place: &Place) -> Solid<'_> {
        Solid::new(shape, place)
    }

    #[test]
    fn shared_volumes_are_those_of_closed_forms() {
        let rod = |radius: f64, half_height: f64| AnalyticShape::Cylinder { radius, half_height };
        let turn = DQuat::from_axis_angle(DVec3::new(0.3, 1.0, -0.2).normalize(), 0.7);
        let at = place(turn, DVec3::new(1e-3, -2e-3, 3e-3));
        // A bore: pi r² times the height of the rod.
        let bore = shared_volume(solid(rod(2e-3, 1e-2), &at), solid(rod(1.5e-3, 1.5e-2), &at));
        let exact = PI * 1.5e-3_f64.powi(2) * 2e-2;
        assert!((bore / exact - 1.0).abs() < 1e-12, "{bore} {exact}");
        // Two equal rods across each other: 16/3 r³ (Steinmetz).
        let across = place(turn * DQuat::from_rotation_x(PI / 2.0), at.position);
        let both = shared_volume(solid(rod(1e-3, 5e-3), &at), solid(rod(1e-3, 5e-3), &across));
        let exact = 16.0 / 3.0 * 1e-9;
        assert!((both / exact - 1.0).abs() < 1e-3, "{both} {exact}");
        // A ball with its centre on the face of a large rod: half of it.
        let ball = AnalyticShape::Sphere { radius: 0.5e-3 };
        let on_face = place(turn, at.world_from_own(DVec3::new(0.0, 0.0, 1e-2)));
        let half = shared_volume(solid(rod(2e-3, 1e-2), &at), solid(ball, &on_face));
        let exact = 2.0 / 3.0 * PI * 0.5e-3_f64.powi(3);
        assert!((half / exact - 1.0).abs() < 1e-3, "{half} {exact}");
        // Lenses: in closed form, and as ellipsoids by lines. Chords end as a root at the edge of the common
        // part, so lines a distance h of the radius apart err by about h^1.5: (1/48)^1.5 = 3e-3.
        let apart = place(turn, at.position + DVec3::new(0.4e-3, 0.3e-3, 0.2e-3));
        let lens = shared_volume(solid(ball, &at), solid(ball, &apart));
        let egg = AnalyticShape::Ellipsoid { semi_axes: DVec3::splat(0.5e-3) };
        let by_lines = shared_volume(solid(egg, &at), solid(egg, &apart));
        assert!((by_lines / lens - 1.0).abs() < 3e-3, "{by_lines} {lens}");
    }
}
