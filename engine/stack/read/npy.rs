//! NPY files: any of the sample types, either byte order, C order.

use crate::{Error, Result, input_file, npy_header, reserve};
use npyz::{DType, Endianness, Order, TypeChar};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// An array on disk whose header was read and whose length was checked.
#[derive(Debug)]
pub(super) struct NpyFile {
    path: PathBuf,
    shape: [usize; 4],
    /// Bytes before the first value.
    header: u64,
    sample: Sample,
    big_endian: bool,
}

#[derive(Debug, Clone, Copy)]
enum Sample {
    F32,
    F64,
    U8,
    U16,
    U32,
}

impl Sample {
    const fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 | Self::U32 => 4,
            Self::F64 => 8,
        }
    }
}

impl NpyFile {
    pub(super) fn open(path: &Path) -> Result<Self> {
        let unread = |error| Error::output(path, "cannot be read", Some(error));
        let mut file = BufReader::new(input_file::open(path).map_err(unread)?);
        let header = npy_header::read(&mut file).map_err(|error| {
            // A parser's message may hold the whole of what it did not understand.
            let error: String = error.to_string().chars().take(120).collect();
            Error::output(path, format!("has no header of an NPY array: {error}"), None)
        })?;
        let start = file.stream_position().map_err(unread)?;
        let (sample, big_endian) = sample_of(&header.dtype()).ok_or_else(|| {
            let found = header.dtype().descr();
            let problem = format!(
                "has samples of type {found}; allowed: f4, f8, u1, u2, u4 (numpy: a.astype('f4'))"
            );
            Error::output(path, problem, None)
        })?;
        if header.order() == Order::Fortran && header.shape().len() > 1 {
            let problem = "is in Fortran order; allowed is C order (numpy: np.ascontiguousarray)";
            return Err(Error::output(path, problem, None));
        }
        let shape = shape_of(header.shape()).ok_or_else(|| {
            let problem = format!(
                "has the shape {:?}; allowed: (row, column), (step, row, column) or (view, step, \
                 row, column)",
                header.shape()
            );
            Error::output(path, problem, None)
        })?;
        let values = header.shape().iter().try_fold(1_u64, |n, side| n.checked_mul(*side));
        let expected = values
            .and_then(|n| n.checked_mul(sample.bytes() as u64))
            .and_then(|n| n.checked_add(start));
        let found = file.get_ref().metadata().map_err(unread)?.len();
        match expected {
            Some(expected) if expected <= found => {}
            _ => {
                let problem = format!(
                    "is cut short: {found} bytes, but its header asks for {}",
                    expected.map_or("more than fit".to_owned(), |n| n.to_string())
                );
                return Err(Error::output(path, problem, None));
            }
        }
        Ok(Self { path: path.to_path_buf(), shape, header: start, sample, big_endian })
    }

    pub(super) const fn shape(&self) -> [usize; 4] {
        self.shape
    }

    /// Rows of a frame, counted over all views.
    pub(super) fn read(&self, frame: usize, rows: Range<usize>) -> Result<Vec<f32>> {
        let [_, _, row_count, columns] = self.shape;
        let bytes = self.sample.bytes();
        let first = (frame * row_count + rows.start) as u64 * (columns * bytes) as u64;
        let mut raw = reserve::zeroed::<u8>(rows.len() * columns * bytes, "rows of a frame")?;
        File::open(&self.path)
            .and_then(|mut file| {
                file.seek(SeekFrom::Start(self.header + first))?;
                file.read_exact(&mut raw)
            })
            .map_err(|error| Error::output(&self.path, "cannot be read", Some(error)))?;
        self.values(&mut raw)
    }

    fn values(&self, raw: &mut [u8]) -> Result<Vec<f32>> {
        if self.big_endian {
            raw.chunks_exact_mut(self.sample.bytes()).for_each(<[u8]>::reverse);
        }
        let purpose = "rows of a frame";
        match self.sample {
            Sample::U8 => reserve::collected(raw.iter().map(|&v| f32::from(v)), purpose),
            Sample::U16 => {
                let whole = |&v| f32::from(u16::from_le_bytes(v));
                reserve::collected(raw.as_chunks().0.iter().map(whole), purpose)
            }
            Sample::U32 => {
                let whole = |&v| u32::from_le_bytes(v) as f32;
                reserve::collected(raw.as_chunks().0.iter().map(whole), purpose)
            }
            Sample::F32 => reserve::collected(
                raw.as_chunks().0.iter().map(|&v| f32::from_le_bytes(v)),
                purpose,
            ),
            Sample::F64 => {
                let rounded = |&v| narrow(f64::from_le_bytes(v));
                reserve::collected(raw.as_chunks().0.iter().map(rounded), purpose)
            }
        }
    }
}

#[allow(clippy::cast_possible_truncation, reason = "rounding to f32 is what is asked for")]
const fn narrow(value: f64) -> f32 {
    value as f32
}

/// The sample type and whether its bytes are swapped.
fn sample_of(dtype: &DType) -> Option<(Sample, bool)> {
    let DType::Plain(text) = dtype else { return None };
    let sample = match (text.type_char(), text.size_field()) {
        (TypeChar::Float, 4) => Sample::F32,
        (TypeChar::Float, 8) => Sample::F64,
        (TypeChar::Uint, 1) => Sample::U8,
        (TypeChar::Uint, 2) => Sample::U16,
        (TypeChar::Uint, 4) => Sample::U32,
        _ => return None,
    };
    Some((sample, text.endianness() == Endianness::Big))
}

/// Two to four sides, filled up with ones in front.
fn shape_of(sides: &[u64]) -> Option<[usize; 4]> {
    if !(2..=4).contains(&sides.len()) {
        return None;
    }
    let mut shape = [1; 4];
    for (to, from) in shape[4 - sides.len()..].iter_mut().zip(sides) {
        *to = usize::try_from(*from).ok().filter(|side| u32::try_from(*side).is_ok())?;
    }
    Some(shape)
}
