//! Built-in shapes: along z, centred, with facets that keep area and volume.

use std::f64::consts::TAU;

use glam::DVec3;

use super::surface::{Defect, Surface};
use crate::numbers;
use crate::scene::Shape;

/// More facets than this serve nobody and fill the memory.
const MOST_SIDES: u32 = 1 << 20;
const MOST_SIDES_SPHERE: u32 = 1 << 12;

/// The surface of a shape, m, closed and outward.
pub(super) fn surface(shape: &Shape) -> Result<Surface, Defect> {
    match *shape {
        Shape::Box { size } => {
            size.into_iter().try_for_each(|edge| positive("size", edge))?;
            let [x, y, z] = size.map(|edge| edge / 2.0);
            let corners = [(-x, -y), (x, -y), (x, y), (-x, y)];
            Ok(prism(&corners.map(|(x, y)| [x, y]), z))
        }
        Shape::Cylinder { radius, height, sides } => {
            // A polygon of n corners at R has the area (n/2) R² sin(2π/n); make it π r².
            let step = TAU / f64::from(sides.max(1));
            upright(radius, height, sides, radius * (step / step.sin()).sqrt())
        }
        Shape::Prism { radius, height, sides } => upright(radius, height, sides, radius),
        Shape::Sphere { radius, sides } => {
            positive("radius", radius)?;
            within("sides", sides, 4, MOST_SIDES_SPHERE)?;
            Ok(sphere(radius, sides))
        }
    }
}

/// About how many triangles a shape has.
pub(super) fn triangles(shape: &Shape) -> u64 {
    match *shape {
        Shape::Box { .. } => 12,
        Shape::Cylinder { sides, .. } | Shape::Prism { sides, .. } => 4 * u64::from(sides),
        Shape::Sphere { sides, .. } => u64::from(sides) * (u64::from(sides) + 1),
    }
}

fn upright(radius: f64, height: f64, sides: u32, corner: f64) -> Result<Surface, Defect> {
    positive("radius", radius)?;
    positive("height", height)?;
    within("sides", sides, 3, MOST_SIDES)?;
    let ring: Vec<[f64; 2]> = (0..sides)
        .map(|side| {
            let (sine, cosine) = (TAU * f64::from(side) / f64::from(sides)).sin_cos();
            [corner * cosine, corner * sine]
        })
        .collect();
    Ok(prism(&ring, height / 2.0))
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

/// A convex polygon, counter-clockwise, drawn from -z to +z.
fn prism(ring: &[[f64; 2]], z: f64) -> Surface {
    let at = |z: f64| ring.iter().map(move |[x, y]| DVec3::new(*x, *y, z));
    let n = index(ring.len());
    let mut triangles = Vec::with_capacity(ring.len() * 4);
    for a in 0..n {
        let b = (a + 1) % n;
        triangles.extend([[a, b, n + b], [a, n + b, n + a]]);
    }
    let mut lid: Vec<u32> = (n..2 * n).collect();
    // Cutting off every second corner, again and again, keeps slivers short; a fan would make
    // n of them meet in one point.
    while lid.len() >= 3 {
        for corner in (1..lid.len()).step_by(2) {
            let [a, b, c] = [lid[corner - 1], lid[corner], lid[(corner + 1) % lid.len()]];
            triangles.extend([[a, b, c], [a - n, c - n, b - n]]);
        }
        lid = lid.into_iter().step_by(2).collect();
    }
    Surface::new(at(-z).chain(at(z)).collect(), triangles)
}

/// Rings of latitude; scaled so that the facets enclose the volume of the sphere.
fn sphere(radius: f64, sides: u32) -> Surface {
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
    let mut surface = Surface::new(vertices, triangles);
    let volume: f64 = (0..surface.triangles.len())
        .map(|triangle| {
            let [a, b, c] = surface.corners(triangle);
            a.dot(b.cross(c)) / 6.0
        })
        .sum();
    let scale = radius * (TAU * 2.0 / 3.0 / volume).cbrt();
    for vertex in &mut surface.vertices {
        *vertex *= scale;
    }
    surface
}
