//! What a scene or run amounts to: `check` and `compare`.

use super::SceneArguments;
use super::names::{BackendName, ImageFormatName};
use super::values::{from_zero, memory_size};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet check scene.toml\n  \
    beamlet check scene.toml --set 'detector.pixels=[512, 512]'\n  \
    beamlet check scene.toml --json\n  \
    beamlet check run\n\n\
    Of a run every view, and the moments that it keeps, are compared with their checksums; the \
    exit code is 1 where it is not whole.")]
pub(crate) struct Check {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// Tell what a run with this memory limit takes, such as "2 GiB"
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) memory_limit: Option<u64>,
    /// How rays find triangles: auto measures both on the scene
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    pub(crate) backend: BackendName,
    /// Vulkan device, by its number or part of its name (see `beamlet devices`)
    #[arg(long, value_name = "N|NAME")]
    pub(crate) device: Option<String>,
    /// Do not estimate rays and time: needs no device, and no more memory than the meshes
    #[arg(long, conflicts_with_all = ["device", "backend"])]
    pub(crate) no_estimate: bool,
    /// Print JSON (SI units, energies in keV)
    #[arg(long)]
    pub(crate) json: bool,
    /// No progress, errors only on stderr; the report stays
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet compare run other\n  \
    beamlet compare run/retrieved other/retrieved --json\n  \
    beamlet compare run/sample measured.tif --tolerance 0.01 --difference differences\n\n\
    Exit codes: 0 nothing differs by more than the tolerance, 1 something does, 2 trouble.")]
pub(crate) struct Compare {
    /// Run, directory of retrieved images, or stack (NPY, EXR, TIFF, folder of frames)
    pub(crate) a: PathBuf,
    /// What is compared with it, of the same kind
    pub(crate) b: PathBuf,
    /// Largest difference of a pixel that counts as none
    #[arg(long, value_name = "NUMBER", default_value_t = 0.0, value_parser = from_zero, allow_negative_numbers = true)]
    pub(crate) tolerance: f64,
    /// Write images of B - A into a new directory
    #[arg(long, value_name = "DIR")]
    pub(crate) difference: Option<PathBuf>,
    /// File format of the images of differences
    #[arg(long, value_enum, default_value_t = ImageFormatName::Exr, requires = "difference")]
    pub(crate) format: ImageFormatName,
    /// Show no progress
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}
