//! Positions of instances from a CSV file.

use std::path::Path;

use csv::{ByteRecord, ReaderBuilder, Trim};
use glam::{DQuat, DVec3};

use super::InstanceTransform;
use crate::error::Place;
use crate::scene::limits;
use crate::units::Dimension::Length;
use crate::{Error, Result, input_file};

const COLUMNS: &str = "columns separated by commas: x_UNIT, y_UNIT and z_UNIT with a unit of length, as \
                       x_mm; scale; for a rotation either axis_x, axis_y, axis_z and angle_deg or \
                       angle_rad, or qw, qx, qy and qz";

/// What a column holds.
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
}

impl Column {
    /// Which of the columns that may stand once it is.
    const fn slot(self) -> usize {
        match self {
            Self::Position(axis, _) => axis,
            Self::Scale => 3,
            Self::Axis(axis) => 4 + axis,
            Self::RotationAngle(_) => 7,
            Self::Quaternion(part) => 8 + part,
        }
    }
}

/// Names of the columns by their slots, without units.
const NAMES: [&str; 12] =
    ["x", "y", "z", "scale", "axis_x", "axis_y", "axis_z", "angle", "qw", "qx", "qy", "qz"];
const AXIS_ANGLE: std::ops::Range<usize> = 4..8;
const QUATERNION: std::ops::Range<usize> = 8..12;

/// Reads the instances of a file.
///
/// # Errors
/// [`Error::File`] where it cannot be read; [`Error::Scene`] with line and column where it is no
/// table of instances.
pub(super) fn read(path: &Path) -> Result<Vec<InstanceTransform>> {
    let failed = |e| Error::file(path, "cannot read the positions of instances", Some(e));
    parse(path, &input_file::read(path, input_file::TEXT).map_err(failed)?)
}

/// The instances in the bytes of a file.
fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<InstanceTransform>> {
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(Trim::All)
        .from_reader(bytes);
    let mut record = ByteRecord::new();
    let mut columns: Vec<Column> = Vec::new();
    let mut instances = Vec::new();
    loop {
        let is_read = reader.read_byte_record(&mut record);
        let row = Row { path, bytes, end: reader.position().byte(), record: &record };
        match is_read {
            Ok(true) => {}
            Ok(false) if instances.is_empty() => {
                let allowed = format!("a header and at least one row; {COLUMNS}");
                return Err(row.error(0, "instances", "no rows", &allowed));
            }
            Ok(false) => return Ok(instances),
            // Bytes in memory have no errors of reading, and any bytes are records of some lengths.
            Err(error) => return Err(row.error(0, "instances", &error.to_string(), COLUMNS)),
        }
        if columns.is_empty() {
            columns = row.header()?;
        } else if instances.len() == limits::INSTANCES as usize {
            let found = format!("more than {} rows", limits::INSTANCES);
            let allowed = format!("up to {}", limits::INSTANCES);
            return Err(row.error(0, "instances", &found, &allowed));
        } else {
            instances.push(row.instance(&columns)?);
        }
    }
}

/// A record of the file.
struct Row<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    /// Offset behind the record.
    end: u64,
    record: &'a ByteRecord,
}

