//! What objects cover of one another: where they overlap the one listed later wins.
//!
//! Every earlier object loses the volumes that later ones cover, by booleans of meshes in f64 (`closed_mesh`).
//! Later stages see bodies that are disjoint or nested: sums over their surfaces need no order. Only
//! *parts* (`parts`: a closed outer surface with its voids) that intersect are cut (`meeting`); disjoint
//! and properly nested parts do not change.

mod closed_mesh;
mod closing;
mod meeting;
mod parts;

use rayon::prelude::*;
use std::collections::{BTreeSet, HashSet};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use super::body::Body;
use super::surface::Surface;
use beamlet_core::error::{Error, Result};
use beamlet_core::numbers;
use beamlet_core::watch::{LoadStep, Task};
pub use closed_mesh::PEAK_PER_CUT_TRIANGLE;
pub(crate) use closed_mesh::{ClosedMesh, snap};
pub(crate) use meeting::{Around, Meetings, pairs, tolerance};
pub(crate) use parts::Parts;

/// Changes of the objects of a sample because they overlap.
#[derive(Debug, Default)]
pub(super) struct Cuts {
    /// Later parts that are taken away, for each part.
    cutters: Vec<Vec<u32>>,
    /// Components that lie in a later object, for each part.
    covered: Vec<Vec<u32>>,
    /// Objects with such components, and the later object around each.
    covers: BTreeSet<[u32; 2]>,
    /// Object around each component, for each object.
    pub(super) outside: Vec<Vec<Option<u32>>>,
    /// For each object: later ones that intersect or cover a part of it.
    pub(crate) cut_by: Vec<Vec<u32>>,
}

impl Cuts {
    /// Decides by the intersections.
    ///
    /// A part loses the later parts that intersect it, and containing parts that have a void in it,
    /// unless nothing would remain. Later parts inside it without contact that intersect one of these are
    /// cut out too; they would lie half in the remainder.
    pub(super) fn of(bodies: &[Body], parts: &Parts, meetings: &Meetings, around: &Around) -> Self {
        let cutters: Vec<Vec<u32>> = (0..parts.all.len())
            .into_par_iter()
            .map(|part| cutters(part, parts, meetings, around))
            .collect();
        let mut cuts = Self {
            covered: vec![Vec::new(); parts.all.len()],
            cut_by: vec![Vec::new(); bodies.len()],
            ..Self::default()
        };
        for (object, body) in bodies.iter().enumerate() {
            let mut outside = Vec::with_capacity(body.components.len());
            for (component, containers) in (0_u32..).zip(&around[object]) {
                let part = parts.of[object][component as usize];
                let object_of = |container: &u32| parts.all[*container as usize].object;
                let is_cut = |it: &&u32| cutters[part as usize].binary_search(it).is_ok();
                let containers = || containers.iter().filter(|it| !is_cut(it));
                if let Some(cover) = containers().map(object_of).find(|it| *it > object) {
                    cuts.covered[part as usize].push(component);
                    cuts.cut_by[object].push(numbers::count(cover));
                    cuts.covers.insert([object, cover].map(numbers::count));
                }
                let whole = |it: &&u32| cutters[**it as usize].binary_search(&part).is_err();
                let latest = containers().filter(whole).map(object_of).max();
                outside.push(latest.map(numbers::count));
            }
            cuts.outside.push(outside);
        }
        for (part, cutters) in parts.all.iter().zip(&cutters) {
            let objects =
                cutters.iter().map(|cutter| numbers::count(parts.all[*cutter as usize].object));
            cuts.cut_by[part.object].extend(objects);
        }
        for cut_by in &mut cuts.cut_by {
            cut_by.sort_unstable();
            cut_by.dedup();
        }
        cuts.cutters = cutters;
        cuts
    }

    /// Cuts the bodies. Bodies without intersections keep every bit. If `wanted`, returns pairs of objects,
    /// earlier and later, that overlap and do not just touch.
    ///
    /// # Errors
    /// Meshes that the boolean cannot take; [`Error::Memory`]; [`Error::Interrupted`].
    pub(super) fn make(
        &self,
        bodies: &mut [Body],
        parts: &Parts,
        names: &[String],
        wanted: bool,
        task: Task<'_>,
    ) -> Result<BTreeSet<[u32; 2]>> {
        let work: Vec<usize> =
            (0..parts.all.len()).filter(|part| !self.cutters[*part].is_empty()).collect();
        if work.is_empty() && self.covered.iter().all(Vec::is_empty) {
            return Ok(BTreeSet::new());
        }
        task.begin(LoadStep::Cutting, work.len() as u64)?;
        let operands = Operands::new(bodies, parts);
        let done = AtomicU64::new(0);
        let left: Vec<(usize, Surface, Vec<u32>)> = work
            .par_iter()
            .map(|part| {
                let surface = self.cut(*part, &operands, names, task)?;
                let winners =
                    if wanted { self.winners(*part, &operands, names, task)? } else { Vec::new() };
                task.reach(done.fetch_add(1, Ordering::Relaxed) + 1);
                Ok((*part, surface, winners))
            })
            .collect::<Result<_>>()?;
        let mut holes = vec![0; bodies.len()];
        for (part, mesh) in parts.all.iter().zip(&operands.meshes) {
            holes[part.object] += mesh.get().map_or(0, |it| it.holes);
        }
        drop(operands);
        for (body, holes) in bodies.iter_mut().zip(holes).filter(|it| it.1 > 0) {
            body.warnings.push(format!(
                "{holes} holes in it are closed with flat covers where it touches other objects"
            ));
        }
        let mut left_of: Vec<Vec<(usize, Surface)>> = bodies.iter().map(|_| Vec::new()).collect();
        let mut overlaps = self.covers.clone();
        for (part, surface, winners) in left {
            let object = parts.all[part].object;
            overlaps.extend(winners.into_iter().map(|winner| [numbers::count(object), winner]));
            left_of[object].push((part, surface));
        }
        for (object, (body, left)) in bodies.iter_mut().zip(left_of).enumerate() {
            let gone = self.gone(object, parts, body.components.len());
            if !gone.contains(&true) {
                continue;
            }
            let outside = &self.outside[object];
            let pieces = left
                .into_iter()
                .map(|(part, surface)| (surface, outside[parts.all[part].components[0] as usize]));
            body.replace(&gone, pieces, numbers::count(object));
            if body.components.is_empty() {
                body.warnings
                    .push("it is covered completely by later objects and ignored".to_owned());
            }
        }
        Ok(overlaps)
    }

