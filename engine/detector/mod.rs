//! The detector: response to photons, blur of the light behind the detector mask, scatter, and the noise
//! of the detector numbers (docs/detector.md).

mod blur;
mod clipping;
mod grid;
mod kernel;
mod model;
mod noise;
mod scatter;
mod spread;

pub(crate) use clipping::offset_warning;
pub use grid::SubpixelGrid;
pub use model::DetectorModel;
pub(crate) use noise::Clipped;
pub use noise::Noise;
