//! The grid of a volume: the field of view, or by the options.

use super::geometry::ScanGeometry;
use super::grid::VolumeGrid;
use beamlet_core::numbers::whole;
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result, setters};

/// Voxels that can be counted: 2^40, 4 TiB.
const MOST: f64 = (1_u64 << 40) as f64;

/// Differences from the grid of the field of view.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct GridChoice {
    /// Side of a voxel, m. `None`: a pixel as the axis of rotation sees it.
    pub voxel: Option<f64>,
    /// Voxels along x, y, z. `None`: the field of view at the axis.
    pub size: Option<[usize; 3]>,
    /// Centre of voxel (0, 0, 0), m. `None`: the volume lies about the axis of rotation and the middle
    /// of the rows.
    pub origin: Option<[f64; 3]>,
}

impl GridChoice {
    setters! {
        /// Sets the side of a voxel, m.
        with_voxel(voxel: impl Into<Option<f64>>);
        /// Sets the voxels along x, y, z.
        with_size(size: impl Into<Option<[usize; 3]>>);
        /// Sets the centre of voxel (0, 0, 0), m.
        with_origin(origin: impl Into<Option<[f64; 3]>>);
    }

    /// The grid for a scan.
    ///
    /// # Errors
    /// [`Error::Argument`] for a grid that cannot be, and for one that no view sees.
    pub fn grid(&self, geometry: &ScanGeometry) -> Result<VolumeGrid> {
        let full = VolumeGrid::of(geometry)?;
        let sides = full.size.iter().zip(full.voxel).map(|(size, side)| *size as f64 * side);
        let field = sides.fold(0.0, f64::max);
        if let Some(side) = self.voxel.filter(|side| *side > field * (1.0 + 1e-9)) {
            let allowed = format!("up to {}, the field of view at the axis", Length.rounded(field));
            return Err(Error::argument("voxel", Length.rounded(side), allowed));
        }
        let voxel = self.voxel.map_or(full.voxel, |side| [side; 3]);
        let size = self.size.unwrap_or_else(|| {
            [0, 1, 2].map(|axis| {
                // One row sees one plane, unless the sample travels.
                if axis == 2 && geometry.rows.len() == 1 && full.size[2] == 1 {
                    return 1;
                }
                let voxels = full.size[axis] as f64 * full.voxel[axis] / voxel[axis];
                whole::<usize>((voxels - 1e-9).ceil().max(1.0))
            })
        });
        let middle = |axis: usize| {
            let [low, high] = full.ends()[axis];
            f64::midpoint(low, high)
        };
        let begin =
            |axis: usize| middle(axis) - voxel[axis] * (size[axis].saturating_sub(1)) as f64 / 2.0;
        let origin = self.origin.unwrap_or_else(|| [0, 1, 2].map(begin));
        let grid = VolumeGrid { size, voxel, origin };
        let voxels: f64 = size.iter().map(|side| *side as f64).product();
        if voxels > MOST {
            let found = format!("{size:?}: {voxels:.3e} voxels");
            return Err(Error::argument(
                "grid",
                found,
                format!("up to {MOST:.3e} voxels: a larger side of the voxel, or a smaller size"),
            ));
        }
        grid.check(geometry)?;
        refuse_unseen(&grid, geometry)?;
        Ok(grid)
    }
}

impl ScanGeometry {
    /// Distances from the axis of rotation at which lines through the outer edges of the first and the
    /// last column pass it, m.
    fn reach(&self) -> [f64; 2] {
        let (per, scale) = (self.per_distance(), self.magnification());
        let half = self.column_pitch() / 2.0;
        let [first, last] = [self.columns[0], self.columns[self.columns.len() - 1]];
        [first - half, last + half].map(|column| {
            let u = column / scale;
            (u - self.axis).abs() / (u * per).mul_add(u * per, 1.0).sqrt()
        })
    }

    /// True if the shadow of the convex hull of some points may reach the detector in a view.
    fn sees(&self, view: usize, points: &[[f64; 3]]) -> bool {
        let (motion, per, scale) = (self.motion(view), self.per_distance(), self.magnification());
        let places = points.iter().map(|point| {
            let [x, y, z] = motion.point(*point);
            [x, z].map(|side| side * scale / (1.0 + y * per))
        });
        let [pitch, height] = [self.column_pitch() / 2.0, self.row_pitch() / 2.0];
        let [columns, rows] = [self.columns.len(), self.rows.len()];
        let detector = [
            [self.columns[0] - pitch, self.columns[columns - 1] + pitch],
            [self.rows[rows - 1] - height, self.rows[0] + height],
        ];
        let places: Vec<[f64; 2]> = places.collect();
        [0, 1].into_iter().all(|side| {
            let [low, high] = detector[side];
            places.iter().any(|place| place[side] >= low)
                && places.iter().any(|place| place[side] <= high)
        })
    }

    /// Distance from the axis up to which every view sees a voxel, in a half-fan one of two opposite views, m.
    pub(super) fn seen_radius(&self) -> f64 {
        let [left, right] = self.reach();
        if self.columns_of_half_fan() > 0 { left.max(right) } else { left.min(right) }
    }

