//! What the sample sweeps over the views: does it clear the masks, does it fit the detector.

use glam::{DVec2, DVec3};

use super::Sample;
use super::sizes::unit_doubt;
use crate::error::{Error, Result};
use crate::scene::{Object, Scene, ShapeOrMesh};

/// Points of an object that are kept before their hull replaces them.
const MOST_POINTS: usize = 1 << 20;

/// Outline of each object seen along the rotation axis, enough for its extent in any view.
#[derive(Debug, Clone, Default)]
pub struct Swept {
    outlines: Vec<Outline>,
}

#[derive(Debug, Clone)]
struct Outline {
    name: String,
    /// Convex hull of (x, y), m.
    hull: Vec<DVec2>,
    /// Least and greatest z, m.
    z: [f64; 2],
}

/// Extent of an object in the beam frame of one view, m from the rotation centre.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct BeamExtent {
    /// Along the beam, source to detector.
    pub y: [f64; 2],
    /// Across the slits.
    pub x: [f64; 2],
    /// Along the slits.
    pub z: [f64; 2],
}

/// The outlines of the objects of a sample.
pub fn swept(sample: &Sample) -> Swept {
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
    let outlines = points
        .into_iter()
        .zip(&sample.objects)
        .map(|(points, object)| Outline {
            name: object.name.clone(),
            hull: hull(points),
            z: object.bounds.map(|[_, _, z]| z),
        })
        .collect();
    Swept { outlines }
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

impl Swept {
    /// Extent of each object in the view at `angle` (rad), in the order of the objects.
    pub fn extents(&self, angle: f64) -> impl Iterator<Item = BeamExtent> {
        self.outlines.iter().map(move |outline| outline.extent(angle))
    }
}

impl Outline {
    fn extent(&self, angle: f64) -> BeamExtent {
        let turned = self.turned(angle);
        BeamExtent {
            x: range(turned.clone().map(|p| p.x)),
            y: range(turned.map(|p| p.y)),
            z: self.z,
        }
    }

    /// The hull in the beam frame: source and detector turn by +angle, so it turns back.
    fn turned(&self, angle: f64) -> impl Iterator<Item = DVec2> + Clone {
        let back = DVec2::from_angle(-angle);
        self.hull.iter().map(move |point| back.rotate(*point))
    }
}

fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    })
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

/// Checks that no object reaches a mask in any view; where a mask is missing, the source or
/// the detector.
///
/// # Errors
/// The first object that does, with the angle and the distances.
pub fn check_clearance(scene: &Scene, sample: &Sample) -> Result<()> {
    swept(sample).check_clearance(scene, sample)
}

/// A body that passes through the field along the slits may reach so many times as far.
const PASSING: f64 = 4.0;

impl Swept {
    /// As [`check_clearance`], of the sample that this is of.
    ///
    /// # Errors
    /// The same.
    pub fn check_clearance(&self, scene: &Scene, sample: &Sample) -> Result<()> {
        let [(near, near_name), (far, far_name)] = scene.clearance();
        // A unit that is wrong makes most samples too large.
        let doubt = |number: usize| {
            let (object, summary) = scene.objects.get(number).zip(sample.objects.get(number))?;
            Some(format!("; it {}", unit_doubt(scene, object, summary)?))
        };
        for angle in &scene.scan.angles {
            for (number, extent) in self.extents(*angle).enumerate() {
                let [first, last] = extent.y.map(|y| scene.source.distance + y);
                if first > near && last < far {
                    continue;
                }
                let (side, wall) =
                    if first > near { ("back", far_name) } else { ("front", near_name) };
                return Err(Error::scene(
                    scene.object_key(number, ""),
                    format!(
                        "\"{}\" reaching, at angle {:.3} deg, from {:.6} m to {:.6} m from the source, so \
                     that its {side} meets {wall}",
                        self.outlines[number].name,
                        angle.to_degrees(),
                        first,
                        last
                    ),
                    format!(
                        "from {near:.6} m ({near_name}) to {far:.6} m ({far_name}){}",
                        doubt(number).unwrap_or_default()
                    ),
                ));
            }
        }
        Ok(())
    }

    /// Outlines of the objects, without the region that the surroundings fill: that is as wide as it
    /// is, and has no edges in the field.
    fn of_objects(&self, scene: &Scene) -> impl Iterator<Item = &Outline> {
        self.outlines.iter().skip(usize::from(scene.region().is_some()))
    }

    /// Name and extent of each object in the view at `angle` (rad), without the region that the
    /// surroundings fill.
    pub(crate) fn extents_of_objects(
        &self,
        scene: &Scene,
        angle: f64,
    ) -> impl Iterator<Item = (&str, BeamExtent)> {
        self.of_objects(scene).map(move |outline| (&*outline.name, outline.extent(angle)))
    }

    /// What of the sample may lie outside the field of view, in words; at most one sentence for
    /// each object and direction.
    #[must_use]
    pub fn fov_warnings(&self, scene: &Scene) -> Vec<String> {
        let half = scene.detector.size().map(|side| side / 2.0);
        let centre = scene.source.distance;
        let mut warnings = Vec::new();
        for outline in self.of_objects(scene) {
            // Greatest distance from the detector's centre over the views, and its angle.
            let mut worst = [(0.0, 0.0); 2];
            for angle in &scene.scan.angles {
                let z = outline.z[0].abs().max(outline.z[1].abs());
                for point in outline.turned(*angle) {
                    let magnification = scene.detector.distance / (centre + point.y);
                    for (worst, reach) in worst.iter_mut().zip([point.x.abs(), z]) {
                        if reach * magnification > worst.0 {
                            *worst = (reach * magnification, *angle);
                        }
                    }
                }
            }
            // Fibres and rods pass through the field along the slits: nothing changes along them. What
            // is many times as long has the wrong unit.
            let [low, high] = outline.z;
            let far = outline.hull.iter().fold(0.0_f64, |far, point| far.max(point.length()));
            let least = scene.detector.distance / (centre + far);
            let passes = low * least < -half[1] && high * least > half[1];
            let is_meant =
                |axis: &str, reach: f64| axis == "z" && passes && reach < PASSING * half[1];
            for (((reach, angle), half), axis) in worst.into_iter().zip(half).zip(["x", "z"]) {
                if reach > half && !is_meant(axis, reach) {
                    let is_mesh = |o: &&Object| matches!(o.geometry, ShapeOrMesh::Mesh(_));
                    let of_file = scene
                        .objects
                        .iter()
                        .filter(is_mesh)
                        .any(|object| object.name == outline.name);
                    warnings.push(format!(
                    "\"{}\" reaches outside the field of view: {:.3} mm from the centre of the \
                     detector in {axis} at angle {:.3} deg, where the detector ends at {:.3} mm; if \
                     it should not, {}?",
                    outline.name,
                    reach * 1e3,
                    angle.to_degrees(),
                    half * 1e3,
                    if of_file {
                        "is its `unit` (or `scale`) the right one"
                    } else {
                        "are its size and place the right ones"
                    }
                ));
                }
            }
        }
        warnings
    }
}
