//! Shapes with curved surfaces, in f64: sizes, containment, distances, and facets in their place
//! (`facets`), lines that enter them (`entry`). Each is centred in a frame of its own, along z.

mod entry;
mod facets;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use beamlet_model::scene::Shape;

pub use entry::Entry;

/// A shape with a curved surface, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AnalyticShape {
    /// From -`half_height` to `half_height`.
    Cylinder {
        /// m.
        radius: f64,
        /// m.
        half_height: f64,
    },
    /// A cone, or a truncated one; `bottom_radius` is above 0.
    Cone {
        /// At -`half_height`, m.
        bottom_radius: f64,
        /// At `half_height`, m.
        top_radius: f64,
        /// m.
        half_height: f64,
    },
    /// A ball.
    Sphere {
        /// m.
        radius: f64,
    },
    /// Half its extent along x, y, z.
    Ellipsoid {
        /// m.
        semi_axes: DVec3,
    },
    /// A cylinder with a coaxial bore through it, from -`half_height` to `half_height`.
    Tube(Tube),
}

impl AnalyticShape {
    /// The exact surface of a shape of a scene; `None` where it consists of facets or planes.
    pub(crate) fn of(shape: &Shape) -> Option<Self> {
        match *shape {
            Shape::Cylinder { radius, height, sides: None } => {
                Some(Self::Cylinder { radius, half_height: height / 2.0 })
            }
            Shape::Cone { radius, top_radius, height, sides: None } => {
                Some(Self::Cone { bottom_radius: radius, top_radius, half_height: height / 2.0 })
            }
            Shape::Sphere { radius, sides: None } => Some(Self::Sphere { radius }),
            Shape::Ellipsoid { semi_axes, sides: None } => {
                Some(Self::Ellipsoid { semi_axes: semi_axes.into() })
            }
            Shape::Tube { outer, inner, height, sides: None } => {
                Some(Self::Tube(Tube { outer, inner, half_height: height / 2.0 }))
            }
            _ => None,
        }
    }

    /// The simpler form shared by the kinds.
    pub fn form(self) -> Form {
        match self {
            Self::Cylinder { radius, half_height } => {
                Form::Frustum(Frustum { radius, half_height, widening: 0.0 })
            }
            Self::Cone { bottom_radius, top_radius, half_height } => Form::Frustum(Frustum {
                radius: bottom_radius.midpoint(top_radius),
                half_height,
                widening: (top_radius - bottom_radius) / (2.0 * half_height),
            }),
            Self::Sphere { radius } => Form::Ellipsoid(DVec3::splat(radius)),
            Self::Ellipsoid { semi_axes } => Form::Ellipsoid(semi_axes),
            Self::Tube(tube) => Form::Tube(tube),
        }
    }

    /// Least and greatest corner of the bounding box.
    pub(crate) fn bounds(self) -> [DVec3; 2] {
        let half = DVec3::from_array(
            [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| self.support(axis).dot(axis)),
        );
        [-half, half]
    }

    /// Radii of a ball about the centre and of a rod along the axis that hold the shape at some scales, m.
    pub fn radii(self, scales: DVec3) -> [f64; 2] {
        let [_, half] = self.bounds();
        let half = half * scales;
        let rod = half.x.max(half.y);
        let ball = match self.form() {
            Form::Ellipsoid(_) => half.max_element(),
            _ => libm::hypot(rod, half.z),
        };
        [ball, rod]
    }

    /// Volume, m3.
    pub(crate) fn volume(self) -> f64 {
        match self {
            Self::Cylinder { radius, half_height } => 2.0 * PI * radius * radius * half_height,
            Self::Cone { bottom_radius: a, top_radius: b, half_height } => {
                2.0 / 3.0 * PI * half_height * (a * a + a * b + b * b)
            }
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
            Self::Ellipsoid { semi_axes } => 4.0 / 3.0 * PI * semi_axes.element_product(),
            Self::Tube(it) => 2.0 * PI * it.wall() * (it.outer + it.inner) * it.half_height,
        }
    }

    /// Area of the surface, m2.
    pub(crate) fn area(self) -> f64 {
        match self {
            Self::Cylinder { radius, half_height } => {
                2.0 * PI * radius * (radius + 2.0 * half_height)
            }
            Self::Cone { bottom_radius: a, top_radius: b, half_height } => {
                PI * (a * a + b * b + (a + b) * libm::hypot(a - b, 2.0 * half_height))
            }
            Self::Sphere { radius } => 4.0 * PI * radius * radius,
            Self::Ellipsoid { semi_axes: DVec3 { x, y, z } } => {
                4.0 * PI * carlson_rg([x * y, y * z, z * x].map(|product| product * product))
            }
            Self::Tube(it) => 2.0 * PI * (it.outer + it.inner) * (it.wall() + 2.0 * it.half_height),
        }
    }

    /// True if a point lies inside.
    pub(crate) fn contains(self, point: DVec3) -> bool {
        self.distance_bound(point) < 0.0
    }

    /// At most the distance of a point to the surface, m; negative inside. It is the distance
    /// itself for spheres, next to the surface for others but ellipsoids, and for those
    /// no less than it by the ratio of their least to their greatest semi-axis.
    pub(crate) fn distance_bound(self, point: DVec3) -> f64 {
        match self.form() {
            Form::Frustum(frustum) => {
                let cosine = 1.0 / libm::hypot(1.0, frustum.widening);
                let side = (across(point) - frustum.radius_at(point.z)) * cosine;
                side.max(point.z.abs() - frustum.half_height)
            }
            Form::Ellipsoid(axes) => ((point / axes).length() - 1.0) * axes.min_element(),
            Form::Tube(it) => {
                let across = across(point);
                let side = (across - it.outer).max(it.inner - across);
                side.max(point.z.abs() - it.half_height)
            }
        }
    }

