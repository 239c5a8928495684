//! Values that are checked as they are typed.

use beamlet::cli_support::units;
use beamlet::stack::ViewRange;

fn number(text: &str, allowed: &str, is_allowed: impl Fn(f64) -> bool) -> Result<f64, String> {
    let found = units::number(text).filter(|value| value.is_finite());
    found.filter(|value| is_allowed(*value)).ok_or_else(|| format!("allowed: {allowed}"))
}

pub(super) fn above_zero(text: &str) -> Result<f64, String> {
    number(text, "a finite number above 0", |value| value > 0.0)
}

pub(super) fn from_zero(text: &str) -> Result<f64, String> {
    number(text, "a finite number of 0 or more", |value| value >= 0.0)
}

pub(super) fn finite(text: &str) -> Result<f64, String> {
    number(text, "a finite number", |_| true)
}

/// A length above 0, m.
pub(super) fn length(text: &str) -> Result<f64, String> {
    match any_length(text)? {
        length if length > 0.0 => Ok(length),
        _ => Err("allowed: a length above 0".into()),
    }
}

/// Three lengths, m.
pub(super) fn lengths(text: &str) -> Result<[f64; 3], String> {
    three(text.split(',').map(any_length).collect::<Result<_, _>>()?)
        .ok_or_else(|| "write three lengths, as in '-2 mm, -2 mm, 0 mm'".into())
}

/// Three numbers of voxels.
pub(super) fn sizes(text: &str) -> Result<[usize; 3], String> {
    let words = text.split(',').map(|word| word.trim().parse::<usize>().ok().filter(|n| *n > 0));
    words
        .collect::<Option<Vec<usize>>>()
        .and_then(three)
        .ok_or_else(|| "write three whole numbers above 0, as in 256,256,4".into())
}

fn three<T: Copy>(list: Vec<T>) -> Option<[T; 3]> {
    list.try_into().ok()
}

fn any_length(text: &str) -> Result<f64, String> {
    units::Dimension::Length.parse(text).map_err(|error| error.to_string())
}

pub(super) fn memory_size(text: &str) -> Result<u64, String> {
    units::memory_size(text).map_err(|error| error.to_string())
}

pub(super) fn degrees(text: &str) -> Result<f64, String> {
    match units::number(text) {
        Some(angle) if angle.abs() <= 360.0 => Ok(angle),
        _ => Err("a number of degrees from -360 to 360".into()),
    }
}

pub(super) fn pixel(text: &str) -> Result<[u32; 2], String> {
    let parts: Vec<_> = text.split(',').map(|part| part.trim().parse::<u32>()).collect();
    match parts[..] {
        [Ok(column), Ok(row)] => Ok([column, row]),
        _ => Err("write column,row, as in 80,64, both counted from 0, rows from the top".into()),
    }
}

/// The ends of a colour scale: of which image, and in its shown unit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ValueRange {
    pub(crate) name: String,
    pub(crate) ends: [f64; 2],
}

pub(super) fn value_range(text: &str) -> Result<ValueRange, String> {
    let number = |text: &str| units::number(text).filter(|value| value.is_finite());
    let parts = text.split_once('=').and_then(|(name, ends)| {
        let (low, high) = ends.split_once("..")?;
        Some((name.trim().to_owned(), [number(low)?, number(high)?]))
    });
    match parts {
        Some((name, ends)) if !name.is_empty() && ends[0] < ends[1] => {
            Ok(ValueRange { name, ends })
        }
        _ => Err("write name=low..high with low below high, as in refraction=-10..10".into()),
    }
}

pub(super) fn view_range(text: &str) -> Result<ViewRange, String> {
    text.parse().map_err(|error: beamlet::Error| error.to_string())
}

pub(super) fn key_value(text: &str) -> Result<String, String> {
    match text.split_once('=') {
        Some((key, _)) if !key.trim().is_empty() => Ok(text.to_owned()),
        _ => Err("write key.path=value, as in 'source.energy=40 keV'".into()),
    }
}
