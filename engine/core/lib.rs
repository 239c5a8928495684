//! Internal to beamlet: errors, units, numbers, files and memory.

#[macro_use]
mod setters;

pub mod array_file;
pub mod cancel;
pub mod csv_table;
pub mod error;
pub mod folder;
pub mod fourier;
pub mod image;
pub mod input_file;
pub mod interpolation;
pub mod locked_file;
pub mod numbers;
pub mod open_file;
pub mod options;
pub mod parallel;
pub mod printed;
pub mod program;
pub mod random;
pub mod reserve;
pub mod rows_control;
pub mod suggestion;
pub mod tally;
pub mod units;
pub mod watch;
pub mod whole_file;

pub use cancel::Cancel;
pub use error::{Error, Place, Result};
pub use rows_control::RowsControl;
pub use tally::Tally;
