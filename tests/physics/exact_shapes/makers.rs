//! Random arrangements: solids that overlap, touch, coincide or stand in one another, around the origin.

use super::solids::{Kind, Solid, cylinder, sphere};
use super::{direction, pick};
use crate::reference::surfaces::Random;
use crate::reference::vector::scaled;
use std::f64::consts::FRAC_PI_2;

/// Objects of an arrangement at most, each of a material of its own.
pub(super) const MOST: usize = 5;

pub(super) type Maker = fn(&mut Random) -> Vec<Solid>;

/// Makers of solids of micrometres, boxes and prisms among them: shapes that those cross become meshes.
pub(super) const MIXED: [(&str, Maker); 4] =
    [("at random", mixed), ("on a grid", on_a_grid), ("nested", nested), ("stacked", stacked)];
/// Makers of exact shapes of millimetres.
pub(super) const EXACT: [(&str, Maker); 4] =
    [("at random", exact), ("bored", bored), ("grazing", grazing), ("end to end", end_to_end)];

fn mixed_kind(random: &mut Random, size: f64) -> Kind {
    let mut length = || size * random.between(0.4, 1.5);
    let (a, b, c) = (length(), length(), length());
    match pick(random, 8) {
        0 => Kind::Box([a, b, c]),
        1 => Kind::Prism { radius: 0.6 * a, half: 0.5 * b, sides: 3 + pick(random, 10) as u32 },
        2 => cylinder(0.5 * a, b),
        3 => sphere(0.5 * a),
        4 => Kind::Cone { bottom: 0.6 * a, top: 0.3 * b, half: 0.5 * c },
        5 => Kind::Ellipsoid([0.5 * a, 0.5 * b, 0.5 * c]),
        _ => Kind::Tube { outer: 0.5 * a, inner: 0.35 * a, half: 0.5 * b },
    }
}

/// Overlapping at random, up to three and more at a place.
fn overlapping(random: &mut Random, room: f64) -> Vec<Solid> {
    let one = |random: &mut Random| {
        let kind = mixed_kind(random, 8e-6);
        let place = scaled(direction(random), room * random.next());
        Solid::new(kind).turned(direction(random), random.between(0.0, 3.0)).at(place)
    };
    (0..2 + pick(random, MOST - 1)).map(|_| one(random)).collect()
}

fn mixed(random: &mut Random) -> Vec<Solid> {
    overlapping(random, 8e-6)
}

/// On a grid of 2 um: faces, edges and corners that coincide, axes in common.
fn on_a_grid(random: &mut Random) -> Vec<Solid> {
    let unit = 2e-6;
    let whole = |random: &mut Random, count: usize| unit * (1 + pick(random, count)) as f64;
    let one = |random: &mut Random| {
        let size = [0; 3].map(|_| 2.0 * whole(random, 3));
        let kind = match pick(random, 4) {
            0 | 1 => Kind::Box(size),
            2 => Kind::Prism { radius: 0.5 * size[0], half: 0.5 * size[2], sides: 6 },
            _ => cylinder(0.5 * size[0], size[2]),
        };
        let place = [0; 3].map(|_| whole(random, 4) - 3.0 * unit);
        Solid::new(kind).at(place)
    };
    (0..2 + pick(random, MOST - 1)).map(|_| one(random)).collect()
}

/// One in the other, the order of some the other way round, and one across.
fn nested(random: &mut Random) -> Vec<Solid> {
    let turn = (direction(random), random.between(0.0, 3.0));
    let mut solids: Vec<Solid> = (0..3)
        .map(|k| {
            let size = 16e-6 * 0.5_f64.powi(k);
            let kind = match pick(random, 3) {
                0 => Kind::Box([size; 3]),
                1 => cylinder(0.5 * size, size),
                _ => sphere(0.5 * size),
            };
            Solid::new(kind).turned(turn.0, turn.1)
        })
        .collect();
    if pick(random, 2) == 0 {
        solids.swap(0, 1);
    }
    if pick(random, 2) == 0 {
        solids.extend(overlapping(random, 10e-6).into_iter().take(1));
    }
    solids
}

