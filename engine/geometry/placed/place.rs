//! Place of a prototype.

use glam::{DMat3, DQuat, DVec3};

use super::super::Lids;
use beamlet_packing::InstanceTransform;

/// Scaled, stretched along its own z, turned, moved, in this order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Scale of all three axes.
    pub scale: f64,
    /// Stretch of z, beyond the scale.
    pub stretch: f64,
    /// Applied after scale and stretch.
    pub rotation: DQuat,
    /// m.
    pub position: DVec3,
}

impl Place {
    /// Place of an instance of a group with this place.
    pub(crate) fn around(&self, instance: &InstanceTransform) -> Self {
        Self {
            scale: self.scale * instance.scale,
            stretch: instance.scale_z / instance.scale,
            rotation: (self.rotation * instance.rotation).normalize(),
            position: self.rotation * (instance.position * self.scale) + self.position,
        }
    }

    /// Scales of the axes of the own frame.
    pub fn scales(&self) -> DVec3 {
        DVec3::new(self.scale, self.scale, self.scale * self.stretch)
    }

    /// The linear part, own frame to world.
    pub fn linear(&self) -> DMat3 {
        DMat3::from_quat(self.rotation) * DMat3::from_diagonal(self.scales())
    }

    /// A point of the own frame in the world, m.
    pub fn world_from_own(&self, point: DVec3) -> DVec3 {
        self.rotation * (point * self.scales()) + self.position
    }

    /// A point of the world in the own frame, m.
    pub(crate) fn own_from_world(&self, point: DVec3) -> DVec3 {
        (self.rotation.inverse() * (point - self.position)) / self.scales()
    }

    /// A box of the own frame: the box around it in the world, m.
    pub(crate) fn bounds(&self, [low, high]: [DVec3; 2]) -> [DVec3; 2] {
        let linear = self.linear();
        let half = (high - low) / 2.0;
        let reach = linear.x_axis.abs() * half.x
            + linear.y_axis.abs() * half.y
            + linear.z_axis.abs() * half.z;
        let centre = self.world_from_own(low.midpoint(high));
        [centre - reach, centre + reach]
    }

    /// The largest of its scales.
    pub(crate) const fn largest_scale(&self) -> f64 {
        self.scale * self.stretch.max(1.0)
    }

    /// The smallest of its scales.
    pub(crate) const fn least_scale(&self) -> f64 {
        self.scale * self.stretch.min(1.0)
    }

    /// Ranges of z that are not upright, in the own frame and then in the world; `None` if its z is not
    /// the world's.
    pub(crate) fn lids(&self, [lower, upper]: Lids) -> Option<Lids> {
        let axis = self.rotation * DVec3::Z;
        let turned = |range: [f64; 2]| {
            let ends = range.map(|z| self.position.z + axis.z * z * self.scale * self.stretch);
            if axis.z > 0.0 { ends } else { [ends[1], ends[0]] }
        };
        let upright = axis.truncate().length() < 1e-9;
        upright.then(|| if axis.z > 0.0 { [lower, upper] } else { [upper, lower] }.map(turned))
    }

    /// How much larger a volume is in the world.
    pub(crate) fn volume(&self) -> f64 {
        self.scale.powi(3) * self.stretch
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn instances_stand_in_their_group() {
        let quarter = DQuat::from_rotation_z(FRAC_PI_2);
        let group = Place {
            scale: 2.0,
            stretch: 1.0,
            rotation: quarter,
            position: DVec3::new(1.0, 0.0, 0.0),
        };
        let instance = InstanceTransform {
            scale: 3.0,
            scale_z: 1.5,
            rotation: DQuat::from_rotation_x(FRAC_PI_2),
            position: DVec3::new(0.0, 1.0, 0.5),
        };
        let place = group.around(&instance);
        // By hand: scaled to (3, 0, 1.5), turned about x to (3, -1.5, 0), moved to (3, -0.5, 0.5);
        // twice that, turned about z to (1, 6, 1), moved to (2, 6, 1).
        let found = place.world_from_own(DVec3::new(1.0, 0.0, 1.0));
        assert!((found - DVec3::new(2.0, 6.0, 1.0)).length() < 1e-14, "{found}");
        assert!((place.own_from_world(found) - DVec3::new(1.0, 0.0, 1.0)).length() < 1e-14);
        assert!((place.volume() - 8.0 * 3.0 * 3.0 * 1.5).abs() < 1e-12);
        let [low, high] = place.bounds([DVec3::ZERO, DVec3::ONE]);
        let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner: u32| {
            place.world_from_own(DVec3::from_array(
                [1, 2, 4].map(|bit| f64::from(corner & bit) / f64::from(bit)),
            ))
        });
        let least = corners.into_iter().fold(DVec3::INFINITY, DVec3::min);
        let most = corners.into_iter().fold(DVec3::NEG_INFINITY, DVec3::max);
        assert!((low - least).length() < 1e-13 && (high - most).length() < 1e-13);
    }
}
