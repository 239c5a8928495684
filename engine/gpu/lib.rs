//! Internal to beamlet: headless Vulkan compute, one file per object. It knows no physics.
//!
//! Every buffer, and the acceleration structure, reaches a kernel as a device address in its push
//! constants; there are no descriptor sets. So a buffer may be larger than the device's largest
//! storage-buffer range, and a scene of any number of parts needs no bindings.
//!
//! A [`Device`] opens, owns and outlives everything made from it. A dropped object that a submission may
//! still use is destroyed after that submission ended. The addresses in push constants are not checked: a
//! kernel with a wrong one reads or writes foreign memory.

mod acceleration;
mod allocation;
mod allocator;
mod backend;
mod buffer;
mod command_batch;
mod compute;
mod device;
mod failure;
mod faults;
mod instance;
mod kernel;
mod kernel_cache;
mod pace;
mod paced;
mod physical;
mod profile;
mod recorder;
mod retire;
mod staging;
mod submission;
mod transfer;

pub use acceleration::AccelerationStructure;
pub use backend::Backend;
pub use buffer::{Buffer, Memory};
pub use compute::{Compute, EngineOptions};
pub use device::{Device, DeviceOptions};
pub use faults::{Fault, FaultAnswer, FaultyCall};
pub use kernel::{Kernel, LazyKernel};
pub use kernel_cache::KernelCache;
pub use pace::Pace;
pub use physical::{DeviceDescription, DeviceKind};
pub use profile::{KernelProfile, Profile, Traffic};
pub use recorder::Recorder;
pub use submission::Submission;
pub use transfer::{Download, Upload};

use beamlet_core::numbers;

/// Largest push constant block, in bytes: what every Vulkan device has.
pub const PUSH_BYTES: u32 = 128;

/// Bytes of a push constant struct.
pub const fn push_bytes<T>() -> u32 {
    const { numbers::count(size_of::<T>()) }
}
