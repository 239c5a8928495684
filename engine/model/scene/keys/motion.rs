//! Keys of a rigid motion, and tables of motions.

use super::prelude::*;
use super::series::read_file;
use crate::scene::Motion;
use beamlet_core::csv_table::{Placement, PlacementTable, TableKind};
use std::path::Path;

keys! { MOTION, "scan.motion",
    [With(&["angle"], "axis", "an axis for the angle"), With(&["y", "z"], "x", "x, y and z together")], [];
    translation => Lengths("lengths along x, y and z", ANY), Default(r#"["0 m", "0 m", "0 m"]"#),
        r#"["0 mm", "0 mm", "0.1 mm"]"#, "Displacement, after the rotation.";
    axis => Direction, Without("no rotation"), "[0.0, 1.0, 0.0]", "Axis of the rotation through the origin.";
    angle => Quantity(Angle, ANY), Default(r#""0 deg""#), r#""0.5 deg""#, "Angle of the rotation about `axis`.";
    x => Direction, Without("no rotation"), "[0.8, 0.6, 0.0]",
        "Direction that +x is rotated to; in place of `axis`.";
    y => Direction, Without("no rotation"), "[-0.6, 0.8, 0.0]", "Direction that +y is rotated to.";
    z => Direction, Without("no rotation"), "[0.0, 0.0, 1.0]", "Direction that +z is rotated to.";
}

const COLUMNS: &str = "columns separated by commas: x_UNIT, y_UNIT and z_UNIT with a unit of length, as \
                       x_mm; for a rotation either axis_x, axis_y, axis_z and angle_deg or angle_rad, \
                       or qw, qx, qy and qz; view, if any";

fn read_motion(item: &ListItem<'_>) -> Result<Motion> {
    let table = item.table(&MOTION)?;
    let translation: [f64; 3] = optional(&table, "translation")?.unwrap_or_default();
    let [x, y, z] = ["x", "y", "z"].map(|key| optional::<[f64; 3]>(&table, key));
    if let (None, Some(angle)) = (table.get("axis"), table.get("angle")) {
        let error = angle.error("an angle without axis", "axis and angle");
        return angle.refuse(error, Motion::IDENTITY);
    }
    let turn = match (optional::<[f64; 3]>(&table, "axis")?, [x?, y?, z?]) {
        (None, [None, None, None]) => Ok(Motion::IDENTITY),
        (Some(axis), [None, None, None]) => {
            Motion::about(axis, optional(&table, "angle")?.unwrap_or(0.0))
        }
        (None, [Some(x), Some(y), Some(z)]) => Motion::with_axes([x, y, z]),
        _ => {
            let found = "some of axis, x, y and z";
            return item
                .refuse(item.error(found, "axis and angle, or x, y and z"), Motion::IDENTITY);
        }
    };
    match turn {
        Ok(turn) => Ok(turn.then(&Motion::translation(translation))),
        Err(error) => item.refuse(item.error(error.to_string(), "a rotation"), Motion::IDENTITY),
    }
}

fn write_motion(motion: &Motion) -> String {
    let (turn, by) = motion.parts();
    let translation = ("translation", list(&by, Length));
    let direction = |it: [f64; 3]| format!("[{}]", it.map(number).join(", "));
    match turn {
        None => inline(&[translation]),
        Some([x, y, z]) => {
            inline(&[translation, ("x", direction(x)), ("y", direction(y)), ("z", direction(z))])
        }
    }
}

fn of_placement(placed: &Placement) -> Motion {
    Motion::of_quaternion(placed.rotation).then(&Motion::translation(placed.position))
}

impl Value for Vec<Motion> {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        let Some(path) = item.as_text() else {
            return item.items(&row.allowed())?.iter().map(read_motion).collect();
        };
        let kind = TableKind {
            key: "motions",
            noun: "motions of views",
            columns: COLUMNS,
            most: limits::ANGLES as usize,
        };
        let table = PlacementTable { kind, scales: false };
        let rows = read_file(item, Path::new(path), |path| table.read(path), Vec::new())?;
        Ok(rows.iter().map(of_placement).collect())
    }

    /// The motions themselves, so that a run needs no file.
    fn write(&self, _: &Row, _: &Base<'_>) -> Result<Option<String>> {
        let motions: Vec<String> = self.iter().map(write_motion).collect();
        Ok(Some(format!("[{}]", motions.join(", "))))
    }
}
