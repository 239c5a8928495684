//! Vulkan result codes as errors that a user can act on.

use crate::Error;
use ash::vk;

/// What to install where there is no loader, driver or device.
pub(super) const INSTALL: &str = "install a Vulkan driver and loader (Debian: mesa-vulkan-drivers \
    and libvulkan1; with or without a GPU, as they bring the CPU device llvmpipe)";

/// An error for a Vulkan call that failed while doing `what`.
pub(super) fn vulkan(what: &str, result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_OUT_OF_HOST_MEMORY | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
            out_of_memory(what, 0, None)
        }
        vk::Result::ERROR_DEVICE_LOST => Error::device(
            what,
            "the device was lost",
            "a driver's time limit or another program may have ended the work: try again, with \
             smaller batches or another device",
        ),
        other => Error::device(what, format!("Vulkan answered {other:?}"), ""),
    }
}

/// An error for memory that is not there; `needed` in bytes, 0 where it is not known.
pub(super) fn out_of_memory(purpose: &str, needed: u64, available: Option<u64>) -> Error {
    Error::Memory {
        purpose: purpose.to_owned(),
        needed,
        available,
        remedy: "lower the memory limit, or choose a device with more memory".to_owned(),
    }
}
