//! Arguments of several verbs: what walks the rays, and how much goes to stderr.

use beamlet::cli_support::units;
use beamlet::{Backend, EngineOptions};
use clap::{Args, ValueEnum};

/// The device of verbs that trace or fit.
#[derive(Debug, Clone, Args)]
pub(crate) struct DeviceArguments {
    /// Vulkan device, by its number or part of its name (see `beamlet devices`)
    #[arg(long, value_name = "N|NAME")]
    pub(crate) device: Option<String>,
}

impl DeviceArguments {
    /// Options of an engine on this device.
    pub(crate) fn options(&self) -> EngineOptions {
        EngineOptions::default().with_device(self.device.clone())
    }
}

/// The option that shows the work of the device.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct ProfileArguments {
    /// Table on stderr of the work of the device: submissions, waits, bytes each way, buffers, and for each
    /// kernel its dispatches, workgroups and time
    #[arg(long)]
    pub(crate) profile: bool,
}

/// What walks the rays of a run, and in how much memory.
#[derive(Debug, Clone, Args)]
pub(crate) struct EngineArguments {
    /// How rays find triangles: auto chooses by the device and counts of the scene
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    pub(crate) backend: BackendName,
    #[command(flatten)]
    pub(crate) device: DeviceArguments,
    /// Memory limit of the run, host and device together, such as "2 GiB" [default: the geometry plus
    /// up to 1 GiB for a band]
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) memory_limit: Option<u64>,
}

impl EngineArguments {
    /// Options of an engine for such a run.
    pub(crate) fn options(&self) -> EngineOptions {
        let options = self.device.options().with_backend(self.backend.choice());
        options.with_memory_limit(self.memory_limit)
    }
}

/// How much is printed. Verbs whose output is the answer print it all the same.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Messages {
    /// No progress and no summary, errors only
    #[arg(short, long, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// More detail
    #[arg(short, long)]
    pub(crate) verbose: bool,
}

/// `--backend`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BackendName {
    /// The faster one on this scene
    Auto,
    /// The driver's acceleration structures
    RayQuery,
    /// The tree of beamlet, in a compute shader
    Bvh,
}

impl BackendName {
    /// `None` leaves the choice to the engine.
    pub(crate) fn choice(self) -> Option<Backend> {
        match self {
            Self::Auto => None,
            Self::RayQuery => Some(Backend::RayQuery),
            Self::Bvh => Some(Backend::Bvh),
        }
    }
}

pub(super) fn memory_size(text: &str) -> Result<u64, String> {
    units::memory_size(text).map_err(|error| error.to_string())
}
