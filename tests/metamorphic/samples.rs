//! Samples drawn from a seed: one to three objects of every shape, tilted, nested, in many places.

use super::case::{Case, Place};
use super::draws::Draws;
use super::set_ups::{Room, set_up};
use beamlet::scene::{MaterialSpec, Normals, Object, Scene, Shape};
use std::f64::consts::{PI, TAU};

/// Materials under a spectrum.
const MATERIALS: [&str; 6] = ["PMMA", "aluminium", "silica", "titanium", "copper", "tin"];

/// Materials of which a small body is opaque.
const HEAVY: [&str; 3] = ["iron", "gold", "tungsten"];

/// Ball about a solid, m.
#[derive(Debug, Clone, Copy)]
struct Ball {
    centre: [f64; 3],
    radius: f64,
}

impl Ball {
    fn is_apart(&self, other: &Self) -> bool {
        let square: f64 = (0..3).map(|it| (self.centre[it] - other.centre[it]).powi(2)).sum();
        square.sqrt() > 1.02 * (self.radius + other.radius)
    }
}

/// The case of a seed.
pub(crate) fn case(seed: u64) -> Case {
    let mut draws = Draws::new(seed);
    let (scene, room) = set_up(&mut draws);
    let mut case = Case { scene, places: Vec::new(), roughness: Vec::new() };
    let mut taken: Vec<Ball> = Vec::new();
    let wanted = 1 + draws.below(3);
    while case.scene.objects.len() < wanted {
        if !taken.is_empty() && draws.chance(0.35) {
            let around = taken[taken.len() - 1];
            nested(&mut draws, &mut case, around);
        } else if draws.chance(0.15) {
            many(&mut draws, &mut case, room, &mut taken);
        } else {
            alone(&mut draws, &mut case, room, &mut taken);
        }
    }
    let mut aside = draws.aside();
    let roughness = |_| if aside.chance(0.5) { aside.log_between(1e-4, 2e-2) } else { 0.0 };
    case.roughness = (0..case.scene.objects.len()).map(roughness).collect();
    case
}

/// Places an object where it meets no other.
fn alone(draws: &mut Draws, case: &mut Case, room: Room, taken: &mut Vec<Ball>) {
    let mut largest = (0.7 * room.view[0]).min(0.9 * room.depth);
    loop {
        let radius = largest * draws.log_between(0.2, 1.0);
        largest *= 0.9;
        let ball = Ball { centre: place(draws, room, radius), radius };
        if taken.iter().all(|it| it.is_apart(&ball)) {
            let placed = object(draws, case, radius);
            put(case, placed, ball);
            taken.push(ball);
            return;
        }
    }
}

/// Where the ball of this radius stands: in view, and between the masks at any angle.
fn place(draws: &mut Draws, room: Room, radius: f64) -> [f64; 3] {
    let far = (0.95 * room.depth - radius).max(0.0);
    let across = (0.5 * room.view[0]).min(0.7 * far);
    let upright = 0.4 * room.view[1];
    [
        draws.between(-across, across),
        draws.between(-0.7, 0.7) * far.min(room.view[0]),
        draws.between(-upright, upright),
    ]
}

fn put(case: &mut Case, mut object: Object, ball: Ball) {
    object.placement.position = ball.centre;
    case.add(object, Vec::new());
}

/// Places an object in the last one, about the same centre, where that surely holds a ball.
fn nested(draws: &mut Draws, case: &mut Case, around: Ball) {
    let outer = case.scene.objects.last().filter(|it| it.instances.is_none());
    if let Some(inner) = outer.and_then(inscribed) {
        let radius = inner * draws.between(0.2, 0.9);
        let placed = object(draws, case, radius);
        put(case, placed, around);
    }
}

/// Radius of a ball about the centre of an object that lies in it, where there is one.
fn inscribed(object: &Object) -> Option<f64> {
    use beamlet::scene::ShapeOrMesh::Shape as Of;
    Some(match &object.geometry {
        Of(Shape::Box { size }) => 0.5 * size.iter().copied().fold(f64::INFINITY, f64::min),
        Of(Shape::Cylinder { radius, height, .. }) => 0.9 * radius.min(0.5 * height),
        Of(Shape::Prism { radius, height, .. }) => 0.45 * radius.min(*height),
        Of(Shape::Sphere { radius, .. }) => 0.9 * radius,
        Of(Shape::Ellipsoid { semi_axes, .. }) => {
            0.8 * semi_axes.iter().copied().fold(f64::INFINITY, f64::min)
        }
        Of(Shape::Cone { radius, top_radius, height, .. }) => {
            0.4 * (0.5 * (radius + top_radius)).min(0.5 * height)
        }
        _ => return None,
    })
}

