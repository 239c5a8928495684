//! Exact shapes, and facets that stand for them in f64.

use super::super::draws::Draws;
use super::makers::Sizes;
use beamlet::scene::Shape;
use beamlet_reference::silhouettes::cone;
use beamlet_reference::surfaces::{Mesh, cylinder, sphere};
use std::f64::consts::PI;

/// Facets around.
const SIDES: u32 = 96;

/// A part: shells in rows, or an exact shape with shells that stand for it.
pub(crate) struct Part {
    pub(crate) shells: Vec<Mesh>,
    pub(crate) shape: Option<Shape>,
}

/// An exact shape along z, and facets that stand for it, in rows.
pub(crate) fn exact(draws: &mut Draws, kind: usize, sizes: Sizes) -> Part {
    let thick = draws.log_between(sizes.thickness[0], sizes.thickness[1]);
    let long = sizes.column * draws.between(0.2, 4.0);
    let radius = 0.5 * thick;
    let (shape, mesh) = match (kind, draws.chance(0.5)) {
        (11, _) => (
            Shape::Cylinder { radius, height: long, sides: None },
            cylinder(radius, long, SIDES, 0.2),
        ),
        (12, _) => {
            // Facets keep the area of the section.
            let step = 2.0 * PI / f64::from(SIDES);
            let grown = radius * (step / step.sin()).sqrt();
            (
                Shape::Cone { radius, top_radius: 0.0, height: long, sides: None },
                cone(grown, long, SIDES),
            )
        }
        (_, true) => {
            let semi_axes = [0.5 * long, radius.max(0.2), radius];
            let mut mesh = sphere(1.0, 3);
            mesh.vertices
                .iter_mut()
                .for_each(|v| *v = [0, 1, 2].map(|axis| v[axis] * semi_axes[axis]));
            (Shape::Ellipsoid { semi_axes, sides: None }, mesh)
        }
        _ => (Shape::Sphere { radius, sides: None }, sphere(radius, 3)),
    };
    Part { shells: vec![mesh], shape: Some(shape) }
}

/// A shape of other units.
pub(crate) fn scaled_shape(shape: Shape, by: f64) -> Shape {
    match shape {
        Shape::Cylinder { radius, height, sides } => {
            Shape::Cylinder { radius: radius * by, height: height * by, sides }
        }
        Shape::Cone { radius, top_radius, height, sides } => Shape::Cone {
            radius: radius * by,
            top_radius: top_radius * by,
            height: height * by,
            sides,
        },
        Shape::Ellipsoid { semi_axes, sides } => {
            Shape::Ellipsoid { semi_axes: semi_axes.map(|it| it * by), sides }
        }
        Shape::Sphere { radius, sides } => Shape::Sphere { radius: radius * by, sides },
        other => other,
    }
}
