//! Fibres of random direction: cylinders, each at the first random place wholly inside the region without
//! overlap.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::InstanceTransform;
use super::packing::{Prototype, Target};
use super::region::Region;
use super::sorted::PURPOSE;
use beamlet_core::random::Draws;
use beamlet_core::watch::{LoadStep, Task};
use beamlet_core::{Result, numbers, reserve};
use beamlet_model::scene::Packing;

/// Places that a fibre tries with its direction.
const PLACES: u32 = 500;
/// Directions without a place until the packing has jammed: in succession, and of all.
const FAILED: u32 = 30;
const FAILED_OF_ALL: f64 = 0.25;
/// Most cells: 64 MiB.
const MOST_CELLS: f64 = 16_777_216.0;

/// No entry.
const NONE: u32 = u32::MAX;

const FIBRE: u8 = 4;

/// A fibre: all points within a radius of the segment from `centre` - `arm` to `centre` + `arm`.
#[derive(Debug, Clone, Copy)]
struct Fibre {
    centre: DVec3,
    arm: DVec3,
    /// Radius with half the gap, m.
    radius: f64,
    size: f64,
}

/// Packs fibres of the body's length into a region.
///
/// # Errors
/// [`beamlet_core::Error::Scene`] where they do not fit; [`beamlet_core::Error::Interrupted`].
pub(super) fn pack(
    key: &str,
    region: &Region,
    body: &Prototype,
    spec: &Packing,
    task: Task<'_>,
) -> Result<Vec<InstanceTransform>> {
    let volume = |size: f64| TAU / 2.0 * (body.radius * size).powi(2) * body.height;
    let space = region.volume(0.0);
    let mean = volume(1.0) * body.mean_power(2.0);
    let target = Target::new(key, spec.amount, space, mean)?;
    let mut packed = Fibres::new(body, target.count, region)?;
    task.begin(LoadStep::Packing, numbers::whole(target.count))?;
    let (mut sum, mut direction, mut failed) = (0.0, 0, 0);
    let mut failed_of_all = 0;
    loop {
        let count = packed.fibres.len();
        task.check()?;
        task.reach(count as u64);
        if count as f64 >= target.count && target.volume.is_infinite() || sum >= target.volume {
            break;
        }
        let mut draws = Draws::new(spec.seed, [direction, 0, 0], FIBRE);
        direction += 1;
        let size = body.size(&mut draws);
        // The last one may be left out where that is nearer to the fill.
        if sum + volume(size) - target.volume > target.volume - sum {
            break;
        }
        match packed.place(region, body, size, &mut draws) {
            Some(fibre) => {
                packed.put(fibre);
                sum += volume(size);
                failed = 0;
            }
            None => {
                failed += 1;
                failed_of_all += 1;
            }
        }
        let most = f64::from(10 * FAILED) + FAILED_OF_ALL * count as f64;
        if failed == FAILED || f64::from(failed_of_all) > most {
            return Err(target.unreached(key, spec, target.share(packed.fibres.len(), sum)));
        }
    }
    target.check(key, packed.fibres.len(), sum, space)?;
    Ok(packed.fibres.iter().map(instance).collect())
}

fn instance(fibre: &Fibre) -> InstanceTransform {
    // The shortest rotation from z to the axis, which points up: half the angle is below 45 degrees.
    let axis = fibre.arm.normalize();
    let rotation = DQuat::from_xyzw(-axis.y, axis.x, 0.0, 1.0 + axis.z).normalize();
    InstanceTransform { scale: fibre.size, scale_z: 1.0, rotation, position: fibre.centre }
}

/// Fibres, and which pass which cell of a box around the region.
struct Fibres {
    fibres: Vec<Fibre>,
    half_sides: DVec3,
    counts: [usize; 3],
    /// First entry of each cell.
    first: Vec<u32>,
    /// A fibre with a sample of its axis in a cell, and the next entry of that cell.
    entries: Vec<[u32; 2]>,
    /// Side of a cell: at least the distance of samples and the largest distance of two fibres in
    /// contact together.
    side: f64,
    /// Intervals between the samples of an axis.
    samples: u32,
}

impl Fibres {
    fn new(body: &Prototype, count: f64, region: &Region) -> Result<Self> {
        let half_sides = DVec3::from_array(region.half_sides());
        let contact = 2.0 * body.outer_radius(body.largest()) + body.gap;
        // A cell of this side is passed by about one fibre.
        let free = (region.volume(0.0) / (count.max(1.0) * body.height)).sqrt();
        let samples = (body.height / free.max(contact)).ceil().clamp(1.0, 1e4);
        let mut side = body.height / samples + contact;
        let cells = |side: f64| (2.0 * half_sides / side).floor() + 1.0;
        while cells(side).element_product() > MOST_CELLS {
            side *= 1.25;
        }
        let counts = cells(side).to_array().map(numbers::whole::<usize>);
        Ok(Self {
            fibres: Vec::new(),
            half_sides,
            counts,
            first: reserve::filled(NONE, counts.iter().product(), PURPOSE)?,
            entries: Vec::new(),
            side,
            samples: numbers::whole(samples),
        })
    }

