//! Arrays in NPY, TIFF and EXR files: frames, and any rows of them, read and written.
//!
//! Samples that are read are f32, f64, or whole numbers of 8, 16 or 32 bits (EXR: f16, f32, u32). A
//! new format is a file here, its row in `format.rs`, and its branches in `file.rs`.

mod exr;
mod file;
mod format;
mod limits;
mod npy;
mod parts;
mod ranges;
mod tiff;

pub use file::{ArrayFile, append};
pub use format::{Abilities, Format, endings};
pub use limits::{LONGEST_SIDE, refuse_wide};
pub use parts::{Append, Sample, Value, le_bytes};
pub use ranges::{RangeFile, RangeLayout};
