//! Solids with curved surfaces in f64: closed forms, and where lines come in and go out. Nothing
//! here is shared with the engine.

use crate::reference::vector::{Vector, add, dot, length, scaled, sub, turned, unit};
use beamlet::scene::{Object, Shape};

/// Centred in a frame of its own, along z, m.
#[derive(Debug, Clone, Copy)]
pub(super) enum Kind {
    Box([f64; 3]),
    /// A regular prism; `radius` is that of its corners. It keeps its facets.
    Prism {
        radius: f64,
        half: f64,
        sides: u32,
    },
    /// Radii at -half and +half.
    Cone {
        bottom: f64,
        top: f64,
        half: f64,
    },
    Ellipsoid([f64; 3]),
    /// A cylinder with a bore from end to end.
    Tube {
        outer: f64,
        inner: f64,
        half: f64,
    },
}

pub(super) const fn cylinder(radius: f64, height: f64) -> Kind {
    Kind::Cone { bottom: radius, top: radius, half: 0.5 * height }
}

pub(super) const fn sphere(radius: f64) -> Kind {
    Kind::Ellipsoid([radius; 3])
}

/// Scaled, turned one turn after the other, moved.
#[derive(Debug, Clone)]
pub(super) struct Solid {
    pub(super) kind: Kind,
    pub(super) scale: f64,
    pub(super) turns: Vec<(Vector, f64)>,
    pub(super) position: Vector,
}

/// A line crosses the surface at o + t d.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    pub(super) t: f64,
    /// Unit, outward.
    pub(super) normal: Vector,
    pub(super) entering: bool,
}

impl Solid {
    pub(super) fn new(kind: Kind) -> Self {
        Self { kind, scale: 1.0, turns: Vec::new(), position: [0.0; 3] }
    }

    pub(super) fn scaled(mut self, scale: f64) -> Self {
        self.scale = scale;
        self
    }

    pub(super) fn turned(mut self, axis: Vector, angle: f64) -> Self {
        self.turns.push((axis, angle));
        self
    }

    pub(super) fn at(mut self, position: Vector) -> Self {
        self.position = position;
        self
    }

    /// As an object of a scene.
    pub(super) fn object(&self, name: &str, material: &str) -> Object {
        let shape = match self.kind {
            Kind::Box(size) => Shape::Box { size },
            Kind::Prism { radius, half, sides } => {
                Shape::Prism { radius, height: 2.0 * half, sides }
            }
            Kind::Cone { bottom, top, half } if bottom.to_bits() == top.to_bits() => {
                Shape::Cylinder { radius: bottom, height: 2.0 * half, sides: None }
            }
            Kind::Cone { bottom, top, half } => {
                Shape::Cone { radius: bottom, top_radius: top, height: 2.0 * half, sides: None }
            }
            Kind::Ellipsoid([a, b, c]) if [b, c].map(f64::to_bits) == [a; 2].map(f64::to_bits) => {
                Shape::Sphere { radius: a, sides: None }
            }
            Kind::Ellipsoid(semi_axes) => Shape::Ellipsoid { semi_axes, sides: None },
            Kind::Tube { outer, inner, half } => {
                Shape::Tube { outer, inner, height: 2.0 * half, sides: None }
            }
        };
        let mut object = Object::new(name, shape, material);
        object.placement.scale = self.scale;
        object.placement.rotate.clone_from(&self.turns);
        object.placement.position = self.position;
        object
    }

    fn own_direction(&self, v: Vector) -> Vector {
        let back = self.turns.iter().rev().fold(v, |v, (axis, angle)| turned(v, *axis, -angle));
        scaled(back, 1.0 / self.scale)
    }

    fn own(&self, p: Vector) -> Vector {
        self.own_direction(sub(p, self.position))
    }

    fn world_direction(&self, v: Vector) -> Vector {
        self.turns.iter().fold(v, |v, (axis, angle)| turned(v, *axis, *angle))
    }

    /// A point of the own frame.
    pub(super) fn world(&self, p: Vector) -> Vector {
        add(self.world_direction(scaled(p, self.scale)), self.position)
    }

