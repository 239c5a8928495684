//! Built-in shapes: along z, centred, with facets that keep area and volume.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::polygon;
use super::surface::{Defect, Surface};
use beamlet_core::numbers;
use beamlet_model::scene::Shape;

/// More facets than this serve nobody and fill the memory.
const MOST_SIDES: u32 = 1 << 20;
const MOST_SIDES_SPHERE: u32 = 1 << 12;

/// Distance of the facets of a torus without `sides` from its surface, m, where [`MOST_FACETS`] allow it.
const TORUS_ERROR: f64 = 1e-8;
/// Most facets of a torus without `sides`.
const MOST_FACETS: f64 = 2e6;

/// The surface of a shape, m, closed and outward. `scale`: the factor by which it is enlarged later.
pub(super) fn surface(shape: &Shape, scale: f64) -> Result<Surface, Defect> {
    match shape {
        Shape::Box { size } => {
            size.iter().try_for_each(|edge| positive("size", *edge))?;
            let [x, y, z] = size.map(|edge| edge / 2.0);
            let corners = [(-x, -y), (x, -y), (x, y), (-x, y)];
            Ok(prism(&corners.map(|(x, y)| [x, y]), z))
        }
        Shape::Cylinder { radius, height, sides } => {
            let sides = facets(*sides)?;
            upright(*radius, *height, sides, radius * area_kept(sides))
        }
        Shape::Cone { radius, top_radius, height, sides } => {
            cone([*radius, *top_radius], *height, facets(*sides)?)
        }
        Shape::Prism { radius, height, sides } => upright(*radius, *height, *sides, *radius),
        Shape::Extrusion { points, height } => extrusion(points, *height),
        Shape::Sphere { radius, sides } => {
            positive("radius", *radius)?;
            let sides = facets(*sides)?;
            within("sides", sides, 4, MOST_SIDES_SPHERE)?;
            Ok(sphere(sides, DVec3::splat(*radius)))
        }
        Shape::Ellipsoid { semi_axes, sides } => {
            semi_axes.iter().try_for_each(|axis| positive("semi_axes", *axis))?;
            let sides = facets(*sides)?;
            within("sides", sides, 4, MOST_SIDES_SPHERE)?;
            Ok(sphere(sides, DVec3::from_array(*semi_axes)))
        }
        Shape::Torus { radius, tube_radius, sides } => {
            positive("tube_radius", *tube_radius)?;
            if !(radius.is_finite() && radius > tube_radius) {
                let problem = format!("radius is {radius} m; it must be above tube_radius");
                return Err(Defect::new(problem, "shape"));
            }
            if let Some(sides) = *sides {
                within("sides", sides, 4, MOST_SIDES_SPHERE)?;
            }
            Ok(torus(*radius, *tube_radius, torus_sides([*radius, *tube_radius], *sides, scale)))
        }
        Shape::Tube { outer, inner, height, sides } => {
            tube([*outer, *inner], *height, facets(*sides)?)
        }
    }
}

/// About how many triangles a shape has; `scale` as in [`surface`].
pub(super) fn triangles(shape: &Shape, scale: f64) -> u64 {
    let square = |sides: Option<u32>| sides.map_or(0, |it| u64::from(it) * (u64::from(it) + 1));
    match shape {
        Shape::Box { .. } => 12,
        Shape::Cylinder { sides, .. } | Shape::Cone { sides, .. } => {
            4 * u64::from(sides.unwrap_or(0))
        }
        Shape::Prism { sides, .. } => 4 * u64::from(*sides),
        Shape::Extrusion { points, .. } => 4 * points.len() as u64,
        Shape::Sphere { sides, .. } | Shape::Ellipsoid { sides, .. } => square(*sides),
        Shape::Torus { radius, tube_radius, sides } => {
            let [around, across] = torus_sides([*radius, *tube_radius], *sides, scale);
            2 * u64::from(around) * u64::from(across)
        }
        Shape::Tube { sides, .. } => 8 * u64::from(sides.unwrap_or(0)),
    }
}

