//! What makes a run: `simulate` and `illuminate`.

use super::SceneArguments;
use super::names::format;
use super::shared::{EngineArguments, Messages, ProfileArguments};
use super::values::shard;
use beamlet::stack::{Format, Shard};
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
    #[arg(long, value_parser = format())]
    pub(crate) format: Option<Format>,
    #[command(flatten)]
    pub(crate) engine: EngineArguments,
    #[command(flatten)]
    pub(crate) profile: ProfileArguments,
    /// Continue an interrupted run
    #[arg(long, conflicts_with = "overwrite", group = "goes_on")]
    pub(crate) resume: bool,
    /// Simulate shard K of N of the run that `beamlet plan` made at RUN, K from 0; an interrupted shard
    /// continues
    #[arg(long, value_name = "K/N", value_parser = shard, group = "goes_on",
          conflicts_with_all = ["overwrite", "format"])]
    pub(crate) shard: Option<Shard>,
    /// With --resume or --shard: accept another device, driver, backend or version than the run began
    /// with
    #[arg(long, requires = "goes_on")]
    pub(crate) allow_mixed: bool,
    /// Replace an earlier run; files that beamlet did not write stay
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}
