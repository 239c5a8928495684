//! Lines through exact shapes: where the plane of a line begins and ends to cut a curved surface or a cap, and the
//! chords of its rays, in closed form.

use beamlet_core::numbers;
use beamlet_geometry::{AnalyticForm, AnalyticShape, Placed};
use glam::{DMat3, DVec3};

/// Coefficient of t2 of a line in a surface, over that of a line across it, that counts as 0.
const PARALLEL: f64 = 1e-14;

/// An exact shape in the beam frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShapeInBeam {
    pub component: u32,
    /// Other shapes cross it.
    pub is_crossed: bool,
    /// Its centre, m.
    centre: DVec3,
    /// From the beam frame to its own, in which an ellipsoid is the unit ball.
    own: DMat3,
    surface: Surface,
    /// Radius of a ball around it, m.
    radius: f64,
}

/// Surface of a shape in its own frame.
#[derive(Debug, Clone, Copy)]
enum Surface {
    Ball,
    /// About z, between caps; `bore`: radius of the bore of a tube, 0 without one.
    Capped {
        radius: f64,
        widening: f64,
        half_height: f64,
        bore: f64,
    },
}

/// Place where a ray crosses a surface.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Crossing {
    /// From the source along y, m.
    pub distance: f64,
    /// Unit normal out of the shape, beam frame.
    pub normal: DVec3,
}

/// Part of the lines of a row whose rays cross the same surfaces of a shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShapeCut {
    /// Ends, m in the cell plane.
    pub x: [f64; 2],
    /// True for each end at which rays touch a curved surface.
    pub rims: [bool; 2],
    /// Chords of each ray.
    pub chords: u32,
}

/// A ray in the frame of a shape, from the plane y of its centre.
#[derive(Debug, Clone, Copy)]
struct OwnRay {
    o: DVec3,
    d: DVec3,
}

impl OwnRay {
    fn at(&self, t: f64) -> DVec3 {
        self.o + self.d * t
    }
}

impl ShapeInBeam {
    /// A shape that no other crosses. `rotation`: from the frame of the sample to the beam's; `centre`: in the beam
    /// frame, m.
    pub(super) fn new(
        shape: AnalyticShape,
        placed: &Placed,
        rotation: &DMat3,
        centre: DVec3,
    ) -> Self {
        let turned = *rotation * DMat3::from_quat(placed.place.rotation);
        let mut scales = placed.place.scales();
        let surface = match shape.form() {
            AnalyticForm::Ellipsoid(axes) => {
                scales *= axes;
                Surface::Ball
            }
            AnalyticForm::Frustum(it) => Surface::Capped {
                radius: it.radius,
                widening: it.widening,
                half_height: it.half_height,
                bore: 0.0,
            },
            AnalyticForm::Tube(it) => Surface::Capped {
                radius: it.outer,
                widening: 0.0,
                half_height: it.half_height,
                bore: it.inner,
            },
        };
        let own = DMat3::from_diagonal(scales.recip()) * turned.transpose();
        let radius = shape.radii(placed.place.scales())[0];
        Self { component: placed.component, is_crossed: false, centre, own, surface, radius }
    }

    /// The ray of a slope; `source`: distance of the source before the rotation centre, m.
    fn ray(&self, source: f64, [slope_x, slope_z]: [f64; 2]) -> OwnRay {
        let along = self.centre.y + source;
        let off = DVec3::new(slope_x * along - self.centre.x, 0.0, slope_z * along - self.centre.z);
        OwnRay { o: self.own * off, d: self.own * DVec3::new(slope_x, 1.0, slope_z) }
    }

    /// Interval of x in a plane, m from the source, within which it lies.
    pub(super) fn x_around(&self, source: f64, plane: f64) -> [f64; 2] {
        let along = self.centre.y + source;
        let [near, far] = [(along - self.radius).max(1e-3 * along), along + self.radius];
        [-1.0, 1.0].map(|side| {
            let x = self.centre.x + side * self.radius;
            x * plane / if x * side > 0.0 { near } else { far }
        })
    }

    /// Slopes along z within which it lies.
    pub(super) fn slopes_around(&self, source: f64) -> [f64; 2] {
        let upright = Self { centre: DVec3::new(self.centre.z, self.centre.y, 0.0), ..*self };
        upright.x_around(source, 1.0)
    }

    /// Slopes along z at which rays of a slope along x begin or end to cut a part of it.
    pub(super) fn ends_along_z(&self, source: f64, slope_x: f64) -> impl Iterator<Item = f64> {
        let along = self.centre.y + source;
        let of = [self.centre.z / along, self.radius / along];
        self.ends(source, of, |slope_z| [slope_x, slope_z]).into_iter().map(|(slope, _)| slope)
    }

