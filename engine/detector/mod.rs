//! The detector: what a photon adds to the signal, the blur of the light behind the detector
//! mask, scatter, and the noise of the numbers that are read out (docs/detector.md).

mod blur;
mod excess;
mod grid;
mod kernel;
mod model;
mod noise;
mod scatter;
mod spread;

pub use excess::excess_noise;
pub use grid::SubpixelGrid;
pub use model::DetectorModel;
pub use noise::Noise;
