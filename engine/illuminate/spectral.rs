//! Light of a spectrum: cells of all energies gathered into few (docs/physics.md, "Spectra").
//!
//! A photon passes each mask either through an aperture or through the bars. Light that took the
//! same way (a group, at most four) is gathered over the energies into one cell with its mean
//! displacement; what the displacement spreads over the energies is added to the blur. Cells for
//! which that is not enough go energy by energy.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounding to f32 is meant; indices are bounded by those of the cells"
)]

mod bars;
mod join;
mod ordered;
mod run;
mod sums;

use super::light::{LightRecord, MaskShape, Part};
use crate::Result;
use crate::gpu::Device;
use crate::gpu::interface::{Cell, MOMENTS_PER_MATERIAL, Strip};
use crate::material::Constants;
use crate::scene::Scene;
use crate::trace::{
    CellMoments, DEPTH_TOLERANCE, FULL_SHARE, Lattice, Media, STEEPEST, Strips, Tracer,
};
use bars::{Bars, Place, passing};
use join::Joining;
use ordered::{Repeated, severe};
use rayon::prelude::*;
use run::{Fitted, Limits, Run};
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::sync::Arc;
use sums::Sums;

pub(crate) use ordered::NARROW;

/// Groups with less light than this, of open beam, are left out.
const NEGLIGIBLE: f64 = 1e-9;
/// The displacement may spread over this share of the blur: the third moment that is left out
/// then moves less than 2e-4 of the light at an edge.
const SPREAD_SHARE: f64 = 0.15;
/// Cells are made one up to this share of the period,
const RUN_SHARE: f64 = 1.0 / 20.0;
/// and to this deviation of the displacement from a straight line, in shares of the blur. It is
/// added to the blur; what an edge of an aperture cuts out of a run may lean by as much.
const RESIDUAL_SHARE: f64 = 0.1;
/// Strips gathered one after the other by a thread.
const STRIPS_AT_ONCE: usize = 1 << 8;

/// What the gathering needs of a scene.
#[derive(Debug)]
pub struct Spectral {
    weights: Vec<f64>,
    /// `[node][material]`, behind the nodes the mean constants.
    mu: Vec<f64>,
    delta: Vec<f64>,
    /// Share of the grazing incidence below which ordered walks are repeated, by node.
    severe: Vec<f64>,
    materials: usize,
    /// Masks by node: the sample mask, the detector mask.
    masks: [Option<Vec<MaskShape>>; 2],
    /// Which masks the light of each group leaks through.
    groups: Vec<[bool; 2]>,
    lattice: Lattice,
    /// dx/dy of the centre ray of each beamlet.
    slopes: Vec<f64>,
    tolerance: f64,
    limits: Limits,
    /// Least blur at any edge on the analyser, standard deviation, m.
    blur: f64,
    gap: f64,
    ratio: f64,
    row_pitch: f64,
    row_slope: f64,
    middle_row: f64,
}

/// Law of a ray at a node, all that light needs.
#[derive(Debug, Clone, Copy, Default)]
struct NodeLaw {
    depth: f64,
    x: f64,
    /// At the detector.
    z: f64,
    slope_x: f64,
}

/// What gathering works with, kept from strip to strip.
#[derive(Default)]
struct Scratch {
    /// First-order laws at either end of a cell, by node.
    first_order: [Vec<NodeLaw>; 2],
    /// Laws at both ends, by node.
    laws: Vec<[NodeLaw; 2]>,
    run: Run,
    /// Laws of the run, by node.
    fitted: Vec<Fitted>,
    /// Light at the low end, the middle and the high end of a cell, by node.
    passing: Vec<[f64; 3]>,
    waiting: Vec<Range<usize>>,
    /// Light of the groups that is joined.
    joining: Vec<Joining>,
    lists: Vec<Vec<Cell>>,
}

