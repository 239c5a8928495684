//! NPY: the length of the header, and the number of values that it claims.

use super::{RAW_HEADER, RAW_LENGTHS};

/// Bytes before the dict in version 1.0.
const DICT: usize = 10;
/// Most bytes of values that a repair makes.
const MOST: usize = 1 << 20;

/// The file with magic, version and length of the header as they have to be, and as many bytes of
/// values as its dict asks for.
pub fn repaired(control: u8, file: &[u8]) -> Vec<u8> {
    let mut file = file.to_vec();
    if control & RAW_HEADER == 0 {
        if file.len() < DICT {
            file.resize(DICT, 0);
        }
        file[..8].copy_from_slice(b"\x93NUMPY\x01\x00");
        let end = file[DICT..].iter().position(|byte| *byte == b'\n');
        let length = end.map_or(file.len() - DICT, |end| end + 1);
        let length = u16::try_from(length).unwrap_or(u16::MAX);
        file[8..DICT].copy_from_slice(&length.to_le_bytes());
    }
    if control & RAW_LENGTHS == 0 {
        let dict = file.get(DICT..).unwrap_or_default();
        let end = dict.iter().position(|byte| *byte == b'\n').map_or(dict.len(), |end| end + 1);
        if let Some(bytes) = claimed(&dict[..end]).filter(|bytes| *bytes <= MOST) {
            let values = &dict[end..];
            let filled = (0..bytes).map(|at| *values.get(at % values.len().max(1)).unwrap_or(&0));
            let filled: Vec<u8> = filled.collect();
            file.truncate(DICT + end);
            file.extend(filled);
        }
    }
    file
}

/// Bytes of values by the dict: the product of the numbers in its brackets, times the last digit
/// of the type.
fn claimed(dict: &[u8]) -> Option<usize> {
    let text = String::from_utf8_lossy(dict);
    let inner = text.split_once('(')?.1.split_once(')')?.0;
    let sides = inner.split(',').map(str::trim).filter(|side| !side.is_empty());
    let mut values = sides.map(|side| side.parse::<usize>().ok());
    let values = values.try_fold(1_usize, |n, side| n.checked_mul(side?))?;
    let kind = text.split_once("descr")?.1.split('\'').nth(2)?;
    let size = kind.chars().last()?.to_digit(10)?;
    values.checked_mul(size as usize)
}

/// Arrays of every type, order and number of dimensions.
pub fn seeds() -> Vec<(u8, Vec<u8>)> {
    let mut made = Vec::new();
    for kind in ["<f4", ">f4", "<f8", "|u1", "<u2", ">u2", "<u4", "<i2", "<i4", "<c8", "<f2"] {
        for shape in ["3, 2", "2, 3, 2", "2, 1, 3, 2", "5,"] {
            for order in ["False", "True"] {
                let dict = format!(
                    "{{'descr': '{kind}', 'fortran_order': {order}, 'shape': ({shape}), }}\n"
                );
                let length = u16::try_from(dict.len()).expect("a short header").to_le_bytes();
                let values: Vec<u8> = (0..96).collect();
                let header = [b"\x93NUMPY\x01\x00".as_slice(), &length, dict.as_bytes()].concat();
                made.push((0, repaired(0, &[header, values].concat())));
            }
        }
    }
    made
}
