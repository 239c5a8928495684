//! Samples, and code shared by the writers of all formats.

use crate::{Error, Result, numbers, reserve};
use ndarray::ArrayView2;
use std::path::Path;

/// Type of values that are read.
pub trait Value: Copy {
    /// The nearest value.
    fn rounded(sample: f64) -> Self;
}

impl Value for f64 {
    fn rounded(sample: f64) -> Self {
        sample
    }
}

impl Value for f32 {
    fn rounded(sample: f64) -> Self {
        numbers::single(sample)
    }
}

/// Type of values that are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sample {
    /// `float32`.
    F32,
    /// `uint16`.
    U16,
    /// `uint32`.
    U32,
}

impl Sample {
    /// Bytes of a value.
    #[doc(hidden)]
    pub const fn bytes(self) -> u64 {
        match self {
            Self::F32 | Self::U32 => 4,
            Self::U16 => 2,
        }
    }

    /// Values as little-endian bytes; rounded where they are whole numbers.
    ///
    /// # Errors
    /// [`Error::Memory`].
    #[doc(hidden)]
    pub fn encode(self, values: impl ExactSizeIterator<Item = f32>) -> Result<Vec<u8>> {
        if self == Self::F32 {
            return le_bytes(values);
        }
        let mut bytes = reserve::room(4 * values.len(), "a frame as bytes")?;
        let rounded = values.map(|value| f64::from(value).round());
        match self {
            Self::U16 => {
                bytes.extend(rounded.flat_map(|it| numbers::whole::<u16>(it).to_le_bytes()))
            }
            Self::F32 | Self::U32 => {
                bytes.extend(rounded.flat_map(|it| numbers::whole::<u32>(it).to_le_bytes()));
            }
        }
        Ok(bytes)
    }
}

/// Values as little-endian bytes.
///
/// # Errors
/// [`Error::Memory`].
pub fn le_bytes(values: impl ExactSizeIterator<Item = f32>) -> Result<Vec<u8>> {
    let mut bytes = reserve::room(4 * values.len(), "a frame as bytes")?;
    bytes.extend(values.flat_map(f32::to_le_bytes));
    Ok(bytes)
}

/// A file that takes frames one after another.
pub trait Append: Send {
    /// Adds a frame, with its metadata where the format has room for them.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::Memory`].
    fn put(&mut self, frame: ArrayView2<'_, f32>, about: &str) -> Result<()>;

    /// Every frame was added: the file is on disk.
    ///
    /// # Errors
    /// [`Error::File`].
    fn finish(self: Box<Self>) -> Result<()>;
}

pub(super) fn unwritten(path: &Path, error: std::io::Error) -> Error {
    Error::file(path, "cannot be written", Some(error))
}
