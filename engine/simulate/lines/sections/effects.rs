//! Effects of surfaces on a ray of a line, and their sums.

use super::{Form, Interval, SurfaceLines, THINNEST};
use crate::lines::by_facets::EdgePlace;
use crate::lines::by_shapes::Crossing;
use crate::lines::line::LinePlace;
use crate::sampling::SurfaceStep;
use crate::trace::FIRST_ORDER_ERROR;
use beamlet_interface::{HORIZON, ROUGH_GRAZING};
use glam::{DVec2, DVec3};

/// Change of a ray by surfaces.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Change {
    pub(super) depth: f64,
    /// Displacement on the analyser along x and z, m.
    pub(super) displacement: DVec2,
    /// Change of the slope along x and z.
    pub(super) slope: DVec2,
    /// Variance of the displacement along x by rough surfaces, m2.
    pub(super) roughness: f64,
    /// The same by materials that scatter, m2.
    pub(super) scattering: f64,
}

impl Change {
    /// With a share of another.
    pub(super) fn plus(self, other: &Self, share: f64) -> Self {
        Self {
            depth: self.depth + other.depth * share,
            displacement: self.displacement + other.displacement * share,
            slope: self.slope + other.slope * share,
            roughness: self.roughness + other.roughness * share,
            scattering: self.scattering + other.scattering * share,
        }
    }

    /// At a share of the way to another.
    pub(super) fn towards(self, other: &Self, share: f64) -> Self {
        self.plus(&other.plus(&self, -1.0), share)
    }
}

/// Effect of a surface on a ray.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Effect {
    pub(super) change: Change,
    /// First-order remainder of the displacement, m; 0 where the first order is enough.
    pub(super) remainder: f64,
    /// The ray draws the normal of a rough surface.
    pub(super) draws: bool,
}

/// Sums over the surfaces that a ray crosses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums {
    pub(super) change: Change,
    /// First-order remainder of the displacement, m.
    pub(super) remainder: f64,
    /// The ray draws normals of rough surfaces.
    pub(super) draws: bool,
    /// From the source along y to the first and to the last surface, m.
    pub(super) distance: [f64; 2],
}

/// A ray enters or leaves an exact shape that others cross.
#[derive(Debug, Clone, Copy)]
struct Passage {
    crossing: Crossing,
    is_front: bool,
    component: u32,
}

impl Default for Sums {
    fn default() -> Self {
        let distance = [f64::INFINITY, 0.0];
        Self { change: Change::default(), remainder: 0.0, draws: false, distance }
    }
}

impl Sums {
    /// Adds a surface at a distance from the source along y, m.
    fn add(&mut self, effect: &Effect, distance: f64) {
        self.change = self.change.plus(&effect.change, 1.0);
        self.remainder += effect.remainder;
        self.draws |= effect.draws;
        self.distance = [self.distance[0].min(distance), self.distance[1].max(distance)];
    }
}

