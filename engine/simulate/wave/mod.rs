//! Light by waves: uniform lines of rays along x in place of cells (docs/waves.md).
//!
//! In the order of the data flow: `refusal` names scenes that waves do not compute; `bars` has the apertures of masks, `frequencies` the spacing of a
//! line and its shears by energy, `columns` the pixels of each beamlet with their response to a frequency; `plan`
//! holds both on the device. `lines` traces lines and makes their light, `patch` chooses the heights of the lines
//! of a beamlet and row, `band` adds light to rows of pixels.

mod band;
mod bars;
mod columns;
mod frequencies;
mod kernels;
mod lines;
mod patch;
mod plan;
mod refusal;

pub(crate) use band::{WaveBand, WaveView};
pub(crate) use kernels::WaveKernels;
pub(crate) use plan::WavePlan;
pub(crate) use refusal::refuse;