impl Spectral {
    /// For the lattice of a scene.
    ///
    /// # Errors
    /// As [`crate::material::constants_at_for`].
    ///
    /// `reference`: constants that ordered walks were made at; `flagged`: the strongest delta
    /// that rays were flagged for.
    pub fn new(
        scene: &Scene,
        media: &Media,
        lattice: &Lattice,
        reference: &[Constants],
        flagged: f64,
    ) -> Result<Self> {
        let analyser = scene.analyser_distance();
        let at = |name: &str, spec: Option<&crate::scene::MaskSpec>, plane: f64| {
            spec.map(|spec| {
                let of = |&energy: &f64| MaskShape::of(scene, name, spec, plane, Some(energy));
                media.energies.iter().map(of).collect::<Result<Vec<_>>>()
            })
            .transpose()
        };
        let masks = [
            at("sample_mask", scene.sample_mask.as_ref(), lattice.plane)?,
            at("detector_mask", scene.detector_mask.as_ref(), analyser)?,
        ];
        let spot = scene.source.spot.narrowest(0);
        let at_mask = spot * (analyser / scene.source.distance - 1.0);
        let at_pixel = spot * (scene.detector.distance / scene.source.distance - 1.0) * analyser
            / scene.detector.distance;
        let flat = |of: fn(&Constants) -> f64| {
            media.constants.iter().flatten().chain(reference).map(of).collect()
        };
        let blur = if masks[1].is_some() { at_mask } else { at_pixel };
        let mut spectral = Self {
            weights: media.weights.clone(),
            mu: flat(|c| c.mu),
            delta: flat(|c| c.delta),
            severe: severe(scene, media, reference, flagged),
            materials: media.names.len(),
            groups: Vec::new(),
            slopes: lattice.columns(scene).iter().map(|c| c.slope.into()).collect(),
            lattice: lattice.clone(),
            tolerance: scene.sampling.tolerance,
            limits: Limits {
                width: RUN_SHARE * lattice.period,
                depth: f64::from(STEEPEST),
                residual: (RESIDUAL_SHARE * blur).max(scene.sampling.tolerance),
            },
            blur,
            gap: scene.detector.distance - analyser,
            ratio: analyser / scene.detector.distance,
            row_pitch: scene.detector.pitch[1],
            row_slope: -scene.detector.pitch[1] / scene.detector.distance,
            middle_row: f64::from(scene.detector.pixels[1]) / 2.0,
            masks,
        };
        // One energy has nothing to gather.
        if spectral.nodes() > 1 {
            spectral.groups = [[false, false], [true, false], [false, true], [true, true]]
                .into_iter()
                .filter(|leaks| {
                    let has = |i: usize| !leaks[i] || spectral.masks[i].is_some();
                    let light = |n| spectral.weights[n] * spectral.passes(n, *leaks);
                    has(0) && has(1) && (0..spectral.nodes()).map(light).sum::<f64>() >= NEGLIGIBLE
                })
                .collect();
        }
        Ok(spectral)
    }

    fn nodes(&self) -> usize {
        self.weights.len()
    }

    /// Share of the light of a node along the axis that takes a way through the masks.
    fn passes(&self, node: usize, group: [bool; 2]) -> f64 {
        passing([0, 1].map(|i| self.masks[i].as_ref().map(|mask| mask[node].leak(1.0))), group)
    }

    /// Light records of the lists of [`Spectral::lists`], in their order.
    ///
    /// # Errors
    /// [`crate::Error::Memory`], or as [`crate::material::constants_at_for`].
    pub fn lights(
        &self,
        device: &Arc<Device>,
        scene: &Scene,
        media: &Media,
    ) -> Result<Vec<LightRecord>> {
        let offsets = &scene.scan.mask_offsets;
        let softness = |mask: usize, leaks: [bool; 2]| {
            let shapes = self.masks[mask].as_ref().filter(|_| !leaks[mask])?;
            let (mut sum, mut all) = ([0.0; 3], 0.0);
            for (n, shape) in shapes.iter().enumerate() {
                let weight = self.weights[n] * self.passes(n, leaks);
                all += weight;
                let shade = shape.shade(1.0);
                sum[0] += weight * shape.softness();
                sum[1] += weight * shade;
                sum[2] += weight * shade * shade;
            }
            if all <= 0.0 {
                return Some(0.0);
            }
            let [softness, shade, shade2] = sum.map(|s| s / all);
            // Either edge moves by half of what the shade differs from its mean.
            Some((softness + 0.25 * (shade2 - shade * shade)) as f32)
        };
        let groups = self
            .groups
            .iter()
            .map(|&leaks| Part::Group { softness: [softness(0, leaks), softness(1, leaks)] });
        let nodes = media.energies.iter().zip(&media.weights);
        groups
            .chain(nodes.map(|(&energy, &weight)| Part::Node { energy, weight }))
            .map(|part| LightRecord::of_cells(device, scene, &self.lattice, offsets, &part))
            .collect()
    }