impl SurfaceLines<'_> {
    /// Sums of the ray at x.
    pub(super) fn sums(&self, interval: &Interval<'_>, x: f64) -> Sums {
        let mut sums = Sums::default();
        let mut crossed: Vec<Passage> = Vec::new();
        let LinePlace { beamlet, row } = *interval.place;
        let slopes_at = |x: f64| self.view.lattice.slopes(beamlet, x, row);
        let step = |component: u32| &self.view.facets.steps[component as usize];
        for section in interval.crossed {
            let width = section.x[1] - section.x[0];
            match &section.form {
                Form::Flat { ends: [low, high], distance } => {
                    let share = (x - section.x[0]) / width;
                    let effect = Effect {
                        change: low.change.towards(&high.change, share),
                        remainder: low.remainder.max(high.remainder),
                        draws: low.draws || high.draws,
                    };
                    // The extent of a piece reaches over both ends of a section.
                    sums.add(&effect, distance[0]);
                    sums.add(&Effect::default(), distance[1]);
                }
                Form::Smooth { ends, x: of_ends, is_front, component } => {
                    let slopes = slopes_at(x);
                    let share = (x - of_ends[0]) / (of_ends[1] - of_ends[0]);
                    let distance = distance_on_plane(ends, share);
                    let normal = ends[0].normal + (ends[1].normal - ends[0].normal) * share;
                    let normal = before_horizon(normal.normalize_or_zero(), *is_front, slopes);
                    let crossing = Crossing { distance, normal };
                    let effect = self.effect(step(*component), crossing, *is_front, slopes);
                    sums.add(&effect, distance);
                }
                Form::Curved { shape, .. } => {
                    let within = (0.5 * width).min(THINNEST);
                    let x = x.clamp(section.x[0] + within, section.x[1] - within);
                    let slopes = slopes_at(x);
                    let component = shape.component;
                    for (crossing, is_front) in
                        shape.chords(self.source, slopes).flat_map(|[a, b]| [(a, true), (b, false)])
                    {
                        if shape.is_crossed {
                            crossed.push(Passage { crossing, is_front, component });
                            continue;
                        }
                        let effect = self.effect(step(component), crossing, is_front, slopes);
                        sums.add(&effect, crossing.distance);
                    }
                }
            }
        }
        if !crossed.is_empty() {
            self.add_crossed(&mut crossed, slopes_at(x), &mut sums);
        }
        sums
    }

    /// Adds the surfaces of exact shapes that cross: of the objects that contain a point the last one fills it.
    fn add_crossed(&self, passages: &mut [Passage], slopes: [f64; 2], sums: &mut Sums) {
        let components = &self.view.sample.components;
        let object = |it: &Passage| components[it.component as usize].object;
        passages.sort_by(|a, b| a.crossing.distance.total_cmp(&b.crossing.distance));
        // Objects around the ray, once for each body.
        let mut around: Vec<u32> = Vec::new();
        for it in passages.iter() {
            let own = object(it);
            if !it.is_front
                && let Some(at) = around.iter().position(|other| *other == own)
            {
                around.swap_remove(at);
            }
            if around.iter().all(|other| *other < own) {
                let last = around.iter().max().copied();
                let outside = last.max(components[it.component as usize].outside);
                let step = self.view.facets.step_in(it.component, own, outside);
                let effect = self.effect(step, it.crossing, it.is_front, slopes);
                sums.add(&effect, it.crossing.distance);
            }
            if it.is_front {
                around.push(own);
            }
        }
    }

    /// Effect of a surface on the ray of a slope that crosses it. `is_front`: the ray enters.
    pub(super) fn effect(
        &self,
        step: &SurfaceStep,
        Crossing { distance, normal }: Crossing,
        is_front: bool,
        slope: [f64; 2],
    ) -> Effect {
        let y = distance - self.source;
        let along = normal.x * slope[0] + normal.y + normal.z * slope[1];
        let square = 1.0 + slope[0] * slope[0] + slope[1] * slope[1];
        let length = square.sqrt();
        let sign = if is_front { 1.0 } else { -1.0 };
        let lever = self.analyser - y;
        let bend = step.delta * square / along.abs().max(1e-9);
        // Against the normal that faces the source.
        let facing = if along > 0.0 { -sign } else { sign };
        let across = DVec2::new(normal.x - normal.y * slope[0], normal.z - normal.y * slope[1]);
        let bends = facing * bend * across;
        let share = along.abs() / length / step.least_cosine.max(1e-30);
        let draws = step.delta != 0.0 && along.abs() < ROUGH_GRAZING * step.roughness * length;
        let remainder = if step.is_open || draws {
            f64::INFINITY
        } else if share < 1.0 {
            FIRST_ORDER_ERROR * lever / (share * share * share)
        } else {
            0.0
        };
        let depth = -sign * step.mu * length * y;
        let roughness = if step.roughness > 0.0 && !draws {
            // As `shaders/walk/cross_rough.glsl`.
            let spread = DVec3::new(1.0, -slope[0], 0.0) / along
                - DVec3::new(slope[0], 1.0, slope[1]) * (across.x / (along * along));
            (step.roughness * square * step.delta * lever).powi(2) * spread.length_squared()
        } else {
            0.0
        };
        // As `squared_arm` of `shaders/walk/moments.glsl`.
        let arm = self.analyser;
        let squared_arm = y * (arm * (arm - y) + y * y / 3.0) * length * square;
        // In the beam frame an angle moves light along x by its part along (1, -slope_x, 0).
        let [along_x, along_y, _] = self.axes;
        let scattering = -sign
            * match self.view.facets.directed(step, along_x - slope[0] * along_y) {
                Some(directed) => directed * squared_arm,
                None => step.scattering * squared_arm * (1.0 + slope[0] * slope[0]),
            };
        let displacement = bends * lever;
        let change = Change { depth, displacement, slope: bends, roughness, scattering };
        Effect { change, remainder, draws }
    }
}

/// Distance from the source along y at a share of the way between two points on a plane, as x goes: there
/// 1 / distance is linear in x.
pub(super) fn distance_on_plane(ends: &[EdgePlace; 2], share: f64) -> f64 {
    let [low, high] = ends.map(|end| 1.0 / end.distance);
    1.0 / (low + (high - low) * share)
}

/// A smooth normal that faces the ray of a slope as its facet does: one that turns away is moved to the horizon.
fn before_horizon(normal: DVec3, is_front: bool, [slope_x, slope_z]: [f64; 2]) -> DVec3 {
    let direction = DVec3::new(slope_x, 1.0, slope_z).normalize();
    let side = if is_front { -1.0 } else { 1.0 };
    let lacks = HORIZON - side * normal.dot(direction);
    if lacks > 0.0 { (normal + side * lacks * direction).normalize() } else { normal }
}
