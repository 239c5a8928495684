//! An open device: the owner of everything made from it.

use super::allocator;
use super::command_batch::CommandBatch;
use super::faults::{Fault, Faults};
use super::instance::Instance;
use super::kernel::KernelTable;
use super::kernel_cache::{DeviceCache, KernelCache};
use super::physical::{self, DeviceDescription, Physical};
use super::profile::{Counters, Profile, Traffic};
use super::retire::{Retired, Retirement};
use super::staging::Staging;
use ash::vk;
use beamlet_core::parallel::is_fork;
use beamlet_core::{Error, Result};
use gpu_allocator::vulkan::Allocator;
use std::fmt;
use std::mem::ManuallyDrop;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Name of the environment variable that chooses a device where the options do not.
const CHOICE: &str = "BEAMLET_DEVICE";

/// How long a device that hangs is waited for when it is closed.
const FAREWELL: Duration = Duration::from_secs(5);

/// How to open a [`Device`].
#[derive(Debug, Clone, Default)]
pub struct DeviceOptions {
    /// Index or part of the name, in any case; `None`: the environment variable `BEAMLET_DEVICE`,
    /// then the first usable of discrete, integrated, virtual and CPU devices.
    pub choice: Option<String>,
    /// Load the Khronos validation layer; its messages go to `log` and are counted.
    pub validation: bool,
    /// Copy through staging buffers even where device memory is mapped (for tests of that path).
    pub staging: bool,
    /// Measure the time of dispatches on the device.
    pub profile: bool,
    /// Calls of Vulkan that fail (for tests).
    pub faults: Vec<Fault>,
    /// Memory behind each buffer where writes beyond its end are found (for tests).
    pub guards: bool,
    /// Where kernels that the driver has made are kept.
    pub cache: KernelCache,
    /// Kernels that [`Device::kernel`] finds by their names.
    pub kernels: KernelTable,
}

/// An open Vulkan device with one compute queue.
pub struct Device {
    /// The functions of Vulkan.
    pub(super) raw: ash::Device,
    pub(super) physical: Physical,
    /// Where ray query is there.
    pub(super) structures: Option<ash::khr::acceleration_structure::Device>,
    pub(super) cache: DeviceCache,
    pub(super) memory_types: vk::PhysicalDeviceMemoryProperties,
    /// Host memory is copied to buffers by submissions.
    pub staging: bool,
    /// Dispatches have timestamps.
    pub(super) timed: bool,
    pub(super) counters: Mutex<Counters>,
    pub(crate) faults: Faults,
    /// Buffers have guards.
    pub(super) guards: bool,
    /// Kernels by name.
    pub(crate) table: KernelTable,
    names: Option<ash::ext::debug_utils::Device>,
    queue: Mutex<vk::Queue>,
    /// `None` only while the device is being destroyed.
    pub(super) allocator: Mutex<Option<Allocator>>,
    pub(super) retirement: Mutex<Retirement>,
    /// Batches whose end was not to be waited for.
    pub(super) stuck: Mutex<Vec<CommandBatch>>,
    /// Staging buffers for the next submissions.
    pub(super) kept: Mutex<Vec<Staging>>,
    /// Staging buffers of submissions that failed.
    pub(super) withdrawn: Mutex<Vec<Staging>>,
    /// Batches that ended and wait for reuse.
    pub(crate) batches: Mutex<Vec<CommandBatch>>,
    /// After everything made from it; kept open where the device hangs.
    instance: ManuallyDrop<Instance>,
}

impl Device {
    /// Every device that Vulkan shows, usable or not.
    ///
    /// # Errors
    /// [`Error::Device`] without a Vulkan loader, driver or device.
    pub fn list() -> Result<Vec<DeviceDescription>> {
        let devices = physical::enumerate(&Instance::new(false)?)?;
        Ok(devices.into_iter().map(|device| device.description).collect())
    }

