//! Changes of a scene whose effect on the stacks is known.

use super::case::{Axis, Case};
use super::compare::Limits;
use beamlet::material::{Constants, constants_over};
use beamlet::scene::{Normals, Object, RandomRays, Scene, Scheme, Shape, ShapeOrMesh, Transport};
use beamlet::{Backend, RunRecord};
use ndarray::{Array4, Axis as Dimension};
use std::f64::consts::PI;
use std::fmt;

/// A change of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Relation {
    MirroredInX,
    MirroredInZ,
    Turned,
    Finer,
    Exact,
    Facets,
    Backend,
    Random,
    /// Rows one by one, with few rays at a time.
    Bands,
    /// The axis of rotation farther from the source, and the sample where it was.
    Origin,
}

pub(crate) const RELATIONS: [Relation; 10] = [
    Relation::MirroredInX,
    Relation::MirroredInZ,
    Relation::Turned,
    Relation::Finer,
    Relation::Exact,
    Relation::Facets,
    Relation::Backend,
    Relation::Random,
    Relation::Bands,
    Relation::Origin,
];

/// Facets around a cylinder or cone that stands for an exact one.
const SIDES_OF_ROUNDS: u32 = 2048;
/// Facets around a ball, whose normals are smooth.
const SIDES_OF_BALLS: u32 = 256;
/// Rays of a pixel along x and z under the scheme `random`.
const RAYS: [u32; 2] = [150, 20];

/// Distance by which the axis of rotation moves towards the detector, share of the distance between them.
const ORIGIN: f64 = 0.25;

/// Share of open beam by which sampling may be off in a pixel that a silhouette crosses, as README.md
/// promises: scenes are so small that silhouettes cross most of their pixels.
const SAMPLED: f64 = 1e-3;
/// Angle that the first order may be off at a surface, rad.
const FIRST_ORDER: f64 = 1e-9;
/// Surfaces that a ray meets at most, nearly.
const SURFACES: f64 = 8.0;

impl fmt::Display for Relation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::MirroredInX => "mirrored in x",
            Self::MirroredInZ => "mirrored in z",
            Self::Turned => "turned",
            Self::Finer => "finer",
            Self::Exact => "exact",
            Self::Facets => "facets",
            Self::Backend => "backend",
            Self::Random => "random",
            Self::Bands => "bands",
            Self::Origin => "origin",
        })
    }
}

impl Relation {
    /// The changed scene; `None` where it is the same.
    pub(crate) fn changed(self, case: &Case) -> Option<Case> {
        let mut changed = case.clone();
        match self {
            Self::MirroredInX => changed = case.mirrored(Axis::X),
            Self::MirroredInZ => changed = case.mirrored(Axis::Z),
            Self::Turned => changed = case.turned(),
            Self::Origin => changed = case.turned().with_origin_behind(ORIGIN),
            Self::Finer => {
                let sampling = &mut changed.scene.sampling;
                sampling.tolerance = Some(sampling.tolerances().light / 4.0);
            }
            Self::Exact => changed.scene.sampling.transport = Transport::Exact,
            Self::Facets => {
                let mut any = false;
                for object in &mut changed.scene.objects {
                    if let ShapeOrMesh::Shape(shape) = &mut object.geometry
                        && let Some(normals) = with_sides(shape)
                    {
                        object.normals = normals;
                        any = true;
                    }
                }
                return any.then_some(changed);
            }
            Self::Backend | Self::Bands => {}
            Self::Random => {
                changed.scene.sampling.scheme = Scheme::Random;
                changed.scene.sampling.rays = RandomRays::Grid(RAYS);
            }
        }
        Some(changed)
    }

    /// The backend of the changed scene.
    pub(crate) const fn backend(self) -> Backend {
        if matches!(self, Self::Backend) { Backend::RayQuery } else { Backend::Bvh }
    }

    /// A stack of the changed scene, its pixels where those of the other one are.
    pub(crate) fn restored(self, mut stack: Array4<f32>) -> Array4<f32> {
        match self {
            Self::MirroredInX => stack.invert_axis(Dimension(3)),
            Self::MirroredInZ => stack.invert_axis(Dimension(2)),
            _ => {}
        }
        stack
    }

    /// How far stacks of the two scenes may differ.
    pub(crate) fn limits(self, case: &Case, records: [&RunRecord; 2]) -> Limits {
        let scene = &case.scene;
        let lever = scene.detector.distance - scene.source.distance;
        // Share of open beam that an angle moves over the two edges of an opening, per rad.
        let per_angle = 2.0 * lever / scene.detector.pitch[0];
        // Where refinement gives up, a run says by how much.
        let beyond = |record: &RunRecord| {
            let sampling = record.sampling.filter(|it| it.beyond_tolerance > 0);
            sampling.map_or(0.0, |it| 3.0 * it.worst_error)
        };
        let sampled = SAMPLED + records.into_iter().map(beyond).sum::<f64>();
        let (sample, flat) = match self {
            Self::Backend => (1e-6, 0.0),
            Self::Bands => (0.0, 0.0),
            Self::MirroredInX => (sampled, 2e-5),
            // Curved ends of apertures are a sum over heights.
            Self::MirroredInZ if scene.has_heights() => (sampled, 2e-5),
            Self::MirroredInZ | Self::Turned | Self::Finer => (sampled, 1e-6),
            Self::Exact => (sampled + SURFACES * FIRST_ORDER * per_angle, 1e-6),
            Self::Facets => {
                let lean = PI / f64::from(SIDES_OF_ROUNDS);
                (sampled + 2.0 * lean * largest_delta(scene) * per_angle, 1e-6)
            }
            Self::Random => (sampled, sampled),
            Self::Origin => (sampled, 1e-6),
        };
        let rays = matches!(self, Self::Random).then(|| f64::from(RAYS[0] * RAYS[1]));
        Limits { sample, flat, rays }
    }
}

/// Makes facets of curved surfaces; the normals that they need, or `None` where there are none.
fn with_sides(shape: &mut Shape) -> Option<Normals> {
    let (sides, count, normals) = match shape {
        Shape::Cylinder { sides, .. } | Shape::Cone { sides, .. } | Shape::Tube { sides, .. } => {
            (sides, SIDES_OF_ROUNDS, Normals::Facets)
        }
        Shape::Sphere { sides, .. } | Shape::Ellipsoid { sides, .. } => {
            (sides, SIDES_OF_BALLS, Normals::Smooth)
        }
        _ => return None,
    };
    if sides.is_some() {
        return None;
    }
    *sides = Some(count);
    Some(normals)
}

/// Largest decrement of the sample, at the least energy.
fn largest_delta(scene: &Scene) -> f64 {
    largest(scene, |it| it.delta)
}

/// Largest of the constants of a sample, at the least energy.
pub(crate) fn largest(scene: &Scene, of: impl Fn(&Constants) -> f64) -> f64 {
    let energy = scene.source.beam.single_energy().unwrap_or(20.0);
    let constant = |object: &Object| {
        of(&constants_over(scene, &object.material, &[energy]).expect("constants")[0])
    };
    scene.objects.iter().map(constant).fold(0.0, f64::max)
}