    /// Places of a row of rays at which these touch a curved surface (true) or meet the edge of a cap. `slopes`: of the ray
    /// at a place; `centre` and `unit`: place of the middle and size of the shape.
    fn ends(
        &self,
        source: f64,
        [centre, unit]: [f64; 2],
        slopes: impl Fn(f64) -> [f64; 2],
    ) -> Vec<(f64, bool)> {
        let mut ends: Vec<(f64, bool)> = Vec::new();
        // All of these are polynomials of second degree in the place, whatever plane a ray begins at.
        let mut add = |is_rim: bool, of: &dyn Fn(&OwnRay) -> f64| {
            let value = |u: f64| of(&self.ray(source, slopes(centre + u * unit)));
            for root in roots([value(-1.0), value(0.0), value(1.0)]).into_iter().flatten() {
                ends.push((centre + root * unit, is_rim));
            }
        };
        match self.surface {
            Surface::Ball => add(true, &|ray| Quadratic::ball(ray).discriminant()),
            Surface::Capped { radius, widening, half_height, bore } => {
                add(true, &|ray| Quadratic::round(ray, radius, widening).discriminant());
                let cap = |z: f64, radius: f64| {
                    move |OwnRay { o, d }: &OwnRay| {
                        let across = d.truncate() * (z - o.z) + o.truncate() * d.z;
                        across.length_squared() - radius * radius * d.z * d.z
                    }
                };
                for z in [-half_height, half_height] {
                    add(false, &cap(z, radius + widening * z));
                }
                if bore > 0.0 {
                    add(true, &|ray| Quadratic::round(ray, bore, 0.0).discriminant());
                    [-half_height, half_height].into_iter().for_each(|z| add(false, &cap(z, bore)));
                }
            }
        }
        ends
    }

    /// Parts of lines that cut it, from left to right. `slopes`: of the ray at x in the cell plane; `plane`: of the
    /// cells, m from the source.
    pub(super) fn cuts(
        &self,
        source: f64,
        plane: f64,
        slopes: impl Fn(f64) -> [f64; 2],
    ) -> Vec<ShapeCut> {
        let to_plane = plane / (self.centre.y + source);
        let mut ends =
            self.ends(source, [self.centre.x, self.radius].map(|it| it * to_plane), &slopes);
        ends.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let cut = |pair: &[(f64, bool)]| {
            let x = [pair[0].0, pair[1].0];
            let chords = self.chords(source, slopes(f64::midpoint(x[0], x[1]))).count();
            let rims = [pair[0].1, pair[1].1];
            (chords > 0 && x[1] > x[0]).then_some(ShapeCut {
                x,
                rims,
                chords: numbers::count(chords),
            })
        };
        ends.windows(2).filter_map(cut).collect()
    }

    /// Chords of the ray of a slope: where it enters and where it leaves.
    pub(super) fn chords(
        &self,
        source: f64,
        slopes: [f64; 2],
    ) -> impl Iterator<Item = [Crossing; 2]> {
        let ray = self.ray(source, slopes);
        let along = self.centre.y + source;
        let crossing = |t: f64, normal: DVec3| Crossing {
            distance: along + t,
            normal: (self.own.transpose() * normal).normalize_or_zero(),
        };
        match self.surface {
            Surface::Ball => {
                let of = |t: f64| crossing(t, ray.at(t));
                let chord = Quadratic::ball(&ray).inside(0.0).map(|ends| ends.map(of));
                [chord, None].into_iter().flatten()
            }
            Surface::Capped { radius, widening, half_height, bore } => {
                let slab = slab(&ray, half_height);
                let normal = |t: f64, radius: f64, widening: f64| {
                    let p = ray.at(t);
                    DVec3::new(p.x, p.y, -widening * (radius + widening * p.z))
                };
                let cap = DVec3::Z * if ray.d.z < 0.0 { 1.0 } else { -1.0 };
                let solid = Quadratic::round(&ray, radius, widening).inside(widening * ray.d.z);
                let Some((slab, solid)) = slab.zip(solid) else {
                    return [None, None].into_iter().flatten();
                };
                let ends = [slab[0].max(solid[0]), slab[1].min(solid[1])];
                if ends[0] >= ends[1] {
                    return [None, None].into_iter().flatten();
                }
                let enters =
                    if solid[0] > slab[0] { normal(ends[0], radius, widening) } else { cap };
                let leaves =
                    if solid[1] < slab[1] { normal(ends[1], radius, widening) } else { -cap };
                let [enters, leaves] = [crossing(ends[0], enters), crossing(ends[1], leaves)];
                let hollow = (bore > 0.0)
                    .then(|| Quadratic::round(&ray, bore, 0.0).inside(0.0))
                    .flatten()
                    .map(|it| [it[0].max(ends[0]), it[1].min(ends[1])])
                    .filter(|it| it[0] < it[1]);
                let Some(hollow) = hollow else {
                    return [Some([enters, leaves]), None].into_iter().flatten();
                };
                let wall = hollow.map(|t| crossing(t, -normal(t, bore, 0.0)));
                let before = (hollow[0] > ends[0]).then_some([enters, wall[0]]);
                let behind = (hollow[1] < ends[1]).then_some([wall[1], leaves]);
                [before, behind].into_iter().flatten()
            }
        }
    }
}

