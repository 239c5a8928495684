//! NPY: one array of any shape.

mod header;
mod read;
mod write;

pub(crate) use read::NpyFile;
pub(super) use write::{append, header};
