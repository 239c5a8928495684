//! Sizes of the bodies of an object.

use beamlet_geometry::{Component, ObjectSummary, Sample};
use beamlet_model::optics::waves::{Body, Form};
use beamlet_model::scene::{Object, Shape, ShapeOrMesh};

/// Groups of the sizes of many bodies, of equal number.
const GROUPS: usize = 5;
/// Sections of a cone.
const SECTIONS: u32 = 5;
/// Facets around a body from which on it counts as round.
const ROUND: u32 = 32;

/// Bodies of an object.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Sizes {
    /// Round bodies with their radii.
    Round(Form, Vec<Body>),
    /// Bodies between an inscribed and an enclosing cylinder.
    Between(Vec<Body>, Vec<Body>),
    /// Bodies without an estimate, with the reason.
    Unknown(String),
}

impl Sizes {
    /// Bodies of an object of the sample.
    pub(super) fn of(index: usize, object: &Object, sample: &Sample) -> Self {
        let scales = scales(index, object, sample);
        let all = |radii: &[f64]| groups(radii, &scales);
        match &object.geometry {
            ShapeOrMesh::Shape(shape) => of_shape(shape, all),
            ShapeOrMesh::Mesh(_) => of_mesh(index, sample, &scales),
        }
    }

    /// Forms of the bodies with their sizes: both cylinders of bodies that are not round.
    pub(super) fn forms(&self) -> Vec<(Form, &[Body])> {
        match self {
            Self::Round(form, bodies) => vec![(*form, bodies)],
            Self::Between(inscribed, enclosing) => {
                vec![(Form::Cylinder, inscribed), (Form::Cylinder, enclosing)]
            }
            Self::Unknown(_) => Vec::new(),
        }
    }

    /// Least and greatest diameter, m.
    pub(super) fn diameters(&self) -> Option<[f64; 2]> {
        let (low, high) = match self {
            Self::Round(_, sizes) => (sizes, sizes),
            Self::Between(inscribed, enclosing) => (inscribed, enclosing),
            Self::Unknown(_) => return None,
        };
        let least = low.iter().map(|body| body.radius).fold(f64::INFINITY, f64::min);
        let greatest = high.iter().map(|body| body.radius).fold(0.0, f64::max);
        Some([2.0 * least, 2.0 * greatest])
    }
}

fn of_shape(shape: &Shape, all: impl Fn(&[f64]) -> Vec<Body>) -> Sizes {
    let round = |sides: &Option<u32>| sides.is_none_or(|sides| sides >= ROUND);
    let angular = |what: &str| {
        Sizes::Unknown(format!(
            "{what} have few slopes: the dark field by rays depends on their angle to the beam"
        ))
    };
    match shape {
        Shape::Cylinder { radius, sides, .. } if round(sides) => {
            Sizes::Round(Form::Cylinder, all(&[*radius]))
        }
        Shape::Sphere { radius, sides } if round(sides) => {
            Sizes::Round(Form::Sphere, all(&[*radius]))
        }
        Shape::Cone { radius, top_radius, sides, .. } if round(sides) => {
            let section = |at: u32| {
                let share = (f64::from(at) + 0.5) / f64::from(SECTIONS);
                radius + (top_radius - radius) * share
            };
            Sizes::Round(Form::Cylinder, all(&(0..SECTIONS).map(section).collect::<Vec<_>>()))
        }
        Shape::Ellipsoid { semi_axes, sides } if round(sides) => {
            let least = semi_axes.iter().copied().fold(f64::INFINITY, f64::min);
            let greatest = semi_axes.iter().copied().fold(0.0, f64::max);
            Sizes::Between(all(&[least]), all(&[greatest]))
        }
        Shape::Torus { radius, tube_radius, .. } => {
            Sizes::Between(all(&[*tube_radius]), all(&[radius + tube_radius]))
        }
        Shape::Tube { outer, inner, sides, .. } if round(sides) => {
            Sizes::Between(all(&[0.5 * (outer - inner)]), all(&[*outer]))
        }
        Shape::Box { .. } | Shape::Extrusion { .. } => angular("flat faces"),
        Shape::Prism { .. }
        | Shape::Cylinder { .. }
        | Shape::Cone { .. }
        | Shape::Sphere { .. }
        | Shape::Ellipsoid { .. }
        | Shape::Tube { .. } => angular("flat facets"),
    }
}