    /// Cells of strips whose moments were kept, as light: one list per group, then one per node.
    ///
    /// # Errors
    /// As [`Tracer::trace`], by which the ordered walks are repeated at each node.
    pub fn lists(&self, tracer: &mut Tracer, strips: &Strips) -> Result<Vec<Strips>> {
        let repeated = self.repeat(tracer, strips)?;
        let places: BTreeSet<Place> = strips.strips.iter().map(|s| self.place(s)).collect();
        let places: Vec<Place> = places.into_iter().collect();
        let bars: HashMap<Place, Bars> =
            places.par_iter().map(|place| (*place, self.bars(*place))).collect();
        let gathered: Vec<Vec<Strips>> = strips
            .strips
            .par_chunks(STRIPS_AT_ONCE)
            .map_init(Scratch::default, |scratch, some| {
                let mut lists = vec![Strips::default(); self.groups.len() + self.nodes()];
                for strip in some {
                    self.gather(strips, strip, &repeated, &bars[&self.place(strip)], scratch);
                    for (list, cells) in lists.iter_mut().zip(&scratch.lists) {
                        list.push(*strip, cells, &CellMoments::default());
                    }
                }
                lists
            })
            .collect();
        let mut lists = vec![Strips::default(); self.groups.len() + self.nodes()];
        for (index, list) in lists.iter_mut().enumerate() {
            let parts = || gathered.iter().map(|some| &some[index]);
            list.strips.reserve_exact(parts().map(|part| part.strips.len()).sum());
            list.cells.reserve_exact(parts().map(|part| part.cells.len()).sum());
            parts().for_each(|part| list.append(part));
        }
        lists.iter_mut().for_each(Strips::balance);
        Ok(lists)
    }

    /// Cells of a strip for every list, in the scratch.
    fn gather(
        &self,
        strips: &Strips,
        strip: &Strip,
        repeated: &[Repeated],
        bars: &Bars,
        scratch: &mut Scratch,
    ) {
        let groups = self.groups.len();
        scratch.lists.resize_with(groups + self.nodes(), Vec::new);
        scratch.lists.iter_mut().for_each(Vec::clear);
        scratch.joining.resize_with(groups, Joining::default);
        let words = 2 * self.materials * MOMENTS_PER_MATERIAL;
        let first = strip.first as usize;
        let exact = &strips.moments.exact;
        let mut at = exact.partition_point(|e| (e.cell as usize) < first);
        let mut before: &[f32] = &[];
        scratch.run.clear();
        for index in first..first + strip.count as usize {
            let cell = &strips.cells[index];
            let ends = &strips.moments.ends[index * words..(index + 1) * words];
            let [low, high] = [&ends[..words / 2], &ends[words / 2..]];
            // Neighbours share a ray.
            if low == before {
                scratch.first_order.swap(0, 1);
            } else {
                self.laws(low, &mut scratch.first_order[0]);
            }
            self.laws(high, &mut scratch.first_order[1]);
            before = high;
            let [low_laws, high_laws] = &scratch.first_order;
            scratch.laws.clear();
            scratch.laws.extend(low_laws.iter().zip(high_laws).map(|(low, high)| [*low, *high]));
            if exact.get(at).is_some_and(|e| e.cell as usize == index) {
                let walked = at;
                at += 1;
                self.correct(&exact[walked], [low, high], &mut scratch.laws);
                if repeated.iter().any(|r| r.places[walked].is_some()) {
                    self.push_run(strip, bars, scratch);
                    let lists = &mut scratch.lists[groups..];
                    for ((laws, repeated), list) in scratch.laws.iter().zip(repeated).zip(lists) {
                        match repeated.places[walked] {
                            None => list.push(self.cell(strip, [cell.x_low, cell.x_high], *laws)),
                            Some(places) => {
                                let laws = places.map(|place| &repeated.laws[place]);
                                self.push_exact(list, strip, cell, laws, exact[walked].range);
                            }
                        }
                    }
                    continue;
                }
            }
            let x = [cell.x_low, cell.x_high].map(f64::from);
            let mean = self.mean(&scratch.laws);
            if !scratch.run.takes(x, mean, &self.limits) {
                self.push_run(strip, bars, scratch);
                scratch.run.begin(x, mean);
            }
            scratch.run.push(x, &scratch.laws);
        }
        self.push_run(strip, bars, scratch);
        for group in 0..groups {
            self.push_joined(strip, group, scratch);
        }
    }