    /// True if the rows of every view of a circle see a height at this distance from the axis, m. One row
    /// sees its plane alone; views that move the sample see a height in turn.
    pub(super) fn rows_see(&self, radius: f64, height: f64) -> bool {
        if self.motions.is_some() || self.rows.len() == 1 {
            return true;
        }
        let (per, half) = (self.per_distance(), self.row_pitch() / 2.0);
        let [top, bottom] = [self.rows[0] + half, self.rows[self.rows.len() - 1] - half];
        // The height is seen largest before the axis, and smallest behind it.
        [-radius, radius].into_iter().all(|depth| {
            let place = height * self.magnification() / (1.0 + depth * per);
            (bottom..=top).contains(&place)
        })
    }
}

/// Refuses a volume outside the field of view of the scan.
fn refuse_unseen(grid: &VolumeGrid, geometry: &ScanGeometry) -> Result<()> {
    if geometry.motions.is_some() {
        return match (0..geometry.angles.len()).any(|view| geometry.sees(view, &grid.corners())) {
            true => Ok(()),
            false => Err(Error::argument("grid", "voxels that no view sees", "voxels in the beam")),
        };
    }
    let per = geometry.per_distance();
    let scale = geometry.magnification();
    let ends = grid.ends();
    let [left, right] = geometry.reach();
    let radius = left.max(right);
    let nearest = |[low, high]: [f64; 2]| {
        if low <= 0.0 && high >= 0.0 { 0.0 } else { low.abs().min(high.abs()) }
    };
    let distance = nearest(ends[0]).hypot(nearest(ends[1]));
    // Rows are seen wider apart behind the axis.
    let half = geometry.row_pitch() / 2.0;
    let [top, bottom] = [geometry.rows[0] + half, geometry.rows[geometry.rows.len() - 1] - half];
    let [near, far] = [1.0 - radius * per, 1.0 + radius * per];
    let highest = (top / scale * near).max(top / scale * far);
    let lowest = (bottom / scale * near).min(bottom / scale * far);
    if distance <= radius && ends[2][0] <= highest && ends[2][1] >= lowest {
        return Ok(());
    }
    let [x, y, z] = ends.map(|[low, high]| format!("{:.4} to {:.4} mm", low * 1e3, high * 1e3));
    let found = format!("voxels at x {x}, y {y}, z {z}");
    let allowed = format!(
        "voxels that the views see: up to {:.4} mm from the axis of rotation, z {:.4} to {:.4} mm",
        radius * 1e3,
        lowest * 1e3,
        highest * 1e3
    );
    Err(Error::argument("grid", found, allowed))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan() -> ScanGeometry {
        let columns = (0..20).map(|n| (f64::from(n) - 9.5) * 2e-4).collect();
        let rows = (0..4).map(|n| (1.5 - f64::from(n)) * 2e-4).collect();
        let angles = (0..90).map(|n| f64::from(4 * n).to_radians()).collect();
        ScanGeometry::new([0.1, 0.2], columns, rows, angles)
    }

    #[track_caller]
    fn assert_near(found: [f64; 3], expected: [f64; 3]) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }

    #[test]
    fn a_chosen_voxel_covers_the_field_of_view() {
        let geometry = scan();
        let full = GridChoice::default().grid(&geometry).unwrap();
        assert_eq!(full, VolumeGrid::of(&geometry).unwrap());
        let grid = GridChoice::default().with_voxel(3e-4).grid(&geometry).unwrap();
        assert_eq!(grid.size, [7, 7, 2]);
        assert_near(grid.origin, [-9e-4, -9e-4, -1.5e-4]);
        let grid = GridChoice::default().with_size([3, 5, 1]).grid(&geometry).unwrap();
        assert_near(grid.origin, [-1e-4, -2e-4, 0.0]);
        let corner = [1e-4, 0.0, -1e-4];
        let grid = GridChoice::default().with_size([3, 5, 1]).with_origin(corner).grid(&geometry);
        assert_near(grid.unwrap().origin, corner);
    }

    #[test]
    fn volumes_that_no_view_sees_are_refused() {
        let geometry = scan();
        let at =
            |origin| GridChoice::default().with_size([2, 2, 2]).with_origin(origin).grid(&geometry);
        assert!(at([9e-4, 0.0, 0.0]).is_ok());
        for origin in [[11e-4, 0.0, 0.0], [-9e-4, -9e-4, 0.0], [0.0, 0.0, 3e-4], [0.0, 0.0, -4e-4]]
        {
            let message = at(origin).unwrap_err().to_string();
            assert!(message.contains("that the views see"), "{message}");
        }
        assert!(GridChoice::default().with_voxel(-1.0).grid(&geometry).is_err());
        let message =
            GridChoice::default().with_voxel(40.0).grid(&geometry).unwrap_err().to_string();
        assert!(message.contains("voxel: found 40 m; allowed: up to 2 mm"), "{message}");
        assert!(GridChoice::default().with_size([0, 1, 1]).grid(&geometry).is_err());
    }
}
