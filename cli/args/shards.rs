//! Runs in shards: `plan` and `join`.

use super::SceneArguments;
use super::names::format;
use super::shared::{EngineArguments, Messages};
use super::values::{sbatch_option, whole_number};
use beamlet::stack::Format;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet plan scan.toml --shards 8 -o run\n  \
    beamlet simulate run/scene.toml --shard 0/8 -o run     # and so on to 7/8, anywhere, in any order\n  \
    beamlet join run\n  \
    beamlet plan scan.toml --shards 40 --slurm --at-once 10 --sbatch-option gres=gpu:1 -o run\n\n\
    Each shard writes its views to its own folder; an interrupted shard continues when it is \
    started again. The shards of a run must have the same device, driver and version. Slurm \
    scripts are \
    written to RUN/slurm: shards.sbatch (an array), join.sbatch and submit.sh.")]
pub(crate) struct PlanArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// Run directory to make
    #[arg(short, long, value_name = "RUN")]
    pub(crate) output: PathBuf,
    /// Number of shards, at most the number of views
    #[arg(long, value_name = "N", value_parser = whole_number, allow_negative_numbers = true)]
    pub(crate) shards: u32,
    /// File format of the frames [default: exr]
    #[arg(long, value_parser = format())]
    pub(crate) format: Option<Format>,
    #[command(flatten)]
    pub(crate) engine: EngineArguments,
    /// Record the device of the first shard that begins: for planning on a machine without it
    #[arg(long, conflicts_with_all = ["device", "backend"])]
    pub(crate) no_device: bool,
    #[command(flatten)]
    pub(crate) slurm: SlurmArguments,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

/// Scripts for Slurm.
#[derive(Debug, Clone, Args)]
pub(crate) struct SlurmArguments {
    /// Write scripts for Slurm to RUN/slurm
    #[arg(long)]
    pub(crate) slurm: bool,
    /// With --slurm: most shards that run at the same time
    #[arg(long, value_name = "M", requires = "slurm", value_parser = whole_number, allow_negative_numbers = true)]
    pub(crate) at_once: Option<u32>,
    /// With --slurm: an option of sbatch, as in partition=gpu; empty for a flag, as in exclusive= (may
    /// be repeated)
    #[arg(long, value_name = "KEY=VALUE", requires = "slurm", value_parser = sbatch_option)]
    pub(crate) sbatch_option: Vec<[String; 2]>,
    /// With --slurm: template of the scripts, with {options} and {command} each on its own line
    #[arg(long, value_name = "FILE", requires = "slurm")]
    pub(crate) template: Option<PathBuf>,
    /// With --slurm: run beamlet in this image of Apptainer
    #[arg(long, value_name = "IMAGE", requires = "slurm")]
    pub(crate) container: Option<String>,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet join run --status\n  \
    beamlet join run\n\n\
    Every view is compared with the checksum of its shard. An interrupted join continues when it \
    is started again. A joined run is like any other; its shards and its plan are removed.")]
pub(crate) struct Join {
    /// Run directory made by `beamlet plan`
    pub(crate) run: PathBuf,
    /// List the shards and their progress
    #[arg(long)]
    pub(crate) status: bool,
    /// With --status: print JSON
    #[arg(long, requires = "status")]
    pub(crate) json: bool,
    /// Accept shards of different devices, drivers, backends or versions
    #[arg(long, conflicts_with = "status")]
    pub(crate) allow_mixed: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}
