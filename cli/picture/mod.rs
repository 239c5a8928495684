//! Pictures: drawings of lines, words and pixels, and the charts that are made of them.
//!
//! A [`drawing::Drawing`] is a list of shapes in units of one pixel at scale 1, y downwards. It
//! is written as PNG (`raster`) or as SVG (`svg`), so that a picture in a file and in the page
//! of a report is the same. `axes`, `colour` and `scale` are the parts of charts; the other files are
//! the charts.

pub(crate) mod axes;
pub(crate) mod colour;
pub(crate) mod curve;
pub(crate) mod drawing;
mod font;
pub(crate) mod illumination;
pub(crate) mod image;
mod impostors;
pub(crate) mod objects;
pub(crate) mod palette;
pub(crate) mod profile;
pub(crate) mod quantity;
mod raster;
pub(crate) mod residuals;
pub(crate) mod sample;
pub(crate) mod scale;
mod section;
pub(crate) mod set_up;
pub(crate) mod spectrum;
pub(crate) mod svg;
pub(crate) mod sweep;
pub(crate) mod text;
pub(crate) mod volume_scale;
