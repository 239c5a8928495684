//! Rigid placements: translation, rotation by axis and angle or by quaternion, and scale.

use super::{Row, TableKind};
use crate::Result;
use crate::units::Dimension::Length;
use std::path::Path;

/// A row: scale, rotation, then translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Factor; 1 without such a column.
    #[doc(hidden)]
    pub scale: f64,
    /// Unit quaternion w, x, y, z.
    #[doc(hidden)]
    pub rotation: [f64; 4],
    /// m.
    #[doc(hidden)]
    pub position: [f64; 3],
}

/// A table of placements.
#[derive(Debug, Clone, Copy)]
pub struct PlacementTable {
    /// Its name in messages.
    pub kind: TableKind,
    /// True if columns may be `scale`; else they may be `view`.
    pub scales: bool,
}

/// Contents of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Column {
    /// A coordinate by its axis, and what one metre is in its unit.
    Position(usize, f64),
    Scale,
    /// A component of the axis of rotation.
    Axis(usize),
    /// The angle of rotation, and its unit in rad.
    RotationAngle(f64),
    /// A component of the quaternion, in the order w, x, y, z.
    Quaternion(usize),
    /// Number of the row.
    View,
}

impl Column {
    /// Index of a column that may occur once.
    const fn slot(self) -> usize {
        match self {
            Self::Position(axis, _) => axis,
            Self::Scale => 3,
            Self::Axis(axis) => 4 + axis,
            Self::RotationAngle(_) => 7,
            Self::Quaternion(part) => 8 + part,
            Self::View => 12,
        }
    }
}

/// Names of the columns by their slots, without units.
const NAMES: [&str; 13] =
    ["x", "y", "z", "scale", "axis_x", "axis_y", "axis_z", "angle", "qw", "qx", "qy", "qz", "view"];
const AXIS_ANGLE: std::ops::Range<usize> = 4..8;
const QUATERNION: std::ops::Range<usize> = 8..12;

impl PlacementTable {
    /// Reads the placements of a file.
    ///
    /// # Errors
    /// As `TableKind::read`.
    pub fn read(&self, path: &Path) -> Result<Vec<Placement>> {
        let header = |row: &Row<'_>| row.placement_columns(self.scales);
        self.kind.read(path, header, |row, columns| row.placement(columns))
    }
}