    /// Distance from the surface, negative inside: to first order beside it.
    pub(super) fn distance(&self, p: Vector) -> f64 {
        self.scale * off(self.kind, self.own(p)).0
    }

    /// The least radius of curvature of its curved surfaces, but tips and edges.
    pub(super) fn roundness(&self) -> f64 {
        self.scale
            * match self.kind {
                Kind::Box(_) | Kind::Prism { .. } => 1.0,
                Kind::Cone { bottom, top, .. } if top > 0.0 => bottom.min(top),
                Kind::Cone { bottom, .. } => 0.05 * bottom,
                Kind::Ellipsoid(axes) => {
                    let least = axes.into_iter().fold(f64::MAX, f64::min);
                    least * least / axes.into_iter().fold(0.0, f64::max)
                }
                Kind::Tube { inner, .. } => inner,
            }
    }

    /// As [`Self::roundness`] next to a point of the surface; that of a cone is less at its tip.
    pub(super) fn roundness_at(&self, p: Vector) -> f64 {
        let [x, y, _] = self.own(p);
        match self.kind {
            Kind::Cone { .. } => self.scale * x.hypot(y),
            _ => self.roundness(),
        }
    }

    /// A ball around the centre that holds it.
    pub(super) fn reach(&self) -> f64 {
        self.scale
            * match self.kind {
                Kind::Box(size) => 0.5 * length(size),
                Kind::Prism { radius, half, .. } => radius.hypot(half),
                Kind::Cone { bottom, top, half } => bottom.max(top).hypot(half),
                Kind::Ellipsoid(axes) => axes.into_iter().fold(0.0, f64::max),
                Kind::Tube { outer, half, .. } => outer.hypot(half),
            }
    }

    /// Where the line comes in and goes out, in order: between any two places at which the line
    /// may cross the surface the middle says on which side it is.
    pub(super) fn hits(&self, o: Vector, d: Vector) -> Vec<Hit> {
        let (o, d) = (self.own(o), self.own_direction(d));
        let norm = length(d);
        let d = scaled(d, 1.0 / norm);
        let base = -dot(o, d);
        let o = add(o, scaled(d, base));
        let mut places = candidates(self.kind, o, d);
        places.retain(|x| x.is_finite());
        places.sort_by(f64::total_cmp);
        let inside = |x: f64| off(self.kind, add(o, scaled(d, x))).0 < 0.0;
        let mut found = Vec::new();
        for (k, &x) in places.iter().enumerate() {
            let after = places.get(k + 1).is_some_and(|next| inside(x.midpoint(*next)));
            if after == (found.len() % 2 == 0) {
                let (_, normal) = off(self.kind, add(o, scaled(d, x)));
                let normal = self.world_direction(normal);
                found.push(Hit { t: (x + base) / norm, normal, entering: after });
            }
        }
        found
    }
}

/// Normals of the sides of a prism; its corners begin on the x axis.
fn sides_of(sides: u32) -> impl Iterator<Item = Vector> {
    (0..sides).map(move |side| {
        let step = std::f64::consts::TAU / f64::from(sides);
        let (sin, cos) = (step * (f64::from(side) + 0.5)).sin_cos();
        [cos, sin, 0.0]
    })
}

/// Distance of the sides of a prism from its axis.
fn apothem(radius: f64, sides: u32) -> f64 {
    radius * (std::f64::consts::PI / f64::from(sides)).cos()
}

