//! Shapes without facets: crossings, first order, exact transport, nesting and whole runs against
//! f64, on both backends.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::print_stdout,
    reason = "counts are small; rays are rounded to f32 as the engine takes them; figures are printed"
)]

mod arrangements;
mod balance;
mod crossing_balance;
mod crossing_faces;
mod crossing_parts;
mod crossing_runs;
mod gaps;
mod makers;
mod rays;
mod refracted;
mod runs;
mod single;
mod solids;
mod torus;

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::Random;
use crate::reference::vector::{Vector, add, scaled, turned, unit};
use crate::support::CARBON;
use beamlet::internals::trace::Ray;
use beamlet::scene::{MaterialSpec, Object, Scene, Transport};
use solids::{Kind, Solid, cylinder, sphere};

/// A scene without masks, every object of a material of its own, with mu and delta.
fn scene(objects: Vec<Object>, constants: &[[f64; 2]], transport: Transport) -> Scene {
    let mut setup = Setup::paper([16, 16]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    let mut scene = scenes::scene(&setup, &[], &[0.0]);
    scene.sampling.transport = transport;
    for (number, (mut object, [mu, delta])) in objects.into_iter().zip(constants).enumerate() {
        object.material = format!("material {number}");
        let (mu, delta) = (*mu, *delta);
        scene.materials.insert(object.material.clone(), MaterialSpec::Constants { mu, delta });
        scene.objects.push(object);
    }
    scene
}

fn carbon(solid: &Solid, transport: Transport) -> Scene {
    scene(vec![solid.object("solid", "")], &[CARBON], transport)
}

/// Ten times carbon's at 30 keV: rays under 3 mrad are totally reflected.
const STRONG: [f64; 2] = [50.0, 4.6e-6];

/// Shapes of millimetres, the fibre of 2.5 um, and those of 10 mm.
const KINDS: [(&str, Kind); 12] = [
    ("cylinder", cylinder(2e-3, 6e-3)),
    ("flat cylinder", cylinder(3e-3, 0.2e-3)),
    ("cone", Kind::Cone { bottom: 2e-3, top: 0.0, half: 1.5e-3 }),
    ("truncated cone", Kind::Cone { bottom: 1e-3, top: 2.5e-3, half: 4e-3 }),
    ("sphere", sphere(1.3e-3)),
    ("ellipsoid", Kind::Ellipsoid([1e-3, 3e-3, 2e-3])),
    ("fibre", cylinder(2.5e-6, 1e-3)),
    ("bead", sphere(2.5e-6)),
    ("large cylinder", cylinder(10e-3, 20e-3)),
    ("large sphere", sphere(10e-3)),
    ("tube", Kind::Tube { outer: 2e-3, inner: 1.5e-3, half: 4e-3 }),
    ("hollow fibre", Kind::Tube { outer: 4e-6, inner: 2.5e-6, half: 1e-3 }),
];

/// A shape where it is, tilted about z, x and y, scaled, and away from the axis by up to 20 mm.
fn places(kind: Kind) -> Vec<(&'static str, Solid)> {
    let tilted = |solid: Solid| {
        let solid = solid.turned([0.0, 0.0, 1.0], 0.7).turned([1.0, 0.0, 0.0], 0.4);
        solid.turned([0.3, 1.0, -0.2], 0.9)
    };
    vec![
        ("untilted", Solid::new(kind)),
        ("tilted", tilted(Solid::new(kind))),
        ("scaled", tilted(Solid::new(kind)).scaled(0.37)),
        ("off-centre", tilted(Solid::new(kind)).at([3.1e-3, -4.7e-3, 2.3e-3])),
        ("far", tilted(Solid::new(kind)).at([17e-3, 6e-3, -9e-3])),
    ]
}

/// Scenes of a test of random arrangements.
fn scenes() -> usize {
    std::env::var("BEAMLET_SCENES").map_or(1, |it| it.parse().expect("a number of scenes"))
}

/// A number below `count`.
fn pick(random: &mut Random, count: usize) -> usize {
    (random.next() * count as f64) as usize
}

/// A direction, uniform over all.
fn direction(random: &mut Random) -> Vector {
    loop {
        let v = [0; 3].map(|_| random.between(-1.0, 1.0));
        let square: f64 = v.iter().map(|it| it * it).sum();
        if square < 1.0 && square > 1e-4 {
            return unit(v);
        }
    }
}

/// A ray of a view through a point of the world, with slopes of up to 0.05.
fn ray_through(point: Vector, view: u32, angle: f64, random: &mut Random) -> Ray {
    let [x, y, z] = turned(point, [0.0, 0.0, 1.0], -angle);
    let slope = [0; 2].map(|_| random.between(-0.05, 0.05) as f32);
    let [x, z] = [x - f64::from(slope[0]) * y, z - f64::from(slope[1]) * y];
    Ray { x: x as f32, z: z as f32, slope_x: slope[0], slope_z: slope[1], pose: view, key: 0 }
}

/// Rays through the ball around a solid.
fn rays_around(solid: &Solid, count: usize, angle: f64, random: &mut Random) -> Vec<Ray> {
    let one = |_| {
        let off = scaled(direction(random), solid.reach() * random.next().sqrt());
        ray_through(add(solid.position, off), 0, angle, random)
    };
    (0..count).map(one).collect()
}