impl Row<'_> {
    fn placement_columns(&self, scales: bool) -> Result<Vec<Column>> {
        let mut columns: Vec<Column> = Vec::new();
        let mut fields = [None; NAMES.len()];
        for index in 0..self.record.len() {
            let column = self.placement_column(index, scales)?;
            if let Some(first) = fields[column.slot()].replace(index) {
                let found = format!("{} after {}", self.shown(index), self.shown(first));
                let key = NAMES[column.slot()];
                return Err(self.error(index, key, &found, "each column once, in one unit"));
            }
            columns.push(column);
        }
        let missing = |slots: std::ops::Range<usize>| {
            slots.into_iter().find(|slot| fields[*slot].is_none()).map(|slot| NAMES[slot])
        };
        if let Some(name) = missing(0..3) {
            return Err(self.error(0, name, "no such column", self.kind.columns));
        }
        let first_of =
            |slots: std::ops::Range<usize>| fields[slots].iter().flatten().min().copied();
        let (axis, quaternion) = (first_of(AXIS_ANGLE), first_of(QUATERNION));
        if let (Some(axis), Some(quaternion)) = (axis, quaternion) {
            let later = axis.max(quaternion);
            let found = format!("{} with {}", self.shown(later), self.shown(axis.min(quaternion)));
            let allowed = "one kind of rotation: axis and angle, or quaternion";
            return Err(self.error(later, "rotation", &found, allowed));
        }
        for (begun, slots) in [(axis, AXIS_ANGLE), (quaternion, QUATERNION)] {
            if let (Some(begun), Some(name)) = (begun, missing(slots)) {
                let found = format!("no such column beside {}", self.shown(begun));
                return Err(self.error(begun, name, &found, self.kind.columns));
            }
        }
        Ok(columns)
    }

    fn placement_column(&self, index: usize, scales: bool) -> Result<Column> {
        let name = self.field(index).unwrap_or_default().to_lowercase();
        let name = name.as_str();
        let unknown = || {
            self.error(
                index,
                "header",
                &format!("the column {}", self.shown(index)),
                self.kind.columns,
            )
        };
        let simple = NAMES.iter().position(|known| *known == name);
        match simple {
            Some(3) if scales => return Ok(Column::Scale),
            Some(12) if !scales => return Ok(Column::View),
            Some(slot) if QUATERNION.contains(&slot) => {
                return Ok(Column::Quaternion(slot - QUATERNION.start));
            }
            Some(slot @ 4..7) => return Ok(Column::Axis(slot - AXIS_ANGLE.start)),
            _ => {}
        }
        match name.split_once('_').unwrap_or((name, "")) {
            ("angle", "deg") => Ok(Column::RotationAngle(1_f64.to_radians())),
            ("angle", "rad") => Ok(Column::RotationAngle(1.0)),
            ("angle", _) => {
                let found = format!("the column {}", self.shown(index));
                Err(self.error(index, "angle", &found, "angle_deg or angle_rad"))
            }
            (letter @ ("x" | "y" | "z"), unit) => {
                let axis = usize::from(letter == "y") + 2 * usize::from(letter == "z");
                match Length.parse(&format!("1 {unit}")) {
                    // Divided by a power of ten a number is the nearest one to its text.
                    Ok(metres) => Ok(Column::Position(axis, (1.0 / metres).round())),
                    _ => {
                        let found = format!("the column {}", self.shown(index));
                        let allowed = format!(
                            "{letter}_m, {letter}_cm, {letter}_mm, {letter}_um, {letter}_nm or \
                             {letter}_pm"
                        );
                        Err(self.error(index, NAMES[axis], &found, &allowed))
                    }
                }
            }
            _ => Err(unknown()),
        }
    }

    fn placement(&self, columns: &[Column]) -> Result<Placement> {
        let (mut position, mut scale, mut axis) = ([0.0; 3], 1.0, [0.0; 3]);
        let (mut angle, mut quaternion) = (0.0, [0.0; 4]);
        for (index, column) in columns.iter().enumerate() {
            if *column == Column::View {
                self.check_view(index)?;
                continue;
            }
            let number = self.number(index, NAMES[column.slot()])?;
            match *column {
                Column::Position(axis, per_metre) => position[axis] = number / per_metre,
                Column::Scale if number > 0.0 => scale = number,
                Column::Scale => {
                    return Err(self.error(index, "scale", &self.shown(index), "a number > 0"));
                }
                Column::Axis(component) => axis[component] = number,
                Column::RotationAngle(unit) => angle = number * unit,
                Column::Quaternion(component) => quaternion[component] = number,
                Column::View => {}
            }
        }
        let has =
            |slots: std::ops::Range<usize>| columns.iter().any(|it| slots.contains(&it.slot()));
        let rotation = match () {
            () if has(QUATERNION) => self.normal(columns, quaternion, QUATERNION)?,
            () if has(AXIS_ANGLE) => {
                let [x, y, z] = axis;
                let axis = self.normal(columns, [0.0, x, y, z], AXIS_ANGLE)?;
                let (sine, cosine) = libm::sincos(angle / 2.0);
                [cosine, sine * axis[1], sine * axis[2], sine * axis[3]]
            }
            () => [1.0, 0.0, 0.0, 0.0],
        };
        Ok(Placement { scale, rotation, position })
    }

    /// The vector of unit length; an error at the first of its columns where it has none.
    fn normal(
        &self,
        columns: &[Column],
        vector: [f64; 4],
        slots: std::ops::Range<usize>,
    ) -> Result<[f64; 4]> {
        // Squares of large or small components would leave the range of numbers.
        let largest = vector.iter().fold(0.0_f64, |most, part| most.max(part.abs()));
        let scaled = vector.map(|part| part / largest);
        let length = scaled.iter().map(|part| part * part).sum::<f64>().sqrt();
        if length.is_finite() && length > 0.0 {
            return Ok(scaled.map(|part| part / length));
        }
        let first = columns.iter().position(|column| slots.contains(&column.slot()));
        let key = if slots == QUATERNION { "quaternion" } else { "axis" };
        let allowed = format!("{key} of length > 0");
        Err(self.error(first.unwrap_or_default(), key, "a length of 0", &allowed))
    }
}
