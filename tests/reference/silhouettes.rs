//! Bodies with rims and folds, and rays near the silhouettes of bodies.

use super::surfaces::{Body, Mesh, Random, prism, sphere};
use super::vector::{add, cross, dot, scaled, sub, unit};
use beamlet::internals::trace::Ray;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Cone along z with its tip up.
pub fn cone(radius: f64, height: f64, sides: u32) -> Mesh {
    let step = TAU / f64::from(sides);
    let rim = (0..sides).map(|i| {
        let (sin, cos) = (step * (f64::from(i) + 0.3)).sin_cos();
        [radius * cos, radius * sin, -0.5 * height]
    });
    let vertices = rim.chain([[0.0, 0.0, 0.5 * height], [0.0, 0.0, -0.5 * height]]).collect();
    let around = (0..sides).map(|i| [i, (i + 1) % sides]);
    let triangles = around.flat_map(|[i, j]| [[i, j, sides], [j, i, sides + 1]]).collect();
    Mesh { vertices, triangles }
}

/// Torus about z: radii of the ring and of its section, facets around each.
pub fn torus([ring, tube]: [f64; 2], [around, across]: [u32; 2]) -> Mesh {
    let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for i in 0..around {
        let (sin, cos) = (TAU * (f64::from(i) + 0.3) / f64::from(around)).sin_cos();
        for j in 0..across {
            let (up, out) = (TAU * (f64::from(j) + 0.3) / f64::from(across)).sin_cos();
            let r = ring + tube * out;
            mesh.vertices.push([r * cos, r * sin, tube * up]);
            let at = |i: u32, j: u32| (i % around) * across + j % across;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// Sphere with smooth bumps, of 20 * 4^levels triangles.
pub fn bumpy(radius: f64, levels: u32) -> Mesh {
    let mut mesh = sphere(1.0, levels);
    for v in &mut mesh.vertices {
        let d = unit(*v);
        let wave = |k: f64, axis| (k * dot(d, unit(axis)) + k).sin() * 0.2 / k;
        let r = 1.0
            + wave(5.0, [1.0, 2.0, 0.5])
            + wave(9.0, [-1.0, 0.4, 1.5])
            + wave(17.0, [0.3, -1.0, 0.8])
            + wave(33.0, [0.7, 0.9, -1.1]);
        *v = scaled(d, radius * r);
    }
    mesh
}

/// Upright fibres in a square, apart.
pub fn fibres(count: usize, radius: f64, sides: u32) -> Mesh {
    let mut random = Random::new(3);
    let mut centres: Vec<[f64; 2]> = Vec::new();
    while centres.len() < count {
        let mut at = || random.between(-1.0, 1.0) * 12.0 * radius;
        let c = [at(), at()];
        if centres.iter().all(|p| (p[0] - c[0]).hypot(p[1] - c[1]) > 2.05 * radius) {
            centres.push(c);
        }
    }
    together(centres.iter().map(|c| prism(radius, 2e-3, sides, 0.2).moved([c[0], c[1], 0.0])))
}

/// Meshes as one.
pub fn together(meshes: impl Iterator<Item = Mesh>) -> Mesh {
    let mut all = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for one in meshes {
        let first = all.vertices.len() as u32;
        all.vertices.extend(one.vertices);
        all.triangles.extend(one.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

/// Rays from the source's centre, or almost, 0.1 nm to 10 um beside silhouettes of the bodies, on
/// either side of them.
pub fn near_silhouettes(
    bodies: &[Body],
    source: f64,
    count: usize,
    random: &mut Random,
) -> Vec<Ray> {
    let from = [0.0, -source, 0.0];
    let mut rims = Vec::new();
    for Body { mesh, .. } in bodies {
        let mut sides: HashMap<[u32; 2], bool> = HashMap::new();
        for (i, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let [p, q, r] = mesh.corners(i);
            let facing = dot(cross(sub(q, p), sub(r, p)), sub(p, from)) < 0.0;
            for [i, j] in [[a, b], [b, c], [c, a]] {
                let key = [i.min(j), i.max(j)];
                if sides.insert(key, facing).is_some_and(|other| other != facing) {
                    rims.push(key.map(|v| mesh.vertices[v as usize]));
                }
            }
        }
    }
    let ray = |_| {
        let [a, b] = rims[(random.next() * rims.len() as f64) as usize];
        let at = add(a, scaled(sub(b, a), random.next()));
        let off = 10f64.powf(random.between(-10.0, -5.0));
        let (sin, cos) = random.between(0.0, TAU).sin_cos();
        let slope = [at[0] / (at[1] + source), at[2] / (at[1] + source)];
        let middle = [at[0] - slope[0] * at[1] + off * cos, at[2] - slope[1] * at[1] + off * sin];
        Ray {
            x: middle[0] as f32,
            z: middle[1] as f32,
            slope_x: slope[0] as f32,
            slope_z: slope[1] as f32,
            pose: 0,
            key: 0,
        }
    };
    (0..count).map(ray).collect()
}