/// Bodies of a mesh: a cylinder of the radius V/A, which fits into any convex body, and one about the two shorter
/// sides of the box.
fn of_mesh(index: usize, sample: &Sample, scales: &[f64]) -> Sizes {
    let is_of = |component: &Component| component.object as usize == index;
    let prototype = sample.prototypes.iter().find(|it| it.components.iter().any(is_of));
    let own: Vec<&Component> = match prototype {
        Some(prototype) => prototype.components.iter().collect(),
        None => sample.components.iter().filter(|it| is_of(it)).collect(),
    };
    let radii = |of: fn(&Component) -> f64| -> Vec<f64> {
        own.iter().filter(|it| it.area > 0.0).map(|it| of(it)).collect()
    };
    let inscribed = radii(|it| it.volume.abs() / it.area);
    let enclosing = radii(|it| {
        let [low, high] = it.bounds;
        let mut sides = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        sides.sort_by(f64::total_cmp);
        0.5 * libm::hypot(sides[0], sides[1])
    });
    if inscribed.is_empty() {
        return Sizes::Unknown("its mesh has no surface".into());
    }
    Sizes::Between(groups(&inscribed, scales), groups(&enclosing, scales))
}

/// Scales of the copies of an object.
fn scales(index: usize, object: &Object, sample: &Sample) -> Vec<f64> {
    let is_of = |component: u32| {
        sample.components.get(component as usize).is_some_and(|it| it.object as usize == index)
    };
    let placed = sample.placed.iter().filter(|placed| is_of(placed.component));
    let found: Vec<f64> = placed.map(|placed| placed.place.scale).collect();
    // Surfaces that are not placed are in the world already; shapes of a scene are not.
    match (&object.geometry, found.is_empty()) {
        (_, false) => found,
        (ShapeOrMesh::Shape(_), true) => vec![object.placement.scale],
        (ShapeOrMesh::Mesh(_), true) => vec![1.0],
    }
}

/// Radii at all scales, in few groups of equal number.
fn groups(radii: &[f64], scales: &[f64]) -> Vec<Body> {
    let mut all: Vec<f64> =
        scales.iter().flat_map(|scale| radii.iter().map(move |radius| scale * radius)).collect();
    all.sort_by(f64::total_cmp);
    let each = all.len().div_ceil(GROUPS).max(1);
    let of = |group: &[f64]| Body {
        radius: group.iter().sum::<f64>() / group.len() as f64,
        share: group.len() as f64 / all.len() as f64,
    };
    let mut found: Vec<Body> = Vec::new();
    for body in all.chunks(each).map(of) {
        match found.last_mut() {
            Some(last) if (body.radius - last.radius).abs() < 1e-6 * body.radius => {
                last.share += body.share;
            }
            _ => found.push(body),
        }
    }
    found
}

/// Share of the box of an object that its volume has.
pub(super) fn fill(summary: &ObjectSummary) -> f64 {
    let [low, high] = summary.bounds;
    let sides = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    summary.volume / sides.iter().product::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_many_bodies_are_in_few_groups_of_equal_number() {
        let scales: Vec<f64> = (0..1000).map(|at| 1.0 + 1e-3 * f64::from(at)).collect();
        let found = groups(&[2e-6], &scales);
        assert_eq!(found.len(), GROUPS);
        assert!(found.iter().all(|body| (body.share - 0.2).abs() < 1e-12), "{found:?}");
        let mean: f64 = found.iter().map(|body| body.share * body.radius).sum();
        assert!((mean - 2e-6 * 1.4995).abs() < 1e-12, "{mean}");
        assert_eq!(groups(&[2e-6], &[1.0; 7]), [Body { radius: 2e-6, share: 1.0 }]);
    }
}
