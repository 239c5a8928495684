//! Voxels in space, and their values.

use super::geometry::ScanGeometry;
use super::quantity::Quantity;
use beamlet_core::numbers::whole;
use beamlet_core::{Error, Result};
use ndarray::Array3;

/// Positions of voxels. The axis of rotation is at x = y = 0; z = 0 is the optical axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeGrid {
    /// Voxels along x, y, z.
    pub size: [usize; 3],
    /// Side of a voxel along x, y, z, m.
    pub voxel: [f64; 3],
    /// Centre of voxel (0, 0, 0), m.
    pub origin: [f64; 3],
}

impl VolumeGrid {
    /// A grid about the axis of rotation with a voxel for each column and row as the axis sees them. Where
    /// views move the sample, planes cover all that their rows see of the axis. Where the axis is a tenth of
    /// the detector or more beside its middle in a whole turn (half-fan), the grid reaches as far as the
    /// longer side.
    ///
    /// # Errors
    /// [`Error::Argument`] for a geometry that cannot be.
    pub fn of(geometry: &ScanGeometry) -> Result<Self> {
        geometry.check()?;
        let shrink = 1.0 / geometry.magnification();
        let [columns, rows] = [geometry.columns.len(), geometry.rows.len()];
        let side = geometry.column_pitch() * shrink;
        let columns = columns.max(geometry.columns_of_half_fan());
        let edge = -side * (columns - 1) as f64 / 2.0;
        let height = geometry.row_pitch() * shrink;
        let [low, high] = geometry.heights();
        let planes = match geometry.motions {
            None => rows,
            Some(_) => whole::<usize>(((high - low) / height - 1e-6).ceil().max(0.0)) + 1,
        };
        Ok(Self {
            size: [columns, columns, planes],
            voxel: [side, side, height],
            origin: [edge, edge, low],
        })
    }

    /// Centre of the voxel `[z][y][x]`, m.
    #[must_use]
    pub fn centre(&self, (z, y, x): (usize, usize, usize)) -> [f64; 3] {
        let place = |axis: usize, at: usize| self.origin[axis] + at as f64 * self.voxel[axis];
        [place(0, x), place(1, y), place(2, z)]
    }

    /// Centres of the first and the last voxel along x, y, z, m.
    #[must_use]
    pub fn ends(&self) -> [[f64; 2]; 3] {
        [0, 1, 2].map(|axis| {
            let last = self.size[axis].saturating_sub(1) as f64;
            [self.origin[axis], self.origin[axis] + last * self.voxel[axis]]
        })
    }

    /// Checks sizes, and that the voxels lie between source and detector in every view.
    ///
    /// # Errors
    /// [`Error::Argument`].
    pub(super) fn check(&self, geometry: &ScanGeometry) -> Result<()> {
        let is_wrong = self.size.contains(&0)
            || self.voxel.iter().any(|side| !(side.is_finite() && *side > 0.0))
            || self.origin.iter().any(|place| !place.is_finite());
        if is_wrong {
            let allowed = "one voxel or more along each axis, sides above zero, a finite origin";
            let Self { size, voxel, origin } = self;
            let found = format!("{size:?} voxels of {voxel:?} m from {origin:?} m");
            return Err(Error::argument("grid", found, allowed));
        }
        if geometry.motions.is_some() {
            return self.check_motions(geometry);
        }
        let far = |axis: usize| {
            let end = self.origin[axis] + self.voxel[axis] * (self.size[axis] - 1) as f64;
            self.origin[axis].abs().max(end.abs())
        };
        let radius = far(0).hypot(far(1));
        let room =
            geometry.source_distance.min(geometry.detector_distance - geometry.source_distance);
        if room.is_finite() && radius >= room {
            let found = format!("voxels up to {radius:.4} m from the axis of rotation");
            let allowed =
                format!("less than {room:.4} m, the distance of the axis from source or detector");
            return Err(Error::argument("grid", found, allowed));
        }
        Ok(())
    }

    /// The corners, m.
    pub(super) fn corners(&self) -> [[f64; 3]; 8] {
        let ends = self.ends();
        [0, 1, 2, 3, 4, 5, 6, 7].map(|n| [ends[0][n & 1], ends[1][n >> 1 & 1], ends[2][n >> 2]])
    }

    fn check_motions(&self, geometry: &ScanGeometry) -> Result<()> {
        let behind = geometry.detector_distance - geometry.source_distance;
        if geometry.source_distance.is_infinite() {
            return Ok(());
        }
        for view in 0..geometry.angles.len() {
            let motion = geometry.motion(view);
            for [_, depth, _] in self.corners().map(|corner| motion.point(corner)) {
                if depth <= -geometry.source_distance || depth >= behind {
                    let found =
                        format!("voxels {depth:.4} m behind the rotation centre in view {view}");
                    let allowed = "voxels between the source and the detector in every view";
                    return Err(Error::argument("grid", found, allowed));
                }
            }
        }
        Ok(())
    }
}

/// Values on a grid.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Volume {
    /// Where the voxels lie.
    pub grid: VolumeGrid,
    /// Quantity of the values, which has their unit.
    pub quantity: Quantity,
    /// `[z][y][x]`, all ascending.
    pub values: Array3<f32>,
}

impl Volume {
    /// Values `[z][y][x]` of a quantity, in its unit, on the voxels of a grid.
    #[must_use]
    pub const fn new(grid: VolumeGrid, quantity: Quantity, values: Array3<f32>) -> Self {
        Self { grid, quantity, values }
    }
}
