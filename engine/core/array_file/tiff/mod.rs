//! TIFF: pages of one sample per pixel.

mod ahead;
mod append;
mod described;
mod one_directory;
mod read;
mod stored;

pub(super) use ahead::header;
pub(crate) use ahead::volume_header;
pub(super) use append::append;
pub(crate) use read::TiffPages;
