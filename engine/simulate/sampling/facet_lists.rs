//! Facets of the sample by patch: candidates for its rays, and whether a silhouette crosses it.

use super::crowding::{bundles, curved};
use super::lattice::Lattice;
use super::patch_facet::PatchFacet;
use super::patch_grid::PatchGrid;
use super::sample_facets::SampleFacets;
use super::touched::touched;
use super::view_context::ViewContext;
use beamlet_core::numbers;
use beamlet_geometry::{FacetOf, Sample};
use beamlet_model::scene::Motion;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Patches with more facets than this are sampled by rays alone: their facets are finer than any
/// rectangle, and sums over them take longer than rays.
pub(super) const MOST_FACETS: u32 = 1024;
/// Number of the facets of a patch that is left to rays.
const CROWDED: u32 = 1 << 31;
/// Triangles that one task takes.
const TRIANGLES_OF_A_TASK: usize = 1 << 12;

/// Facets of a view in the beam frame.
#[derive(Clone, Copy)]
pub(super) struct Triangles<'a> {
    sample: &'a Sample,
    facets: &'a SampleFacets,
    lattice: &'a Lattice,
    motion: Motion,
    source: DVec3,
}

impl<'a> Triangles<'a> {
    pub(super) const fn of(view: &ViewContext<'a>) -> Self {
        Self {
            sample: view.sample,
            facets: view.facets,
            lattice: view.lattice,
            motion: view.motion,
            source: DVec3::new(0.0, -view.optics.rotation, 0.0),
        }
    }

    /// Place of the source.
    pub(super) const fn source(&self) -> DVec3 {
        self.source
    }

    pub(super) fn corners(&self, facet: FacetOf) -> [DVec3; 3] {
        self.sample.corners(facet).map(|corner| self.motion.at(corner))
    }

    pub(super) fn is_front(&self, corners: &[DVec3; 3]) -> bool {
        let [a, b, c] = *corners;
        (b - a).cross(c - a).dot(a - self.source) < 0.0
    }

    /// True for each edge that is a silhouette: the facet across faces the other way.
    fn silhouettes(&self, facet: FacetOf, front: bool) -> [bool; 3] {
        let differs = |other: FacetOf| self.is_front(&self.corners(other)) != front;
        self.beside(facet).map(|other| other.is_none_or(differs))
    }

    /// The facets across the edges of one; none at an open edge.
    pub(super) fn beside(&self, facet: FacetOf) -> [Option<FacetOf>; 3] {
        let known = |other: u32| (other != u32::MAX).then_some(other as usize);
        match facet {
            FacetOf::Sample(triangle) => {
                self.facets.across[triangle].map(|other| known(other).map(FacetOf::Sample))
            }
            FacetOf::Placed(placed, triangle) => {
                let prototype =
                    &self.sample.prototypes[self.sample.placed[placed].prototype as usize];
                prototype.across[triangle]
                    .map(|other| known(other).map(|other| FacetOf::Placed(placed, other)))
            }
        }
    }

    /// Calls `visit` with the facets of the components that are not left out.
    pub(super) fn each(&self, left_out: &[bool], visit: &Visit<'_>) {
        let tasks = self.sample.triangles.len().div_ceil(TRIANGLES_OF_A_TASK);
        let take = |number: u32, facet: FacetOf| {
            let corners = self.corners(facet);
            visit((number, facet), &corners, &self.project(&corners));
        };
        (0..tasks).into_par_iter().for_each(|task| {
            let first = task * TRIANGLES_OF_A_TASK;
            let end = (first + TRIANGLES_OF_A_TASK).min(self.sample.triangles.len());
            for triangle in first..end {
                if !left_out[self.sample.triangle_component[triangle] as usize] {
                    take(numbers::count(triangle), FacetOf::Sample(triangle));
                }
            }
        });
        self.facets.numbers.placed().par_bridge().for_each(|(at, first)| {
            let placed = &self.sample.placed[at];
            let prototype = &self.sample.prototypes[placed.prototype as usize];
            for (number, (triangle, component)) in
                (numbers::low_word(first)..).zip(prototype.triangle_component.iter().enumerate())
            {
                if !left_out[(placed.component + component) as usize] {
                    take(number, FacetOf::Placed(at, triangle));
                }
            }
        });
    }

    /// x in the cell plane and row coordinate.
    fn project(&self, corners: &[DVec3; 3]) -> [[f64; 2]; 3] {
        corners.map(|p| self.lattice.project(p.x, p.y, p.z))
    }
}

/// Takes a facet: its number, its corners in the beam frame, and where they project to.
pub(super) type Visit<'v> = dyn Fn((u32, FacetOf), &[DVec3; 3], &[[f64; 2]; 3]) + Sync + 'v;

/// Facets of the patches of some rows.
pub(super) struct FacetLists<'a> {
    triangles: Triangles<'a>,
    grid: PatchGrid,
    /// End of the list of each patch, by row and beamlet; lists follow one another.
    ends: Vec<u32>,
    /// Patches with more facets than lists hold.
    crowded: Vec<bool>,
    silhouettes: Vec<bool>,
    list: Vec<u32>,
}

