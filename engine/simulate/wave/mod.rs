//! Light by waves: uniform lines of rays along x in place of cells (docs/waves.md).
//!
//! In the order of the data flow:
//!
//! - `refusal`: scenes that waves do not compute;
//! - `facets`: facets that diffract as edges;
//! - `bars`: apertures of a mask at an energy;
//! - `frequencies`: spacing of a line, and its shears by energy;
//! - `inline`: beamlets without a sample mask;
//! - `columns`: pixels of each beamlet, and their response to a frequency;
//! - `laws`: contrast of materials that scatter, by shear;
//! - `energy`, `plan`: tables of these on the device;
//! - `line`: places of rays;
//! - `grazing`: parts of lines near grazing, for the light of rays;
//! - `kernels`, `lines`: lines of rays, traced, and their light, at heights by `crate::lines`;
//! - `cells`: these parts as cells, for the illumination of rays;
//! - `rows`: patches of rows, and estimates of their errors;
//! - `band`: sums of light of a band of rows.

mod band;
mod bars;
mod cells;
mod columns;
mod energy;
mod facets;
mod frequencies;
mod grazing;
mod inline;
mod kernels;
mod laws;
mod line;
mod lines;
mod plan;
mod refusal;
mod rows;

pub(crate) use band::WaveBand;
pub(crate) use cells::CellPlaces;
pub use facets::facet_kinks;
pub(crate) use kernels::WaveKernels;
pub(crate) use plan::WavePlans;
pub use refusal::refuse_by_waves;
pub(crate) use refusal::{grazing_warning, refuse};
pub(crate) use rows::WaveView;
