//! Facets that stand for a curved surface.

use std::f64::consts::{PI, SQRT_2};

use super::super::shapes;
use super::super::surface::Surface;
use super::{AnalyticShape, Form, Tube};
use beamlet_core::numbers;

/// Facets around at least.
const LEAST: u32 = 8;
/// Most facets around: a ball of 2048 has 2 million triangles.
const MOST: u32 = 2048;

impl AnalyticShape {
    /// Closed facets, outward, in the frame of the shape. Their vertices lie on the surface, and
    /// nothing of it is farther than `error` (m, > 0) from them, unless that took more than 2048
    /// facets around; there are 8 at least.
    pub(crate) fn surface(self, error: f64) -> Surface {
        match self.form() {
            Form::Frustum(frustum) => {
                let [low, high] =
                    [-1.0, 1.0].map(|side| frustum.radius_at(side * frustum.half_height).max(0.0));
                let corners = shapes::ring(around(low.max(high), error), 1.0);
                shapes::frustum(&corners, [low, high], frustum.half_height)
            }
            Form::Ellipsoid(axes) => {
                // A facet spans a step along both angles: its middle is half a diagonal off.
                let step = SQRT_2 * half_step(axes.max_element(), error);
                shapes::ball(sides(2.0 * PI / step), axes)
            }
            Form::Tube(it) => {
                let [outer, inner] = rings_of(it, error);
                shapes::pipe([(it.outer, outer), (it.inner, inner)], it.half_height)
            }
        }
    }

    /// The least error that [`Self::surface`] keeps to, m.
    pub(crate) fn least_error(self) -> f64 {
        let off = |radius: f64, half_step: f64| radius * (1.0 - half_step.cos());
        let step = PI / f64::from(MOST);
        match self.form() {
            Form::Frustum(frustum) => {
                let [low, high] =
                    [-1.0, 1.0].map(|side| frustum.radius_at(side * frustum.half_height));
                off(low.max(high), step)
            }
            Form::Ellipsoid(axes) => off(axes.max_element(), SQRT_2 * step),
            Form::Tube(it) => off(it.outer, step),
        }
    }

    /// About how many triangles `Self::surface` has.
    pub(crate) fn triangles(self, error: f64) -> u64 {
        match self.form() {
            Form::Frustum(frustum) => {
                let [low, high] =
                    [-1.0, 1.0].map(|side| frustum.radius_at(side * frustum.half_height));
                4 * u64::from(around(low.max(high), error))
            }
            Form::Ellipsoid(axes) => {
                let step = SQRT_2 * half_step(axes.max_element(), error);
                u64::from(sides(2.0 * PI / step)).pow(2)
            }
            Form::Tube(it) => rings_of(it, error).into_iter().map(|it| 4 * u64::from(it)).sum(),
        }
    }
}

/// Facets around a tube and its bore, whose walls keep apart.
fn rings_of(it: Tube, error: f64) -> [u32; 2] {
    let error = error.min(0.25 * it.wall());
    [it.outer, it.inner].map(|radius| around(radius, error))
}

/// Half the angle of the chord whose arc of a radius is `error` high.
fn half_step(radius: f64, error: f64) -> f64 {
    (1.0 - (error / radius).min(1.0)).acos()
}

fn around(radius: f64, error: f64) -> u32 {
    sides(PI / half_step(radius, error))
}

fn sides(count: f64) -> u32 {
    numbers::whole(count.ceil().clamp(f64::from(LEAST), f64::from(MOST)))
}
