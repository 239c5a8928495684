//! Beamlets that may cross the sample: shadows of its components on the detector.

use super::lattice::Lattice;
use beamlet_core::numbers;
use beamlet_geometry::{Component, Lids, Placed, Sample};
use beamlet_model::scene::Motion;
use glam::DVec3;
use std::ops::Range;

/// Shadow of one component from the source centre: a rectangle, and how fine it may be inside.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ProjectedBounds {
    /// x in the cell plane, m.
    pub x: [f64; 2],
    /// Row coordinates, downwards.
    pub rows: [f64; 2],
    /// Half of its mean chord along x, m in the cell plane: cells that are wider may step over it.
    pub width: f64,
    /// Half of its mean chord along z, rows.
    pub height: f64,
    /// Row coordinates of its surfaces that are not upright: light thrown out of its row comes from
    /// there.
    pub lids: Lids,
    /// True if its surface is rough.
    pub rough: bool,
}

impl ProjectedBounds {
    /// Rows among `rows` that it touches and whose light may be recorded: of others than the recorded ones only where it
    /// throws light out of its row.
    pub(crate) fn rows_that_count(
        &self,
        lattice: &Lattice,
        recorded: &Range<i64>,
        rows: &Range<i64>,
    ) -> impl Iterator<Item = i64> {
        let [own, _] = self.patches(lattice);
        let touched = own.start.max(rows.start)..own.end.min(rows.end);
        touched.filter(move |row| {
            recorded.contains(row) || (row - 1..=row + 1).any(|row| self.throws(row))
        })
    }

    /// True if it may throw light out of a row: it has surfaces there that are not upright.
    pub(crate) fn throws(&self, row: i64) -> bool {
        let (top, bottom) = (row as f64, (row + 1) as f64);
        self.lids.iter().any(|[first, last]| *first <= bottom && *last >= top)
    }

    /// Rows (of any number) and beamlets of the lattice whose patches it touches.
    pub(crate) fn patches(&self, lattice: &Lattice) -> [Range<i64>; 2] {
        let [top, bottom] = self.rows.map(|row| numbers::whole::<i64>(row.floor()));
        [top..bottom + 1, lattice.beamlets_of(self.x)]
    }
}

/// True if a ray from anywhere on the spot to a pixel can cross one of the shadows.
pub(crate) fn touches_pixel(
    bounds: &[ProjectedBounds],
    lattice: &Lattice,
    [column, row]: [i64; 2],
) -> bool {
    let (column, row) = (column as f64, row as f64);
    let [reach, reach_rows] = lattice.blur;
    bounds.iter().any(|s| {
        let at = |x: f64| lattice.detector.column_at(x, lattice.plane);
        at(s.x[0]) - reach <= column + 1.0
            && at(s.x[1]) + reach >= column
            && s.rows[0] - reach_rows <= row + 1.0
            && s.rows[1] + reach_rows >= row
    })
}

/// Largest distance of rays that hides no component, over its mean chord: at half of it, two rays cross
/// the component wherever it is thicker than its mean.
const CHORD_SHARE: f64 = 0.5;

/// Shadows of all components in a view.
pub(crate) fn projected_bounds(
    sample: &Sample,
    lattice: &Lattice,
    motion: &Motion,
) -> Vec<ProjectedBounds> {
    let scale = lattice.project(1.0, 0.0, 0.0)[0];
    let rows_per_metre = lattice.project(0.0, 0.0, 0.0)[1] - lattice.project(0.0, 0.0, 1.0)[1];
    let may_hide = |c: &Component| {
        let least = CHORD_SHARE * least_chord(c);
        least * scale < lattice.period || least * rows_per_metre < 1.0
    };
    let chords = mean_chords(sample, motion.rows(), may_hide);
    sample
        .components
        .iter()
        .zip(chords)
        .map(|(component, [chord_x, chord_z])| {
            let [low, high] = component.bounds;
            let mut x = [f64::INFINITY, f64::NEG_INFINITY];
            let mut rows = x;
            let mut lids = [x; 2];
            let project = |x, y, z| {
                let [x, y, z] = motion.point([x, y, z]);
                lattice.project(x, y, z)
            };
            for corner in 0..4 {
                let pick =
                    |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                let (wx, wy) = (pick(0), pick(1));
                for z in [low[2], high[2]] {
                    let [px, row] = project(wx, wy, z);
                    x = [x[0].min(px), x[1].max(px)];
                    rows = [rows[0].min(row), rows[1].max(row)];
                }
                for (lid, range) in lids.iter_mut().zip(component.lids.unwrap_or_default()) {
                    for z in range {
                        let [_, row] = project(wx, wy, z);
                        *lid = [lid[0].min(row), lid[1].max(row)];
                    }
                }
            }
            // Upright walls lean in views that tilt the sample. Rough ones throw light up and down:
            // beyond the next row it counts.
            let leans = lattice.halo as f64 * component.leans > 1.0;
            if component.lids.is_none() || leans || !motion.keeps_upright() {
                lids = [rows; 2];
            }
            ProjectedBounds {
                x,
                rows,
                width: CHORD_SHARE * chord_x * scale,
                height: CHORD_SHARE * chord_z * rows_per_metre,
                lids,
                rough: component.leans > 0.0,
            }
        })
        .collect()
}

/// Mean chord of a component is at least this in every direction: at most half of its area
/// shows on either side (Cauchy).
fn least_chord(component: &Component) -> f64 {
    2.0 * component.volume.abs() / component.area
}

/// Mean chord of each component along x and z of the beam frame: volume over projected area (Cauchy). Of components that
/// cannot hide the chords are the least in any direction, which says as much and needs no walk over millions of triangles
/// in every view.
fn mean_chords(
    sample: &Sample,
    [x, _, z]: [DVec3; 3],
    may_hide: impl Fn(&Component) -> bool,
) -> Vec<[f64; 2]> {
    let hide: Vec<bool> = sample.components.iter().map(may_hide).collect();
    let mut areas = vec![[0.0_f64; 2]; sample.components.len()];
    if hide.contains(&true) {
        for (t, &component) in sample.triangles.iter().zip(&sample.triangle_component) {
            if !hide[component as usize] {
                continue;
            }
            let [a, b, c] = t.map(|v| DVec3::from_array(sample.vertices[v as usize]));
            let area = 0.5 * (b - a).cross(c - a);
            let sum = &mut areas[component as usize];
            sum[0] += 0.5 * area.dot(x).abs();
            sum[1] += 0.5 * area.dot(z).abs();
        }
        let mut known: Option<(&Placed, Vec<[f64; 2]>)> = None;
        for placed in &sample.placed {
            let same = known.as_ref().filter(|(other, _)| other.shows_the_same(placed));
            let shown = match same {
                Some((_, shown)) => shown.clone(),
                None => sample.projected_areas(placed, [x, z]),
            };
            let scale = placed.place.scale * placed.place.scale;
            for (component, shown) in (placed.component as usize..).zip(&shown) {
                if hide[component] {
                    areas[component] = shown.map(|area| area * scale);
                }
            }
            known = Some((placed, shown));
        }
    }
    sample
        .components
        .iter()
        .zip(areas)
        .zip(hide)
        .map(
            |((c, [ax, az]), hide)| {
                if hide { [c.volume.abs() / ax, c.volume.abs() / az] } else { [least_chord(c); 2] }
            },
        )
        .collect()
}
