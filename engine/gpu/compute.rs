//! A device that work runs on, with the options that it goes by.

use super::backend::Backend;
use super::device::{Device, DeviceOptions};
use super::faults::Fault;
use super::kernel::KernelTable;
use super::kernel_cache::KernelCache;
use super::physical::DeviceDescription;
use super::profile::Profile;
use beamlet_core::parallel::start_threads;
use beamlet_core::{Result, setters};
use std::sync::Arc;

/// Name of the environment variable that forces staging.
const STAGING: &str = "BEAMLET_STAGING";

/// How to open an engine. `EngineOptions::default()` takes the best device that is found; what
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
    /// Measure the time of each kernel on the device ([`Compute::profile`]); counts are taken always.
    pub profile: bool,
    /// Copy through staging buffers even where device memory is mapped, as on a CPU: its counts are those
    /// of a device with memory of its own. Set also by `BEAMLET_STAGING=1`. Results do not depend on it.
    pub staging: bool,
    /// Where kernels that the driver has made are kept: some drivers take seconds for the large ones.
    pub cache: KernelCache,
    /// Calls of Vulkan that fail (for tests).
    #[doc(hidden)]
    pub faults: Vec<Fault>,
    /// Memory behind each buffer where writes beyond its end are found (for tests).
    #[doc(hidden)]
    pub guards: bool,
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
        /// Measures the time of each kernel on the device.
        with_profile(profile: bool);
        /// Copies through staging buffers where device memory is mapped.
        with_staging(staging: bool);
        /// Chooses where kernels that the driver has made are kept.
        with_cache(cache: KernelCache);
        /// Makes calls of Vulkan fail (for tests).
        #[doc(hidden)]
        with_faults(faults: Vec<Fault>);
        /// Finds writes beyond the end of buffers (for tests).
        #[doc(hidden)]
        with_guards(guards: bool);
    }
}

/// An open device and its options. Clones share the device.
#[derive(Debug, Clone)]
pub struct Compute {
    options: Arc<EngineOptions>,
    device: Arc<Device>,
}

impl Compute {
    /// Opens a device; its kernels are found in `kernels`.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`] without a Vulkan loader or a device that can serve.
    #[doc(hidden)]
    pub fn open(options: &EngineOptions, kernels: KernelTable) -> Result<Self> {
        start_threads()?;
        let device = Device::open(&DeviceOptions {
            choice: options.device.clone(),
            validation: options.validation,
            profile: options.profile,
            staging: options.staging || std::env::var(STAGING).is_ok_and(|value| value == "1"),
            faults: options.faults.clone(),
            guards: options.guards,
            cache: options.cache.clone(),
            kernels,
        })?;
        Ok(Self { options: Arc::new(options.clone()), device })
    }

    /// Drops it. Returns whether the device is destroyed: `false` while somebody uses it.
    #[doc(hidden)]
    pub fn close(self) -> bool {
        Arc::into_inner(self.device).is_some()
    }

    /// The same device under other options of runs: the backend, rows of a band, rays of a dispatch and the limit
    /// of the memory.
    #[doc(hidden)]
    #[must_use]
    pub fn with_options(&self, options: EngineOptions) -> Self {
        Self { options: Arc::new(options), device: Arc::clone(&self.device) }
    }

    /// The device in use.
    #[must_use]
    pub fn description(&self) -> &DeviceDescription {
        self.device.description()
    }

    /// Buffers so far with writes beyond their end, where they have guards.
    #[doc(hidden)]
    #[must_use]
    pub fn overflows(&self) -> u32 {
        self.device.overflows()
    }

    /// Messages of the validation layer so far, where it was requested.
    #[must_use]
    pub fn validation_messages(&self) -> u32 {
        self.device.validation_messages()
    }

    /// Counts of the work of the device since it was opened, by all its users: submissions, waits,
    /// bytes each way, buffers, and dispatches of each kernel.
    #[must_use]
    pub fn profile(&self) -> Profile {
        self.device.profile()
    }

    /// How it was opened.
    #[doc(hidden)]
    pub fn options(&self) -> &EngineOptions {
        &self.options
    }

    /// The open device.
    #[doc(hidden)]
    pub const fn device(&self) -> &Arc<Device> {
        &self.device
    }
}
