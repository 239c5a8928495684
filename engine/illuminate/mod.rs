//! Illumination: from the laws of cells or rays to the light in the pixels at every mask step.

mod cells;
mod light;
mod random;
mod spectral;
mod sums;

pub use cells::{CellIlluminator, CellKernels};
pub(crate) use light::alike_rows;
pub use light::{LightRecord, Part};
pub use random::{Cast, RandomKernels, cast};
pub(crate) use spectral::NARROW;
pub use spectral::{KnownBars, Spectral};
pub use sums::Sums;