/// The facets of a curved shape.
fn facets(sides: Option<u32>) -> Result<u32, Defect> {
    sides.ok_or_else(|| Defect::new("a curved shape needs `sides`, the number of facets", "shape"))
}

/// Corner radius of a polygon of n sides over the radius of the circle of equal area: the polygon has the
/// area (n/2) R² sin(2π/n), the circle π r².
fn area_kept(sides: u32) -> f64 {
    let step = TAU / f64::from(sides.max(1));
    (step / step.sin()).sqrt()
}

/// Corners of a regular polygon, counter-clockwise.
pub(super) fn ring(sides: u32, corner: f64) -> Vec<[f64; 2]> {
    let at = |side: u32| {
        let (sine, cosine) = (TAU * f64::from(side) / f64::from(sides)).sin_cos();
        [corner * cosine, corner * sine]
    };
    (0..sides).map(at).collect()
}

fn upright(radius: f64, height: f64, sides: u32, corner: f64) -> Result<Surface, Defect> {
    positive("radius", radius)?;
    positive("height", height)?;
    within("sides", sides, 3, MOST_SIDES)?;
    Ok(prism(&ring(sides, corner), height / 2.0))
}

/// A cone, or a truncated one, of the radii at -z and +z.
fn cone(radii: [f64; 2], height: f64, sides: u32) -> Result<Surface, Defect> {
    let [lower, upper] = radii;
    positive("radius", lower)?;
    positive("height", height)?;
    within("sides", sides, 3, MOST_SIDES)?;
    if upper != 0.0 {
        positive("top_radius", upper)?;
    }
    Ok(frustum(&ring(sides, area_kept(sides)), radii, height / 2.0))
}

/// A cone, or a truncated one, over a convex polygon that is scaled by the radii at -z and +z.
pub(super) fn frustum(corners: &[[f64; 2]], [lower, upper]: [f64; 2], z: f64) -> Surface {
    if upper > 0.0 {
        let mut surface = prism(corners, z);
        for vertex in &mut surface.vertices {
            let radius = if vertex.z < 0.0 { lower } else { upper };
            *vertex = DVec3::new(vertex.x * radius, vertex.y * radius, vertex.z);
        }
        return surface;
    }
    let n = index(corners.len());
    let at = |[x, y]: &[f64; 2]| DVec3::new(x * lower, y * lower, -z);
    let mut vertices: Vec<DVec3> = corners.iter().map(at).collect();
    vertices.push(DVec3::new(0.0, 0.0, z));
    let mut triangles: Vec<[u32; 3]> = (0..n).map(|side| [side, (side + 1) % n, n]).collect();
    triangles.extend(lid((0..n).collect()).map(|[a, b, c]| [a, c, b]));
    Surface::new(vertices, triangles)
}

/// A cylinder with a bore, whose facets keep the areas of both sections.
fn tube([outer, inner]: [f64; 2], height: f64, sides: u32) -> Result<Surface, Defect> {
    positive("inner", inner)?;
    positive("height", height)?;
    within("sides", sides, 3, MOST_SIDES)?;
    if !(outer.is_finite() && outer > inner) {
        let problem = format!("outer is {outer} m; it must be above inner");
        return Err(Defect::new(problem, "shape"));
    }
    let kept = area_kept(sides);
    Ok(pipe([(outer * kept, sides), (inner * kept, sides)], height / 2.0))
}

/// A tube from -z to +z: radius of the corners of its outer and of its inner wall, and facets around
/// each.
pub(super) fn pipe([(outer, n), (inner, m)]: [(f64, u32); 2], z: f64) -> Surface {
    let mut vertices = Vec::new();
    for (radius, sides) in [(outer, n), (inner, m)] {
        for z in [-z, z] {
            vertices.extend(ring(sides, radius).into_iter().map(|[x, y]| DVec3::new(x, y, z)));
        }
    }
    let mut triangles = walls(n);
    let bore = 2 * n;
    triangles.extend(
        walls(m).into_iter().map(|it| it.map(|vertex| bore + vertex)).map(|[a, b, c]| [a, c, b]),
    );
    // Around the upper end: of the next corners of both rings the one that comes first.
    let (mut a, mut b) = (0, 0);
    let upper = |ring: u32, corner: u32| match ring {
        0 => n + corner % n,
        _ => bore + m + corner % m,
    };
    let mut end = Vec::new();
    while a < n || b < m {
        let [here, there] = [upper(0, a), upper(1, b)];
        let goes_on = u64::from(a + 1) * u64::from(m) <= u64::from(b + 1) * u64::from(n);
        if b == m || (a < n && goes_on) {
            a += 1;
            end.push([here, upper(0, a), there]);
        } else {
            b += 1;
            end.push([here, upper(1, b), there]);
        }
    }
    let lower = |vertex: u32| if vertex < bore { vertex - n } else { vertex - m };
    triangles.extend(end.iter().map(|it| it.map(lower)).map(|[a, b, c]| [a, c, b]));
    triangles.extend(end);
    Surface::new(vertices, triangles)
}

