//! Shapes against closed forms.

use std::f64::consts::PI;

use glam::{DQuat, DVec2, DVec3};

use super::super::shapes;
use super::super::surface::Surface;
use super::{AnalyticShape, Tube};
use beamlet_model::scene::Shape;

/// Numbers from 0 to 1, the same at every run.
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Within a cube from -1 to 1.
    fn point(&mut self) -> DVec3 {
        2.0 * DVec3::new(self.next(), self.next(), self.next()) - 1.0
    }
}

const SHAPES: [AnalyticShape; 7] = [
    AnalyticShape::Cylinder { radius: 2e-3, half_height: 3e-3 },
    AnalyticShape::Cone { bottom_radius: 2e-3, top_radius: 0.0, half_height: 1.5e-3 },
    AnalyticShape::Cone { bottom_radius: 1e-3, top_radius: 2.5e-3, half_height: 4e-3 },
    AnalyticShape::Sphere { radius: 1e-3 },
    AnalyticShape::Ellipsoid { semi_axes: DVec3::new(1e-3, 4e-3, 2.5e-3) },
    AnalyticShape::Tube(Tube { outer: 2e-3, inner: 1.5e-3, half_height: 3e-3 }),
    AnalyticShape::Tube(Tube { outer: 3e-3, inner: 2.99e-3, half_height: 0.4e-3 }),
];

fn radius(shape: AnalyticShape) -> f64 {
    shape.bounds()[1].length()
}

#[test]
fn volumes_areas_and_bounds_are_those_of_fine_facets() {
    for shape in SHAPES {
        let surface = shape.surface(1e-6 * radius(shape));
        let (mut volume, mut area) = (0.0, 0.0);
        for triangle in 0..surface.triangles.len() {
            let [a, b, c] = surface.corners(triangle);
            volume += a.dot(b.cross(c)) / 6.0;
            area += (b - a).cross(c - a).length() / 2.0;
        }
        assert!((volume / shape.volume() - 1.0).abs() < 2e-5, "{shape:?} {volume}");
        assert!((area / shape.area() - 1.0).abs() < 2e-5, "{shape:?} {area}");
        let ([low, high], [least, most]) = (shape.bounds(), surface.bounds());
        let off = (low - least).abs().max((high - most).abs()).max_element();
        assert!(off < 1e-5 * radius(shape), "{shape:?} {off}");
    }
    let sphere = AnalyticShape::Ellipsoid { semi_axes: DVec3::splat(2e-3) };
    assert!((sphere.area() / (16.0 * PI * 1e-6) - 1.0).abs() < 1e-14);
    // Oblate, by its own formula.
    let (a, c) = (2e-3, 1e-3_f64);
    let e = (1.0 - c * c / (a * a)).sqrt();
    let exact = 2.0 * PI * a * a * (1.0 + (1.0 - e * e) / e * e.atanh());
    for axes in [DVec3::new(a, a, c), DVec3::new(c, a, a), DVec3::new(a, c, a)] {
        let found = AnalyticShape::Ellipsoid { semi_axes: axes }.area();
        assert!((found / exact - 1.0).abs() < 1e-14, "{found} {exact}");
    }
}

#[test]
fn facets_stand_on_the_surface_and_leave_no_more_than_they_say() {
    for shape in SHAPES {
        for error in [1e-3, 1e-4, 3e-6].map(|share| share * radius(shape)) {
            let surface = shape.surface(error);
            for vertex in &surface.vertices {
                assert!(shape.distance_bound(*vertex).abs() < 1e-15, "{shape:?}");
            }
            let mut draws = Draws(7);
            let mut most = 0.0_f64;
            for triangle in 0..surface.triangles.len() {
                let [a, b, c] = surface.corners(triangle);
                let (u, v) = (draws.next(), draws.next());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                for point in [a + u * (b - a) + v * (c - a), a.midpoint(b), (a + b + c) / 3.0] {
                    most = most.max(shape.distance_bound(point).abs());
                }
            }
            assert!(most <= error * (1.0 + 1e-9), "{shape:?} {error} {most}");
        }
    }
}

