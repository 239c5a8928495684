//! Adaptive refinement of the patches of some rows: trace, judge, split where the error is, until
//! every budget holds. All patches ask for their rays together, so that the device gets many.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

use super::alignment::Scanlines;
use super::base_lattice::{BaseLattice, ROWS_TOGETHER};
use super::cell_batch::{Strips, blank_strips, empty_cell};
use super::cell_moments::CellMoments;
use super::emission::Emitter;
use super::error_estimate::{CellError, ErrorBudget, Estimator, Narrow};
use super::lattice::Lattice;
use super::moment_recording::Keep;
use super::patch::{Patch, alike};
use super::projected_bounds::Shadow;
use super::response::{Opening, Response};
use crate::Result;
use crate::gpu::interface::{Law, MOMENTS_PER_MATERIAL, Ray};
use crate::scene::Scene;
use crate::trace::Tracer;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Least width of a rectangle, m: coordinates in f32 are as coarse.
const LEAST_WIDTH: f32 = 2e-9;
/// Least height of a rectangle, rows.
const LEAST_HEIGHT: f32 = 1.0 / 8192.0;
/// Most silhouettes of a patch that its rectangles are aligned with.
const MOST_ALIGNED: u32 = 8;
/// Most that rectangles slant over a row, periods.
const MOST_SHEAR: f32 = 2.0;
/// Lines of rectangles that a patch with silhouettes begins with.
const LINES: u32 = 3;
/// Leaves of a patch that memory is reckoned for.
const LEAVES_OF_A_PATCH: usize = 256;
/// Strips without a sample that are handed over at once.
const BLANK_AT_ONCE: usize = 1 << 12;

/// What the cells of a view are made from.
#[derive(Debug)]
pub struct View<'a> {
    /// The scene that is traced.
    pub scene: &'a Scene,
    /// Its lattice.
    pub lattice: &'a Lattice,
    /// Index of the view.
    pub index: u32,
    /// Projected bounds of the components.
    pub shadows: &'a [Shadow],
    /// Keep the moments of the rays, for other energies or masks.
    pub keep: Option<&'a Keep>,
    /// What changes of a law do to recorded values.
    pub response: &'a Response,
    /// What sampling may leave.
    pub budget: ErrorBudget,
}

impl View<'_> {
    /// The ray through a place of a beamlet (m from its centre) and row (share of it).
    pub(super) fn ray(&self, beamlet: i64, row: i64, x: f32, z: f32) -> Ray {
        self.lattice.ray(beamlet, f64::from(x), row as f64 + f64::from(z), self.index)
    }

    /// How much farther than its law says light may land, at another energy.
    pub(super) fn stronger(&self) -> f64 {
        self.keep.map_or(1.0, |keep| keep.stronger)
    }
}

/// Takes strips as they are ready; may trace with the tracer that it is lent.
pub type Take<'a> = &'a mut dyn FnMut(&mut Tracer, &Strips) -> Result<()>;

/// A patch in refinement.
#[derive(Debug)]
struct Work {
    patch: Patch,
    openings: Vec<Opening>,
    narrow: Vec<Narrow>,
    rays: u32,
    /// Estimated error of the recorded value that has the largest.
    light: f64,
    /// Splits to be traced, and the first node that they make.
    first_new: usize,
    places: Vec<[f32; 2]>,
    errors: Vec<Option<CellError>>,
    done: bool,
}

