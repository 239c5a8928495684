//! From mesh coordinates to the world.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::placed::Place;
use super::surface::{Defect, Surface};
use beamlet_model::scene::Placement;

/// The scale, rotations and position of an object, as for a group of instances.
pub(super) fn group(placement: &Placement) -> Result<Place, Defect> {
    let scale = placement.scale;
    if !(scale.is_finite() && scale > 0.0) {
        return Err(Defect::new(format!("scale {scale} must be above 0"), "placement"));
    }
    let mut rotation = DQuat::IDENTITY;
    for (axis, angle) in &placement.rotate {
        rotation = DQuat::from_axis_angle(unit_axis(*axis, *angle)?, *angle) * rotation;
    }
    let position = DVec3::from_array(placement.position);
    Ok(Place { scale, stretch: 1.0, rotation: rotation.normalize(), position })
}

fn unit_axis(axis: [f64; 3], angle: f64) -> Result<DVec3, Defect> {
    DVec3::from_array(axis)
        .try_normalize()
        .filter(|_| angle.is_finite())
        .ok_or_else(|| Defect::new("a rotation needs an axis longer than 0", "rotate"))
}

/// Applies unit, then center, scale, rotations in their order, and position; returns them all
/// in one.
pub(super) fn place(
    surface: &mut Surface,
    unit: f64,
    placement: &Placement,
) -> Result<DAffine3, Defect> {
    let scale = unit * placement.scale;
    if !(unit.is_finite() && unit > 0.0 && scale.is_finite() && scale > 0.0) {
        let problem = format!("unit {unit} m and scale {} must be above 0", placement.scale);
        return Err(Defect::new(problem, "placement"));
    }
    let mut linear = DMat3::from_diagonal(DVec3::splat(scale));
    for (axis, angle) in &placement.rotate {
        linear = DMat3::from_axis_angle(unit_axis(*axis, *angle)?, *angle) * linear;
    }
    let centre = if placement.center {
        let [low, high] = surface.bounds();
        low.midpoint(high)
    } else {
        DVec3::ZERO
    };
    let position = DVec3::from_array(placement.position);
    let world = DAffine3::from_mat3_translation(linear, position - linear * centre);
    for vertex in &mut surface.vertices {
        *vertex = linear * (*vertex - centre) + position;
        // The device sees f32.
        if !vertex.as_vec3().is_finite() {
            return Err(Defect::new("a vertex is not finite after placement", "placement"));
        }
    }
    Ok(world)
}
