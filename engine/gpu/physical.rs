//! The Vulkan devices: their abilities, and the choice among them.

use super::failure;
use super::instance::{Instance, no_device};
use ash::vk;
use beamlet_core::{Error, Result};
use serde::Serialize;
use std::ffi::CStr;
use std::fmt;

/// Kind of a device, best first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the memory of the host.
    Integrated,
    /// A GPU lent by a virtual machine.
    Virtual,
    /// The processor.
    Cpu,
    /// Something else.
    Other,
}

/// A device and what matters of it here.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DeviceDescription {
    /// Position in Vulkan's list: serves as a choice.
    pub index: usize,
    /// Name; any part of it serves as a choice.
    pub name: String,
    /// Its kind.
    pub kind: DeviceKind,
    /// Driver name and version.
    pub driver: String,
    /// Vulkan version.
    pub api_version: String,
    /// Why the device cannot serve; `None` where it can.
    pub problem: Option<String>,
    /// Can walk acceleration structures in compute shaders.
    pub ray_query: bool,
    /// Size of the largest device-local heap, in bytes.
    pub memory_bytes: u64,
    /// Largest single allocation, in bytes.
    pub max_allocation_bytes: u64,
    /// Invocations of a subgroup.
    pub subgroup_size: u32,
    /// Invocations of a subgroup in compute shaders can read each other's values.
    pub subgroup_exchange: bool,
}

impl fmt::Display for DeviceDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} ({})", self.index, self.name, self.driver)?;
        match &self.problem {
            Some(problem) => write!(f, ": unsuitable: {problem}"),
            None => Ok(()),
        }
    }
}

/// A device of an instance, with what opening it needs to know.
pub(super) struct Physical {
    pub(crate) raw: vk::PhysicalDevice,
    pub(crate) description: DeviceDescription,
    pub(crate) limits: vk::PhysicalDeviceLimits,
    /// Family of the queue to open: compute, without graphics where there is one.
    pub(super) queue_family: u32,
    /// The queue writes timestamps.
    pub(super) has_timestamps: bool,
    pub(super) portability_subset: bool,
    /// Alignment of the scratch memory of acceleration structure builds.
    pub(super) scratch_alignment: u64,
    /// Numbers of its vendor and of the device.
    pub(super) vendor_and_device: [u32; 2],
    /// The driver keeps kernels for drivers with this one.
    pub(super) cache_uuid: [u8; 16],
}

/// Every device that Vulkan shows; an error where there is none.
pub(super) fn enumerate(instance: &Instance) -> Result<Vec<Physical>> {
    // SAFETY: the instance is alive.
    let devices = unsafe { instance.raw.enumerate_physical_devices() }.map_err(|e| match e {
        vk::Result::ERROR_INITIALIZATION_FAILED => no_device(),
        e => failure::vulkan("listing Vulkan devices", e),
    })?;
    if devices.is_empty() {
        return Err(no_device());
    }
    devices.into_iter().enumerate().map(|(index, raw)| diagnose(instance, index, raw)).collect()
}

/// The device of that index or with that part in its name; the best usable one for `None`.
pub(super) fn choose(mut devices: Vec<Physical>, choice: Option<&str>) -> Result<Physical> {
    devices.sort_by_key(|d| (d.description.problem.is_some(), d.description.kind));
    let chosen = |d: &Physical| match choice {
        None => true,
        Some(text) => match text.trim().parse::<usize>() {
            Ok(index) => d.description.index == index,
            Err(_) => d.description.name.to_lowercase().contains(&text.trim().to_lowercase()),
        },
    };
    let wanted = choice.map_or("a Vulkan device".to_owned(), |c| format!("device {c:?}"));
    let Some(at) = devices.iter().position(chosen) else {
        let mut names: Vec<_> = devices.iter().map(|d| d.description.to_string()).collect();
        names.sort();
        let found = format!("it is not among the devices: {}", names.join(", "));
        return Err(Error::device(
            wanted,
            found,
            "choose one of these by number or part of its name",
        ));
    };
    let device = devices.swap_remove(at);
    match &device.description.problem {
        None => Ok(device),
        Some(_) => Err(Error::device(wanted, device.description.to_string(), failure::INSTALL)),
    }
}