    /// Light of neighbouring cells that are as good as one.
    fn push_run(&self, strip: &Strip, bars: &Bars, scratch: &mut Scratch) {
        let Some(x) = scratch.run.fit(self.nodes(), &mut scratch.fitted) else { return };
        scratch.run.clear();
        if !bars.closed {
            self.push_groups(strip, x, bars, scratch);
            return;
        }
        let lists = &mut scratch.lists[self.groups.len()..];
        for (fitted, list) in scratch.fitted.iter().zip(lists) {
            list.push(Cell { spread: fitted.residual as f32, ..self.cell(strip, x, fitted.ends) });
        }
    }

    /// Laws averaged over the energies.
    fn mean(&self, laws: &[[NodeLaw; 2]]) -> [NodeLaw; 2] {
        let mut mean = [NodeLaw::default(); 2];
        for (ends, weight) in laws.iter().zip(&self.weights) {
            for (mean, law) in mean.iter_mut().zip(ends) {
                mean.depth += weight * law.depth;
                mean.x += weight * law.x;
            }
        }
        mean
    }

    /// First-order laws at all nodes.
    fn laws(&self, moments: &[f32], laws: &mut Vec<NodeLaw>) {
        laws.clear();
        if moments.iter().all(|m| *m == 0.0) {
            laws.resize(self.nodes(), NodeLaw::default());
        } else {
            laws.extend((0..self.nodes()).map(|node| self.law(node, moments)));
        }
    }

    /// Ends the cell that light of a group is joined to.
    fn push_joined(&self, strip: &Strip, group: usize, scratch: &mut Scratch) {
        if let Some((x, sums)) = scratch.joining[group].take() {
            scratch.lists[group].push(self.gathered(strip, x, &sums));
        }
    }

    /// First-order law at a node.
    fn law(&self, node: usize, moments: &[f32]) -> NodeLaw {
        let mut law = NodeLaw::default();
        let constants = node * self.materials..(node + 1) * self.materials;
        let (mu, delta) = (&self.mu[constants.clone()], &self.delta[constants]);
        for ((m, mu), delta) in moments.chunks_exact(MOMENTS_PER_MATERIAL).zip(mu).zip(delta) {
            let m: [f64; 5] = std::array::from_fn(|i| m[i].into());
            law.depth += mu * m[0];
            law.x += delta * m[1];
            law.z += delta * (m[2] + m[4] * self.gap);
            law.slope_x += delta * m[3];
        }
        law
    }