/// Parameters of a ray between the caps.
fn slab(ray: &OwnRay, half_height: f64) -> Option<[f64; 2]> {
    if ray.d.z == 0.0 {
        return (ray.o.z.abs() < half_height).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let [a, b] = [-half_height, half_height].map(|z| (z - ray.o.z) / ray.d.z);
    Some([a.min(b), a.max(b)])
}

/// a t2 + 2 b t + c, below 0 within a curved surface.
#[derive(Debug, Clone, Copy)]
struct Quadratic {
    a: f64,
    b: f64,
    c: f64,
    /// The coefficient of t2 without the surface's slant.
    across: f64,
}

impl Quadratic {
    fn ball(&OwnRay { o, d }: &OwnRay) -> Self {
        let a = d.length_squared();
        Self { a, b: o.dot(d), c: o.length_squared() - 1.0, across: a }
    }

    /// A surface whose radius changes along z by `widening` per length.
    fn round(&OwnRay { o, d }: &OwnRay, radius: f64, widening: f64) -> Self {
        let at = radius + widening * o.z;
        let [flat_o, flat_d] = [o, d].map(DVec3::truncate);
        Self {
            a: flat_d.length_squared() - widening * widening * d.z * d.z,
            b: flat_o.dot(flat_d) - widening * at * d.z,
            c: flat_o.length_squared() - at * at,
            across: d.length_squared(),
        }
    }

    fn discriminant(&self) -> f64 {
        self.b * self.b - self.a * self.c
    }

    /// Parameters between which a ray is within the surface. `widens`: above 0 where the surface widens along the ray.
    fn inside(&self, widens: f64) -> Option<[f64; 2]> {
        let Self { a, b, c, across } = *self;
        if a.abs() <= PARALLEL * across {
            if b.abs() <= PARALLEL * across {
                return (c < 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY]);
            }
            let t = -0.5 * c / b;
            return Some(if b > 0.0 { [f64::NEG_INFINITY, t] } else { [t, f64::INFINITY] });
        }
        let discriminant = self.discriminant();
        if discriminant < 0.0 && a > 0.0 {
            return None;
        }
        let sum = -(b + discriminant.max(0.0).sqrt().copysign(b));
        let [first, second] = [sum / a, if sum == 0.0 { 0.0 } else { c / sum }];
        let [low, high] = [first.min(second), first.max(second)];
        Some(match a > 0.0 {
            true => [low, high],
            // Steeper than a cone: of its two halves the one that is there.
            false if widens > 0.0 => [high, f64::INFINITY],
            false => [f64::NEG_INFINITY, low],
        })
    }
}