/// Distance from the surface, to first order, and the outward normal of the surface that is next.
fn off(kind: Kind, p: Vector) -> (f64, Vector) {
    let [x, y, z] = p;
    match kind {
        Kind::Box(size) => {
            let face = |k: usize| p[k].abs() - 0.5 * size[k];
            let k = if face(0) >= face(1) && face(0) >= face(2) { 0 } else { 1 };
            let k = if face(2) > face(k) { 2 } else { k };
            let mut normal = [0.0; 3];
            normal[k] = p[k].signum();
            (face(k), normal)
        }
        Kind::Prism { radius, half, sides } => {
            let cap = (z.abs() - half, [0.0, 0.0, z.signum()]);
            let inner = apothem(radius, sides);
            sides_of(sides)
                .map(|normal| (dot(normal, p) - inner, normal))
                .fold(cap, |most, it| if it.0 > most.0 { it } else { most })
        }
        Kind::Cone { bottom, top, half } => {
            let widening = (top - bottom) / (2.0 * half);
            let cosine = 1.0 / 1.0_f64.hypot(widening);
            let across = x.hypot(y);
            let side = (across - (0.5 * (top + bottom) + widening * z)) * cosine;
            let cap = z.abs() - half;
            if cap > side {
                return (cap, [0.0, 0.0, z.signum()]);
            }
            (side, unit([x / across, y / across, -widening]))
        }
        Kind::Ellipsoid(axes) => {
            let q = [0, 1, 2].map(|k| p[k] / axes[k]);
            let gradient = [0, 1, 2].map(|k| q[k] / axes[k]);
            ((dot(q, q) - 1.0) / (2.0 * length(gradient)), unit(gradient))
        }
        Kind::Tube { outer, inner, half } => {
            let across = x.hypot(y);
            let out = [x / across, y / across, 0.0];
            let faces = [
                (across - outer, out),
                (inner - across, scaled(out, -1.0)),
                (z.abs() - half, [0.0, 0.0, z.signum()]),
            ];
            faces
                .into_iter()
                .fold((f64::MIN, out), |most, it| if it.0 > most.0 { it } else { most })
        }
    }
}

/// Places at which a line may cross the surface; o is next to the origin, d of length 1.
fn candidates(kind: Kind, o: Vector, d: Vector) -> Vec<f64> {
    match kind {
        Kind::Box(size) => {
            (0..3).flat_map(|k| [-0.5, 0.5].map(|s| (s * size[k] - o[k]) / d[k])).collect()
        }
        Kind::Prism { radius, half, sides } => {
            let inner = apothem(radius, sides);
            let of_side = |normal| (inner - dot(normal, o)) / dot(normal, d);
            let caps = [-half, half].map(|z| (z - o[2]) / d[2]);
            sides_of(sides).map(of_side).chain(caps).collect()
        }
        Kind::Cone { bottom, top, half } => {
            let widening = (top - bottom) / (2.0 * half);
            let mut all = vec![(-half - o[2]) / d[2], (half - o[2]) / d[2]];
            // From the point next to the axis.
            let flat = d[0] * d[0] + d[1] * d[1];
            let at = if flat > 1e-20 { -(o[0] * d[0] + o[1] * d[1]) / flat } else { 0.0 };
            let p = add(o, scaled(d, at));
            let radius = 0.5 * (top + bottom) + widening * p[2];
            let slope = widening * d[2];
            let b = p[0] * d[0] + p[1] * d[1] - radius * slope;
            let across = p[0].hypot(p[1]);
            let c = (across - radius) * (across + radius);
            all.extend(quadratic(flat - slope * slope, b, c).map(|x| at + x));
            all
        }
        Kind::Ellipsoid(axes) => {
            let (p, q) = ([0, 1, 2].map(|k| o[k] / axes[k]), [0, 1, 2].map(|k| d[k] / axes[k]));
            let at = -dot(p, q) / dot(q, q);
            let p = add(p, scaled(q, at));
            let c = (length(p) - 1.0) * (length(p) + 1.0);
            quadratic(dot(q, q), dot(p, q), c).map(|x| at + x).to_vec()
        }
        Kind::Tube { outer, inner, half } => {
            let wall = |radius| candidates(cylinder(radius, 2.0 * half), o, d);
            let mut all = wall(outer);
            // Its caps are there already.
            all.extend(&wall(inner)[2..]);
            all
        }
    }
}

/// Zeros of a x² + 2 b x + c; not a number where there are none.
fn quadratic(a: f64, b: f64, c: f64) -> [f64; 2] {
    let sum = -(b + (b * b - a * c).sqrt().copysign(b));
    [sum / a, c / sum]
}
