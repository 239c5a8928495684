//! The five scenes of the tracing benchmark, and their rays.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small counts")]

use beamlet::internals::trace::Ray;
use beamlet::scene::{Beam, Detector, MaterialSpec, Mesh, Object, Scene, Source, Transport};
use std::f64::consts::TAU;

/// Triangles of a scene by name.
pub(crate) type Soup = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Names of the scenes.
pub(crate) const NAMES: [&str; 5] =
    ["cylinder", "mesh 100k", "mesh 1M", "1,000 fibres", "10,000 fibres"];

/// The triangles of a scene.
pub(crate) fn soup(name: &str) -> Soup {
    let mut out = (Vec::new(), Vec::new());
    match name {
        "cylinder" => cylinder(&mut out, [0.0, 0.0], 4e-3, 16e-3, 126),
        "mesh 100k" => bumpy(&mut out, 158),
        "mesh 1M" => bumpy(&mut out, 500),
        "1,000 fibres" => fibres(&mut out, 1_000, 0.59e-3),
        _ => fibres(&mut out, 10_000, 1.96e-3),
    }
    out
}

/// A closed cylinder along z of 4 n - 4 triangles.
fn cylinder(out: &mut Soup, centre: [f64; 2], radius: f64, height: f64, n: u32) {
    let first = out.0.len() as u32;
    for i in 0..n {
        let angle = TAU * f64::from(i) / f64::from(n);
        let (x, y) = (centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin());
        out.0.extend([[x, y, -height / 2.0], [x, y, height / 2.0]]);
    }
    let at = |i: u32, top: u32| first + 2 * (i % n) + top;
    for i in 0..n {
        out.1.push([at(i, 0), at(i + 1, 0), at(i + 1, 1)]);
        out.1.push([at(i, 0), at(i + 1, 1), at(i, 1)]);
        if i >= 1 && i + 1 < n {
            out.1.push([at(0, 1), at(i, 1), at(i + 1, 1)]);
            out.1.push([at(0, 0), at(i + 1, 0), at(i, 0)]);
        }
    }
}

/// A bumpy sphere of 4 n (n - 1) triangles, about.
fn bumpy(out: &mut Soup, n: u32) {
    let (around, rings) = (2 * n, n);
    let point = |ring: u32, i: u32| {
        let theta = TAU / 2.0 * f64::from(ring) / f64::from(rings);
        let phi = TAU * f64::from(i) / f64::from(around);
        let r = 4e-3 * (1.0 + 0.15 * (5.0 * phi).sin() * theta.sin().powi(2) * (7.0 * theta).cos());
        [r * theta.sin() * phi.cos(), r * theta.sin() * phi.sin(), r * theta.cos()]
    };
    out.0.push(point(0, 0));
    for ring in 1..rings {
        out.0.extend((0..around).map(|i| point(ring, i)));
    }
    out.0.push(point(rings, 0));
    let at = |ring: u32, i: u32| 1 + (ring - 1) * around + i % around;
    let last = out.0.len() as u32 - 1;
    for i in 0..around {
        out.1.push([0, at(1, i), at(1, i + 1)]);
        out.1.push([last, at(rings - 1, i + 1), at(rings - 1, i)]);
        for ring in 1..rings - 1 {
            out.1.push([at(ring, i), at(ring + 1, i), at(ring + 1, i + 1)]);
            out.1.push([at(ring, i), at(ring + 1, i + 1), at(ring, i + 1)]);
        }
    }
}

/// Parallel fibres of 5 um along z (64 triangles each) in a square of this side.
fn fibres(out: &mut Soup, count: u32, side: f64) {
    let columns = f64::from(count).sqrt().ceil();
    let pitch = side / columns;
    for i in 0..count {
        let (cx, cy) = (f64::from(i) % columns, (f64::from(i) / columns).floor());
        // Golden-ratio jitter: no rows to look along.
        let jitter = |k: f64| ((f64::from(i) * k).fract() - 0.5) * (pitch - 6e-6);
        let at = |c: f64| (c + 0.5) * pitch - side / 2.0;
        cylinder(
            out,
            [at(cx) + jitter(0.618_033_988_749), at(cy) + jitter(0.754_877_666_246)],
            2.5e-6,
            4e-3,
            17,
        );
    }
}

/// Side of the square in the plane of the rotation centre that the rays of a scene cross, m.
fn side(name: &str) -> f64 {
    match name {
        "1,000 fibres" => 0.55e-3,
        "10,000 fibres" => 1.8e-3,
        _ => 9e-3,
    }
}

/// `n` x `n` rays from a source at 1.21 m over the square of a scene, in tiles of 4 x 4.
pub(crate) fn rays(name: &str, n: u32) -> Vec<Ray> {
    let step = side(name) / f64::from(n);
    let at = |i: u32| (f64::from(i) + 0.5) * step - side(name) / 2.0;
    (0..n * n)
        .map(|i| {
            let (tile, within) = (i / 16, i % 16);
            let (column, row) = (tile % (n / 4) * 4 + within % 4, tile / (n / 4) * 4 + within / 4);
            let (x, z) = (at(column) as f32, -at(row) as f32);
            Ray { x, z, slope_x: x / 1.21, slope_z: z / 1.21, pose: 0, key: 0 }
        })
        .collect()
}

/// The scene around the triangles.
pub(crate) fn scene((vertices, triangles): Soup) -> Scene {
    let source = Source::new(1.21, [0.0, 0.0], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(1.8, [64, 64], [150e-6, 150e-6]));
    scene.sampling.transport = Transport::FirstOrder;
    let matter = MaterialSpec::Constants { mu: 50.0, delta: 4.6e-7 };
    scene.materials.insert("matter".into(), matter);
    scene.objects.push(Object::new("sample", Mesh::Arrays { vertices, triangles }, "matter"));
    scene
}