#[test]
fn support_is_the_farthest_point_and_bounds_hold_distances() {
    let mut draws = Draws(3);
    for shape in SHAPES {
        let surface = shape.surface(1e-4 * radius(shape));
        for _ in 0..200 {
            let direction = draws.point();
            let most = surface.vertices.iter().map(|it| it.dot(direction)).fold(-1.0, f64::max);
            let found = shape.support(direction).dot(direction);
            let slack = 1e-3 * radius(shape) * direction.length();
            assert!((most - 1e-15..most + slack).contains(&found), "{shape:?} {found} {most}");
            let point = 2.0 * radius(shape) * draws.point();
            let near = surface.vertices.iter().map(|it| it.distance(point)).fold(1.0, f64::min);
            assert!(shape.distance_bound(point).abs() <= near + 1e-12, "{shape:?} {point}");
        }
    }
}

#[test]
fn shapes_with_sides_or_planes_have_no_exact_surface() {
    let cylinder = |sides| Shape::Cylinder { radius: 1e-3, height: 2e-3, sides };
    let exact = AnalyticShape::Cylinder { radius: 1e-3, half_height: 1e-3 };
    assert_eq!(AnalyticShape::of(&cylinder(None)), Some(exact));
    assert_eq!(AnalyticShape::of(&cylinder(Some(8))), None);
    assert_eq!(AnalyticShape::of(&Shape::Box { size: [1e-3; 3] }), None);
    let ring = Shape::Torus { radius: 2e-3, tube_radius: 1e-3, sides: None };
    assert_eq!(AnalyticShape::of(&ring), None);
}

/// Root mean squares of what facets change of dT/dx of a ball or cylinder, T the thickness along
/// y, over the middle 80 % of its width: at points, and of means over 1/40 of its radius, 1.
/// `facets`: T and dT/dx at (x, z); `flat`: at z = 0.
fn slope_errors(rays: u32, flat: bool, facets: impl Fn(f64, f64) -> [f64; 2]) -> [f64; 2] {
    let mut draws = Draws(11);
    let (mut points, mut means) = (0.0, 0.0);
    for _ in 0..rays {
        let at = loop {
            let at = draws.point().truncate() * if flat { DVec2::X } else { DVec2::ONE };
            if at.length() < 0.8 {
                break at;
            }
        };
        let height = |x: f64| (1.0 - x * x - at.y * at.y).sqrt();
        points += (facets(at.x, at.y)[1] + 2.0 * at.x / height(at.x)).powi(2);
        let ends = [at.x - 1.0 / 80.0, at.x + 1.0 / 80.0];
        let [low, high] = ends.map(|x| facets(x, at.y)[0] - 2.0 * height(x));
        means += (40.0 * (high - low)).powi(2);
    }
    [points, means].map(|sum| (sum / f64::from(rays)).sqrt())
}

/// Thickness along y of a ball of facets, and its change along x.
fn thickness_of_facets(surface: &Surface, x: f64, z: f64) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for triangle in 0..surface.triangles.len() {
        let corners = surface.corners(triangle);
        let [a, b, c] = corners.map(|it| DVec2::new(it.x - x, it.z - z));
        let sides = [a.perp_dot(b), b.perp_dot(c), c.perp_dot(a)];
        if sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side < 0.0) {
            let [p, q, r] = corners;
            let normal = (q - p).cross(r - p);
            let y = p.y + ((p.x - x) * normal.x + (p.z - z) * normal.z) / normal.y;
            let sign = normal.y.signum();
            sum = [sum[0] + sign * y, sum[1] - sign * normal.x / normal.y];
        }
    }
    sum
}

