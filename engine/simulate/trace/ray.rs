//! A ray as callers of the library give it.

use beamlet_interface as interface;

/// A straight line through the sample, in the beam frame of a pose: y along the optical axis from
/// source to detector, x across the slits, z along them, origin in the rotation centre.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Ray {
    /// Index of the pose of the sample: the index of the view, unless the sample turns during a view;
    /// then the poses of a view follow one another.
    pub pose: u32,
    /// x and z in the plane y = 0, m.
    pub point: [f32; 2],
    /// dx/dy and dz/dy.
    pub slope: [f32; 2],
}

impl Ray {
    /// A ray of a pose through `point` (x, z in the plane y = 0, m) with slopes dx/dy and dz/dy.
    #[must_use]
    pub const fn new(pose: u32, point: [f32; 2], slope: [f32; 2]) -> Self {
        Self { pose, point, slope }
    }
}

impl From<&interface::Ray> for Ray {
    fn from(ray: &interface::Ray) -> Self {
        Self::new(ray.pose, [ray.x, ray.z], [ray.slope_x, ray.slope_z])
    }
}

impl From<&Ray> for interface::Ray {
    fn from(&Ray { pose, point: [x, z], slope: [slope_x, slope_z] }: &Ray) -> Self {
        Self { x, z, slope_x, slope_z, pose, key: 0 }
    }
}
