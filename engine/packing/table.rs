//! Positions of instances from a CSV file.

use super::InstanceTransform;
use beamlet_core::Result;
use beamlet_core::csv_table::{PlacementTable, TableKind};
use beamlet_model::scene::limits;
use glam::{DQuat, DVec3};
use std::path::Path;

const TABLE: PlacementTable = PlacementTable {
    kind: TableKind {
        key: "instances",
        noun: "positions of instances",
        columns: "columns separated by commas: x_UNIT, y_UNIT and z_UNIT with a unit of length, as \
                  x_mm; scale; for a rotation either axis_x, axis_y, axis_z and angle_deg or \
                  angle_rad, or qw, qx, qy and qz",
        most: limits::INSTANCES as usize,
    },
    scales: true,
};

/// Reads the instances of a file.
///
/// # Errors
/// [`beamlet_core::Error::File`] where it cannot be read; [`beamlet_core::Error::Scene`] with line and column where it
/// is no table of instances.
pub(super) fn read(path: &Path) -> Result<Vec<InstanceTransform>> {
    let placed = TABLE.read(path)?;
    let instance = |it: &beamlet_core::csv_table::Placement| {
        let ([w, x, y, z], scale) = (it.rotation, it.scale);
        InstanceTransform {
            scale,
            scale_z: scale,
            rotation: DQuat::from_xyzw(x, y, z, w),
            position: DVec3::from_array(it.position),
        }
    };
    Ok(placed.iter().map(instance).collect())
}
