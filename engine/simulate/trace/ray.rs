//! A ray as callers of the library give it.

use beamlet_interface as interface;

/// A straight line through the sample, in the beam frame of a view: y along the optical axis from
/// source to detector, x across the slits, z along them, origin in the rotation centre.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Ray {
    /// Index of the view among the angles of the scene.
    pub view: u32,
    /// x and z in the plane y = 0, m.
    pub point: [f32; 2],
    /// dx/dy and dz/dy.
    pub slope: [f32; 2],
}

impl Ray {
    /// A ray of a view through `point` (x, z in the plane y = 0, m) with slopes dx/dy and dz/dy.
    #[must_use]
    pub const fn new(view: u32, point: [f32; 2], slope: [f32; 2]) -> Self {
        Self { view, point, slope }
    }
}

impl From<&interface::Ray> for Ray {
    fn from(ray: &interface::Ray) -> Self {
        Self::new(ray.view, [ray.x, ray.z], [ray.slope_x, ray.slope_z])
    }
}

impl From<&Ray> for interface::Ray {
    fn from(&Ray { view, point: [x, z], slope: [slope_x, slope_z] }: &Ray) -> Self {
        Self { x, z, slope_x, slope_z, view, key: 0 }
    }
}