/// Samples the patches of some rows and hands their cells to `take`, in parts. `lit`: the rows from
/// which undeflected light matters; what neither stands nor lands there is left out. About
/// `rays_at_once` rays are in memory at a time. The cells, but not their order, are the same
/// whatever `rows` and `rays_at_once` are.
///
/// # Errors
/// As [`Tracer::trace`]; those of `take`.
pub fn sample_rows(
    view: &View<'_>,
    tracer: &mut Tracer,
    rows: Range<i64>,
    lit: &Range<i64>,
    rays_at_once: usize,
    take: Take<'_>,
) -> Result<()> {
    let base = BaseLattice::trace(view, tracer, &rows)?;
    let narrow = narrow_components(view, &rows, base.base);
    let mut blank = Vec::new();
    let mut waiting = Vec::new();
    let first_beamlet = view.lattice.beamlets.start;
    for block in blocks(&rows) {
        for beamlet in view.lattice.beamlets.clone() {
            for row in block.clone() {
                let direct = lit.contains(&row) && view.lattice.direct.contains(&beamlet);
                match base.patch(beamlet, row) {
                    Some(_) => waiting.push((beamlet, row)),
                    None if direct => blank.push((beamlet - first_beamlet, row)),
                    None => {}
                }
            }
        }
    }
    let refiner = Refiner::new(view, &base, narrow, lit);
    for chunk in waiting.chunks((rays_at_once / LEAVES_OF_A_PATCH).max(1)) {
        let mut work: Vec<Work> = chunk.par_iter().filter_map(|at| refiner.begin(*at)).collect();
        refiner.align(tracer, &mut work)?;
        refiner.refine(tracer, &mut work)?;
        let emitter = Emitter::new(view, &refiner.estimator, lit);
        let patches: Vec<&Patch> = work.iter().map(|work| &work.patch).collect();
        let (mut strips, empty) = emitter.cells(tracer, &patches)?;
        blank.extend(empty.into_iter().filter(|(column, row)| {
            lit.contains(row) && view.lattice.direct.contains(&(column + first_beamlet))
        }));
        for work in &work {
            strips.splits += u64::from(work.patch.splits);
            strips.estimate.add(work.light, work.rays, view.budget.light);
        }
        strips.balance();
        take(tracer, &strips)?;
    }
    let cell = empty_cell(view.lattice);
    let words = if view.keep.is_some() { tracer.materials() * MOMENTS_PER_MATERIAL } else { 0 };
    let none = CellMoments { ends: vec![0.0; 2 * words], ..CellMoments::default() };
    for strips in blank_strips(view.lattice, blank).chunks(BLANK_AT_ONCE) {
        let mut part = Strips::default();
        strips.iter().for_each(|strip| part.push(*strip, &[cell], &none));
        take(tracer, &part)?;
    }
    Ok(())
}

/// Rows whose rays go side by side.
fn blocks(rows: &Range<i64>) -> impl Iterator<Item = Range<i64>> {
    let end = rows.end;
    rows.clone()
        .step_by(ROWS_TOGETHER as usize)
        .map(move |first| first..(first + ROWS_TOGETHER).min(end))
}

/// By beamlet and row the components that may hide between base rays, in coordinates of the patch.
fn narrow_components(
    view: &View<'_>,
    rows: &Range<i64>,
    base: [u32; 2],
) -> HashMap<(i64, i64), Vec<Narrow>> {
    let lattice = view.lattice;
    let cell = [lattice.period / f64::from(base[0]), 1.0 / f64::from(base[1])];
    let mut all: HashMap<(i64, i64), Vec<Narrow>> = HashMap::new();
    for shadow in view.shadows {
        if shadow.width >= cell[0] && shadow.height >= cell[1] {
            continue;
        }
        let [top, bottom] = shadow.rows.map(|row| row.floor() as i64);
        for row in top.max(rows.start)..(bottom + 1).min(rows.end) {
            for beamlet in lattice.beamlets_of(shadow.x) {
                let centre = lattice.centre(beamlet);
                all.entry((beamlet, row)).or_default().push(Narrow {
                    x: shadow.x.map(|x| (x - centre) as f32),
                    z: shadow.rows.map(|z| (z - row as f64) as f32),
                    width: shadow.width as f32,
                    height: shadow.height as f32,
                });
            }
        }
    }
    all
}

/// Refines patches.
struct Refiner<'a> {
    view: &'a View<'a>,
    estimator: Estimator<'a>,
    narrow: HashMap<(i64, i64), Vec<Narrow>>,
    lit: &'a Range<i64>,
}