/// Stacked face to face, of sections of their own.
fn stacked(random: &mut Random) -> Vec<Solid> {
    let mut z = -8e-6;
    (0..2 + pick(random, MOST - 1))
        .map(|_| {
            let height = 1e-6 * (2 + pick(random, 4)) as f64;
            let width = random.between(3e-6, 14e-6);
            let kind = match pick(random, 3) {
                0 => Kind::Box([width, 1.1 * width, height]),
                1 => Kind::Prism { radius: width, half: 0.5 * height, sides: 8 },
                _ => cylinder(0.5 * width, height),
            };
            z += height;
            Solid::new(kind).at([0.0, 0.0, z - 0.5 * height])
        })
        .collect()
}

fn exact_kind(random: &mut Random) -> Kind {
    let mut size = || 1e-3 * random.between(0.3, 1.2);
    let (a, b, c) = (size(), size(), size());
    match pick(random, 7) {
        0 | 1 => cylinder(a, 3.0 * b),
        2 => Kind::Cone { bottom: a, top: if b > c { 0.0 } else { 0.7 * b }, half: 1.5 * c },
        3 => sphere(a),
        4 => Kind::Ellipsoid([a, b, c]),
        _ => Kind::Tube { outer: a, inner: 0.7 * a, half: 1.5 * c },
    }
}

/// At random, up to five at a place.
fn exact(random: &mut Random) -> Vec<Solid> {
    let one = |random: &mut Random| {
        let place = scaled(direction(random), 1e-3 * random.next());
        Solid::new(exact_kind(random)).turned(direction(random), random.between(0.0, 3.0)).at(place)
    };
    (0..2 + pick(random, MOST - 1)).map(|_| one(random)).collect()
}

/// A rod with a bore that leaves it, or ends in its faces, and what fills or lines that; one across.
fn bored(random: &mut Random) -> Vec<Solid> {
    let (radius, height) = (1e-3 * random.between(0.6, 1.2), 1e-3 * random.between(1.0, 3.0));
    let bore = radius * random.between(0.3, 0.9);
    let longer = [1.0, 1.0, 1.5, 0.8][pick(random, 4)];
    let mut solids =
        vec![Solid::new(cylinder(radius, height)), Solid::new(cylinder(bore, longer * height))];
    match pick(random, 4) {
        0 => solids.push(Solid::new(cylinder(bore, height))),
        1 => solids.push(Solid::new(Kind::Tube {
            outer: bore,
            inner: 0.8 * bore,
            half: 0.5 * longer * height,
        })),
        2 => solids.push(Solid::new(sphere(bore))),
        _ => {}
    }
    if pick(random, 2) == 0 {
        let across = Solid::new(cylinder(0.3 * radius, 4.0 * radius));
        solids.push(across.turned([1.0, 0.0, 0.0], FRAC_PI_2));
    }
    solids
}

/// Bores that graze a wall from inside, and balls that touch it, by 0, 1 nm, 0.1 um or 10 um.
fn grazing(random: &mut Random) -> Vec<Solid> {
    let (radius, height) = (1e-3 * random.between(0.6, 1.2), 1e-3 * random.between(1.0, 3.0));
    let by = [0.0, 1e-9, -1e-7, 1e-7, -1e-5, 1e-5][pick(random, 6)];
    let small = radius * random.between(0.2, 0.6);
    let off = radius - small + by;
    let mut solids = vec![
        Solid::new(cylinder(radius, height)),
        Solid::new(cylinder(small, height * random.between(0.8, 1.4))).at([off, 0.0, 0.0]),
    ];
    if pick(random, 2) == 0 {
        solids.push(Solid::new(sphere(small)).at([0.0, -(radius + small + by), 0.0]));
    }
    solids
}

/// Rods end to end, with faces in one plane, and a ball across a joint.
fn end_to_end(random: &mut Random) -> Vec<Solid> {
    let mut z = -1.5e-3;
    let mut solids: Vec<Solid> = (0..2 + pick(random, 2))
        .map(|_| {
            let height = 1e-3 * random.between(0.5, 1.5);
            let radius = 1e-3 * random.between(0.4, 1.2);
            let kind = match pick(random, 3) {
                0 => Kind::Tube { outer: radius, inner: 0.6 * radius, half: 0.5 * height },
                1 => Kind::Cone { bottom: radius, top: 0.6 * radius, half: 0.5 * height },
                _ => cylinder(radius, height),
            };
            z += height;
            Solid::new(kind).at([0.0, 0.0, z - 0.5 * height])
        })
        .collect();
    if pick(random, 2) == 0 {
        let at = [0.0, 0.0, solids[0].position[2] + 0.3e-3];
        solids.push(Solid::new(sphere(0.5e-3)).at(at));
    }
    solids
}
