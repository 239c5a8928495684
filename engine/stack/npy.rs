//! NPY: headers of version 1.0, padded to 64 bytes, f32 little endian, C order: numpy, and
//! everything that memory-maps, reads it as it is.

use super::StackShape;
use crate::{Result, reserve};

/// Header of a stack: (S, R, C), or (V, S, R, C) with a number of views.
pub(super) fn stack_header(extent: StackShape, views: Option<u32>) -> Vec<u8> {
    let StackShape { steps, rows, columns, .. } = extent;
    let of_view = format!("{steps}, {rows}, {columns}");
    header(&views.map_or_else(|| of_view.clone(), |views| format!("{views}, {of_view}")))
}

/// Header of version 1.0: magic, version, length, a Python dict padded with spaces so that the
/// values start at a multiple of 64 bytes. `shape` has commas between its numbers, at least two.
fn header(shape: &str) -> Vec<u8> {
    const BEFORE_DICT: usize = 10;
    let mut dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
    let end = (BEFORE_DICT + dict.len() + 1).next_multiple_of(64);
    dict.push_str(&" ".repeat(end - BEFORE_DICT - dict.len() - 1));
    dict.push('\n');
    // At most four numbers of ten digits each: the dict never comes near 64 KiB.
    let len = u16::try_from(dict.len()).unwrap_or(u16::MAX);
    [b"\x93NUMPY\x01\x00".as_slice(), &len.to_le_bytes(), dict.as_bytes()].concat()
}

/// Header of an array with two sides or more.
pub(crate) fn npy_header(sides: &[usize]) -> Vec<u8> {
    let shape: Vec<String> = sides.iter().map(usize::to_string).collect();
    header(&shape.join(", "))
}

/// Values as little-endian bytes.
///
/// # Errors
/// [`Error::Memory`].
pub(crate) fn le_bytes(values: impl ExactSizeIterator<Item = f32>) -> Result<Vec<u8>> {
    let mut bytes = reserve::room(4 * values.len(), "a frame as bytes")?;
    bytes.extend(values.flat_map(f32::to_le_bytes));
    Ok(bytes)
}

/// Lower-case hexadecimal.
pub(super) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