/// A polygon, either way round, drawn out along z.
fn extrusion(points: &[[f64; 2]], height: f64) -> Result<Surface, Defect> {
    positive("height", height)?;
    if points.len() < 3 || !points.as_flattened().iter().all(|it| it.is_finite()) {
        return Err(Defect::new("an extrusion needs three finite points or more", "shape"));
    }
    let mut corners: Vec<DVec3> =
        points.iter().map(|[x, y]| DVec3::new(*x, *y, -height / 2.0)).collect();
    let n = corners.len();
    let area: f64 =
        (1..n - 1).map(|at| (corners[at] - corners[0]).cross(corners[at + 1] - corners[0]).z).sum();
    if area < 0.0 {
        corners.reverse();
    }
    let lid = polygon::triangles(&corners).map_err(|problem| Defect::new(problem, "shape"))?;
    let n = index(n);
    let mut triangles = walls(n);
    for corners in lid {
        let [a, b, c] = corners.map(index);
        triangles.extend([[n + a, n + b, n + c], [a, c, b]]);
    }
    let upper = corners.clone().into_iter().map(|it| DVec3::new(it.x, it.y, height / 2.0));
    corners.extend(upper.collect::<Vec<_>>());
    Ok(Surface::new(corners, triangles))
}

fn positive(key: &str, value: f64) -> Result<(), Defect> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Defect::new(format!("{key} is {value} m; it must be above 0"), "shape"))
}

fn within(key: &str, value: u32, least: u32, most: u32) -> Result<(), Defect> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(Defect::new(format!("{key} is {value}; it must be {least} to {most}"), "shape"))
}

fn index(value: usize) -> u32 {
    numbers::count(value)
}

/// The sides between a ring of vertices from 0 on and one from n on.
fn walls(n: u32) -> Vec<[u32; 3]> {
    let wall = |a: u32| {
        let b = (a + 1) % n;
        [[a, b, n + b], [a, n + b, n + a]]
    };
    (0..n).flat_map(wall).collect()
}

/// Triangles of a convex polygon. Cutting off every second corner, again and again, keeps slivers short;
/// a fan would join n of them in one point.
fn lid(mut ring: Vec<u32>) -> impl Iterator<Item = [u32; 3]> {
    let mut triangles = Vec::with_capacity(ring.len());
    while ring.len() >= 3 {
        for corner in (1..ring.len()).step_by(2) {
            triangles.push([ring[corner - 1], ring[corner], ring[(corner + 1) % ring.len()]]);
        }
        ring = ring.into_iter().step_by(2).collect();
    }
    triangles.into_iter()
}

/// A convex polygon, counter-clockwise, drawn from -z to +z.
fn prism(ring: &[[f64; 2]], z: f64) -> Surface {
    let at = |z: f64| ring.iter().map(move |[x, y]| DVec3::new(*x, *y, z));
    let n = index(ring.len());
    let mut triangles = walls(n);
    for [a, b, c] in lid((n..2 * n).collect()) {
        triangles.extend([[a, b, c], [a - n, c - n, b - n]]);
    }
    Surface::new(at(-z).chain(at(z)).collect(), triangles)
}

