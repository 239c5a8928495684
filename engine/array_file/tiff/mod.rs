//! TIFF: pages of one sample per pixel.

mod ahead;
mod append;
mod one_directory;
mod read;
mod stored;

pub(super) use ahead::{header, volume_header};
pub(super) use append::append;
pub(super) use read::TiffPages;