impl<'a> FacetLists<'a> {
    /// Lists of a view; nothing where its facets are too many to be listed.
    pub(super) fn new(view: &ViewContext<'a>, rows: &Range<i64>) -> Option<Self> {
        let facets = view.facets;
        let lattice = view.lattice;
        let triangles = Triangles::of(view);
        let grid = PatchGrid { rows: rows.clone(), beamlets: lattice.beamlets.clone() };
        let patches = grid.count();
        let counts: Vec<AtomicU32> = (0..patches).map(|_| AtomicU32::new(0)).collect();
        let silhouettes: Vec<AtomicBool> = (0..patches).map(|_| AtomicBool::new(false)).collect();
        let (mut crowded, left_out) = bundles(view, &grid);
        curved(view, &grid, &mut crowded);
        triangles.each(&left_out, &|(_, facet), corners, places| {
            let mut met = false;
            let by_rays = facets.by_rays[view.sample.component_of(facet) as usize];
            touched(lattice, rows, places, |row, beamlets| {
                met = true;
                for patch in grid.in_row(row, beamlets) {
                    if by_rays {
                        counts[patch].fetch_or(CROWDED, Ordering::Relaxed);
                    } else {
                        counts[patch].fetch_add(1, Ordering::Relaxed);
                    }
                }
            });
            if !met {
                return;
            }
            let edges = triangles.silhouettes(facet, triangles.is_front(corners));
            for (edge, _) in edges.iter().enumerate().filter(|(_, is)| **is) {
                let ends = [places[(edge + 1) % 3], places[(edge + 2) % 3]];
                touched(lattice, rows, &ends, |row, beamlets| {
                    for patch in grid.in_row(row, beamlets) {
                        silhouettes[patch].store(true, Ordering::Relaxed);
                    }
                });
            }
        });
        for (crowded, count) in crowded.iter_mut().zip(&counts) {
            *crowded |= count.load(Ordering::Relaxed) > MOST_FACETS;
        }
        let mut total = 0_u32;
        for (count, crowded) in counts.iter().zip(&crowded) {
            let own = if *crowded { 0 } else { count.load(Ordering::Relaxed) };
            count.store(total, Ordering::Relaxed);
            total = total.checked_add(own)?;
        }
        let list: Vec<AtomicU32> = (0..total).map(|_| AtomicU32::new(0)).collect();
        triangles.each(&left_out, &|(number, _), _, places| {
            touched(lattice, rows, places, |row, beamlets| {
                for patch in grid.in_row(row, beamlets) {
                    if !crowded[patch] {
                        let place = counts[patch].fetch_add(1, Ordering::Relaxed);
                        list[place as usize].store(number, Ordering::Relaxed);
                    }
                }
            });
        });
        Some(Self {
            triangles,
            grid,
            ends: counts.into_iter().map(AtomicU32::into_inner).collect(),
            crowded,
            silhouettes: silhouettes.into_iter().map(AtomicBool::into_inner).collect(),
            list: list.into_iter().map(AtomicU32::into_inner).collect(),
        })
    }

    /// True if a silhouette crosses a patch.
    pub(super) fn has_silhouette(&self, beamlet: i64, row: i64) -> bool {
        self.grid
            .index(beamlet, row)
            .is_none_or(|index| self.silhouettes[index] || self.crowded[index])
    }

    /// Number of the facets of a patch that are listed.
    pub(super) fn count(&self, beamlet: i64, row: i64) -> usize {
        self.grid.index(beamlet, row).map_or(0, |index| self.range(index).len())
    }

    fn range(&self, index: usize) -> Range<usize> {
        let begin = index.checked_sub(1).map_or(0, |before| self.ends[before]);
        begin as usize..self.ends[index] as usize
    }

    /// The facets of a patch in the order of the mesh; nothing where they are too many.
    pub(super) fn facets(&self, beamlet: i64, row: i64) -> Option<Vec<PatchFacet>> {
        let index = self.grid.index(beamlet, row)?;
        if self.crowded[index] {
            return None;
        }
        let mut list = self.list[self.range(index)].to_vec();
        list.sort_unstable();
        let centre = self.triangles.lattice.centre(beamlet);
        let facet = |number: &u32| {
            let of = self.triangles.facets.numbers.of(self.triangles.sample, *number);
            let corners = self.triangles.corners(of);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let front = self.triangles.is_front(&corners);
            let y = corners.map(|corner| corner.y);
            let mut facet = PatchFacet {
                edges: [[0.0; 3]; 3],
                corners: self
                    .triangles
                    .project(&corners)
                    .map(|[x, z]| [x - centre, z - row as f64]),
                normal,
                plane: normal.dot(a),
                depth: [
                    y.into_iter().fold(f64::INFINITY, f64::min),
                    y.into_iter().fold(f64::NEG_INFINITY, f64::max),
                ],
                component: self.triangles.sample.component_of(of),
                front,
                silhouette: self.triangles.silhouettes(of, front),
            };
            facet.set_edges();
            facet
        };
        Some(list.iter().map(facet).collect())
    }
}