/// A ball whose facets enclose the volume of the sphere, scaled along the axes.
fn sphere(sides: u32, semi_axes: DVec3) -> Surface {
    let mut surface = unit_sphere(sides);
    let scale = (TAU * 2.0 / 3.0 / volume(&surface)).cbrt();
    for vertex in &mut surface.vertices {
        *vertex *= semi_axes * scale;
    }
    surface
}

/// An ellipsoid with its vertices on the surface.
pub(super) fn ball(sides: u32, semi_axes: DVec3) -> Surface {
    let mut surface = unit_sphere(sides);
    surface.vertices.iter_mut().for_each(|vertex| *vertex *= semi_axes);
    surface
}

/// Rings of latitude.
fn unit_sphere(sides: u32) -> Surface {
    let bands = sides.div_ceil(2);
    let mut vertices = vec![DVec3::NEG_Z];
    for ring in 1..bands {
        let latitude = TAU / 2.0 * (f64::from(ring) / f64::from(bands) - 0.5);
        for side in 0..sides {
            let (sine, cosine) = (TAU * f64::from(side) / f64::from(sides)).sin_cos();
            let flat = latitude.cos();
            vertices.push(DVec3::new(flat * cosine, flat * sine, latitude.sin()));
        }
    }
    vertices.push(DVec3::Z);
    let (south, north) = (0, index(vertices.len() - 1));
    let vertex = |ring: u32, side: u32| 1 + (ring - 1) * sides + side % sides;
    let mut triangles = Vec::new();
    for side in 0..sides {
        triangles.push([south, vertex(1, side + 1), vertex(1, side)]);
        for ring in 1..bands - 1 {
            let (a, b) = (vertex(ring, side), vertex(ring, side + 1));
            let (c, d) = (vertex(ring + 1, side + 1), vertex(ring + 1, side));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        triangles.push([north, vertex(bands - 1, side), vertex(bands - 1, side + 1)]);
    }
    Surface::new(vertices, triangles)
}

/// Facets of a torus around its ring and around its tube: `sides`, or the number that keeps them within
/// [`TORUS_ERROR`] of the surface at a scale.
///
/// Chords are s = (R + r) π²/2n² and t = r π²/2m² off the circles of ring and tube at most; their corners
/// lie 2s/3 and 2t/3 outside, so facets are up to e = 2 (s + t)/3 off the surface. Along the outline of a
/// ring s changes its sign within a pixel, t does not: s = 1.2 e and t = 0.3 e.
fn torus_sides([radius, tube_radius]: [f64; 2], sides: Option<u32>, scale: f64) -> [u32; 2] {
    if let Some(sides) = sides {
        return [sides; 2];
    }
    let error = TORUS_ERROR / scale;
    let around = [(radius + tube_radius) / (2.4 * error), tube_radius / (0.6 * error)];
    let around = around.map(|it| PI * it.sqrt());
    let fewer = (MOST_FACETS / (2.0 * around[0] * around[1])).sqrt().min(1.0);
    around.map(|it| numbers::whole((fewer * it).ceil().max(8.0)))
}

/// A torus whose facets enclose its volume: both polygons keep the areas of their circles. `n` facets around
/// the ring, `m` around the tube.
fn torus(radius: f64, tube_radius: f64, [n, m]: [u32; 2]) -> Surface {
    let (circle, tubes) = (ring(n, area_kept(n)), ring(m, tube_radius * area_kept(m)));
    let corner = |[x, y]: [f64; 2], [off, z]: [f64; 2]| {
        DVec3::new((radius + off) * x, (radius + off) * y, z)
    };
    let vertices = circle.iter().flat_map(|around| tubes.iter().map(|tube| corner(*around, *tube)));
    let mut triangles = Vec::new();
    for around in 0..n {
        let next = (around + 1) % n;
        for tube in 0..m {
            let [a, d] = [tube, (tube + 1) % m].map(|tube| around * m + tube);
            let [b, c] = [tube, (tube + 1) % m].map(|tube| next * m + tube);
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Surface::new(vertices.collect(), triangles)
}

/// Volume that a closed surface encloses.
fn volume(surface: &Surface) -> f64 {
    (0..surface.triangles.len())
        .map(|triangle| {
            let [a, b, c] = surface.corners(triangle);
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}
