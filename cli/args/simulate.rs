//! What makes a run: `simulate` and `illuminate`.

use super::SceneArguments;
use super::names::format;
use super::shared::{EngineArguments, Messages, ProfileArguments};
use super::values::{key_value, shard};
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
          conflicts_with_all = ["overwrite", "format", "keep_moments"])]
    pub(crate) shard: Option<Shard>,
    /// With --resume or --shard: accept another device, driver, backend or version than the run began
    /// with
    #[arg(long, requires = "goes_on")]
    pub(crate) allow_mixed: bool,
    /// Replace an earlier run; files that beamlet did not write stay
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Keep the moments of the rays in RUN/moments, for `beamlet illuminate`
    #[arg(long)]
    pub(crate) keep_moments: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n  \
    beamlet simulate scene.toml -o run --keep-moments\n  \
    beamlet illuminate run --scene wider.toml -o wider\n  \
    beamlet illuminate run --set 'source.spot=60 um' -o blurred\n  \
    beamlet illuminate run --scene a.toml --scene b.toml -o designs\n\n\
    Source distance, angles, and the place and shape of every object must be as in the run; \
    masks, mask offsets, spot, spectrum, the materials' constants and the detector may differ. \
    With several scenes each run directory is named after its scene.")]
pub(crate) struct Illuminate {
    /// Run directory with moments (`simulate --keep-moments`)
    pub(crate) run: PathBuf,
    /// Scene with the new masks, spectrum or detector, TOML or JSON (may be repeated) [default: the
    /// scene of RUN]
    #[arg(long, value_name = "SCENE")]
    pub(crate) scene: Vec<PathBuf>,
    /// Change a value of every scene: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub(crate) sets: Vec<String>,
    /// Run directory to write; with several scenes, the directory of their run directories
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// File format of the frames [default: exr]
    #[arg(long, value_parser = format())]
    pub(crate) format: Option<Format>,
    #[command(flatten)]
    pub(crate) engine: EngineArguments,
    #[command(flatten)]
    pub(crate) profile: ProfileArguments,
    /// Replace earlier runs; files that beamlet did not write stay
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}
