//! Heights at which light may change between two lines of a patch, from the geometry of the sample, before the first line.
//!
//! In the image from the source (x in the cell plane, row coordinate) the section of a surface by the plane of a line
//! changes its topology at *critical* heights alone: corners at which the row coordinate has an extremum or a saddle, and
//! places where an outline crosses a border of what counts of a beamlet. Steep facets let light jump over their height,
//! and creases bend it.
//!
//! - `mesh`: corners, crossings, steep facets and creases of meshes.
//! - `shape`: exact shapes, in closed form.

mod mesh;
mod shape;

use crate::sampling::{Lattice, Opening, SampleFacets, ViewContext};
use beamlet_core::numbers;
use beamlet_geometry::{Placed, Sample};
use beamlet_model::scene::Motion;
use glam::DVec3;
use mesh::MeshImage;
use rayon::prelude::*;
use std::ops::Range;

/// Distance from a border of a row within which a jump counts in the row beyond it, rows: above [`super::LEAST_OF_RAYS`].
const BESIDE: f64 = 1e-3;

/// Change of light along z in a patch. Places are row coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Change {
    /// A surface begins, ends, joins or parts.
    Critical(f64),
    /// Light jumps between two heights.
    Jump([f64; 2]),
    /// The slope of light, per row, changes by `weight` of the light of the beamlet at most.
    Crease { row: f64, weight: f64 },
}

/// Change of light in a patch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PatchChange {
    pub beamlet: i64,
    pub row: i64,
    pub change: Change,
}

/// Sample in a view, and what counts of each beamlet.
#[derive(Debug)]
pub(crate) struct SampleImage<'a> {
    sample: &'a Sample,
    facets: &'a SampleFacets,
    motion: Motion,
    pub lattice: &'a Lattice,
    /// Interval of x whose light counts, m in the cell plane, by column of the lattice.
    borders: Vec<[f64; 2]>,
    /// How far these reach beyond the period of a beamlet, m.
    reach: f64,
    /// Error of a recorded value, share of open beam.
    tolerance: f64,
}

/// Point in the image from the source.
#[derive(Debug, Clone, Copy, Default)]
struct ImagePoint {
    /// In the cell plane, m.
    x: f64,
    /// Row coordinate.
    row: f64,
    /// Along the beam, m.
    depth: f64,
}

/// Patches of some rows whose changes are collected.
struct Patches<'a> {
    image: &'a SampleImage<'a>,
    rows: Range<i64>,
    is_wanted: &'a (dyn Fn(i64, i64) -> bool + Sync),
}

/// Changes of light in patches, as they are found.
struct Collector<'a> {
    patches: &'a Patches<'a>,
    found: Vec<PatchChange>,
}

impl<'a> SampleImage<'a> {
    /// Image for lines: the openings of a beamlet, at any mask step of any design, bound what counts.
    pub(super) fn of_lines(view: &ViewContext<'a>) -> Self {
        let lattice = view.lattice;
        let openings = |beamlet| view.responses.openings(lattice.column(beamlet)).widest;
        Self::new(view.sample, view.facets, view.motion, lattice, view.budget.tolerance)
            .with_borders(openings, 0.0)
    }

    /// Image of which whole beamlets count.
    pub(crate) fn new(
        sample: &'a Sample,
        facets: &'a SampleFacets,
        motion: Motion,
        lattice: &'a Lattice,
        tolerance: f64,
    ) -> Self {
        let whole =
            Self { sample, facets, motion, lattice, borders: Vec::new(), reach: 0.0, tolerance };
        whole.with_borders(|_| Vec::new(), 0.0)
    }

    /// The image with other borders: those of the union of the openings of a beamlet, of all of it where there are none,
    /// moved outwards by a width, m.
    pub(crate) fn with_borders(
        mut self,
        openings: impl Fn(i64) -> Vec<Opening>,
        beyond: f64,
    ) -> Self {
        let half = 0.5 * self.lattice.period;
        let borders = self.lattice.beamlets.clone().map(|beamlet| {
            let openings = openings(beamlet);
            let ends = openings.iter().map(|it| it.x.map(f64::from));
            let union = ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
            let [low, high] = union.unwrap_or([-half, half]);
            [low - beyond, high + beyond].map(|x| self.lattice.centre(beamlet) + x)
        });
        self.borders = borders.collect();
        self.reach = beyond;
        self
    }

