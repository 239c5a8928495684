//! The detector: what a photon adds to the signal, the blur of the light behind the detector
//! mask, scatter, and the noise of the numbers that are read out (docs/detector.md).

mod blur;
mod detection;
mod excess;
mod grid;
mod kernel;
mod noise;
mod scatter;
mod spread;

pub use detection::DetectorModel;
pub use excess::excess_noise;
pub use grid::SubpixelGrid;
pub use noise::Noise;