    /// Later objects that overlap a part: they share a volume with it that is thicker than rounding.
    fn winners(
        &self,
        number: usize,
        operands: &Operands<'_>,
        names: &[String],
        task: Task<'_>,
    ) -> Result<Vec<u32>> {
        let parts = operands.parts;
        let bounds = |object: usize| operands.bodies[object].bounds();
        let mut winners = Vec::new();
        for cutter in &self.cutters[number] {
            let pair = [number, *cutter as usize];
            let failed = |problem| parts.failed(pair, names, problem);
            let [own, other] = pair.map(|part| operands.mesh(part));
            let [first, second] = pair.map(|part| parts.all[part].object);
            let limit = tolerance(bounds(first), bounds(second));
            if own.and(other, task, failed)?.thickness() > 2.0 * limit {
                winners.push(numbers::count(second));
            }
        }
        Ok(winners)
    }

    /// Components of an object that are cut, or covered.
    fn gone(&self, object: usize, parts: &Parts, components: usize) -> Vec<bool> {
        let mut gone = vec![false; components];
        for (part, known) in parts.all.iter().enumerate().filter(|(_, it)| it.object == object) {
            let cut = if self.cutters[part].is_empty() { &[] } else { &known.components[..] };
            cut.iter().chain(&self.covered[part]).for_each(|it| gone[*it as usize] = true);
        }
        gone
    }

    /// The remainder of a part.
    fn cut(
        &self,
        number: usize,
        operands: &Operands<'_>,
        names: &[String],
        task: Task<'_>,
    ) -> Result<Surface> {
        let parts = operands.parts;
        let part = &parts.all[number];
        if !self.covered[number].is_empty() && part.defective.is_none() {
            return Ok(Surface::default());
        }
        let mut left = operands.mesh(number).clone();
        for group in parts.apart(&self.cutters[number]) {
            if task.is_cancelled() {
                return Err(Error::Interrupted);
            }
            let failed = |problem| parts.failed([number, group[0] as usize], names, problem);
            left = match group[..] {
                [one] => left.less(operands.mesh(one as usize), task, failed)?,
                _ => left.less(&operands.joined(&group), task, failed)?,
            };
        }
        Ok(left.surface())
    }
}

/// Parts as the booleans take them, each made once.
struct Operands<'a> {
    bodies: &'a [Body],
    parts: &'a Parts,
    members: Vec<Vec<u32>>,
    meshes: Vec<OnceLock<ClosedMesh>>,
}

impl<'a> Operands<'a> {
    fn new(bodies: &'a [Body], parts: &'a Parts) -> Self {
        let meshes = parts.all.iter().map(|_| OnceLock::new()).collect();
        Self { bodies, parts, members: parts.members(bodies), meshes }
    }

    fn mesh(&self, part: usize) -> &ClosedMesh {
        self.meshes[part].get_or_init(|| self.joined(&[numbers::count(part)]))
    }

    fn joined(&self, parts: &[u32]) -> ClosedMesh {
        let clean = parts.iter().all(|it| self.parts.all[*it as usize].defective.is_none());
        ClosedMesh::of(&self.parts.joined(parts, &self.members, self.bodies), clean)
    }
}

/// Later parts that are taken away from a part.
fn cutters(part: usize, parts: &Parts, meetings: &Meetings, around: &[Vec<Vec<u32>>]) -> Vec<u32> {
    let object = parts.all[part].object;
    let later = |it: &&u32| parts.all[**it as usize].object > object;
    let mut found: Vec<u32> = meetings.of(part).iter().filter(later).copied().collect();
    let number = numbers::count(part);
    let inside = |it: u32| {
        let Some(known) = parts.all.get(it as usize) else { return false };
        let containers = |component: &u32| &around[known.object][*component as usize];
        known.components.iter().any(|component| containers(component).contains(&number))
    };
    let containers = parts.all[part].components.iter().flat_map(|it| &around[object][*it as usize]);
    found.extend(containers.filter(later).filter(|it| inside(**it)));
    found.sort_unstable();
    found.dedup();
    let mut known: HashSet<u32> = found.iter().copied().collect();
    let mut next = 0;
    while let Some(cutter) = found.get(next).copied() {
        for other in meetings.of(cutter as usize).iter().filter(later) {
            if inside(*other) && known.insert(*other) {
                found.push(*other);
            }
        }
        next += 1;
    }
    found.sort_unstable();
    found
}
