//! NPY files: any of the sample types, either byte order.

use super::header;
use crate::array_file::parts::Value;
use crate::{Error, Result, input_file, reserve};
use npyz::{DType, Endianness, Order, TypeChar};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// First bytes of an array.
const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// An array on disk whose header was read and whose length was checked.
#[derive(Debug)]
pub struct NpyFile {
    path: PathBuf,
    sides: Vec<u64>,
    fortran: bool,
    /// Bytes before the first value.
    header: u64,
    sample: ValueType,
    big_endian: bool,
}

#[derive(Debug, Clone, Copy)]
enum ValueType {
    F32,
    F64,
    U8,
    U16,
    U32,
    I8,
    I16,
    I32,
}

impl ValueType {
    const fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::F32 | Self::U32 | Self::I32 => 4,
            Self::F64 => 8,
        }
    }
}

impl NpyFile {
    /// True if values have 8 bits.
    pub(crate) const fn has_bytes(&self) -> bool {
        self.sample.bytes() == 1
    }

    pub(crate) fn open(path: &Path) -> Result<Self> {
        let unread = |error| Error::file(path, "cannot be read", Some(error));
        let mut file = BufReader::new(input_file::open(path).map_err(unread)?);
        let header = header::read(&mut file).map_err(|error| {
            // A parser's message may contain all of the text that it did not understand.
            let error: String = error.to_string().chars().take(120).collect();
            Error::file(path, format!("has no header of an NPY array: {error}"), None)
        })?;
        let start = file.stream_position().map_err(unread)?;
        let (sample, big_endian) = sample_of(&header.dtype()).ok_or_else(|| {
            let found = header.dtype().descr();
            let problem = format!(
                "has samples of type {found}; allowed: f4, f8, u1, u2, u4, i1, i2, i4, b1 (numpy: \
                 a.astype('f4'))"
            );
            Error::file(path, problem, None)
        })?;
        let sides = header.shape().to_vec();
        let expected = sides
            .iter()
            .try_fold(sample.bytes() as u64, |n, side| n.checked_mul(*side))
            .and_then(|n| n.checked_add(start));
        let found = file.get_ref().metadata().map_err(unread)?.len();
        match expected {
            Some(expected) if expected <= found => {}
            _ => {
                let problem = format!(
                    "is cut short: {found} bytes, but its header requires {}",
                    expected.map_or("more than fit".to_owned(), |n| n.to_string())
                );
                return Err(Error::file(path, problem, None));
            }
        }
        let end = expected.unwrap_or(found);
        let mut next = [0; MAGIC.len()];
        let has_more = found - end >= next.len() as u64
            && file.seek(SeekFrom::Start(end)).and_then(|_| file.read_exact(&mut next)).is_ok();
        if has_more && next == *MAGIC {
            let problem = "holds arrays one behind another, as np.save appends them; allowed: one array \
                           (numpy: np.save of np.stack of them)";
            return Err(Error::file(path, problem, None));
        }
        let fortran = header.order() == Order::Fortran && sides.len() > 1;
        Ok(Self { path: path.to_path_buf(), sides, fortran, header: start, sample, big_endian })
    }

    /// Sides of the array, the slowest first.
    pub(crate) fn sides(&self) -> &[u64] {
        &self.sides
    }

    /// True if the first side is the fastest.
    pub(crate) const fn is_fortran(&self) -> bool {
        self.fortran
    }

    /// Some values, in the order of the file.
    pub(crate) fn read<T: Value>(&self, first: u64, count: usize) -> Result<Vec<T>> {
        let bytes = self.sample.bytes();
        let mut raw = reserve::zeroed::<u8>(count * bytes, "values of an array")?;
        File::open(&self.path)
            .and_then(|mut file| {
                file.seek(SeekFrom::Start(self.header + first * bytes as u64))?;
                file.read_exact(&mut raw)
            })
            .map_err(|error| Error::file(&self.path, "cannot be read", Some(error)))?;
        if self.big_endian {
            raw.chunks_exact_mut(bytes).for_each(<[u8]>::reverse);
        }
        match self.sample {
            ValueType::U8 => values(&raw, u8::from_le_bytes),
            ValueType::U16 => values(&raw, u16::from_le_bytes),
            ValueType::U32 => values(&raw, u32::from_le_bytes),
            ValueType::I8 => values(&raw, i8::from_le_bytes),
            ValueType::I16 => values(&raw, i16::from_le_bytes),
            ValueType::I32 => values(&raw, i32::from_le_bytes),
            ValueType::F32 => values(&raw, f32::from_le_bytes),
            ValueType::F64 => values(&raw, f64::from_le_bytes),
        }
    }
}

fn values<S: Into<f64>, T: Value, const N: usize>(
    raw: &[u8],
    of: fn([u8; N]) -> S,
) -> Result<Vec<T>> {
    let each = |bytes: &[u8; N]| T::rounded(of(*bytes).into());
    reserve::collected(raw.as_chunks().0.iter().map(each), "values of an array")
}

/// The sample type and whether its bytes are swapped.
fn sample_of(dtype: &DType) -> Option<(ValueType, bool)> {
    let DType::Plain(text) = dtype else { return None };
    let sample = match (text.type_char(), text.size_field()) {
        (TypeChar::Float, 4) => ValueType::F32,
        (TypeChar::Float, 8) => ValueType::F64,
        (TypeChar::Uint | TypeChar::Bool, 1) => ValueType::U8,
        (TypeChar::Uint, 2) => ValueType::U16,
        (TypeChar::Uint, 4) => ValueType::U32,
        (TypeChar::Int, 1) => ValueType::I8,
        (TypeChar::Int, 2) => ValueType::I16,
        (TypeChar::Int, 4) => ValueType::I32,
        _ => return None,
    };
    Some((sample, text.endianness() == Endianness::Big))
}