    /// Opens a device.
    ///
    /// # Errors
    /// [`Error::Device`] without a loader, driver, or device that can serve, where the chosen
    /// device is not there, or where validation is requested and not installed; [`Error::Memory`]
    /// where a driver could not begin.
    pub fn open(options: &DeviceOptions) -> Result<Arc<Self>> {
        let instance = Instance::new(options.validation)?;
        let from_environment =
            || std::env::var(CHOICE).ok().filter(|choice| !choice.trim().is_empty());
        let choice = options.choice.clone().or_else(from_environment);
        let physical = physical::choose(physical::enumerate(&instance)?, choice.as_deref())?;
        let raw = open(&instance, &physical)?;
        let guard = Unowned(&raw);

        // SAFETY: the queue was requested when the device was opened.
        let queue = unsafe { raw.get_device_queue(physical.queue_family, 0) };
        let ray_query = physical.description.ray_query;
        let structures =
            ray_query.then(|| ash::khr::acceleration_structure::Device::new(&instance.raw, &raw));
        let names =
            instance.validation().then(|| ash::ext::debug_utils::Device::new(&instance.raw, &raw));
        // SAFETY: `physical` is a device of `instance`.
        let memory_types =
            unsafe { instance.raw.get_physical_device_memory_properties(physical.raw) };
        let allocator = allocator::allocator(&instance.raw, &raw, physical.raw)?;
        let cache = DeviceCache::open(&raw, &physical, &options.cache, options.kernels)?;
        log::debug!("opened {}", physical.description);
        let timed = options.profile && physical.has_timestamps;
        std::mem::forget(guard);
        Ok(Arc::new(Self {
            raw,
            physical,
            structures,
            cache,
            memory_types,
            staging: options.staging,
            timed,
            counters: Mutex::default(),
            faults: Faults::new(&options.faults),
            guards: options.guards,
            table: options.kernels,
            names,
            queue: Mutex::new(queue),
            allocator: Mutex::new(Some(allocator)),
            retirement: Mutex::default(),
            stuck: Mutex::default(),
            kept: Mutex::default(),
            withdrawn: Mutex::default(),
            batches: Mutex::default(),
            instance: ManuallyDrop::new(instance),
        }))
    }

    /// Name, driver and kind of the device.
    pub fn description(&self) -> &DeviceDescription {
        &self.physical.description
    }

    /// Counts of its work since it was opened, by all its users.
    pub fn profile(&self) -> Profile {
        lock(&self.counters).profile()
    }

    /// The part of [`Device::profile`] without the kernels.
    pub fn traffic(&self) -> Traffic {
        lock(&self.counters).traffic
    }

    /// Buffers so far with writes beyond their end, where they have guards and the host reaches their memory.
    pub fn overflows(&self) -> u32 {
        lock(&self.counters).overflows
    }

    /// Warnings and errors of the validation layer so far; 0 without it.
    pub fn validation_messages(&self) -> u32 {
        self.instance.messages()
    }

    /// True if the validation layer listens.
    pub fn validation(&self) -> bool {
        self.instance.validation()
    }

    /// The most workgroups of one dispatch, in x, y and z.
    pub fn max_groups(&self) -> [u32; 3] {
        self.physical.limits.max_compute_work_group_count
    }

