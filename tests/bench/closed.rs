//! Ten kinds of closed meshes that tracers stumble over, of moderate sizes: what matters is how
//! many rays run along how many of their edges.

use crate::reference::surfaces::{Body, Mesh, Random, body, cuboid, cylinder, prism, star};
use std::collections::HashMap;

/// Makes the bodies of a kind.
type Make = fn() -> Vec<Body>;

/// Names of the kinds and how they are made; coordinates are f32 already.
pub(crate) const KINDS: [(&str, Make); 10] = [
    ("long-thin-triangles", || one(cylinder(4e-3, 16e-3, 300, 0.0))),
    ("vertex-fans", || one(fans(200))),
    ("grid-in-the-beam", || one(grid_cube(16, |i| f64::from(i) * 2.0_f64.powi(-13)))),
    ("shells-1-um-apart", nested),
    ("fibres", || one(fibres(100))),
    ("bumpy-sphere", || one(star(0.8e-3, 1.5e-3, 3, 4))),
    ("faces-along-the-beam", octagons),
    ("needles", || one(needles(250))),
    ("huge-and-tiny-triangles", || one(grid_cube(16, graded))),
    ("wall-of-1-um", || one(hollow())),
];

const MATTER: [f64; 2] = [51.235, 4.6092e-7];

fn one(mesh: Mesh) -> Vec<Body> {
    vec![body(mesh.rounded(), MATTER[0], MATTER[1])]
}

/// Many meshes as one.
fn joined(meshes: impl IntoIterator<Item = Mesh>) -> Mesh {
    let mut all = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for mesh in meshes {
        let first = all.vertices.len() as u32;
        all.vertices.extend(mesh.vertices);
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

/// Two tips on the axis of the beam, joined by the triangles of two fans of `n`.
fn fans(n: u32) -> Mesh {
    let rim = (0..n).map(|i| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(n)).sin_cos();
        [1e-3 * cos, 0.0, 1e-3 * sin]
    });
    let vertices = [[0.0, -0.3e-3, 0.0], [0.0, 0.3e-3, 0.0]].into_iter().chain(rim).collect();
    let sides = |i: u32| {
        let (a, b) = (2 + i, 2 + (i + 1) % n);
        [[0, a, b], [1, b, a]]
    };
    Mesh { vertices, triangles: (0..n).flat_map(sides).collect() }
}

/// A cube whose faces are grids of `2 half` squares a side at the coordinates `place`, each
/// square cut in two.
fn grid_cube(half: i32, place: fn(i32) -> f64) -> Mesh {
    let mut numbers: HashMap<[i32; 3], u32> = HashMap::new();
    let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for axis in 0..3 {
        for side in [-half, half] {
            for i in -half..half {
                for j in -half..half {
                    let mut at = |i: i32, j: i32| {
                        let mut key = [0; 3];
                        (key[axis], key[(axis + 1) % 3], key[(axis + 2) % 3]) = (side, i, j);
                        *numbers.entry(key).or_insert_with(|| {
                            mesh.vertices.push(key.map(place));
                            mesh.vertices.len() as u32 - 1
                        })
                    };
                    let (a, b) = (at(i, j), at(i + 1, j));
                    let (c, d) = (at(i + 1, j + 1), at(i, j + 1));
                    let turn = |t: [u32; 3]| if side > 0 { t } else { [t[0], t[2], t[1]] };
                    mesh.triangles.extend([[a, b, c], [a, c, d]].map(turn));
                }
            }
        }
    }
    mesh
}

/// From 4 mm at the rim down to 0.1 um at the middle, halved (about) from line to line.
fn graded(i: i32) -> f64 {
    f64::from(i.signum()) * if i == 0 { 0.0 } else { 4e-3 * 2.0_f64.powi(i.abs() - 16) }
}

/// Balls in one another, an object each, 1 um apart.
fn nested() -> Vec<Body> {
    (0..4)
        .map(|i| {
            let radius = 1e-3 - 1e-6 * f64::from(i);
            let mu = if i % 2 == 0 { 51.235 } else { 37.559 };
            body(star(radius, radius, 4, 0).rounded(), mu, mu * 1e-8)
        })
        .collect()
}

/// A ball with a void that leaves a wall of 1 um.
fn hollow() -> Mesh {
    let mut void = star(0.999e-3, 0.999e-3, 4, 0);
    void.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    joined([star(1e-3, 1e-3, 4, 0), void])
}

/// Fibres of 5 um along z, 17 sides each, side by side on a jittered grid.
fn fibres(count: u32) -> Mesh {
    let mut random = Random::new(3);
    joined((0..count).map(|i| {
        let mut at = |k: u32| 20e-6 * (f64::from(k) - 9.5) + random.between(-6e-6, 6e-6);
        let place = [at(i % 20), at(i / 20), 0.0];
        cylinder(2.5e-6, 4e-3, 17, 0.1 * f64::from(i)).moved(place)
    }))
}

/// Octagons drawn along z, each with two faces that beams of the first view run within, and
/// a box that they run within four faces of.
fn octagons() -> Vec<Body> {
    let prisms = (0..5).map(|i| {
        // A corner half a facet off the axis puts two faces along y.
        prism(0.5e-3, 1e-3, 8, 0.5).moved([1.5e-3 * f64::from(i) - 3e-3, 0.0, 0.0])
    });
    one(joined(prisms.chain([cuboid([1e-3, 1e-3, 0.5e-3]).moved([0.0, 0.0, 2e-3])])))
}

/// Spikes 8 mm long and 4 um thick, along the beam and aslant, side by side in layers.
fn needles(count: u32) -> Mesh {
    joined((0..count).map(|i| {
        let tip = |y: f64| [0.0, y, 0.0];
        let waist = [[2e-6, 0.0, -1e-6], [-2e-6, 0.0, -1e-6], [0.0, 0.0, 2e-6]];
        let vertices = [tip(-4e-3), tip(4e-3)].into_iter().chain(waist).collect();
        let triangles = vec![[0, 2, 4], [0, 4, 3], [0, 3, 2], [1, 4, 2], [1, 3, 4], [1, 2, 3]];
        let (layer, place) = (i / 25, 20e-6 * (f64::from(i % 25) - 12.0));
        Mesh { vertices, triangles }
            .moved([place, 0.0, 20e-6 * (f64::from(layer) - 9.5)])
            .turned([0.0, 0.0, 1.0], 0.1 * f64::from(layer % 3))
    }))
}
