//! Facets that base rays may miss: narrow in the picture, and bending light unlike the facets beside them, as
//! walls along the beam.

use super::crowding::bundles;
use super::patch_grid::PatchGrid;
use super::touched::touched;
use super::triangles::Triangles;
use super::view_context::ViewContext;
use beamlet_core::numbers::single;
use beamlet_geometry::FacetOf;
use beamlet_interface::RefinedWall;
use glam::{DVec2, DVec3};
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Light of a facet below which it is left out, share of the budget of a patch.
const FAINT: f64 = 0.1;
/// Most facets of a patch: those with the most light.
const MOST_WALLS: usize = 64;
/// Least cosine of incidence, for quotients.
const LEAST_COSINE: f64 = 1e-9;

/// Facets by patch.
#[derive(Debug)]
pub(crate) struct Walls {
    grid: PatchGrid,
    /// Facets of each patch, in its coordinates.
    walls: Vec<Vec<RefinedWall>>,
}

impl Walls {
    /// Facets of the patches of some rows that are narrower than base rectangles, of which a patch has `base` along
    /// x and z.
    pub(crate) fn new(view: &ViewContext<'_>, rows: &Range<i64>, base: [u32; 2]) -> Self {
        let lattice = view.lattice;
        let grid = PatchGrid { rows: rows.clone(), beamlets: lattice.beamlets.clone() };
        let mut walls = vec![Vec::new(); grid.count()];
        let finder = Finder { view, triangles: Triangles::of(view), base };
        let (crowded, left_out) = bundles(view, &grid);
        let found = Mutex::new(Vec::new());
        finder.triangles.each(&left_out, &|(number, facet), corners, places| {
            let Some(wall) = finder.wall(facet, corners, places) else { return };
            touched(lattice, rows, places, |row, beamlets| {
                let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
                found.extend(grid.in_row(row, beamlets).map(|at| (at, number, wall)));
            });
        });
        for (at, number, wall) in found.into_inner().unwrap_or_else(PoisonError::into_inner) {
            if !crowded[at] {
                walls[at].push((number, wall));
            }
        }
        let of_patch = |(at, mut walls): (usize, Vec<(u32, Wall)>)| {
            walls.sort_unstable_by(|a, b| b.1.light.total_cmp(&a.1.light).then(a.0.cmp(&b.0)));
            walls.truncate(MOST_WALLS);
            let (beamlet, row) = grid.place(at);
            let place = [lattice.centre(beamlet), row as f64];
            walls.iter().map(|(_, wall)| wall.from(place)).collect()
        };
        let walls = walls.into_iter().enumerate().map(of_patch).collect();
        Self { grid, walls }
    }

    /// Facets of a patch.
    pub(crate) fn of(&self, beamlet: i64, row: i64) -> &[RefinedWall] {
        self.grid.index(beamlet, row).map_or(&[], |at| &self.walls[at])
    }
}

/// A narrow facet: the ends of its longest side (x in the cell plane, m, and row coordinate), its width across that
/// side, m, and the light that it bends, m times rows.
#[derive(Debug, Clone, Copy)]
struct Wall {
    ends: [[f64; 2]; 2],
    width: f64,
    light: f64,
}

impl Wall {
    /// The facet from the middle of a beamlet and the upper end of a row.
    fn from(&self, [x, row]: [f64; 2]) -> RefinedWall {
        let [[from_x, from_z], [to_x, to_z]] =
            self.ends.map(|[px, pz]| [single(px - x), single(pz - row)]);
        let (width, light) = (single(self.width), single(self.light));
        RefinedWall { from_x, from_z, to_x, to_z, width, light }
    }
}

/// Finds narrow facets.
struct Finder<'f> {
    view: &'f ViewContext<'f>,
    triangles: Triangles<'f>,
    /// Base rectangles of a patch.
    base: [u32; 2],
}

impl Finder<'_> {
    /// The facet, if it is narrow and has light.
    fn wall(&self, facet: FacetOf, corners: &[DVec3; 3], places: &[[f64; 2]; 3]) -> Option<Wall> {
        let lattice = self.view.lattice;
        let row_height = lattice.detector.pitch_at(1, lattice.plane);
        let metric = places.map(|[x, z]| DVec2::new(x, z * row_height));
        let sides = [[1, 2], [2, 0], [0, 1]];
        let length = |side: &[usize; 2]| metric[side[0]].distance(metric[side[1]]);
        let longest = sides.into_iter().max_by(|a, b| length(a).total_cmp(&length(b)))?;
        let along = (metric[longest[1]] - metric[longest[0]]).normalize_or_zero();
        let area = 0.5 * (metric[1] - metric[0]).perp_dot(metric[2] - metric[0]).abs();
        let light = area / row_height;
        let budget = self.view.budget.light / f64::from(self.view.response.weight);
        let width = 2.0 * area / length(&longest);
        let [columns, lines] = self.base.map(f64::from);
        let base = along.y.abs() * lattice.period / columns + along.x.abs() * row_height / lines;
        if light <= FAINT * budget || width >= base {
            return None;
        }
        let light = light * self.strength(facet, corners);
        let ends = longest.map(|corner| places[corner]);
        (light > FAINT * budget).then_some(Wall { ends, width, light })
    }

    /// Share of its light that a facet bends out of the light beside it, at most.
    fn strength(&self, facet: FacetOf, corners: &[DVec3; 3]) -> f64 {
        let view = self.view;
        let component = view.sample.component_of(facet);
        let delta = view.facets.steps[component as usize].delta;
        let own = self.bend(corners);
        let front = self.triangles.is_front(corners);
        let differs = self.triangles.beside(facet).map(|other| {
            // Across a silhouette the light beside it does not cross this surface.
            let corners = other.map(|other| self.triangles.corners(other));
            let same = corners.filter(|corners| self.triangles.is_front(corners) == front);
            own - same.map_or(DVec2::ZERO, |corners| self.bend(&corners))
        });
        let lever = view.optics.analyser_place() - corners.iter().map(|it| it.y).sum::<f64>() / 3.0;
        let pitch = view.optics.detector.pitch[1];
        let steepest = view.response.steepest();
        let light = |differs: DVec2| {
            let moved = delta.abs() * differs.abs();
            moved.x * lever * steepest + moved.y * (lever + view.optics.gap()) / pitch
        };
        differs.map(light).into_iter().fold(0.0, f64::max).min(1.0)
    }

    /// Deflection of light at a facet per step of delta, along x and z.
    fn bend(&self, [a, b, c]: &[DVec3; 3]) -> DVec2 {
        let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
        let ray = ((*a + *b + *c) / 3.0 - self.triangles.source()).normalize_or_zero();
        let cosine = normal.dot(ray);
        let across = (normal - ray * cosine) / cosine.abs().max(LEAST_COSINE);
        DVec2::new(across.x, across.z)
    }
}
