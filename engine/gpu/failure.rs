//! Vulkan result codes as errors that a user can act on.

use ash::vk;
use beamlet_core::Error;

/// Advice where there is no loader, driver or device.
pub(super) const INSTALL: &str = "install a Vulkan driver and loader (Debian: mesa-vulkan-drivers \
    and libvulkan1; with or without a GPU, as they bring the CPU device llvmpipe)";

/// An error for a Vulkan call that failed while doing `what`.
pub(super) fn vulkan(what: &str, result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_OUT_OF_HOST_MEMORY | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
            out_of_memory(what, 0, result)
        }
        vk::Result::ERROR_DEVICE_LOST => Error::device(
            what,
            "the device was lost",
            "a driver's time limit or another program may have ended the work: try again, with \
             smaller batches or another device; a run directory can be resumed",
        ),
        vk::Result::TIMEOUT => hung(what, "it did not finish in time".to_owned()),
        other => Error::device(what, format!("Vulkan answered {other:?}"), ""),
    }
}

/// An error for work that does not end.
pub(super) fn hung(what: &str, found: String) -> Error {
    let remedy = "the device hangs, or batches are far too large for it; a run directory can be \
                  resumed on another device";
    Error::device(what, found, remedy)
}

/// An error for memory that Vulkan did not give; `needed` in bytes, 0 where it is not known.
/// `result` says whether the device or the host has no more.
pub(super) fn out_of_memory(purpose: &str, needed: u64, result: vk::Result) -> Error {
    let remedy = match result {
        vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
            "the host has no memory left: lower the memory limit, or end other programs"
        }
        _ => {
            "the device has no memory left: lower the memory limit, end other programs that use it, \
             or choose a device with more memory"
        }
    };
    Error::Memory {
        purpose: purpose.to_owned(),
        needed,
        available: None,
        remedy: remedy.to_owned(),
    }
}

/// An error for memory that the driver gave and that is not there.
pub(super) fn not_backed(purpose: &str, needed: u64) -> Error {
    Error::Memory {
        purpose: purpose.to_owned(),
        needed,
        available: None,
        remedy: "the device keeps its memory in a file, which may not grow this large: raise the \
                 limit of file sizes (ulimit -f)"
            .to_owned(),
    }
}

/// An error for a buffer larger than the device gives at once.
pub(super) fn too_large(purpose: &str, needed: u64, limit: u64) -> Error {
    Error::Memory {
        purpose: purpose.to_owned(),
        needed,
        available: Some(limit),
        remedy: "lower the memory limit, or choose a device with larger allocations".to_owned(),
    }
}