    /// The queue, for one thread at a time as Vulkan demands.
    pub(super) fn queue(&self) -> MutexGuard<'_, vk::Queue> {
        lock(&self.queue)
    }

    /// Names an object in the messages of the validation layer.
    pub(super) fn name(&self, object: impl vk::Handle, name: &str) {
        let (Some(names), Ok(name)) = (&self.names, std::ffi::CString::new(name)) else { return };
        let info =
            vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        // SAFETY: the extension is enabled with validation; the object was made by this device.
        if let Err(e) = unsafe { names.set_debug_utils_object_name(&info) } {
            log::debug!("naming a Vulkan object: {e}");
        }
    }

    /// Destroys something as soon as no submission can use it.
    pub(super) fn retire(&self, retired: Retired) {
        let ready = lock(&self.retirement).retire(retired);
        self.destroy(ready);
    }

    /// Destroys what no submission uses any more.
    pub(super) fn destroy(&self, retired: impl IntoIterator<Item = Retired>) {
        for one in retired {
            // SAFETY: each was made by this device, and `Retirement` hands it out once, after the
            // last submission that could use it.
            unsafe {
                match one {
                    Retired::Buffer(buffer, memory) => {
                        self.raw.destroy_buffer(buffer, None);
                        self.free(memory);
                    }
                    Retired::Pipeline(pipeline, layout) => {
                        self.raw.destroy_pipeline(pipeline, None);
                        self.raw.destroy_pipeline_layout(layout, None);
                    }
                    Retired::AccelerationStructure(structure) => {
                        if let Some(structures) = &self.structures {
                            structures.destroy_acceleration_structure(structure, None);
                        }
                    }
                }
            }
        }
    }
}

/// Locks; data of a panicking thread is still consistent here.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Device").field("description", self.description()).finish_non_exhaustive()
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let stuck = std::mem::take(&mut *lock(&self.stuck));
        if is_fork() {
            // The device is that of the parent.
            std::mem::forget((stuck, lock(&self.allocator).take()));
            return;
        }
        if stuck.iter().any(|batch| !batch.ends_within(&self.raw, FAREWELL)) {
            // Waiting would never end, and what runs must keep its memory.
            log::warn!("the device hangs: it is left open");
            std::mem::forget(lock(&self.allocator).take());
            return;
        }
        // SAFETY: buffers, kernels, structures and submissions keep the device alive, so that only the
        // objects destroyed here exist. The instance is not used afterwards.
        unsafe {
            if let Err(e) = self.raw.device_wait_idle() {
                log::warn!("closing the device: {e}");
            }
            for batch in stuck {
                batch.destroy(&self.raw);
            }
            for staging in [&self.kept, &self.withdrawn] {
                self.destroy(lock(staging).drain(..).map(Staging::retired));
            }
            let retired = lock(&self.retirement).drain();
            self.destroy(retired);
            for batch in lock(&self.batches).drain(..) {
                batch.destroy(&self.raw);
            }
            self.cache.keep(&self.raw);
            self.raw.destroy_pipeline_cache(self.cache.raw, None);
            drop(lock(&self.allocator).take());
            self.raw.destroy_device(None);
            ManuallyDrop::drop(&mut self.instance);
        }
    }
}

/// A device that nothing owns yet: closed unless forgotten.
struct Unowned<'a>(&'a ash::Device);

impl Drop for Unowned<'_> {
    fn drop(&mut self) {
        // SAFETY: opening failed half way, before anything was made that outlives this.
        unsafe { self.0.destroy_device(None) };
    }
}

fn open(instance: &Instance, physical: &Physical) -> Result<ash::Device> {
    let ray_query = physical.description.ray_query;
    let mut extensions = Vec::new();
    if physical.portability_subset {
        extensions.push(ash::khr::portability_subset::NAME.as_ptr());
    }
    if ray_query {
        extensions.push(ash::khr::acceleration_structure::NAME.as_ptr());
        extensions.push(ash::khr::ray_query::NAME.as_ptr());
        extensions.push(ash::khr::deferred_host_operations::NAME.as_ptr());
    }
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(physical.queue_family)
        .queue_priorities(&[1.0])];
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default()
        .buffer_device_address(true)
        .scalar_block_layout(true);
    let mut structure =
        vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
    let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
    let mut info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .push_next(&mut v12);
    if ray_query {
        info = info.push_next(&mut structure).push_next(&mut query);
    }
    // SAFETY: every requested extension and feature was found on this device before.
    unsafe { instance.raw.create_device(physical.raw, &info, None) }.map_err(|e| {
        Error::device(
            format!("opening {}", physical.description),
            format!("Vulkan answered {e:?}"),
            "choose another device",
        )
    })
}
