//! Illumination: from the results of cells or rays to the light in the pixels at every mask step.

mod cells;
mod fill;
mod fit;
mod heights;
mod light;
mod random;
mod row_parts;
mod spectral;
mod sums;

pub(crate) use cells::{CellIlluminator, CellKernels};
pub(crate) use fit::GrowingBuffer;
pub(crate) use light::{ApertureEdges, IlluminationBuffer, SpectralBand, alike_rows};
pub(crate) use random::{RandomBatch, RandomIlluminator, RandomKernels};
pub(crate) use spectral::{EnergyBinning, Gatherer};
pub use sums::PixelSums;
