//! Arguments of the verb that writes images for other programs.

use super::shared::Messages;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet retrieve run\n  \
    beamlet convert run --to astra -o astra\n\n\
    Writes each retrieved image as NAME.npy, [row][view][column], astra.json with the vectors of the \
    views (cone_vec) and the extents of a volume in mm, and load_astra.py, which loads both. Pixels of \
    transmission, refraction and dark field without a value are filled as by `beamlet reconstruct`. \
    NXtomo, CIL and DXchange are HDF5, which the Python package writes: --to prints the command \
    (docs/how-to/convert.md).")]
pub(crate) struct Convert {
    /// Run with retrieved images, or a directory of retrieved images
    #[arg(value_name = "RUN|IMAGES")]
    pub(crate) input: PathBuf,
    /// Program to write for
    #[arg(long, value_enum, value_name = "PROGRAM")]
    pub(crate) to: Program,
    /// Directory to write
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Leave pixels without a result NaN, and misfits of the transmission as they are
    #[arg(long)]
    pub(crate) as_retrieved: bool,
    /// Replace files that beamlet wrote there
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

/// Programs that images are written for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Program {
    /// The ASTRA toolbox
    Astra,
    /// NXtomo, in Python: prints the command
    Nxtomo,
    /// CIL, in Python: prints the command
    Cil,
    /// DXchange, in Python: prints the command
    Dxchange,
}
