//! Places and shapes with curved surfaces as the device takes them.

use glam::{DQuat, DVec3};

use beamlet_core::numbers::single;
use beamlet_geometry::{AnalyticForm, AnalyticShape, Placed};
use beamlet_interface as interface;
use beamlet_interface::{NO_PARTNERS, SHAPE_ELLIPSOID, SHAPE_FRUSTUM, SHAPE_TUBE};

/// Lengths of a quaternion that are tried.
const LENGTHS: u32 = 128;

/// The record of a shape.
pub(super) fn shape_record(shape: AnalyticShape) -> interface::AnalyticShape {
    let (kind, parameters) = match shape.form() {
        AnalyticForm::Frustum(it) => {
            (SHAPE_FRUSTUM, DVec3::new(it.radius, it.half_height, it.widening))
        }
        AnalyticForm::Ellipsoid(axes) => (SHAPE_ELLIPSOID, axes.recip()),
        AnalyticForm::Tube(it) => (SHAPE_TUBE, DVec3::new(it.outer, it.half_height, it.inner)),
    };
    interface::AnalyticShape { kind, parameters: parameters.to_array().map(single) }
}

/// A prototype in its place; `primitive`: number of its first primitive. `last`: the rotation before it,
/// which most have in common.
pub(super) fn placed_record(
    placed: &Placed,
    primitive: u32,
    last: &mut Option<(DQuat, [f32; 4])>,
) -> interface::Placed {
    let place = &placed.place;
    let rotation = match last {
        Some((known, rounded)) if *known == place.rotation => *rounded,
        _ => rounded(place.rotation),
    };
    *last = Some((place.rotation, rotation));
    let [position, rest] = twofold(place.position);
    interface::Placed {
        position,
        rest,
        rotation,
        scale: single(place.scale),
        scale_z: single(place.scale * place.stretch),
        prototype: placed.prototype,
        primitive,
        surface: placed.component,
        partners: NO_PARTNERS,
    }
}

/// A vector in f32, and its remainder.
pub(crate) fn twofold(vector: DVec3) -> [[f32; 3]; 2] {
    let high = vector.to_array().map(single);
    let low = vector - DVec3::from_array(high.map(f64::from));
    [high, low.to_array().map(single)]
}

/// A quaternion in f32, of the length from 1 to 2 at which rounding turns it least: by 4e-8 rad at
/// most, at length 1 by 1e-7.
fn rounded(rotation: DQuat) -> [f32; 4] {
    let at = |k: u32| {
        let length = 1.0 + f64::from(k) / f64::from(LENGTHS);
        let found = (rotation * length).to_array().map(single);
        let off = DQuat::from_array(found.map(f64::from)) * length.recip() - rotation;
        (found, off.length_squared())
    };
    (0..LENGTHS).map(at).min_by(|a, b| a.1.total_cmp(&b.1)).map_or([0.0; 4], |it| it.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_geometry::Place;

    #[test]
    fn quaternions_rotate_to_4e_8() {
        for k in 0..200 {
            let k = f64::from(k);
            let axis = DVec3::new(k.sin(), (1.7 * k).cos(), (0.3 * k).sin()).normalize();
            let rotation = DQuat::from_axis_angle(axis, 0.1 * k);
            let found = DQuat::from_array(rounded(rotation).map(f64::from)).normalize();
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let off = (found * axis - rotation * axis).length();
                assert!(off < 4e-8, "{k}: {off}");
            }
        }
        assert_eq!(rounded(DQuat::IDENTITY).map(f32::to_bits), [0, 0, 0, 1.0_f32.to_bits()]);
    }

    #[test]
    fn places_hold_positions_to_48_bits() {
        let position = DVec3::new(0.1 / 3.0, -1e-2 / 7.0, 1e-5 / 11.0);
        let place = Place { scale: 1.0, stretch: 1.0, rotation: DQuat::IDENTITY, position };
        let placed = placed_record(&Placed { prototype: 3, component: 5, place }, 77, &mut None);
        let sum = |high: [f32; 3], low: [f32; 3]| {
            DVec3::from_array(high.map(f64::from)) + DVec3::from_array(low.map(f64::from))
        };
        let found = sum(placed.position, placed.rest);
        assert!(((found - position) / position).abs().max_element() < 1e-14);
        assert_eq!([{ placed.prototype }, { placed.surface }, { placed.primitive }], [3, 5, 77]);
    }
}
