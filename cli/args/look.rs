//! Arguments of `check` and `compare`.

use super::SceneArguments;
use super::options::choice;
use super::shared::{EngineArguments, Messages};
use beamlet::cli_support::units;
use beamlet::stack::Format;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet check scene.toml\n  \
    beamlet check scene.toml --set 'detector.pixels=[512, 512]'\n  \
    beamlet check scene.toml --plot curve.svg\n  \
    beamlet check scene.toml --json\n  \
    beamlet check run\n\n\
    For a scene, the line \"sampling\" has the measured error of some beamlets and rows.\n\n\
    For a run, every view and its moments are compared with their checksums; the exit code is 1 if any differs.")]
pub(crate) struct Check {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    #[command(flatten)]
    pub(crate) engine: EngineArguments,
    /// Do not estimate rays and time: needs no device without --plot, and no more memory than the meshes
    #[arg(long)]
    pub(crate) no_estimate: bool,
    /// Draw the illumination curve into this file (.svg or .png)
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    /// Replace an existing picture
    #[arg(long, requires = "plot")]
    pub(crate) overwrite: bool,
    /// Print JSON (SI units, energies in keV)
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet compare run other\n  \
    beamlet compare run/retrieved other/retrieved --json\n  \
    beamlet compare run/sample measured.tif --tolerance 0.01 --difference differences\n  \
    beamlet compare run/retrieved measured_images -o pictures\n\n\
    Exit codes: 0 no difference above the tolerance, 1 a difference, 2 it could not compare.")]
pub(crate) struct Compare {
    /// Run, directory of retrieved images, or stack (NPY, EXR, TIFF, folder of frames)
    pub(crate) a: PathBuf,
    /// The other one, of the same kind
    pub(crate) b: PathBuf,
    /// Largest difference of a pixel that is ignored
    #[arg(long, value_name = "NUMBER", default_value_t = 0.0, value_parser = from_zero, allow_negative_numbers = true)]
    pub(crate) tolerance: f64,
    /// Directory for pictures of B - A: the image of each series that differs most
    #[arg(short, long, value_name = "DIR", conflicts_with = "json")]
    pub(crate) output: Option<PathBuf>,
    /// Replace existing pictures
    #[arg(long, requires = "output")]
    pub(crate) overwrite: bool,
    /// Write images of B - A into a new directory
    #[arg(long, value_name = "DIR")]
    pub(crate) difference: Option<PathBuf>,
    /// File format of the difference images
    #[arg(long, value_parser = choice::<Format>(), default_value_t = Format::Exr, requires = "difference")]
    pub(crate) format: Format,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

fn from_zero(text: &str) -> Result<f64, String> {
    let found = units::number(text).filter(|value| value.is_finite() && *value >= 0.0);
    found.ok_or_else(|| "allowed: a finite number of 0 or more".into())
}
