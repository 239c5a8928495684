//! The engine: a Vulkan device that serves many scenes.

use crate::Result;
use crate::gpu::Backend;
use crate::gpu::{Device, DeviceDescription, DeviceOptions, Fault};
use crate::illuminate::{CellKernels, RandomKernels};
use crate::moments::StoredMoments;
use crate::parallel::start_threads;
use crate::run::Control;
use crate::run::simulation::{Kernels, Simulation};
use crate::scene::Scene;
use crate::stack::RunRecord;
use crate::stack::{ArraySink, Sink, Stacks};
use crate::trace::TraceKernels;
use std::sync::Arc;

/// How to open an [`Engine`]. `EngineOptions::default()` takes the best device that is found; what
/// differs from it is set in a chain.
///
/// ```
/// use beamlet::{Backend, EngineOptions};
///
/// let options = EngineOptions::default().with_backend(Backend::Bvh).with_memory_limit(2 << 30);
/// assert_eq!(options.backend, Some(Backend::Bvh));
/// ```
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct EngineOptions {
    /// Device by index or part of its name; `None`: the environment variable
    /// `BEAMLET_DEVICE`, then the best device found.
    pub device: Option<String>,
    /// Backend; `None`: chosen by the device and counts of the scene.
    pub backend: Option<Backend>,
    /// Load the Khronos validation layer; its messages go to `log` as errors.
    pub validation: bool,
    /// Rows of a band; `None`: from the memory limit. Results do not depend on it.
    pub band_rows: Option<u32>,
    /// Rays of a dispatch; `None`: adapted to the device. Results do not depend on it.
    pub batch_rays: Option<u32>,
    /// Memory limit of a run on host and device together, bytes; `None`: the geometry, and up to 1 GiB
    /// for a band. Results do not depend on it.
    pub memory_limit: Option<u64>,
    /// Prepare runs whose moments are kept ([`Control::keep`]): rays are flagged for materials
    /// that refract up to twice as strongly.
    pub keep_moments: bool,
    /// Calls of Vulkan that fail (for tests).
    #[doc(hidden)]
    pub faults: Vec<Fault>,
}

impl EngineOptions {
    setters! {
        /// Chooses the device by its index or a part of its name.
        with_device(device: impl Into<Option<String>>);
        /// Chooses the backend.
        with_backend(backend: impl Into<Option<Backend>>);
        /// Loads the Khronos validation layer.
        with_validation(validation: bool);
        /// Sets the rows of a band.
        with_band_rows(band_rows: impl Into<Option<u32>>);
        /// Sets the rays of a dispatch.
        with_batch_rays(batch_rays: impl Into<Option<u32>>);
        /// Limits the memory of a run, host and device together, bytes.
        with_memory_limit(memory_limit: impl Into<Option<u64>>);
        /// Prepares runs whose moments are kept.
        with_keep_moments(keep_moments: bool);
        /// Makes calls of Vulkan fail (for tests).
        #[doc(hidden)]
        with_faults(faults: Vec<Fault>);
    }
}

/// Handle of a Vulkan device that serves many scenes. Clones share the device; they may be sent to
/// other threads and work there at the same time. The device and the Vulkan instance are destroyed
/// with the last clone and the last [`Simulation`] made from it.
#[derive(Debug, Clone)]
pub struct Engine {
    options: Arc<EngineOptions>,
    kernels: Arc<Kernels>,
    device: Arc<Device>,
}

