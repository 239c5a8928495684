//! Discs (D = 2) and spheres (D = 3) in a periodic box.
//!
//! Random sequential addition fills the box as far as it is quick. Beyond that smaller bodies are
//! added, and `relax` makes room for them at full size. Neither knows a place from another, so the
//! density is the same everywhere.

use rayon::prelude::*;

use super::relax::Relaxation;
use super::share::Share;
use super::sorted::{Cells, PURPOSE};
use beamlet_core::random::Draws;
use beamlet_core::{Result, numbers, reserve};

/// Fill up to which bodies are added one by one: beyond it most places are taken.
const ADDED_FILL: [f64; 2] = [0.40, 0.20];
/// Rounds of addition. The few bodies that find no free place overlap others, until they push each other
/// apart.
const ROUNDS: u32 = 9;
/// A body tries one place in the first round, and twice the number in each further one up to this one.
const MOST_DOUBLED: u32 = 5;
/// Share of the work that addition is where bodies are added smaller: measured with a million spheres.
const ADDITION_SHARE: f64 = 0.27;
/// Bodies without a place that a round leaves of a hundred, about.
const LEFT_OF_ROUND: f64 = 0.45;
/// Bodies between two reports.
const REPORTED: usize = 1 << 15;

const ADDITION: u8 = 1;

/// No body.
const NONE: u32 = u32::MAX;

/// Outcome of a packing.
#[derive(Debug)]
pub(super) enum Packed<const D: usize> {
    /// Centres, in the order of the radii, each coordinate from 0 up to the side of the box.
    Whole(Vec<[f64; D]>),
    /// The bodies overlap.
    Jammed {
        /// Volume of bodies small enough not to overlap, as a share of the target.
        share: f64,
    },
}

/// Packs bodies of these radii into a periodic box with these sides, which are at least
/// [`Cells::least_side`] of the largest diameter. The same bits on any number of threads.
///
/// # Errors
/// [`beamlet_core::Error::Memory`]; [`beamlet_core::Error::Interrupted`].
pub(super) fn pack<const D: usize>(
    sides: [f64; D],
    radii: &[f64],
    seed: u64,
    attempt: u32,
    share: Share<'_>,
) -> Result<Packed<D>> {
    let largest = radii.iter().fold(0.0_f64, |most, radius| most.max(*radius));
    let cells = Cells::new(sides, 2.0 * largest, radii.len());
    let power = |radius: f64| (0..D).fold(1.0, |power, _| power * radius);
    let volume = super::region::unit_ball(D) * radii.iter().map(|r| power(*r)).sum::<f64>();
    let fill = volume / sides.iter().product::<f64>();
    // Large ones first: they find no place between many small ones.
    let mut order: Vec<u32> = (0..numbers::count(radii.len())).collect();
    order.sort_by(|a, b| radii[*b as usize].total_cmp(&radii[*a as usize]).then(a.cmp(b)));
    let shrunk = libm::pow(ADDED_FILL[D - 2] / fill, 1.0 / D as f64).min(1.0);
    let end = if shrunk < 1.0 { ADDITION_SHARE } else { 1.0 };
    let added = share.part([0.0, end]);
    let (centres, left) =
        Addition { cells: &cells, radii, shrunk, seed, attempt, share: added }.all(&order)?;
    if shrunk >= 1.0 && left == 0 {
        return Ok(Packed::Whole(centres));
    }
    let share = share.part([end, 1.0]);
    Relaxation { cells, radii, fill, seed, attempt, share }.pack(&centres)
}

/// Random sequential addition in rounds: each body that has no place tries some, and takes the first
/// that is free.
struct Addition<'a, const D: usize> {
    cells: &'a Cells<D>,
    radii: &'a [f64],
    /// Factor on the radii.
    shrunk: f64,
    seed: u64,
    attempt: u32,
    share: Share<'a>,
}

/// Bodies by their cells: the first of each cell, and after each body the next.
struct Lists<const D: usize> {
    first: Vec<u32>,
    next: Vec<u32>,
    centres: Vec<[f64; D]>,
}

impl<const D: usize> Addition<'_, D> {
    /// Centres of all bodies, and how many of them found no free place.
    fn all(&self, order: &[u32]) -> Result<(Vec<[f64; D]>, usize)> {
        let mut lists = Lists {
            first: reserve::filled(NONE, self.cells.len(), PURPOSE)?,
            next: reserve::filled(NONE, order.len(), PURPOSE)?,
            centres: reserve::filled([0.0; D], order.len(), PURPOSE)?,
        };
        let mut left = order.to_vec();
        for round in 0..ROUNDS {
            // Fewer bodies try more places: what rounds take goes with the root of their number.
            let done = |left: f64| 1.0 - (left / order.len().max(1) as f64).sqrt();
            let of_round = [1.0, LEFT_OF_ROUND].map(|part| done(part * left.len() as f64));
            let share = self.share.part(of_round);
            share.reach(0.0)?;
            let mut found: Vec<([f64; D], bool)> = Vec::with_capacity(left.len());
            for some in left.chunks(REPORTED) {
                found.par_extend(some.par_iter().map(|body| self.place(*body, round, &lists)));
                share.reach(found.len() as f64 / left.len() as f64)?;
            }
            let mut without = Vec::new();
            for (body, (centre, is_free)) in left.iter().zip(found) {
                // Those before it in this round may have taken the place.
                if is_free && self.is_free(*body, &centre, &lists) {
                    self.put(*body, centre, &mut lists);
                } else {
                    lists.centres[*body as usize] = centre;
                    without.push(*body);
                }
            }
            left = without;
            if left.is_empty() {
                break;
            }
        }
        Ok((lists.centres, left.len()))
    }

    /// A random place, and whether it is free.
    fn place(&self, body: u32, round: u32, lists: &Lists<D>) -> ([f64; D], bool) {
        let mut draws = Draws::new(self.seed, [body, round, self.attempt], ADDITION);
        let mut centre = [0.0; D];
        for _ in 0..1_u32 << round.min(MOST_DOUBLED) {
            centre = std::array::from_fn(|k| draws.uniform() * self.cells.sides[k]);
            if self.is_free(body, &centre, lists) {
                return (centre, true);
            }
        }
        (centre, false)
    }

    fn is_free(&self, body: u32, centre: &[f64; D], lists: &Lists<D>) -> bool {
        let own = self.radii[body as usize];
        self.cells.around(self.cells.coordinates(centre)).into_iter().flatten().all(|cell| {
            let mut other = lists.first[cell];
            while other != NONE {
                let there = other as usize;
                let apart = self.shrunk * (own + self.radii[there]);
                if self.cells.square_distance(centre, &lists.centres[there]) < apart * apart {
                    return false;
                }
                other = lists.next[there];
            }
            true
        })
    }

    fn put(&self, body: u32, centre: [f64; D], lists: &mut Lists<D>) {
        let cell = self.cells.index(self.cells.coordinates(&centre));
        lists.centres[body as usize] = centre;
        lists.next[body as usize] = std::mem::replace(&mut lists.first[cell], body);
    }
}
