//! An acceleration structure over boxes, for ray queries.
//!
//! Boxes, not triangles: drivers differ in the triangles that they report for a ray near an edge
//! (lavapipe loses both sides of thin ones near grazing), and a lost pair leaves no trace. Every padded
//! box in the way of a ray is a candidate; the shader's own test decides.

use super::buffer::{Buffer, Memory};
use super::device::Device;
use super::failure;
use super::retire::Retired;
use ash::vk;
use beamlet_core::{Error, Result};
use std::fmt;
use std::sync::Arc;

/// Bytes of a box: `VkAabbPositionsKHR`.
const BOX_BYTES: u64 = 24;

/// All boxes in one bottom level, placed once, unchanged, by a top level. A query sees every box in its
/// way once.
pub struct AccelerationStructure {
    bottom: Level,
    top: Level,
}

/// One level: the structure goes before the memory it lies in.
struct Level {
    device: Arc<Device>,
    raw: vk::AccelerationStructureKHR,
    _storage: Buffer,
    address: u64,
}

impl AccelerationStructure {
    /// Builds over boxes: `boxes` holds the low and high corner (x, y, z as f32 each) of each.
    /// They are not needed afterwards. Some drivers split in the order given, so let neighbours
    /// follow each other.
    ///
    /// # Errors
    /// [`Error::Device`] without ray query, [`Error::Memory`] where memory runs out.
    ///
    /// # Panics
    /// Where the buffer is too short.
    pub fn build(device: &Arc<Device>, boxes: &Buffer, count: u32) -> Result<Self> {
        boxes.check(0, BOX_BYTES * u64::from(count));
        let geometry = vk::AccelerationStructureGeometryAabbsDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: boxes.address() })
            .stride(BOX_BYTES);
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::AABBS)
            .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs: geometry })
            .flags(vk::GeometryFlagsKHR::NO_DUPLICATE_ANY_HIT_INVOCATION);
        let kind = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
        let bottom = Level::build(device, "bottom acceleration structure", kind, geometry, count)?;

        let instances =
            device.upload("acceleration structure instance", &instance(bottom.address))?;
        let geometry = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: instances.address() });
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: geometry });
        let kind = vk::AccelerationStructureTypeKHR::TOP_LEVEL;
        let top = Level::build(device, "top acceleration structure", kind, geometry, 1)?;
        Ok(Self { bottom, top })
    }

    /// Address for kernels: `accelerationStructureEXT(uvec2)` in GLSL.
    pub fn address(&self) -> u64 {
        self.top.address
    }

    /// Bytes of device memory.
    pub fn bytes(&self) -> u64 {
        self.top._storage.len() + self.bottom._storage.len()
    }
}

impl fmt::Debug for AccelerationStructure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("AccelerationStructure")
            .field("bytes", &self.bytes())
            .finish_non_exhaustive()
    }
}

/// `VkAccelerationStructureInstanceKHR` as words: identity transform, custom index 0, mask 0xff,
/// no culling.
fn instance(bottom: u64) -> [u32; 16] {
    let one = 1.0f32.to_bits();
    let cull_disable = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw();
    let [low, high] = bytemuck::cast(bottom);
    [
        one,
        0,
        0,
        0,
        0,
        one,
        0,
        0,
        0,
        0,
        one,
        0, // rows of the transform
        0xff << 24,
        cull_disable << 24,
        low,
        high,
    ]
}

impl Level {
    fn build(
        device: &Arc<Device>,
        name: &str,
        kind: vk::AccelerationStructureTypeKHR,
        geometry: vk::AccelerationStructureGeometryKHR<'_>,
        primitives: u32,
    ) -> Result<Self> {
        let structures = device.structures.as_ref().ok_or_else(|| {
            Error::device(
                name,
                format!("{} has no ray query", device.description().name),
                "choose the bvh backend or another device",
            )
        })?;
        let geometries = [geometry];
        let mut info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(kind)
            .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE)
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(&geometries);
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        // SAFETY: the extension is enabled; there is one count for the one geometry.
        unsafe {
            structures.get_acceleration_structure_build_sizes(
                vk::AccelerationStructureBuildTypeKHR::DEVICE,
                &info,
                &[primitives],
                &mut sizes,
            );
        }
        let usage = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR;
        let bytes = sizes.acceleration_structure_size;
        let storage = Buffer::new(device, name, bytes, Memory::Device, usage)?;
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(storage.raw())
            .size(bytes)
            .ty(kind);
        // SAFETY: the storage is as large as requested and was made for this use.
        let raw = unsafe { structures.create_acceleration_structure(&create, None) }
            .map_err(|e| failure::vulkan(name, e))?;
        let mut level = Self { device: device.clone(), raw, _storage: storage, address: 0 };

        let alignment = device.physical.scratch_alignment;
        let scratch = device.buffer(
            &format!("scratch for the {name}"),
            sizes.build_scratch_size + alignment,
            Memory::Device,
        )?;
        info = info.dst_acceleration_structure(raw).scratch_data(vk::DeviceOrHostAddressKHR {
            device_address: scratch.address().next_multiple_of(alignment),
        });
        let range =
            vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(primitives);
        device.run(|r| {
            // SAFETY: the command buffer is recording; geometry, storage and scratch live until
            // `run` has waited, and sizes and alignment are those that Vulkan required.
            unsafe {
                structures.cmd_build_acceleration_structures(
                    r.batch.commands,
                    &[info],
                    &[&[range]],
                );
            }
        })?;
        let info =
            vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(raw);
        // SAFETY: the structure was made by this device.
        level.address = unsafe { structures.get_acceleration_structure_device_address(&info) };
        device.name(raw, name);
        Ok(level)
    }
}

impl Drop for Level {
    fn drop(&mut self) {
        self.device.retire(Retired::AccelerationStructure(self.raw));
    }
}
