//! From bodies that were packed smaller to bodies of full size: those that overlap push each other
//! apart, then Monte Carlo moves stir them all.

use std::ops::Range;

use rayon::prelude::*;

use super::periodic::Packed;
use super::share::Share;
use super::sorted::{Body, Cells, PURPOSE, Sorted};
use beamlet_core::random::Draws;
use beamlet_core::{Result, reserve};

/// Passes in which bodies push each other apart, at most.
const PASSES: u32 = 400;
/// Factor on each push, as of overrelaxation: it takes half the passes that 1 takes.
const OVERSHOOT: f64 = 1.6;
/// Bodies are pushed to this much more than contact, so that rounding leaves no overlap and the next
/// neighbour does not push back; less where the box is full.
const MARGIN: f64 = 0.04;
const LEAST_MARGIN: f64 = 1e-3;
/// Fill at which random arrangements jam, roughly: 0.84 and 0.64, less some room to move.
const JAMMED: [f64; 2] = [0.80, 0.60];
/// Sweeps of Monte Carlo moves.
const SWEEPS: u32 = 10;
/// First length of moves along each axis, in radii, and its bounds.
const STEP: f64 = 0.3;
const STEPS: [f64; 2] = [1e-3, 1.0];
/// Share of moves that should succeed.
const ACCEPTED: f64 = 0.4;

/// Share of the work that pushing is, beside sweeps: measured with a million spheres.
const PUSHED_SHARE: f64 = 0.44;

const SHIFT: u8 = 2;
const MOVE: u8 = 3;

/// Bodies of full size in a periodic box.
pub(super) struct Relaxation<'a, const D: usize> {
    pub(crate) cells: Cells<D>,
    pub(crate) radii: &'a [f64],
    /// Share of the box that they take.
    pub(crate) fill: f64,
    pub(crate) seed: u64,
    pub(super) attempt: u32,
    pub(crate) share: Share<'a>,
}

/// Result of a pass.
struct Pushed<const D: usize> {
    bodies: Vec<Body<D>>,
    /// The least distance of two before it, as a share of contact.
    nearest: f64,
    /// Bodies that overlapped another before it.
    overlapping: usize,
}

/// How far bodies are pushed apart, from 0 to 1: each pass leaves a smaller part of the overlaps than
/// the one before.
fn pushed_apart(overlapping: usize, all: usize) -> f64 {
    let logarithm = |count: usize| libm::log1p(count as f64);
    (1.0 - logarithm(overlapping) / logarithm(all.max(1))).max(0.0).sqrt()
}

