//! The engine: a Vulkan device that serves many scenes one after another.

use crate::run::{Backend, Control, RunRecord};
use crate::scene::Scene;
use crate::stack::{Sink, Stacks};
use crate::{Error, Result};

/// How to open an [`Engine`].
#[derive(Debug, Clone, Default)]
pub struct EngineOptions {
    /// Device by index or part of its name; `None`: the environment variable
    /// `BEAMLET_DEVICE`, then the best device found.
    pub device: Option<String>,
    /// Backend; `None`: by capability and calibration on the scene.
    pub backend: Option<Backend>,
    /// Ask for the Khronos validation layer; its messages go to `log` as errors.
    pub validation: bool,
    /// Rows of a band; `None`: from the memory limit. Results do not depend on it.
    pub band_rows: Option<u32>,
    /// Rays of a dispatch; `None`: adapted to the device. Results do not depend on it.
    pub batch_rays: Option<u32>,
    /// Bytes that a band may take; `None`: 1 GiB.
    pub memory_limit: Option<u64>,
}

/// A Vulkan device that serves many scenes one after another.
#[derive(Debug)]
pub struct Engine {}

impl Engine {
    /// Opens a device.
    ///
    /// # Errors
    /// [`Error::Device`] without a Vulkan loader or a device that can serve.
    pub fn open(options: &EngineOptions) -> Result<Self> {
        let _ = options;
        Err(Error::device("a Vulkan device", "not built yet", ""))
    }

    /// Runs a scene: every view is traced, illuminated and handed to `sink`.
    ///
    /// # Errors
    /// See [`Error`]; [`Error::Interrupted`] when `control.cancel` was set.
    pub fn run(
        &self,
        scene: &Scene,
        sink: &mut dyn Sink,
        control: Control<'_>,
    ) -> Result<RunRecord> {
        let _ = (scene, sink, control);
        Err(Error::Interrupted)
    }

    /// Runs a scene into arrays.
    ///
    /// # Errors
    /// As [`Engine::run`].
    pub fn simulate(&self, scene: &Scene) -> Result<Stacks> {
        let _ = scene;
        Err(Error::Interrupted)
    }
}