/// An object of few places, each of which meets no other.
fn many(draws: &mut Draws, case: &mut Case, room: Room, taken: &mut Vec<Ball>) {
    let largest = (0.15 * room.view[0]).min(0.3 * room.depth);
    let radius = largest * draws.between(0.3, 1.0);
    let mut object = object(draws, case, radius);
    let mut places = Vec::new();
    for _ in 0..2 + draws.below(10) {
        let scale = draws.between(0.5, 1.0);
        let ball = Ball { centre: place(draws, room, radius), radius: radius * scale };
        if taken.iter().all(|it| it.is_apart(&ball)) {
            let [x, y, z] = draws.direction();
            let (sin, cos) = draws.between(0.0, PI).sin_cos();
            let rotation = [cos, sin * x, sin * y, sin * z];
            places.push(Place { rotation, position: ball.centre, scale });
            taken.push(ball);
        }
    }
    if !places.is_empty() {
        object.placement.rotate.clear();
        case.add(object, places);
    }
}

/// An object of any shape and material in a ball of this radius about its origin.
fn object(draws: &mut Draws, case: &mut Case, radius: f64) -> Object {
    let shape = shape(draws, radius);
    let holds_normals = has_sides(&shape);
    let name = format!("object {}", case.scene.objects.len());
    let mut object = Object::new(name, shape, material(draws, &mut case.scene, radius));
    if holds_normals && draws.chance(0.3) {
        object.normals = Normals::Smooth;
    }
    object.placement.rotate = tilt(draws);
    let mut aside = draws.aside();
    if aside.chance(0.12) {
        object.material = aside.pick(HEAVY).into();
    }
    if aside.chance(0.12) {
        // Within a degree of the beam.
        object.placement.rotate = vec![([1.0, 0.0, 0.0], aside.between(-PI, PI) / 180.0)];
    }
    object
}

/// A material of which a body of this radius is to be seen, with the decrement of light to heavy
/// matter; under a spectrum a built-in one.
fn material(draws: &mut Draws, scene: &mut Scene, radius: f64) -> String {
    if scene.source.beam.single_energy().is_none() {
        return draws.pick(MATERIALS).into();
    }
    let mu = (draws.log_between(0.01, 2.0) / radius).min(2e5);
    let delta = draws.log_between(1e-7, 6e-6);
    let name = format!("material {}", scene.materials.len());
    scene.materials.insert(name.clone(), MaterialSpec::Constants { mu, delta });
    name
}

/// Any direction, upright, or nearly so: faces along the beam are grazed.
fn tilt(draws: &mut Draws) -> Vec<([f64; 3], f64)> {
    match draws.below(5) {
        0 => Vec::new(),
        1 => vec![(draws.pick([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), PI / 2.0)],
        2 => vec![(draws.direction(), draws.log_between(1e-4, 3e-2))],
        3 => vec![([0.0, 0.0, 1.0], draws.between(-PI, PI))],
        _ => vec![
            (draws.direction(), draws.between(0.0, PI)),
            (draws.direction(), draws.between(0.0, PI)),
        ],
    }
}

fn has_sides(shape: &Shape) -> bool {
    match shape {
        Shape::Cylinder { sides, .. }
        | Shape::Cone { sides, .. }
        | Shape::Sphere { sides, .. }
        | Shape::Ellipsoid { sides, .. }
        | Shape::Torus { sides, .. }
        | Shape::Tube { sides, .. } => sides.is_some(),
        _ => false,
    }
}

/// A shape in a ball of this radius about its origin.
fn shape(draws: &mut Draws, radius: f64) -> Shape {
    // Facets that keep the volume stand out of the surface.
    let sides = if draws.chance(0.35) { Some(draws.whole(24..124)) } else { None };
    let radius = 0.95 * radius;
    let lean = draws.between(0.15, PI / 2.0 - 0.15);
    let (flat, half) = (radius * lean.cos(), radius * lean.sin());
    let height = 2.0 * half;
    match draws.below(8) {
        0 => {
            let turn = draws.between(0.2, PI / 2.0 - 0.2);
            Shape::Box { size: [2.0 * flat * turn.cos(), 2.0 * flat * turn.sin(), height] }
        }
        1 => Shape::Cylinder { radius: flat, height, sides },
        2 => {
            let top_radius = if draws.chance(0.4) { 0.0 } else { flat * draws.between(0.1, 1.0) };
            Shape::Cone { radius: flat, top_radius, height, sides }
        }
        3 => Shape::Prism { radius: flat, height, sides: draws.whole(3..9) },
        4 => Shape::Sphere { radius, sides },
        5 => {
            let semi_axes = [0; 3].map(|_| radius * draws.between(0.2, 1.0));
            Shape::Ellipsoid { semi_axes, sides }
        }
        6 => {
            let tube_radius = radius * draws.between(0.1, 0.4);
            Shape::Torus { radius: radius - tube_radius, tube_radius, sides }
        }
        _ => Shape::Extrusion { points: star(draws, flat), height },
    }
}

/// A polygon about the origin that is not convex.
fn star(draws: &mut Draws, radius: f64) -> Vec<[f64; 2]> {
    let corners = 3 + draws.below(6);
    let step = TAU / corners as f64;
    let corner = |it: usize| {
        let (sin, cos) = ((it as f64 + draws.between(-0.3, 0.3)) * step).sin_cos();
        let far = radius * draws.between(0.35, 1.0);
        [far * cos, far * sin]
    };
    (0..corners).map(corner).collect()
}