    /// Light of a cell by group: one cell, or as many as keep the energies in each close enough.
    fn push_groups(&self, strip: &Strip, x: [f32; 2], bars: &Bars, scratch: &mut Scratch) {
        let Scratch { fitted, passing, .. } = scratch;
        passing.clear();
        passing.extend(fitted.iter().map(|fitted| {
            let [low, high] = fitted.ends.map(|law| f64::from((-law.depth as f32).exp()));
            [low, (low * high).sqrt(), high]
        }));
        let nodes = self.nodes();
        let light = bars.shares.iter().zip(passing.iter().cycle());
        let all: f64 = light.map(|(share, passing)| share * passing[1]).sum();
        let room = self.room(x);
        // What the third moment moves grows with the light of the cell.
        let spread = (SPREAD_SHARE * self.blur).max(self.tolerance) * libm::cbrt(room);
        for group in 0..self.groups.len() {
            let shares = &bars.shares[group * nodes..][..nodes];
            if let Some(width) = bars.joined[group] {
                if !scratch.joining[group].fits(x, width) {
                    self.push_joined(strip, group, scratch);
                }
                if scratch.joining[group].fits(x, width) {
                    let Scratch { fitted, passing, joining, .. } = scratch;
                    let sums = Sums::over(0..nodes, shares, passing, fitted, &bars.shades);
                    joining[group].add(x, &sums);
                    continue;
                }
            }
            let Scratch { fitted, passing, waiting, lists, .. } = scratch;
            let mut next = Some(0..nodes);
            while let Some(band) = next.take().or_else(|| waiting.pop()) {
                let sums = Sums::over(band.clone(), shares, passing, fitted, &bars.shades);
                if !sums.light.iter().all(|light| *light > 0.0) {
                    continue;
                }
                let part = sums.light[1] / all;
                let agrees = part * sums.bend() <= f64::from(DEPTH_TOLERANCE) * room
                    && part * sums.drift() <= self.tolerance * room
                    && part * sums.spread() <= spread * spread;
                if agrees || band.len() == 1 {
                    lists[group].push(self.gathered(strip, x, &sums));
                    continue;
                }
                let mut light = 0.0;
                let half = band.clone().find(|&n| {
                    light += shares[n] * passing[n][1];
                    light >= 0.5 * sums.light[1]
                });
                let cut = half.unwrap_or(band.start).clamp(band.start + 1, band.end - 1);
                waiting.extend([cut..band.end, band.start..cut]);
            }
        }
    }

    /// How much more than the widest cell of full accuracy a cell may err: it has less light.
    fn room(&self, x: [f32; 2]) -> f64 {
        let width = f64::from(x[1] - x[0]);
        (self.lattice.period * f64::from(FULL_SHARE) / width).max(1.0)
    }

    fn gathered(&self, strip: &Strip, x: [f32; 2], sums: &Sums) -> Cell {
        let end = |i: usize| NodeLaw {
            depth: -sums.light[i].ln(),
            x: sums.x[i] / sums.light[i],
            z: sums.z / sums.light[1],
            slope_x: sums.slope_x / sums.light[1],
        };
        Cell {
            spread: sums.spread() as f32,
            sample_shade: (sums.shade[0] / sums.light[1]) as f32,
            detector_shade: (sums.shade[1] / sums.light[1]) as f32,
            sample_lean: sums.lean(0) as f32,
            detector_lean: sums.lean(1) as f32,
            ..self.cell(strip, x, [end(0), end(2)])
        }
    }

    fn cell(&self, strip: &Strip, x: [f32; 2], [low, high]: [NodeLaw; 2]) -> Cell {
        let mean = |f: fn(&NodeLaw) -> f64| 0.5 * (f(&low) + f(&high));
        let z = mean(|l| l.z);
        let down = -z / self.row_pitch;
        let [above, below] = self.lattice.row_shares(strip.top.into(), strip.bottom.into(), down);
        Cell {
            x_low: x[0],
            x_high: x[1],
            depth_low: low.depth as f32,
            depth_high: high.depth as f32,
            displacement_low: low.x as f32,
            displacement_high: high.x as f32,
            displacement_z: z as f32,
            above,
            below,
            pixel_shift: (mean(|l| l.x) * (1.0 - self.ratio)
                - mean(|l| l.slope_x) * self.gap * self.ratio) as f32,
            ..bytemuck::Zeroable::zeroed()
        }
    }
}
