//! Closed triangle meshes made in f64, outward counter-clockwise, each with its constants.

use super::vector::{Vector, add, cross, dot, scaled, sub, turned, unit};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// A closed mesh, metres.
#[derive(Debug, Clone)]
pub struct Mesh {
    pub vertices: Vec<Vector>,
    pub triangles: Vec<[u32; 3]>,
}

/// A mesh of one material. In a list of bodies the later one wins where they overlap.
#[derive(Debug, Clone)]
pub struct Body {
    pub mesh: Mesh,
    /// Linear attenuation coefficient, 1/m.
    pub mu: f64,
    /// Refractive index decrement.
    pub delta: f64,
}

/// A body of a mesh and its constants.
pub fn body(mesh: Mesh, mu: f64, delta: f64) -> Body {
    Body { mesh, mu, delta }
}

/// Box of full edge lengths `size`, centred.
pub fn cuboid(size: Vector) -> Mesh {
    let [x, y, z] = scaled(size, 0.5);
    extruded(&[[-x, -y], [x, -y], [x, y], [-x, y]], z)
}

/// Cylinder along z with `sides` facets whose section has the area of the circle. The first
/// vertex stands at `phase` facets from +x.
pub fn cylinder(radius: f64, height: f64, sides: u32, phase: f64) -> Mesh {
    let step = TAU / f64::from(sides);
    prism(radius * (step / step.sin()).sqrt(), height, sides, phase)
}

/// Regular prism along z, circumradius `radius`.
pub fn prism(radius: f64, height: f64, sides: u32, phase: f64) -> Mesh {
    let step = TAU / f64::from(sides);
    let corner = |i: u32| {
        let (sin, cos) = (step * (f64::from(i) + phase)).sin_cos();
        [radius * cos, radius * sin]
    };
    extruded(&(0..sides).map(corner).collect::<Vec<_>>(), 0.5 * height)
}

/// Wedge: section in (x, y) with corners (0, 0), (length, 0), (length, length tan angle), so
/// that the thickness along y grows with x; the face of entry is y = 0.
pub fn wedge(length: f64, angle: f64, height: f64) -> Mesh {
    extruded(&[[0.0, 0.0], [length, 0.0], [length, length * angle.tan()]], 0.5 * height)
}

/// Convex section (counter-clockwise) drawn out from z = -half to z = half.
pub fn extruded(section: &[[f64; 2]], half: f64) -> Mesh {
    let n = u32::try_from(section.len()).expect("small section");
    let ring = |z: f64| section.iter().map(move |p| [p[0], p[1], z]);
    let mut triangles = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
    }
    for i in 1..n - 1 {
        triangles.extend([[0, i + 1, i], [n, n + i, n + i + 1]]);
    }
    Mesh { vertices: ring(-half).chain(ring(half)).collect(), triangles }
}

/// Icosahedron with every triangle split in four `levels` times, vertices on the unit sphere.
fn unit_sphere(levels: u32) -> Mesh {
    let g = 0.5 * (1.0 + 5.0_f64.sqrt());
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let mut vertices: Vec<Vector> = corners.into_iter().map(unit).collect();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                vertices.push(unit(add(vertices[a as usize], vertices[b as usize])));
                vertices.len() as u32 - 1
            })
        };
        let split = triangles.iter().flat_map(|&[a, b, c]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        });
        triangles = split.collect();
    }
    Mesh { vertices, triangles }
}

/// Sphere of 20 * 4^levels triangles with the volume of the true one.
pub fn sphere(radius: f64, levels: u32) -> Mesh {
    let mesh = unit_sphere(levels);
    let grow = (4.0 / 3.0 * PI / mesh.volume()).cbrt();
    mesh.scaled(radius * grow)
}

/// Random closed mesh, star-shaped about the origin: radii between `inner` and `outer`.
pub fn star(inner: f64, outer: f64, levels: u32, seed: u64) -> Mesh {
    let mut random = Random::new(seed);
    let mut mesh = unit_sphere(levels);
    for vertex in &mut mesh.vertices {
        *vertex = scaled(*vertex, inner + (outer - inner) * random.next());
    }
    // An awkward general position: no vertex or edge is aligned with any axis.
    mesh.turned([1.0, 2.0, 3.0], 0.7)
}

impl Mesh {
    pub fn scaled(mut self, factor: f64) -> Self {
        self.vertices.iter_mut().for_each(|v| *v = scaled(*v, factor));
        self
    }

    pub fn moved(mut self, by: Vector) -> Self {
        self.vertices.iter_mut().for_each(|v| *v = add(*v, by));
        self
    }

    pub fn turned(mut self, axis: Vector, angle: f64) -> Self {
        self.vertices.iter_mut().for_each(|v| *v = turned(*v, axis, angle));
        self
    }

    /// The mesh with every vertex rounded to f32, so that a program that keeps f32 metres and
    /// this reference speak of the same body.
    pub fn rounded(mut self) -> Self {
        self.vertices.iter_mut().for_each(|v| *v = v.map(|c| f64::from(c as f32)));
        self
    }

    pub fn corners(&self, triangle: usize) -> [Vector; 3] {
        self.triangles[triangle].map(|v| self.vertices[v as usize])
    }

    /// Enclosed volume, m3; positive where triangles face outward.
    pub fn volume(&self) -> f64 {
        let six = (0..self.triangles.len()).map(|i| {
            let [a, b, c] = self.corners(i);
            dot(a, cross(b, c))
        });
        six.sum::<f64>() / 6.0
    }

    /// Area of the surface, m2.
    pub fn area(&self) -> f64 {
        let each = (0..self.triangles.len()).map(|i| {
            let [a, b, c] = self.corners(i);
            0.5 * super::vector::length(cross(sub(b, a), sub(c, a)))
        });
        each.sum()
    }
}

/// `SplitMix64`: random numbers of the tests.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    #[allow(clippy::should_implement_trait, reason = "draws have no end, and are no iterator")]
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / 18_446_744_073_709_551_616.0
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}
