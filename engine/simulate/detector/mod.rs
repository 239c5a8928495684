//! The detector: blur of the light behind the detector mask, scatter, and the noise of the detector numbers
//! (docs/detector.md). Its response to photons is `response` of the spectra.

mod blur;
mod clipping;
mod grid;
mod kernel;
mod model;
mod noise;
mod scatter;
mod spread;

pub use clipping::offset_warning;
pub use grid::SubpixelGrid;
pub use model::DetectorModel;
pub(crate) use noise::Frame;
pub use noise::Noise;