fn diagnose(instance: &Instance, index: usize, raw: vk::PhysicalDevice) -> Result<Physical> {
    // SAFETY: `raw` is a device of this instance, in this function and in those it calls.
    let basic = unsafe { instance.raw.get_physical_device_properties(raw) };
    // SAFETY: as above.
    let families = unsafe { instance.raw.get_physical_device_queue_family_properties(raw) };
    // SAFETY: as above.
    let memory = unsafe { instance.raw.get_physical_device_memory_properties(raw) };
    // SAFETY: as above.
    let extensions = unsafe { instance.raw.enumerate_device_extension_properties(raw) }
        .map_err(|e| failure::vulkan("listing device extensions", e))?;
    let has = |name: &CStr| {
        extensions.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|n| n == name))
    };

    let version = basic.api_version;
    let mut description = DeviceDescription {
        index,
        name: basic.device_name_as_c_str().unwrap_or(c"?").to_string_lossy().into_owned(),
        kind: match basic.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
            vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
            vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
            vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
            _ => DeviceKind::Other,
        },
        driver: format!("{:#x}", basic.driver_version),
        api_version: format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        ),
        problem: None,
        ray_query: false,
        memory_bytes: memory
            .memory_heaps_as_slice()
            .iter()
            .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
            .map(|heap| heap.size)
            .max()
            .unwrap_or(0),
        max_allocation_bytes: 0,
        subgroup_size: 0,
        subgroup_exchange: false,
    };
    let mut problems = Vec::new();
    let compute = |graphics: bool| {
        families.iter().position(|family| {
            family.queue_flags.contains(vk::QueueFlags::COMPUTE)
                && family.queue_flags.contains(vk::QueueFlags::GRAPHICS) == graphics
        })
    };
    let queue_family = compute(false).or_else(|| compute(true));
    if queue_family.is_none() {
        problems.push("it has no compute queue".to_owned());
    }
    let mut scratch_alignment = 1;
    if version < vk::API_VERSION_1_2 {
        problems.push(format!("it has Vulkan {}, 1.2 is needed", description.api_version));
    } else {
        let ray_query = has(ash::khr::acceleration_structure::NAME)
            && has(ash::khr::ray_query::NAME)
            && has(ash::khr::deferred_host_operations::NAME);
        read_properties(instance, raw, ray_query, &mut description, &mut scratch_alignment);
        read_features(instance, raw, ray_query, &mut description, &mut problems);
    }
    if !problems.is_empty() {
        description.problem = Some(problems.join(", "));
    }
    Ok(Physical {
        raw,
        description,
        limits: basic.limits,
        has_timestamps: queue_family.is_some_and(|at| families[at].timestamp_valid_bits > 0),
        queue_family: queue_family.and_then(|family| u32::try_from(family).ok()).unwrap_or(0),
        portability_subset: has(ash::khr::portability_subset::NAME),
        scratch_alignment,
        vendor_and_device: [basic.vendor_id, basic.device_id],
        cache_uuid: basic.pipeline_cache_uuid,
    })
}

/// Reads what only devices of Vulkan 1.2 report.
fn read_properties(
    instance: &Instance,
    raw: vk::PhysicalDevice,
    ray_query: bool,
    description: &mut DeviceDescription,
    scratch_alignment: &mut u64,
) {
    let mut v11 = vk::PhysicalDeviceVulkan11Properties::default();
    let mut v12 = vk::PhysicalDeviceVulkan12Properties::default();
    let mut structure = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut v11).push_next(&mut v12);
    if ray_query {
        all = all.push_next(&mut structure);
    }
    // SAFETY: the device has Vulkan 1.2 and, with `ray_query`, the extension of the last record.
    unsafe { instance.raw.get_physical_device_properties2(raw, &mut all) };
    description.max_allocation_bytes = v11.max_memory_allocation_size;
    description.subgroup_size = v11.subgroup_size;
    let exchange = vk::SubgroupFeatureFlags::BALLOT | vk::SubgroupFeatureFlags::SHUFFLE;
    description.subgroup_exchange = v11.subgroup_supported_operations.contains(exchange)
        && v11.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE);
    *scratch_alignment =
        u64::from(structure.min_acceleration_structure_scratch_offset_alignment).max(1);
    let text = |bytes: Option<&CStr>| bytes.unwrap_or(c"").to_string_lossy().into_owned();
    description.driver = format!(
        "{} {}",
        text(v12.driver_name_as_c_str().ok()),
        text(v12.driver_info_as_c_str().ok())
    )
    .trim()
    .to_owned();
}

/// Checks the features that are needed and looks for ray query.
fn read_features(
    instance: &Instance,
    raw: vk::PhysicalDevice,
    ray_query: bool,
    description: &mut DeviceDescription,
    problems: &mut Vec<String>,
) {
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut structure = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
    let mut all = vk::PhysicalDeviceFeatures2::default().push_next(&mut v12);
    if ray_query {
        all = all.push_next(&mut structure).push_next(&mut query);
    }
    // SAFETY: the device has Vulkan 1.2 and, with `ray_query`, the extensions of the last records.
    unsafe { instance.raw.get_physical_device_features2(raw, &mut all) };
    for (there, name) in [
        (v12.buffer_device_address, "bufferDeviceAddress"),
        (v12.scalar_block_layout, "scalarBlockLayout"),
    ] {
        if there == vk::FALSE {
            problems.push(format!("its driver lacks {name}"));
        }
    }
    description.ray_query =
        structure.acceleration_structure == vk::TRUE && query.ray_query == vk::TRUE;
}
