//! Light of lines that crosses surfaces near grazing, where phases do not describe reflection and refraction: its rays
//! are traced exactly at each energy.

use super::line::LineRays;
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_interface::{
    FLAG_GRAZING, FLAG_NOT_FINITE, FLAG_REFLECTED, FLAG_UNBALANCED, Ray, RayResult,
};
use std::collections::{BTreeMap, BTreeSet};

/// Least width of a part of a line near grazing that refracts as rays do, m: twice the shears of
/// illumination curves. Rims of carbon of a radius below 80 mm are narrower at 30 keV, and
/// have waves.
const WIDE: f64 = 0.6e-6;
/// Parts of the cell of a ray at a border of such light: a border errs by a sixteenth of the spacing at most.
const PARTS: usize = 8;

/// A part of a line that has the light of a ray at an energy.
#[derive(Debug, Clone, Copy)]
pub(super) struct GrazingPart {
    /// Index of the energy.
    pub energy: usize,
    /// Ends from the centre of the beamlet, m.
    pub x: [f64; 2],
    /// Its ray at the energy.
    pub result: RayResult,
}

/// Share of the light of a ray near grazing at an energy.
#[derive(Debug, Clone, Copy)]
pub(super) struct Share {
    pub energy: usize,
    pub ray: usize,
    pub share: f32,
}

/// Light near grazing of lines that are traced together.
#[derive(Debug)]
pub(super) struct GrazingLight {
    /// Parts of each line, in the order of x.
    pub of_line: Vec<Vec<GrazingPart>>,
    /// Shares in the order of energies, then rays.
    pub shares: Vec<Share>,
}

impl GrazingLight {
    /// Light near grazing among the `flagged` rays at each of the energies.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(super) fn find(
        tracer: &Tracer,
        rays: &LineRays<'_>,
        flagged: &[usize],
        energies: usize,
    ) -> Result<Self> {
        let mut all = Self { of_line: vec![Vec::new(); rays.lines.len()], shares: Vec::new() };
        if flagged.is_empty() {
            return Ok(all);
        }
        let middles: Vec<Ray> = flagged.iter().map(|at| rays.ray(*at, rays.x(*at))).collect();
        let found = tracer.walk_at_nodes(&vec![middles; energies])?;
        let wide = wide_runs(rays, flagged);
        let of_energy = |results: &Vec<RayResult>| {
            let pairs = flagged.iter().copied().zip(results.iter().copied());
            pairs.filter(|(at, result)| is_exact(result, wide.contains(at))).collect()
        };
        let found: Vec<BTreeMap<usize, RayResult>> = found.iter().map(of_energy).collect();
        let borders: Vec<BTreeSet<usize>> = found.iter().map(|it| borders(rays, it)).collect();
        let part_rays = |at: &usize| {
            let parts = parts(rays, *at).into_iter();
            parts.map(|[low, high]| rays.ray(*at, f64::midpoint(low, high))).collect::<Vec<_>>()
        };
        let at_borders: Vec<Vec<Ray>> =
            borders.iter().map(|cells| cells.iter().flat_map(part_rays).collect()).collect();
        let at_borders = tracer.walk_at_nodes(&at_borders)?;
        for energy in 0..energies {
            let inner = found[energy].iter().filter(|(at, _)| !borders[energy].contains(at));
            for (at, result) in inner {
                let half = 0.5 * rays.spacing;
                let x = [rays.x(*at) - half, rays.x(*at) + half];
                all.push(rays, (energy, *at), &[GrazingPart { energy, x, result: *result }], 1.0);
            }
            for (at, results) in borders[energy].iter().zip(at_borders[energy].chunks(PARTS)) {
                let beside = [Some(*at), at.checked_sub(1), Some(at + 1)];
                let is_wide = beside.iter().flatten().any(|it| wide.contains(it));
                let part = |(x, result): ([f64; 2], &RayResult)| {
                    is_exact(result, is_wide).then_some(GrazingPart { energy, x, result: *result })
                };
                let some: Vec<GrazingPart> =
                    parts(rays, *at).into_iter().zip(results).filter_map(part).collect();
                let share = numbers::single(some.len() as f64 / PARTS as f64);
                all.push(rays, (energy, *at), &some, share);
            }
        }
        // Cells of a row are in order.
        all.of_line.iter_mut().for_each(|line| line.sort_by(|a, b| a.x[0].total_cmp(&b.x[0])));
        all.shares.sort_by_key(|it| (it.energy, it.ray));
        Ok(all)
    }

    fn push(
        &mut self,
        rays: &LineRays<'_>,
        (energy, ray): (usize, usize),
        some: &[GrazingPart],
        share: f32,
    ) {
        if !some.is_empty() {
            // Beside its beamlet a line sees light that other lines add.
            let half = 0.5 * rays.lattice.period;
            let own = some.iter().filter(|it| it.x[1] > -half && it.x[0] < half);
            self.of_line[rays.line_of(ray)].extend(own);
            self.shares.push(Share { energy, ray, share });
        }
    }
}

/// True if a ray has the light of its exact walk: where surfaces reflect it totally, and in wide runs near
/// grazing.
fn is_exact(result: &RayResult, is_wide: bool) -> bool {
    let kinds = FLAG_REFLECTED | if is_wide { FLAG_GRAZING } else { 0 };
    result.flags & kinds != 0 && result.flags & (FLAG_UNBALANCED | FLAG_NOT_FINITE) == 0
}

/// Rays of wide runs of flagged rays.
fn wide_runs(rays: &LineRays<'_>, flagged: &[usize]) -> BTreeSet<usize> {
    let follows = |a: &usize, b: &usize| a + 1 == *b && rays.line_of(*a) == rays.line_of(*b);
    let runs = flagged.chunk_by(follows);
    runs.filter(|run| run.len() as f64 * rays.spacing >= WIDE).flatten().copied().collect()
}

/// Rays on either side of each border between light of exact rays and other light of a line.
fn borders(rays: &LineRays<'_>, found: &BTreeMap<usize, RayResult>) -> BTreeSet<usize> {
    let pairs = found.keys().flat_map(|at| {
        let beside = [at.checked_sub(1), Some(at + 1)].into_iter().flatten();
        let is_other =
            |it: &usize| rays.line_of(*it) == rays.line_of(*at) && !found.contains_key(it);
        beside.filter(is_other).flat_map(|it| [*at, it])
    });
    pairs.collect()
}

/// Parts of the cell of a ray: ends from the centre of its beamlet, m.
fn parts(rays: &LineRays<'_>, ray: usize) -> [[f64; 2]; PARTS] {
    let end = |part: usize| rays.x(ray) + (part as f64 / PARTS as f64 - 0.5) * rays.spacing;
    std::array::from_fn(|part| [end(part), end(part + 1)])
}