impl Row<'_> {
    /// An error at a field.
    fn error(&self, field: usize, key: &str, found: &str, allowed: &str) -> Error {
        let end =
            usize::try_from(self.end).map_or(self.bytes.len(), |end| end.min(self.bytes.len()));
        let before = self.bytes[..end].trim_ascii_end();
        let newlines = before.iter().filter(|byte| **byte == b'\n').count();
        let line = before.rsplit(|byte| *byte == b'\n').next().unwrap_or_default();
        let line = String::from_utf8_lossy(line);
        // A field in quotes may hold commas: then the column is that of a comma before it.
        let skipped: usize = line.split(',').take(field).map(|text| text.chars().count() + 1).sum();
        let text = line.split(',').nth(field).unwrap_or_default();
        let spaces = text.chars().take_while(|c| c.is_whitespace()).count();
        let place = Place {
            file: Some(self.path.to_owned()),
            line_column: Some((newlines + 1, skipped + spaces + 1)),
            excerpt: None,
        };
        Error::scene_at(place, key, found, allowed)
    }

    /// A field as text.
    fn field(&self, index: usize) -> Option<&str> {
        std::str::from_utf8(self.record.get(index)?).ok()
    }

    /// A field for a message.
    fn shown(&self, index: usize) -> String {
        let text = String::from_utf8_lossy(self.record.get(index).unwrap_or_default());
        let short: String = text.chars().take(60).collect();
        format!("{short:?}{}", if short.len() < text.len() { "..." } else { "" })
    }

    fn header(&self) -> Result<Vec<Column>> {
        let mut columns: Vec<Column> = Vec::new();
        let mut fields = [None; NAMES.len()];
        for index in 0..self.record.len() {
            let column = self.column(index)?;
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
            return Err(self.error(0, name, "no such column", COLUMNS));
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
                return Err(self.error(begun, name, &found, COLUMNS));
            }
        }
        Ok(columns)
    }

    fn column(&self, index: usize) -> Result<Column> {
        let name = self.field(index).unwrap_or_default();
        let unknown =
            || self.error(index, "header", &format!("the column {}", self.shown(index)), COLUMNS);
        let simple = NAMES.iter().position(|known| *known == name);
        match simple {
            Some(3) => return Ok(Column::Scale),
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
                let is_name = unit.chars().all(char::is_alphabetic);
                match Length.parse_unit(unit) {
                    // Divided by a power of ten a number is the nearest one to its text.
                    Ok(metres) if is_name => Ok(Column::Position(axis, (1.0 / metres).round())),
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

    fn instance(&self, columns: &[Column]) -> Result<InstanceTransform> {
        if self.record.len() != columns.len() {
            let found = format!("{} fields", self.record.len());
            let allowed = format!("{}, one for each column of the header", columns.len());
            let last = self.record.len().min(columns.len()).saturating_sub(1);
            return Err(self.error(last, "instances", &found, &allowed));
        }
        let (mut position, mut scale, mut axis) = ([0.0; 3], 1.0, [0.0; 3]);
        let (mut angle, mut quaternion) = (0.0, [0.0; 4]);
        for (index, column) in columns.iter().enumerate() {
            let number = self.number(index, *column)?;
            match *column {
                Column::Position(axis, per_metre) => position[axis] = number / per_metre,
                Column::Scale if number > 0.0 => scale = number,
                Column::Scale => {
                    return Err(self.error(index, "scale", &self.shown(index), "a number > 0"));
                }
                Column::Axis(component) => axis[component] = number,
                Column::RotationAngle(unit) => angle = number * unit,
                Column::Quaternion(component) => quaternion[component] = number,
            }
        }
        let rotation = match columns.iter().map(|column| column.slot()).max().unwrap_or(0) {
            slot if QUATERNION.contains(&slot) => self.normal(columns, quaternion, QUATERNION)?,
            slot if AXIS_ANGLE.contains(&slot) => {
                let [x, y, z] = axis;
                let axis = self.normal(columns, [0.0, x, y, z], AXIS_ANGLE)?;
                let (sine, cosine) = libm::sincos(angle / 2.0);
                [cosine, sine * axis[1], sine * axis[2], sine * axis[3]]
            }
            _ => [1.0, 0.0, 0.0, 0.0],
        };
        let [w, x, y, z] = rotation;
        Ok(InstanceTransform {
            scale,
            scale_z: scale,
            rotation: DQuat::from_xyzw(x, y, z, w),
            position: DVec3::from_array(position),
        })
    }

    fn number(&self, index: usize, column: Column) -> Result<f64> {
        match self.field(index).map(str::parse::<f64>) {
            Some(Ok(number)) if number.is_finite() => Ok(number),
            _ => {
                let found = self.shown(index);
                Err(self.error(index, NAMES[column.slot()], &found, "a finite number"))
            }
        }
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