    /// A place for a fibre of a random direction, which it keeps.
    fn place(
        &self,
        region: &Region,
        body: &Prototype,
        size: f64,
        draws: &mut Draws,
    ) -> Option<Fibre> {
        // The ends are alike: half the directions are all.
        let [z, turn] = draws.pair();
        let (sine, cosine) = libm::sincos(TAU * turn);
        let across = (1.0 - z * z).sqrt();
        let arm = DVec3::new(across * cosine, across * sine, z) * (body.height / 2.0);
        let room = self.half_sides - arm.abs();
        if room.min_element() < 0.0 {
            return None;
        }
        let outer = body.outer_radius(size);
        let radius = outer + body.gap / 2.0;
        (0..PLACES).find_map(|_| {
            let at = [(); 3].map(|()| 2.0 * draws.uniform() - 1.0);
            let fibre = Fibre { centre: DVec3::from_array(at) * room, arm, radius, size };
            let (centre, arm) = (fibre.centre.to_array(), arm.to_array());
            let is_inside = region.contains_cylinder(centre, arm, outer, body.gap);
            (is_inside && self.is_free(&fibre)).then_some(fibre)
        })
    }

    /// Cells of the samples of an axis.
    fn cells_of(&self, fibre: &Fibre) -> impl Iterator<Item = [usize; 3]> {
        let count = f64::from(self.samples);
        let (centre, arm) = (fibre.centre, fibre.arm);
        let mut before = None;
        (0..=self.samples).filter_map(move |index| {
            let along = 2.0 * f64::from(index) / count - 1.0;
            let point = (centre + arm * along + self.half_sides) / self.side;
            let cell = point.to_array().map(numbers::whole::<usize>);
            let cell = std::array::from_fn(|k| cell[k].min(self.counts[k] - 1));
            (before.replace(cell) != Some(cell)).then_some(cell)
        })
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.counts[1] + y) * self.counts[2] + z
    }

    /// Two axes that are nearer than contact have samples within a side of a cell.
    fn is_free(&self, fibre: &Fibre) -> bool {
        self.cells_of(fibre).all(|cell| {
            let around =
                |k: usize| cell[k].saturating_sub(1)..=(cell[k] + 1).min(self.counts[k] - 1);
            around(0)
                .all(|x| around(1).all(|y| around(2).all(|z| self.is_free_in([x, y, z], fibre))))
        })
    }

    fn is_free_in(&self, cell: [usize; 3], fibre: &Fibre) -> bool {
        let mut entry = self.first[self.index(cell)];
        while entry != NONE {
            let [other, next] = self.entries[entry as usize];
            let other = &self.fibres[other as usize];
            let apart = fibre.radius + other.radius;
            if square_distance(fibre, other) < apart * apart {
                return false;
            }
            entry = next;
        }
        true
    }

    fn put(&mut self, fibre: Fibre) {
        let number = numbers::count(self.fibres.len());
        let cells: Vec<[usize; 3]> = self.cells_of(&fibre).collect();
        for cell in cells {
            let index = self.index(cell);
            let entry = numbers::count(self.entries.len());
            let next = std::mem::replace(&mut self.first[index], entry);
            self.entries.push([number, next]);
        }
        self.fibres.push(fibre);
    }
}

/// Square of the distance of two axes, m2 (Lumelsky 1985).
fn square_distance(a: &Fibre, b: &Fibre) -> f64 {
    let between = b.centre - a.centre;
    let (aa, bb, ab) = (a.arm.length_squared(), b.arm.length_squared(), a.arm.dot(b.arm));
    let (along_a, along_b) = (a.arm.dot(between), b.arm.dot(between));
    let determinant = aa * bb - ab * ab;
    // Nearest points of the lines, moved onto the segments one after the other.
    let s = match determinant > 1e-12 * aa * bb {
        true => ((along_a * bb - along_b * ab) / determinant).clamp(-1.0, 1.0),
        false => 0.0,
    };
    let t = ((ab * s - along_b) / bb).clamp(-1.0, 1.0);
    let s = ((ab * t + along_a) / aa).clamp(-1.0, 1.0);
    (between + b.arm * t - a.arm * s).length_squared()
}