impl Engine {
    /// Opens a device.
    ///
    /// # Errors
    /// [`crate::Error::Device`] without a Vulkan loader or a device that can serve.
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
        start_threads()?;
        let device = Device::open(&DeviceOptions {
            choice: options.device.clone(),
            validation: options.validation,
            faults: options.faults.clone(),
            ..DeviceOptions::default()
        })?;
        let kernels = Arc::new(Kernels {
            trace: Arc::new(TraceKernels::new(&device)),
            illuminate: Arc::new(CellKernels::new(&device)),
            random: RandomKernels::new(&device),
        });
        Ok(Self { options: Arc::new(options.clone()), device, kernels })
    }

    /// Closes the engine. Returns whether the device and the Vulkan instance are destroyed: `false`
    /// while a clone, a [`Simulation`] or cancelled work in another thread still uses them; the last
    /// user destroys them. Some drivers crash where a device exists at the end of the process:
    /// programs that keep an engine in a static variable call `close` before they exit.
    #[must_use = "the device is not destroyed while somebody uses it"]
    pub fn close(self) -> bool {
        let Self { options: _, kernels, device } = self;
        drop(kernels);
        Arc::into_inner(device).is_some()
    }

    /// The device in use.
    #[must_use]
    pub fn description(&self) -> &DeviceDescription {
        self.device.description()
    }

    /// Messages of the validation layer so far, where it was requested.
    #[must_use]
    pub fn validation_messages(&self) -> u32 {
        self.device.validation_messages()
    }

    pub(crate) fn options(&self) -> &EngineOptions {
        &self.options
    }

    pub(crate) const fn device(&self) -> &Arc<Device> {
        &self.device
    }

    pub(crate) fn trace_kernels(&self) -> &Arc<TraceKernels> {
        &self.kernels.trace
    }

    pub(crate) fn random_kernels(&self) -> &RandomKernels {
        &self.kernels.random
    }

    pub(crate) fn illuminate_kernels(&self) -> &Arc<CellKernels> {
        &self.kernels.illuminate
    }

    /// Makes a scene ready: loads and checks its meshes, uploads them, chooses a backend.
    ///
    /// # Errors
    /// [`crate::Error::Scene`], [`crate::Error::Mesh`], [`crate::Error::Device`],
    /// [`crate::Error::Memory`].
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
    /// As [`Engine::prepare`]; [`crate::Error::Interrupted`] when `control.cancel` was set.
    pub fn prepare_with(&self, scene: &Scene, control: &mut Control<'_>) -> Result<Simulation> {
        Simulation::new(self, scene, control)
    }

    /// Runs a scene: every view is traced, illuminated and handed to `sink`.
    ///
    /// # Errors
    /// See [`crate::Error`]; [`crate::Error::Interrupted`] when `control.cancel` was set.
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

    /// Makes a scene ready whose rays were traced by the run that kept `moments`. Meshes are
    /// loaded only where rays have to be traced exactly again.
    ///
    /// # Errors
    /// As [`Engine::prepare`]; [`crate::Error::Scene`] if the scene differs from the run's in more than
    /// masks, steps, spot, spectrum, materials' constants and detector.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::stack::ArraySink;
    /// use beamlet::{Control, Engine, EngineOptions, moments::StoredMoments, scene::Scene};
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let moments = StoredMoments::open("run".as_ref())?;
    /// let other = Scene::load_with("run/scene.toml", &["scan.mask_offsets=[\"0 um\"]".to_owned()])?;
    /// let mut sink = ArraySink::new();
    /// engine.reilluminate(&moments, &other)?.run(&mut sink, Control::default())?;
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn reilluminate(&self, moments: &StoredMoments, scene: &Scene) -> Result<Simulation> {
        self.reilluminate_with(moments, scene, &mut Control::default())
    }

    /// As [`Engine::reilluminate`]; `control` is used as in [`Engine::prepare_with`].
    ///
    /// # Errors
    /// As [`Engine::reilluminate`]; [`crate::Error::Interrupted`] when `control.cancel` was set.
    pub fn reilluminate_with(
        &self,
        moments: &StoredMoments,
        scene: &Scene,
        control: &mut Control<'_>,
    ) -> Result<Simulation> {
        Simulation::of_stored(self, moments, scene, control)
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
        sink.into_stacks().ok_or(crate::Error::Interrupted)
    }
}

/// Every device that Vulkan shows, usable or not.
///
/// # Errors
/// [`crate::Error::Device`] without a Vulkan loader, driver or device.
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