/// Roots of the polynomial of second degree that has these values at -1, 0 and 1.
pub(super) fn roots([low, middle, high]: [f64; 3]) -> [Option<f64>; 2] {
    let (a, b) = (f64::midpoint(low, high) - middle, 0.5 * (high - low));
    let discriminant = b * b - 4.0 * a * middle;
    if discriminant < 0.0 {
        return [None, None];
    }
    let sum = -0.5 * (b + discriminant.sqrt().copysign(b));
    let near = |root: f64| Some(root).filter(|root| root.is_finite());
    [near(sum / a), near(middle / sum)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_core::random::Draws;
    use beamlet_geometry::Place;
    use glam::DQuat;

    const SOURCE: f64 = 1.2;
    const PLANE: f64 = 1.1;

    /// A random shape in a random place, with the test of a point in the beam frame.
    fn drawn(draws: &mut Draws, kind: u32) -> (ShapeInBeam, impl Fn(DVec3) -> bool + use<>) {
        let mut between = |low: f64, high: f64| low + (high - low) * draws.uniform();
        let [a, b, half_height] = [0; 3].map(|_| between(0.1e-3, 1e-3));
        let shape = match kind % 5 {
            0 => AnalyticShape::Sphere { radius: a },
            1 => AnalyticShape::Ellipsoid { semi_axes: DVec3::new(a, b, half_height) },
            2 => AnalyticShape::Cylinder { radius: a, half_height },
            3 => AnalyticShape::Cone {
                bottom_radius: a,
                top_radius: (b - 3e-4).max(0.0),
                half_height,
            },
            _ => AnalyticShape::Tube(beamlet_geometry::Tube {
                outer: a,
                inner: between(0.1, 0.95) * a,
                half_height,
            }),
        };
        let axis = DVec3::new(between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0));
        let place = Place {
            scale: between(0.5, 2.0),
            stretch: between(0.5, 2.0),
            rotation: DQuat::from_axis_angle(axis.normalize(), between(0.0, 3.0)),
            position: DVec3::new(between(-0.03, 0.03), between(-0.1, 0.1), between(-0.01, 0.01)),
        };
        let placed = Placed { prototype: 0, component: 0, place };
        let inside = move |point: DVec3| {
            let own = place.rotation.inverse() * (point - place.position) / place.scales();
            let across = own.truncate().length();
            let height = own.z.abs() < half_height;
            match shape {
                AnalyticShape::Sphere { radius } => own.length() < radius,
                AnalyticShape::Ellipsoid { semi_axes } => (own / semi_axes).length() < 1.0,
                AnalyticShape::Cylinder { radius, .. } => height && across < radius,
                AnalyticShape::Cone { bottom_radius, top_radius, .. } => {
                    let share = 0.5 + 0.5 * own.z / half_height;
                    height && across < bottom_radius + (top_radius - bottom_radius) * share
                }
                AnalyticShape::Tube(it) => height && (it.inner..it.outer).contains(&across),
            }
        };
        (ShapeInBeam::new(shape, &placed, &DMat3::IDENTITY, place.position), inside)
    }

    /// Chords against points on the ray; cuts against chords.
    #[test]
    fn chords_and_cuts_are_those_of_points_in_the_shape() {
        let mut draws = Draws::new(11, [0; 3], 0);
        let (mut met, mut hollow) = (0, 0);
        for case in 0..400 {
            let (shape, inside) = drawn(&mut draws, case);
            let along = shape.centre.y + SOURCE;
            let row = (shape.centre.z + shape.radius * (2.0 * draws.uniform() - 1.0)) / along;
            let slopes = |x: f64| [x / PLANE, row];
            let middle = shape.centre.x / along * PLANE;
            let unit = shape.radius / along * PLANE;
            let cuts = shape.cuts(SOURCE, PLANE, slopes);
            for _ in 0..20 {
                let x = middle + unit * 2.2 * (draws.uniform() - 0.5);
                let chords: Vec<_> = shape.chords(SOURCE, slopes(x)).collect();
                let of_cuts =
                    cuts.iter().find(|it| it.x[0] <= x && x < it.x[1]).map_or(0, |it| it.chords);
                assert_eq!(chords.len(), of_cuts as usize, "case {case} at {x}: {cuts:?}");
                let steps = 4000;
                let step = 2.2 * shape.radius / f64::from(steps);
                let at = |k: i32| along + (f64::from(k) + 0.5 - 0.5 * f64::from(steps)) * step;
                let point = |distance: f64| {
                    DVec3::new(x / PLANE * distance, distance - SOURCE, row * distance)
                };
                let seen = (0..steps).filter(|k| inside(point(at(*k)))).count() as f64 * step;
                let length: f64 = chords.iter().map(|[a, b]| b.distance - a.distance).sum();
                let limit = 2.0 * chords.len() as f64 * step;
                assert!((seen - length).abs() <= limit, "case {case}: {seen:e} for {length:e}");
                met += usize::from(!chords.is_empty());
                hollow += usize::from(chords.len() == 2);
                for [a, b] in &chords {
                    let direction = DVec3::new(x / PLANE, 1.0, row);
                    assert!(a.normal.dot(direction) <= 1e-9 && b.normal.dot(direction) >= -1e-9);
                    // A little along the normal is outside, against it inside.
                    for it in [a, b] {
                        let [out, within] =
                            [1e-8, -1e-8].map(|off| inside(point(it.distance) + it.normal * off));
                        assert!(!out && within, "case {case}: {it:?}");
                    }
                }
            }
        }
        assert!(met > 3000 && hollow > 100, "{met} chords, {hollow} around bores");
    }
}
