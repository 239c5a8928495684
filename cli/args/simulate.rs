//! What makes a run: `simulate` and `illuminate`.

use super::SceneArguments;
use super::options::choice;
use super::shared::{EngineArguments, Messages, ProfileArguments};
use beamlet::stack::{Format, ViewRange};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet simulate scene.toml -o run\n  \
    beamlet simulate scene.toml -o run --resume\n  \
    beamlet simulate scene.toml -o run40 --format npy --set 'source.energy=40 keV'\n\n\
    The run directory holds scene.toml (the scene with every default), run.json (device, \
    counts, times), progress.log (committed views) and the frames: flat and sample. \
    --resume continues a run that Ctrl-C ended.")]
pub(crate) struct Simulate {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// Run directory to write
    #[arg(short, long, value_name = "RUN")]
    pub(crate) output: PathBuf,
    /// File format of the frames [default: exr; with --resume the format of the run]
    #[arg(long, value_parser = choice::<Format>())]
    pub(crate) format: Option<Format>,
    #[command(flatten)]
    pub(crate) engine: EngineArguments,
    #[command(flatten)]
    pub(crate) profile: ProfileArguments,
    /// Continue an interrupted run
    #[arg(long, conflicts_with = "overwrite")]
    pub(crate) resume: bool,
    /// Simulate a part of the run, for `beamlet join`: the views A to B - 1, from 0, with their flats and
    /// darks
    #[arg(long, value_name = "A..B", value_parser = view_range)]
    pub(crate) views: Option<ViewRange>,
    /// With --resume: accept another device, driver, backend or version than the run began with
    #[arg(long, requires = "resume")]
    pub(crate) allow_mixed: bool,
    /// Replace an earlier run; files that beamlet did not write stay
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet simulate scan.toml --views 0..90 -o parts/0        # anywhere, in any order\n  \
    beamlet simulate scan.toml --views 90..180 -o parts/1\n  \
    beamlet join parts/* -o run\n\n\
    Every view is compared with the checksum of its part. An interrupted join continues when it is \
    started again. The parts stay. The parts of a run must have the same device, driver and version.")]
pub(crate) struct Join {
    /// Parts of one run, each made by `beamlet simulate --views`, in any order
    #[arg(required = true, value_name = "PART")]
    pub(crate) parts: Vec<PathBuf>,
    /// Run directory to write
    #[arg(short, long, value_name = "RUN")]
    pub(crate) output: PathBuf,
    /// Accept parts of different devices, drivers, backends or versions
    #[arg(long)]
    pub(crate) allow_mixed: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

fn view_range(text: &str) -> Result<ViewRange, String> {
    text.parse().map_err(|error: beamlet::Error| error.to_string())
}