    /// Changes of light in patches (beamlet, row) of some rows, of the components that are selected.
    pub(crate) fn changes(
        &self,
        rows: Range<i64>,
        is_selected: &[bool],
        is_wanted: &(dyn Fn(i64, i64) -> bool + Sync),
    ) -> Vec<PatchChange> {
        let patches = Patches { image: self, rows, is_wanted };
        let mut all = self.changes_of_own(is_selected, &patches);
        let placed = self.sample.placed.par_iter().filter(|it| {
            let prototype = &self.sample.prototypes[it.prototype as usize];
            let components = it.component as usize..;
            components.take(prototype.components.len()).any(|component| is_selected[component])
        });
        all.par_extend(placed.flat_map_iter(|placed| self.changes_of_placed(placed, &patches)));
        all
    }

    /// Changes by a mesh or an exact shape in its place.
    fn changes_of_placed(&self, placed: &Placed, patches: &Patches<'_>) -> Vec<PatchChange> {
        let prototype = &self.sample.prototypes[placed.prototype as usize];
        if let Some(shape) = prototype.shape {
            return patches.changes_of_shape(shape, placed);
        }
        let corners = prototype.vertices.iter();
        let corners = corners.map(|it| self.project(placed.place.world_from_own(*it)));
        let image = MeshImage {
            corners: corners.collect(),
            triangles: &prototype.triangles,
            across: &prototype.across,
        };
        image.changes(patches, &|triangle| {
            let component = placed.component + prototype.triangle_component[triangle];
            Some(self.facets.steps[component as usize].mu)
        })
    }

    /// Changes by the triangles of the sample that no prototype has.
    fn changes_of_own(&self, is_selected: &[bool], patches: &Patches<'_>) -> Vec<PatchChange> {
        let sample = self.sample;
        let is_any = sample.triangle_component.par_iter().any(|it| is_selected[*it as usize]);
        if !is_any {
            return Vec::new();
        }
        let corners = sample.vertices.par_iter().map(|it| self.project(DVec3::from_array(*it)));
        let image = MeshImage {
            corners: corners.collect(),
            triangles: &sample.triangles,
            across: &self.facets.across,
        };
        image.changes(patches, &|triangle| {
            let component = sample.triangle_component[triangle] as usize;
            is_selected[component].then(|| self.facets.steps[component].mu)
        })
    }

    /// Image of a point of the sample.
    fn project(&self, point: DVec3) -> ImagePoint {
        self.project_from_beam(self.motion.at(point))
    }

    /// Image of a point of the beam frame.
    fn project_from_beam(&self, point: DVec3) -> ImagePoint {
        let [x, row] = self.lattice.project(point.x, point.y, point.z);
        ImagePoint { x, row, depth: point.y }
    }

    /// Beamlets of which an interval of x counts, with their borders.
    fn beamlets(&self, [low, high]: [f64; 2]) -> impl Iterator<Item = (i64, [f64; 2])> {
        let reach = self.reach;
        let near = self.lattice.beamlets_of([low - reach, high + reach]);
        let with_borders = |beamlet| (beamlet, self.borders[self.lattice.column(beamlet)]);
        near.map(with_borders).filter(move |(_, ends)| high >= ends[0] && low <= ends[1])
    }

    /// Rows per metre along z at the rotation centre.
    fn rows_per_metre(&self) -> f64 {
        self.lattice.project(0.0, 0.0, 0.0)[1] - self.lattice.project(0.0, 0.0, 1.0)[1]
    }
}

impl Patches<'_> {
    /// True if an interval of row coordinates is near the rows.
    fn touch(&self, [low, high]: [f64; 2]) -> bool {
        high >= self.rows.start as f64 - BESIDE && low <= self.rows.end as f64 + BESIDE
    }

    /// The changes that a search adds.
    fn collect(&self, search: impl FnOnce(&mut Collector<'_>)) -> Vec<PatchChange> {
        let mut collector = Collector { patches: self, found: Vec::new() };
        search(&mut collector);
        collector.found
    }
}

impl Collector<'_> {
    /// Adds a change of a beamlet to the patches that it falls on.
    fn add(&mut self, beamlet: i64, change: Change) {
        let Patches { rows, is_wanted, .. } = self.patches;
        let ends = match change {
            Change::Critical(row) | Change::Crease { row, .. } => [row; 2],
            Change::Jump([low, high]) => [low - BESIDE, high + BESIDE],
        };
        let [first, last] = ends.map(|row| numbers::whole::<i64>(row.floor()));
        let rows = first.max(rows.start)..(last + 1).min(rows.end);
        let rows = rows.filter(|row| is_wanted(beamlet, *row));
        self.found.extend(rows.map(|row| PatchChange { beamlet, row, change }));
    }

    /// Adds a change of all beamlets of which an interval of x counts.
    fn add_to_beamlets(&mut self, x: [f64; 2], change: Change) {
        for (beamlet, _) in self.patches.image.beamlets(x) {
            self.add(beamlet, change);
        }
    }
}
