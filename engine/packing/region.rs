//! Regions of packings: products of balls. A box is three intervals, a cylinder a disc and an
//! interval, a sphere one ball.

use std::f64::consts::{FRAC_PI_3, PI};

use arrayvec::ArrayVec;

use beamlet_model::scene::PackingRegion;

/// Volume of the ball of radius 1 in 1, 2 or 3 dimensions.
pub(super) const fn unit_ball(dimensions: usize) -> f64 {
    match dimensions {
        1 => 2.0,
        2 => PI,
        _ => 4.0 * FRAC_PI_3,
    }
}

/// A region around the origin.
#[derive(Debug, Clone)]
pub(super) struct Region {
    /// Dimensions and radius of each ball, m, in the order of the axes.
    balls: ArrayVec<(usize, f64), 3>,
}

impl Region {
    /// The solid region.
    pub(super) fn solid(region: &PackingRegion) -> Self {
        let balls = match *region {
            PackingRegion::Box { size } => size.map(|edge| (1, edge / 2.0)).into(),
            PackingRegion::Cylinder { radius, height } => {
                ArrayVec::from_iter([(2, radius), (1, height / 2.0)])
            }
            PackingRegion::Sphere { radius } => ArrayVec::from_iter([(3, radius)]),
        };
        Self { balls }
    }

    /// The cross-section across z that holds upright fibres of this height, centred at z = 0; `None` if
    /// they do not fit.
    pub(super) fn cross_section(region: &PackingRegion, height: f64) -> Option<Self> {
        // A height equal to the region's may be the next larger number.
        let fits = |most: f64| height <= most * (1.0 + 1e-9);
        let balls = match *region {
            PackingRegion::Box { size: [x, y, z] } => {
                fits(z).then(|| ArrayVec::from_iter([(1, x / 2.0), (1, y / 2.0)]))
            }
            PackingRegion::Cylinder { radius, height: most } => {
                fits(most).then(|| ArrayVec::from_iter([(2, radius)]))
            }
            PackingRegion::Sphere { radius } => {
                let square = radius * radius - height * height / 4.0;
                (square > 0.0).then(|| ArrayVec::from_iter([(2, square.sqrt())]))
            }
        };
        balls.map(|balls| Self { balls })
    }

    /// Volume of the points at least `margin` from the wall; in two dimensions, area.
    pub(super) fn volume(&self, margin: f64) -> f64 {
        let inner = |&(dimensions, radius): &(usize, f64)| {
            let side = (radius - margin).max(0.0);
            (0..dimensions).fold(unit_ball(dimensions), |volume, _| volume * side)
        };
        self.balls.iter().map(inner).product()
    }

    /// True if a point is at least `margin` from the wall.
    pub(super) fn contains(&self, point: &[f64], margin: f64) -> bool {
        let mut rest = point;
        self.balls.iter().all(|&(dimensions, radius)| {
            let (own, after) = rest.split_at(dimensions);
            rest = after;
            let side = radius - margin;
            side >= 0.0 && own.iter().map(|x| x * x).sum::<f64>() <= side * side
        })
    }

    /// Half the sides of the box around it.
    pub(super) fn half_sides<const D: usize>(&self) -> [f64; D] {
        let mut sides =
            self.balls.iter().flat_map(|&(dims, radius)| (0..dims).map(move |_| radius));
        std::array::from_fn(|_| sides.next().unwrap_or_default())
    }

    /// True if a cylinder around the segment from `centre` - `arm` to `centre` + `arm`, of this radius,
    /// lies inside, at least `gap` from the wall. The rim of a cylinder in a cylinder is taken for a sphere.
    pub(super) fn contains_cylinder(
        &self,
        centre: [f64; 3],
        arm: [f64; 3],
        radius: f64,
        gap: f64,
    ) -> bool {
        let square = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
        let length = square(arm);
        let mut first = 0;
        self.balls.iter().all(|&(dimensions, size)| {
            let axes = first..first + dimensions;
            first = axes.end;
            [-1.0, 1.0].iter().all(|sign| {
                let end: [f64; 3] = std::array::from_fn(|k| centre[k] + sign * arm[k]);
                let reach = match dimensions {
                    1 => {
                        let along = arm[axes.start];
                        let across = (1.0 - along * along / length).max(0.0).sqrt();
                        end[axes.start].abs() + radius * across
                    }
                    2 => axes.clone().map(|k| end[k] * end[k]).sum::<f64>().sqrt() + radius,
                    _ => {
                        // The point of the end disc that is farthest from the centre of the region.
                        let dot: f64 = (0..3).map(|k| end[k] * arm[k]).sum();
                        let across = (square(end) - dot * dot / length).max(0.0).sqrt();
                        (square(end) + radius * radius + 2.0 * radius * across).sqrt()
                    }
                };
                reach + gap <= size
            })
        })
    }
}
