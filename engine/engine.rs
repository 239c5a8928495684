//! The engine: a Vulkan device that serves many scenes.

use crate::shaders;
use beamlet_core::{Result, program};
use beamlet_files::{ArraySink, RunRecord, Sink, Stacks};
use beamlet_gpu::{Compute, Device, DeviceDescription, EngineOptions};
use beamlet_model::scene::Scene;
use beamlet_simulate::run::{Control, Simulation, Simulator};
use std::ops::Deref;

/// Handle of a Vulkan device that serves many scenes. Clones share the device; they may be sent to
/// other threads and work there at the same time. The device and the Vulkan instance are destroyed
/// with the last clone and the last [`Simulation`] made from it. In a fork of a process that worked, all work is an
/// [`beamlet_core::Error::Device`].
#[derive(Debug, Clone)]
pub struct Engine {
    simulator: Simulator,
}

impl Deref for Engine {
    type Target = Compute;

    /// The device, as retrieval and reconstruction take it.
    fn deref(&self) -> &Compute {
        self.simulator.compute()
    }
}

impl Engine {
    /// Opens a device.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`] without a Vulkan loader or a device that can serve.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::{Backend, Engine, EngineOptions};
    ///
    /// let engine = Engine::open(&EngineOptions::default().with_backend(Backend::Bvh))?;
    /// println!("{}", engine.description().name);
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn open(options: &EngineOptions) -> Result<Self> {
        program::set_commit(option_env!("BEAMLET_COMMIT"));
        Ok(Self { simulator: Simulator::new(Compute::open(options, shaders::ALL)?) })
    }

    /// Closes the engine. Returns whether the device and the Vulkan instance are destroyed: `false`
    /// while a clone, a [`Simulation`] or cancelled work in another thread still uses them; the last
    /// user destroys them. Some drivers crash where a device exists at the end of the process:
    /// programs that keep an engine in a static variable call `close` before they exit.
    #[must_use = "the device is not destroyed while somebody uses it"]
    pub fn close(self) -> bool {
        self.simulator.close()
    }

    /// The same device and kernels under other options of runs ([`Compute::with_options`]).
    #[doc(hidden)]
    #[must_use]
    pub fn with_options(&self, options: EngineOptions) -> Self {
        Self { simulator: self.simulator.with_options(options) }
    }

    pub(crate) const fn simulator(&self) -> &Simulator {
        &self.simulator
    }

    /// Makes a scene ready: loads and checks its meshes, uploads them, chooses a backend.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Scene`], [`beamlet_core::Error::Mesh`], [`beamlet_core::Error::Device`],
    /// [`beamlet_core::Error::Memory`].
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::{Engine, EngineOptions, scene::Scene};
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let simulation = engine.prepare(&Scene::load("scene.toml")?)?;
    /// println!("{} bytes at the peak", simulation.memory().peak_bytes);
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn prepare(&self, scene: &Scene) -> Result<Simulation> {
        self.prepare_with(scene, &mut Control::default())
    }

    /// As [`Engine::prepare`]; `control.progress` receives the loading of objects, and
    /// `control.cancel` ends it.
    ///
    /// # Errors
    /// As [`Engine::prepare`]; [`beamlet_core::Error::Interrupted`] when `control.cancel` was set.
    pub fn prepare_with(&self, scene: &Scene, control: &mut Control<'_>) -> Result<Simulation> {
        Simulation::new(&self.simulator, scene, control)
    }

    /// Runs a scene: every view is traced, illuminated and handed to `sink`.
    ///
    /// # Errors
    /// See [`beamlet_core::Error`]; [`beamlet_core::Error::Interrupted`] when `control.cancel` was set.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::stack::{Format, RunDirectory};
    /// use beamlet::{Control, Engine, EngineOptions, scene::Scene};
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let mut directory = RunDirectory::create("run", Format::Exr, false)?;
    /// let record = engine.run(&Scene::load("scene.toml")?, &mut directory, Control::default())?;
    /// println!("{} rays", record.tally.rays);
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn run(
        &self,
        scene: &Scene,
        sink: &mut dyn Sink,
        mut control: Control<'_>,
    ) -> Result<RunRecord> {
        self.prepare_with(scene, &mut control)?.run(sink, control)
    }

    /// Runs a scene into arrays.
    ///
    /// # Errors
    /// As [`Engine::run`].
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::{Engine, EngineOptions, scene::Scene};
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let stacks = engine.simulate(&Scene::load("scene.toml")?)?;
    /// // [step][row][column] and [view][step][row][column], 1 is the open beam.
    /// println!("{:?} {:?}", stacks.flat.shape(), stacks.sample.shape());
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn simulate(&self, scene: &Scene) -> Result<Stacks> {
        let mut sink = ArraySink::new();
        self.run(scene, &mut sink, Control::default())?;
        sink.into_stacks().ok_or(beamlet_core::Error::Interrupted)
    }
}

/// Every device that Vulkan shows, usable or not.
///
/// # Errors
/// [`beamlet_core::Error::Device`] without a Vulkan loader, driver or device.
///
/// # Example
///
/// ```no_run
/// for device in beamlet::devices()? {
///     println!("{} {}", device.index, device.name);
/// }
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn devices() -> Result<Vec<DeviceDescription>> {
    Device::list()
}