impl<'a> Refiner<'a> {
    fn new(
        view: &'a View<'a>,
        base: &'a BaseLattice,
        narrow: HashMap<(i64, i64), Vec<Narrow>>,
        lit: &'a Range<i64>,
    ) -> Self {
        let scene = view.scene;
        let row_pitch = scene.detector.pitch[1];
        let estimator = Estimator {
            response: view.response,
            budget: view.budget,
            base,
            first_beamlet: view.lattice.beamlets.start,
            least: [LEAST_WIDTH, LEAST_HEIGHT],
            row_height: (row_pitch * view.lattice.plane / scene.detector.distance) as f32,
            row_pitch: row_pitch as f32,
            gap: (scene.detector.distance - scene.analyser_distance()) as f32,
            // Of the whole detector, so that cells do not depend on bands.
            lit: -view.lattice.blur_rows
                ..i64::from(scene.detector.pixels[1]) + view.lattice.blur_rows,
        };
        Self { view, estimator, narrow, lit }
    }

    /// A patch with its base rays; nothing where no light of it can reach the lit rows.
    fn begin(&self, (beamlet, row): (i64, i64)) -> Option<Work> {
        let base = self.estimator.base;
        let laws = base.patch(beamlet, row)?;
        let period = self.view.lattice.period as f32;
        let patch = Patch::new(beamlet, row, period, base.base, laws);
        let narrow = self.narrow.get(&(beamlet, row)).cloned().unwrap_or_default();
        if narrow.is_empty() && self.misses(&patch) {
            return None;
        }
        let column = (beamlet - self.estimator.first_beamlet) as usize;
        Some(Work {
            openings: self.view.response.openings(column),
            narrow,
            rays: laws.len() as u32,
            light: 0.0,
            first_new: 0,
            places: Vec::new(),
            errors: Vec::new(),
            done: false,
            patch,
        })
    }

    /// Whether a patch outside the lit rows is seen to throw no light into them: no silhouette
    /// there or beside it, and no ray that lands half as far off.
    fn misses(&self, patch: &Patch) -> bool {
        let row = patch.row;
        if self.lit.contains(&row) {
            return false;
        }
        let first = &patch.nodes[0].law;
        let smooth = patch.nodes.iter().all(|node| {
            let neighbours = self.estimator.neighbours(patch, node);
            neighbours.iter().flatten().all(|found| alike(&found.law, first))
        });
        let reach = patch
            .nodes
            .iter()
            .map(|node| (node.law.displacement_z + node.law.slope_z * self.estimator.gap).abs());
        let rows = f64::from(2.0 * reach.fold(0.0, f32::max) / self.estimator.row_pitch);
        let rows = (rows * self.view.stronger()).ceil() as i64;
        smooth && (row + rows < self.lit.start || row - rows >= self.lit.end)
    }

    /// Lets the rectangles of patches with silhouettes slant as these do.
    fn align(&self, tracer: &mut Tracer, work: &mut [Work]) -> Result<()> {
        let period = self.view.lattice.period as f32;
        let base = self.estimator.base.base;
        let slants = |work: &&mut Work| {
            let few = |count: u32| count <= MOST_ALIGNED;
            work.narrow.is_empty() && self.silhouettes(&work.patch).is_some_and(few)
        };
        let mut slanting: Vec<(&mut Work, Scanlines)> = work
            .par_iter_mut()
            .filter(slants)
            .map(|work| (work, Scanlines::new(period, base[0])))
            .collect();
        loop {
            let places: Vec<Vec<[f32; 2]>> =
                slanting.par_iter().map(|(_, lines)| lines.pending()).collect();
            if places.iter().all(Vec::is_empty) {
                break;
            }
            let patches = slanting.iter().map(|(work, _)| &work.patch).collect();
            let laws = self.trace(tracer, patches, &places)?;
            for ((work, lines), own) in slanting.iter_mut().zip(&laws) {
                lines.accept(own);
                work.rays += own.len() as u32;
            }
        }
        // Patches with silhouettes begin on three lines whether these slant or not: narrow
        // rectangles learn nothing from the rows above and below.
        for (work, lines) in &mut slanting {
            let most = MOST_SHEAR * period;
            let slant = lines.slant().filter(|slant| slant.shear.abs() <= most);
            let shear = slant.map_or(0.0, |slant| slant.shear);
            let width = period + shear.abs();
            let columns = (width * base[0] as f32 / period).ceil() as u32;
            let base = [columns, LINES * base[1]];
            let Patch { beamlet, row, .. } = work.patch;
            work.errors.clear();
            work.patch = Patch::sheared(beamlet, row, 0.5 * width, shear, base);
            work.patch.straight = slant.is_some_and(|slant| slant.straight);
        }
        let centres = |patch: &Patch| -> Vec<[f32; 2]> {
            patch.nodes.iter().map(|node| patch.place(node.centre())).collect()
        };
        let places: Vec<Vec<[f32; 2]>> =
            slanting.par_iter().map(|(work, _)| centres(&work.patch)).collect();
        let patches = slanting.iter().map(|(work, _)| &work.patch).collect();
        let laws = self.trace(tracer, patches, &places)?;
        for ((work, _), own) in slanting.iter_mut().zip(&laws) {
            work.rays += own.len() as u32;
            for (node, law) in work.patch.nodes.iter_mut().zip(own) {
                node.law = *law;
            }
        }
        Ok(())
    }