impl<const D: usize> Relaxation<'_, D> {
    /// Removes the overlap of bodies at these centres.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`]; [`beamlet_core::Error::Interrupted`].
    pub(super) fn pack(&self, centres: &[[f64; D]]) -> Result<Packed<D>> {
        let body = |(number, at): (u32, &[f64; D])| Body {
            at: *at,
            radius: self.radii[number as usize],
            number,
        };
        let mut bodies: Vec<Body<D>> = (0..).zip(centres).map(body).collect();
        let room = libm::pow(JAMMED[D - 2] / self.fill, 1.0 / D as f64) - 1.0;
        let margin = 1.0 + (room / 2.0).clamp(LEAST_MARGIN, MARGIN);
        let mut best = 0.0_f64;
        let share = self.share.part([0.0, PUSHED_SHARE]);
        for _ in 0..PASSES {
            share.reach(0.0)?;
            let sorted = Sorted::new(&bodies, &self.cells)?;
            let Pushed { bodies: pushed, nearest, overlapping } = self.push(&sorted, margin);
            share.reach(pushed_apart(overlapping, pushed.len()))?;
            if nearest >= 1.0 {
                return Ok(Packed::Whole(self.stir(sorted.bodies)?));
            }
            best = best.max(nearest);
            bodies = pushed;
        }
        Ok(Packed::Jammed { share: (0..D).fold(1.0, |share, _| share * best) })
    }

    /// The bodies after one pass.
    fn push(&self, sorted: &Sorted<D>, margin: f64) -> Pushed<D> {
        let push = |body: &Body<D>| {
            let (mut by, mut nearest) = ([0.0; D], f64::INFINITY);
            for run in sorted.near(&self.cells, self.cells.coordinates(&body.at)) {
                for other in &sorted.bodies[run] {
                    let contact = body.radius + other.radius;
                    let wanted = contact * margin;
                    let square = self.cells.square_distance(&body.at, &other.at);
                    if square >= wanted * wanted || other.number == body.number {
                        continue;
                    }
                    let distance = square.sqrt();
                    // Exactly, as in the check for overlaps.
                    let share = if square >= contact * contact { 1.0 } else { distance / contact };
                    nearest = nearest.min(share);
                    // The lighter one gives way.
                    let mass = |radius: f64| (0..D).fold(1.0, |mass, _| mass * radius);
                    let (own, there) = (mass(body.radius), mass(other.radius));
                    let part = OVERSHOOT * (wanted - distance) * there
                        / (own + there)
                        / distance.max(1e-300);
                    let away = self.cells.between(&body.at, &other.at);
                    (0..D).for_each(|k| by[k] += part * away[k]);
                }
            }
            // Many at once may push far.
            let most = body.radius;
            let length = by.iter().map(|x| x * x).sum::<f64>().sqrt();
            let by = if length > most { by.map(|x| x / length * most) } else { by };
            (Body { at: self.cells.moved(&body.at, &by), ..*body }, nearest)
        };
        let pushed: Vec<(Body<D>, f64)> = sorted.bodies.par_iter().map(push).collect();
        let nearest = pushed.iter().fold(1.0_f64, |least, (_, nearest)| least.min(*nearest));
        let overlapping = pushed.iter().filter(|(_, nearest)| *nearest < 1.0).count();
        Pushed { bodies: pushed.into_iter().map(|(body, _)| body).collect(), nearest, overlapping }
    }

    /// Centres, in the order of the radii, after sweeps of Monte Carlo moves. Each sweep moves the box by
    /// a random vector against its cells, then offers each body one move within its cell. Cells of one
    /// colour (the parities of their coordinates) are a cell apart, so that their bodies cannot touch:
    /// they move at the same time, and threads change no bit.
    fn stir(&self, mut bodies: Vec<Body<D>>) -> Result<Vec<[f64; D]>> {
        let mut step = STEP;
        for sweep in 0..SWEEPS {
            let ends = [sweep, sweep + 1].map(|done| f64::from(done) / f64::from(SWEEPS));
            let share = self.share.part([PUSHED_SHARE, 1.0]).part(ends);
            share.reach(0.0)?;
            let mut draws = Draws::new(self.seed, [sweep, self.attempt, 0], SHIFT);
            let shift: [f64; D] = std::array::from_fn(|k| draws.uniform() * self.cells.sides[k]);
            bodies.par_iter_mut().for_each(|body| body.at = self.cells.moved(&body.at, &shift));
            let mut sorted = Sorted::new(&bodies, &self.cells)?;
            let moved = self.sweep(&mut sorted, sweep, step, share)?;
            bodies = sorted.bodies;
            let wanted = moved as f64 > ACCEPTED * bodies.len() as f64;
            step = (if wanted { step * 1.2 } else { step / 1.2 }).clamp(STEPS[0], STEPS[1]);
        }
        let mut centres = reserve::filled([0.0; D], bodies.len(), PURPOSE)?;
        for body in bodies {
            centres[body.number as usize] = body.at;
        }
        Ok(centres)
    }

    /// One sweep with moves of up to `step` radii along each axis; the number of moves.
    fn sweep(
        &self,
        sorted: &mut Sorted<D>,
        sweep: u32,
        step: f64,
        share: Share<'_>,
    ) -> Result<usize> {
        let length = self.cells.counts[D - 1];
        let mut moved = 0;
        for colour in 0..1_usize << D {
            let is_colour = |row: &usize| {
                let cell = self.cells.cell(row * length);
                (0..D - 1).all(|axis| cell[axis] % 2 == colour >> axis & 1)
            };
            let rows: Vec<usize> = (0..self.cells.len() / length).filter(is_colour).collect();
            let of_row = |row: &usize| {
                let first = row * length + (colour >> (D - 1) & 1);
                let cells = (first..(row + 1) * length).step_by(2);
                self.move_cells(sorted, cells, sweep, step)
            };
            let changed: Vec<Vec<(usize, Body<D>)>> = rows.par_iter().map(of_row).collect();
            for (index, body) in changed.into_iter().flatten() {
                sorted.bodies[index] = body;
                moved += 1;
            }
            share.reach((colour + 1) as f64 / f64::from(1 << D))?;
        }
        Ok(moved)
    }

    /// The bodies of these cells that moved, with their indices.
    fn move_cells(
        &self,
        sorted: &Sorted<D>,
        cells: impl Iterator<Item = usize>,
        sweep: u32,
        step: f64,
    ) -> Vec<(usize, Body<D>)> {
        let mut changes = Vec::new();
        for cell in cells {
            let own = sorted.range(&(cell..cell + 1));
            if own.is_empty() {
                continue;
            }
            let coordinates = self.cells.cell(cell);
            let near = sorted.near(&self.cells, coordinates);
            let begin = changes.len();
            for index in own.clone() {
                let body = &sorted.bodies[index];
                let mut draws = Draws::new(self.seed, [body.number, sweep, self.attempt], MOVE);
                let at: [f64; D] = std::array::from_fn(|k| {
                    body.at[k] + (2.0 * draws.uniform() - 1.0) * step * body.radius
                });
                let is_inside = (0..D).all(|k| at[k] >= 0.0 && at[k] < self.cells.sides[k])
                    && self.cells.coordinates(&at) == coordinates;
                let moved = Body { at, ..*body };
                if is_inside && self.is_free(&moved, &own, &changes[begin..], &near, sorted) {
                    changes.push((index, moved));
                }
            }
        }
        changes
    }

    /// True if a body overlaps no other; bodies of its `own` cell have their new positions.
    fn is_free(
        &self,
        body: &Body<D>,
        own: &Range<usize>,
        changes: &[(usize, Body<D>)],
        near: &[Range<usize>],
        sorted: &Sorted<D>,
    ) -> bool {
        let is_apart = |other: &Body<D>| {
            let contact = body.radius + other.radius;
            self.cells.square_distance(&body.at, &other.at) >= contact * contact
        };
        let has_moved = |index: &usize| changes.iter().any(|(moved, _)| moved == index);
        changes.iter().all(|(_, other)| is_apart(other))
            && near.iter().all(|run| {
                run.clone().all(|index| {
                    let other = &sorted.bodies[index];
                    other.number == body.number
                        || is_apart(other)
                        || own.contains(&index) && has_moved(&index)
                })
            })
    }
}
