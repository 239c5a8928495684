//! Outlines of objects: enough for their extents in the views of a scan.

use super::super::Sample;
use super::BeamExtent;
use beamlet_model::scene::Motion;
use glam::{DVec2, DVec3};

/// Points of an object that are kept before their hull replaces them.
const MOST_POINTS: usize = 1 << 20;

/// Convex hull (x, y) of an object seen along the rotation axis and its range of z, m: enough for views
/// that keep +z.
#[derive(Debug, Clone)]
pub(super) struct UprightOutline {
    hull: Vec<DVec2>,
    z: [f64; 2],
}

/// An object in one view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) extent: BeamExtent,
    /// Greatest |x| and |z| of its points over their distance from the source.
    pub(super) slopes: [f64; 2],
}

impl Seen {
    /// No point yet.
    const NOTHING: Self =
        Self { extent: BeamExtent { x: NONE, y: NONE, z: NONE }, slopes: [0.0; 2] };

    fn add(&mut self, point: DVec3, source: f64) {
        let BeamExtent { x, y, z } = &mut self.extent;
        for ([low, high], value) in [(x, point.x), (y, point.y), (z, point.z)] {
            *low = low.min(value);
            *high = high.max(value);
        }
        for (slope, across) in self.slopes.iter_mut().zip([point.x, point.z]) {
            *slope = slope.max(across.abs() / (source + point.y));
        }
    }

    /// True if a box with this centre and half size may add to it.
    fn grows(&self, centre: DVec3, half: DVec3, source: f64) -> bool {
        let (low, high) = (centre - half, centre + half);
        let BeamExtent { x, y, z } = self.extent;
        let beyond = |[least, most]: [f64; 2], low: f64, high: f64| low < least || high > most;
        let steep = |slope: f64, across: f64, half: f64| {
            across.abs() + half > slope * (source + low.y).max(0.0)
        };
        beyond(x, low.x, high.x)
            || beyond(y, low.y, high.y)
            || beyond(z, low.z, high.z)
            || steep(self.slopes[0], centre.x, half.x)
            || steep(self.slopes[1], centre.z, half.z)
    }
}

const NONE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// Each object in a view, from all its points; `source`: distance to the rotation centre, m.
pub(super) fn seen(sample: &Sample, motion: &Motion, source: f64) -> Vec<Seen> {
    let mut all = vec![Seen::NOTHING; sample.objects.len()];
    for (triangle, component) in sample.triangles.iter().zip(&sample.triangle_component) {
        let seen = &mut all[sample.components[*component as usize].object as usize];
        for vertex in triangle {
            let point = DVec3::from_array(sample.vertices[*vertex as usize]);
            seen.add(motion.at(point), source);
        }
    }
    let rows = motion.rows().map(DVec3::abs);
    for placed in &sample.placed {
        let seen = &mut all[sample.components[placed.component as usize].object as usize];
        let [low, high] = sample.bounds_of_placed(placed);
        let half = (high - low) / 2.0;
        let half = DVec3::from_array(rows.map(|row| row.dot(half)));
        if seen.grows(motion.at(low.midpoint(high)), half, source) {
            for vertex in &sample.prototypes[placed.prototype as usize].vertices {
                seen.add(motion.at(placed.place.world_from_own(*vertex)), source);
            }
        }
    }
    all
}

/// Outlines of the objects, for views that keep +z.
pub(super) fn upright(sample: &Sample) -> Vec<UprightOutline> {
    let mut points = vec![Vec::new(); sample.objects.len()];
    let mut seen = vec![false; sample.vertices.len()];
    for (triangle, component) in sample.triangles.iter().zip(&sample.triangle_component) {
        let points = &mut points[sample.components[*component as usize].object as usize];
        for vertex in triangle.map(|vertex| vertex as usize) {
            if !std::mem::replace(&mut seen[vertex], true) {
                let [x, y, _] = sample.vertices[vertex];
                points.push(DVec2::new(x, y));
            }
        }
        // The hull of a hull and more points is the hull of them all.
        if points.len() > MOST_POINTS {
            *points = hull(std::mem::take(points));
        }
    }
    let directions = directions();
    let mut reached = vec![Reached::default(); sample.objects.len()];
    for placed in &sample.placed {
        let object = sample.components[placed.component as usize].object as usize;
        if !reached[object].grows(&directions, sample.bounds_of_placed(placed)) {
            continue;
        }
        let points = &mut points[object];
        let prototype = &sample.prototypes[placed.prototype as usize];
        points.extend(
            prototype.vertices.iter().map(|it| placed.place.world_from_own(*it).truncate()),
        );
        if points.len() > MOST_POINTS {
            *points = hull(std::mem::take(points));
        }
    }
    points
        .into_iter()
        .zip(&sample.objects)
        .map(|(points, object)| UprightOutline {
            hull: hull(points),
            z: object.bounds.map(|[_, _, z]| z),
        })
        .collect()
}

impl UprightOutline {
    /// Greatest distance from the axis, m.
    pub(super) fn far(&self) -> f64 {
        self.hull.iter().fold(0.0, |far, point| far.max(point.length()))
    }

    pub(super) fn seen(&self, motion: &Motion, source: f64) -> Seen {
        let z = self.z.map(|z| z + motion.offset().z);
        let mut seen = Seen::NOTHING;
        for point in &self.hull {
            for z in z {
                let [x, y, _] = motion.point([point.x, point.y, 0.0]);
                seen.add(DVec3::new(x, y, z), source);
            }
        }
        seen.extent.z = z;
        seen
    }
}

/// Directions in which an outline of many instances is followed.
const DIRECTIONS: usize = 32;

fn directions() -> [DVec2; DIRECTIONS] {
    let step = std::f64::consts::TAU / DIRECTIONS as f64;
    std::array::from_fn(|number| DVec2::from_angle(number as f64 * step))
}

/// How far boxes are known to reach, by direction: those that lie within it cannot be on the hull.
#[derive(Clone)]
struct Reached([f64; DIRECTIONS]);

impl Default for Reached {
    fn default() -> Self {
        Self([f64::NEG_INFINITY; DIRECTIONS])
    }
}

impl Reached {
    /// Takes a box; whether it may reach beyond the others.
    fn grows(&mut self, directions: &[DVec2; DIRECTIONS], [low, high]: [DVec3; 2]) -> bool {
        let (centre, half) = (low.midpoint(high).truncate(), ((high - low) / 2.0).truncate());
        let mut grows = false;
        // Between two directions a hull bulges by no more than this.
        let bulge = centre.length() * 0.5 * (std::f64::consts::TAU / DIRECTIONS as f64).powi(2);
        for (along, reached) in directions.iter().zip(&mut self.0) {
            let most = along.dot(centre) + along.abs().dot(half);
            grows = grows || most + bulge + half.length() > *reached;
            *reached = reached.max(along.dot(centre));
        }
        grows
    }
}

/// Convex hull, counter-clockwise (Andrew's monotone chain).
fn hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    let mut hull: Vec<DVec2> = Vec::new();
    for upper in [false, true] {
        let start = hull.len();
        let mut add = |point: DVec2| {
            while let [.., a, b] = hull[start..] {
                if (b - a).perp_dot(point - a) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        };
        if upper {
            points.iter().rev().for_each(|point| add(*point));
        } else {
            points.iter().for_each(|point| add(*point));
        }
        // The end of one chain is the beginning of the other.
        hull.pop();
    }
    if hull.is_empty() { points } else { hull }
}