    /// Silhouettes between base rays that stand side by side, where there are any in the patch or
    /// around it.
    fn silhouettes(&self, patch: &Patch) -> Option<u32> {
        let mut count = None;
        for node in &patch.nodes {
            let neighbours = self.estimator.neighbours(patch, node);
            for (index, found) in neighbours.iter().enumerate() {
                if found.as_ref().is_some_and(|found| !alike(&found.law, &node.law)) {
                    count = Some(count.unwrap_or(0) + u32::from(index < 3));
                }
            }
        }
        count
    }

    /// Laws of the rays through places of patches, by patch. All go to the device together.
    fn trace(
        &self,
        tracer: &mut Tracer,
        patches: Vec<&Patch>,
        places: &[Vec<[f32; 2]>],
    ) -> Result<Vec<Vec<Law>>> {
        let rays = |(patch, places): (&Patch, &Vec<[f32; 2]>)| -> Vec<Ray> {
            let ray = |[x, z]: &[f32; 2]| self.view.ray(patch.beamlet, patch.row, *x, *z);
            places.iter().map(ray).collect()
        };
        let rays: Vec<Vec<Ray>> = patches.into_par_iter().zip(places).map(rays).collect();
        let laws = tracer.trace(&crate::parallel::concat(&rays))?;
        let mut rest = &laws[..];
        let of_patch = |rays: &Vec<Ray>| {
            let (own, after) = rest.split_at(rays.len());
            rest = after;
            own.to_vec()
        };
        Ok(rays.iter().map(of_patch).collect())
    }

    fn refine(&self, tracer: &mut Tracer, work: &mut [Work]) -> Result<()> {
        loop {
            work.par_iter_mut().filter(|work| !work.done).for_each(|work| self.judge(work));
            let places: Vec<Vec<[f32; 2]>> =
                work.iter_mut().map(|work| std::mem::take(&mut work.places)).collect();
            if places.iter().all(Vec::is_empty) {
                return Ok(());
            }
            let patches = work.iter().map(|work| &work.patch).collect();
            let laws = self.trace(tracer, patches, &places)?;
            for (work, own) in work.iter_mut().zip(&laws) {
                work.patch.set_laws(work.first_new, own);
                work.rays += own.len() as u32;
            }
        }
    }

    /// Judges a patch and splits the rectangles that it is wrong in.
    fn judge(&self, work: &mut Work) {
        let Work { patch, openings, narrow, errors, .. } = work;
        // Neighbours of new rectangles are judged anew.
        for node in &patch.nodes[work.first_new..] {
            for leaf in self.estimator.leaves_beside(patch, node) {
                if let Some(error) = errors.get_mut(leaf as usize) {
                    *error = None;
                }
            }
        }
        let error = self.estimator.judge(patch, openings, narrow, errors);
        work.light = error.light;
        work.first_new = work.patch.nodes.len();
        let left = self.view.budget.max_rays.saturating_sub(work.rays) / 2;
        if error.splits.is_empty() || left == 0 {
            work.done = true;
            return;
        }
        // Rays in the order of x: neighbours meet the same triangles.
        let mut splits = error.splits;
        splits.truncate(left as usize);
        let place = |node: u32| work.patch.nodes[node as usize].x[0];
        splits.sort_unstable_by(|a, b| place(a.0).total_cmp(&place(b.0)).then(a.0.cmp(&b.0)));
        for (node, axis) in splits {
            work.places.extend(work.patch.split(node, axis));
        }
    }
}