/// The table of docs/physics.md, "Curved surfaces". A facet of a cylinder leans away from the
/// surface by an angle that is spread evenly over ±π/n, on both sides of the beam: sqrt(2/3) π/n
/// sec² at points.
#[test]
#[allow(clippy::print_stdout, reason = "the table is made of what this prints")]
fn facets_err_as_in_the_table_of_physics_md() {
    let secant = (0..1000).map(|k| 0.8 * (f64::from(k) + 0.5) / 1000.0);
    let secant = secant.map(|x| (1.0 - x * x).powi(-2)).sum::<f64>() / 1000.0;
    for sides in [32_u32, 64, 128, 256, 512, 1024, 2048, 4096, 16_384] {
        let step = 2.0 * PI / f64::from(sides);
        let corner = (step / step.sin()).sqrt();
        // Height and slope of the upper half, with a corner at `phase` of a step.
        let facet = |x: f64, phase: f64| {
            let mut low = ((x / corner).acos() / step - phase).floor();
            loop {
                let [a, b] = [low, low + 1.0].map(|at| (at + phase) * step);
                let [from, to] = [a, b].map(|it| it.cos() * corner);
                if x > from {
                    low -= 1.0;
                } else if x < to {
                    low += 1.0;
                } else {
                    let slope = (b.sin() - a.sin()) * corner / (to - from);
                    return [a.sin() * corner + (x - from) * slope, slope];
                }
            }
        };
        // Where the facets of both sides have nothing to do with one another.
        let apart = (3.0 - 3_f64.sqrt()) / 6.0;
        let [points, means] = slope_errors(4000, true, |x, _| {
            let [upper, lower] = [facet(x, 0.3), facet(x, 0.3 + apart)];
            [0, 1].map(|at| upper[at] + lower[at])
        });
        let expected = (2.0_f64 / 3.0 * secant).sqrt() * PI / f64::from(sides);
        println!("cylinder of {sides}: {points:.2e} at points, {means:.2e} of means");
        assert!((points / expected - 1.0).abs() < 0.1, "{sides}: {points} {expected}");
        assert!(means <= points, "{sides}");
    }
    let mut before = [1.0; 2];
    for sides in [32, 64, 128, 256, 512] {
        let ball = Shape::Sphere { radius: 1.0, sides: Some(sides) };
        let mut surface = shapes::surface(&ball, 1.0).unwrap();
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 1.0);
        surface.vertices.iter_mut().for_each(|vertex| *vertex = turn * *vertex);
        let found = slope_errors(300, false, |x, z| thickness_of_facets(&surface, x, z));
        println!("sphere of {sides}: {:.2e} at points, {:.2e} of means", found[0], found[1]);
        assert!([0, 1].iter().all(|at| found[*at] < 0.8 * before[*at]), "{sides}");
        before = found;
    }
}

#[test]
fn lines_enter_shapes_where_points_of_them_begin_to_lie_inside() {
    let mut draws = Draws(12_345);
    let mut hits = 0;
    for shape in SHAPES {
        let size = radius(shape);
        for at in 0..200 {
            let start = 3.0 * size * draws.point();
            let towards = 0.8 * size * draws.point();
            let along = match at % 4 {
                // Across the axis, and along it.
                0 => (towards - start).truncate().extend(0.0),
                1 => DVec3::Z * size,
                _ => towards - start,
            };
            let found = shape.entry(start, along);
            let inside = |distance: f64| shape.contains(start + distance * along);
            let reach = 8.0 * size / along.length();
            let steps = 4000;
            let first = (-steps..=steps)
                .map(|step| reach * f64::from(step) / f64::from(steps))
                .find(|distance| inside(*distance));
            match (found, first) {
                (Some(entry), Some(first)) => {
                    hits += 1;
                    let at = start + entry.distance * along;
                    // Not behind the first point inside, and on the surface.
                    assert!(entry.distance <= first + 1e-9 * reach, "{shape:?} {entry:?} {first}");
                    assert!(shape.distance_bound(at).abs() < 1e-9 * size, "{shape:?} {at}");
                    assert!(entry.normal.dot(along) < 0.0, "{shape:?} {entry:?}");
                    let off = 1e-6 * size * entry.normal.normalize();
                    assert!(!shape.contains(at + off), "{shape:?} {at} {off}");
                    let next = entry.distance + reach / f64::from(steps);
                    let skips = (first - next) * along.length();
                    // What is thinner than a step may be stepped over.
                    assert!(skips < 1e-9 * size || !inside(next), "{shape:?} {skips}");
                }
                (None, None) => {}
                // Thinner than a step.
                (Some(entry), None) => {
                    assert!(
                        shape.distance_bound(start + entry.distance * along).abs() < 1e-9 * size
                    );
                }
                (None, Some(first)) => panic!("{shape:?} is missed, and not at {first}"),
            }
        }
    }
    assert!(hits > 300, "{hits}");
}