    /// True if it holds all that lies between its points.
    pub(crate) const fn is_convex(self) -> bool {
        !matches!(self, Self::Tube(_))
    }

    /// The shape that it holds at a distance from its surface, m, or at most twice that at the tip of
    /// a cone; `None` where nothing is left.
    pub(crate) fn inset(self, by: f64) -> Option<Self> {
        let left = |it: f64| (it > by).then_some(it - by);
        Some(match self {
            Self::Cylinder { radius, half_height } => {
                Self::Cylinder { radius: left(radius)?, half_height: left(half_height)? }
            }
            Self::Cone { bottom_radius, top_radius, half_height } => {
                let widening = (top_radius - bottom_radius) / (2.0 * half_height);
                let less = by * (widening.abs() + libm::hypot(1.0, widening));
                let [bottom_radius, top_radius] = [bottom_radius, top_radius].map(|it| it - less);
                let half_height = left(half_height)?;
                if bottom_radius <= 0.0 {
                    return None;
                }
                Self::Cone { bottom_radius, top_radius: top_radius.max(0.0), half_height }
            }
            Self::Sphere { radius } => Self::Sphere { radius: left(radius)? },
            Self::Ellipsoid { semi_axes } => {
                let semi_axes = semi_axes - by;
                if semi_axes.min_element() <= 0.0 {
                    return None;
                }
                Self::Ellipsoid { semi_axes }
            }
            Self::Tube(it) => {
                left(0.5 * it.wall())?;
                let half_height = left(it.half_height)?;
                Self::Tube(Tube { outer: it.outer - by, inner: it.inner + by, half_height })
            }
        })
    }

    /// The point of the convex hull that is farthest along a direction, which is not 0.
    pub(crate) fn support(self, direction: DVec3) -> DVec3 {
        let flat = direction.truncate().normalize_or(DVec2::X);
        match self.form() {
            Form::Frustum(frustum) => {
                let rim = |z: f64| (frustum.radius_at(z).max(0.0) * flat).extend(z);
                let [lower, upper] = [-frustum.half_height, frustum.half_height].map(rim);
                if upper.dot(direction) > lower.dot(direction) { upper } else { lower }
            }
            Form::Ellipsoid(axes) => axes * (axes * direction).normalize_or_zero(),
            Form::Tube(it) => (it.outer * flat).extend(it.half_height.copysign(direction.z)),
        }
    }
}

/// The kinds that surfaces differ by.
#[derive(Debug, Clone, Copy)]
pub enum Form {
    /// A cylinder or a cone.
    Frustum(Frustum),
    /// Semi-axes.
    Ellipsoid(DVec3),
    /// A tube.
    Tube(Tube),
}

/// A cylinder less a coaxial bore, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tube {
    /// Radius of the cylinder.
    pub outer: f64,
    /// Radius of the bore, above 0 and less than `outer`.
    pub inner: f64,
    /// From the centre to an end.
    pub half_height: f64,
}

impl Tube {
    /// Thickness of the wall.
    pub(crate) const fn wall(self) -> f64 {
        self.outer - self.inner
    }
}

/// A cylinder, a cone or a truncated one.
#[derive(Debug, Clone, Copy)]
pub struct Frustum {
    /// At z = 0.
    pub radius: f64,
    pub half_height: f64,
    /// Change of the radius per length of z.
    pub widening: f64,
}

impl Frustum {
    fn radius_at(self, z: f64) -> f64 {
        self.radius + self.widening * z
    }
}

/// Distance from the z axis.
fn across(point: DVec3) -> f64 {
    libm::hypot(point.x, point.y)
}

/// Carlson's symmetric integral of the second kind, of three positive numbers (Carlson 1995,
/// by duplication).
fn carlson_rg([x, y, z]: [f64; 3]) -> f64 {
    let (mut n, mut sum, mut weight) = (DVec3::new(x, y, z), 0.0, 1.0);
    // R_D(x, y, z) from the same steps as R_F.
    let mut mean;
    loop {
        mean = n.element_sum() / 3.0;
        let roots = DVec3::new(n.x.sqrt(), n.y.sqrt(), n.z.sqrt());
        let lambda = roots.x * roots.y + roots.y * roots.z + roots.z * roots.x;
        if (n - mean).abs().max_element() < 1e-3 * mean {
            break;
        }
        sum += weight / (roots.z * (n.z + lambda));
        weight /= 4.0;
        n = (n + lambda) / 4.0;
    }
    let off = DVec3::ONE - n / mean;
    let (e2, e3) = (off.x * off.y - off.z * off.z, off.element_product());
    let rf = (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / mean.sqrt();
    let mean = (n.x + n.y + 3.0 * n.z) / 5.0;
    let off = DVec3::ONE - n / mean;
    let (ab, zz) = (off.x * off.y, off.z * off.z);
    let e2 = ab - 6.0 * zz;
    let e3 = (3.0 * ab - 8.0 * zz) * off.z;
    let e4 = 3.0 * (ab - zz) * zz;
    let series = 1.0 - 3.0 * e2 / 14.0 + e3 / 6.0 + 9.0 * e2 * e2 / 88.0
        - 3.0 * e4 / 22.0
        - 9.0 * e2 * e3 / 52.0;
    let rd = 3.0 * sum + weight * series / (mean * mean.sqrt());
    0.5 * (z * rf - (x - z) * (y - z) * rd / 3.0 + (x * y / z).sqrt())
}
