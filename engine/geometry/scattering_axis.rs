//! Axes along which materials scatter, and instances that turn them.

use beamlet_core::error::{Error, Result};
use beamlet_model::scene::{Object, Scattering, Scene};
use beamlet_packing::InstanceTransform;
use glam::DVec3;

/// Sine of the angle between directions that are one but for the digits of a table of instances.
const DIGITS: f64 = 1e-6;

/// Refuses instances that turn the axis along which their material scatters: light has one variance in a material of an
/// object.
pub(super) fn keep_scattering_axis(
    scene: &Scene,
    object: &Object,
    number: u32,
    instances: &[InstanceTransform],
) -> Result<()> {
    let scattering = scene.scattering.get(&object.material);
    let Some(axis) = scattering.and_then(Scattering::unequal_axis) else { return Ok(()) };
    let axis = DVec3::from_array(axis.direction);
    let turns = |it: &InstanceTransform| (it.rotation * axis).cross(axis).length() > DIGITS;
    match instances.iter().position(turns) {
        None => Ok(()),
        Some(place) => {
            let found = format!(
                "instance {} turned against the scattering_axis of {:?}",
                place + 1,
                object.material
            );
            let allowed =
                "rotations about that axis; instances of each direction as an object with `rotate`";
            Err(Error::scene(scene.object_key(number as usize, "instances"), found, allowed))
        }
    }
}
