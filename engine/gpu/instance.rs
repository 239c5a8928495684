//! The Vulkan loader and instance, and the messages of the validation layer.

use super::failure::{self, INSTALL};
use ash::vk;
use beamlet_core::parallel::is_fork;
use beamlet_core::{Error, Result, reserve};
use std::ffi::{CStr, c_void};
use std::sync::atomic::{AtomicU32, Ordering};

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Bytes of address space that a driver is left to begin with. Mesa's CPU device takes most of
/// them for libraries, threads and compiled kernels, and ends the program where it has less.
const DRIVER: u64 = 400 << 20;

/// A loaded loader with an instance of Vulkan 1.2.
pub(super) struct Instance {
    pub(super) raw: ash::Instance,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    /// Boxed: the messenger holds its address.
    messages: Box<AtomicU32>,
    /// Last: the library of the loader is closed with it.
    _entry: ash::Entry,
}

impl Instance {
    pub(super) fn new(validation: bool) -> Result<Self> {
        reserve::ask(DRIVER, "a Vulkan driver", reserve::REMEDY)?;
        // SAFETY: loading runs the initialisers of the system's Vulkan loader, which is trusted
        // like any shared library of the system.
        let entry = unsafe { ash::Entry::load() }
            .map_err(|e| Error::device("the Vulkan loader", e.to_string(), INSTALL))?;
        check_version(&entry)?;
        if validation {
            check_layer(&entry)?;
        }

        // SAFETY: `entry` is alive.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }
            .map_err(|e| failure::vulkan("listing instance extensions", e))?;
        let has = |name: &CStr| {
            extensions.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|n| n == name))
        };
        let mut enabled = Vec::new();
        let mut flags = vk::InstanceCreateFlags::empty();
        if has(ash::khr::portability_enumeration::NAME) {
            enabled.push(ash::khr::portability_enumeration::NAME.as_ptr());
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        let layers = if validation {
            // The layer provides this extension where the loader does not.
            enabled.push(ash::ext::debug_utils::NAME.as_ptr());
            vec![VALIDATION.as_ptr()]
        } else {
            Vec::new()
        };

        let messages = Box::new(AtomicU32::new(0));
        let mut messenger_info = messenger_info(&messages);
        let application =
            vk::ApplicationInfo::default().engine_name(c"beamlet").api_version(vk::API_VERSION_1_2);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_extension_names(&enabled)
            .enabled_layer_names(&layers)
            .flags(flags);
        if validation {
            info = info.push_next(&mut messenger_info);
        }
        // SAFETY: every name is a static C string, every layer and extension was found above, and
        // the counter that the messenger points to lives as long as the instance.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|e| match e {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => no_device(),
            e => failure::vulkan("opening Vulkan", e),
        })?;

        let mut instance = Self { raw, messenger: None, messages, _entry: entry };
        if validation {
            let utils = ash::ext::debug_utils::Instance::new(&instance._entry, &instance.raw);
            let info = self::messenger_info(&instance.messages);
            // SAFETY: the extension is enabled; the counter outlives the messenger.
            let messenger = unsafe { utils.create_debug_utils_messenger(&info, None) }
                .map_err(|e| failure::vulkan("listening to the validation layer", e))?;
            instance.messenger = Some((utils, messenger));
        }
        Ok(instance)
    }

    /// Warnings and errors of the validation layer so far.
    pub(super) fn messages(&self) -> u32 {
        self.messages.load(Ordering::Relaxed)
    }

    pub(super) fn validation(&self) -> bool {
        self.messenger.is_some()
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if is_fork() {
            return;
        }
        // SAFETY: both were made by this instance, which nothing uses any more: the device that
        // owns it is destroyed before its fields are dropped.
        unsafe {
            if let Some((utils, messenger)) = self.messenger.take() {
                utils.destroy_debug_utils_messenger(messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

/// The error where Vulkan is there but shows no device.
pub(super) fn no_device() -> Error {
    Error::device("a Vulkan device", "no driver provides one", INSTALL)
}

fn check_version(entry: &ash::Entry) -> Result<()> {
    // SAFETY: `entry` is alive.
    let version = unsafe { entry.try_enumerate_instance_version() }
        .map_err(|e| failure::vulkan("asking the Vulkan loader for its version", e))?
        .unwrap_or(vk::API_VERSION_1_0);
    if version >= vk::API_VERSION_1_2 {
        return Ok(());
    }
    Err(Error::device(
        "a Vulkan loader of version 1.2",
        format!("version {}.{}", vk::api_version_major(version), vk::api_version_minor(version)),
        INSTALL,
    ))
}

fn check_layer(entry: &ash::Entry) -> Result<()> {
    // SAFETY: `entry` is alive.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .map_err(|e| failure::vulkan("listing Vulkan layers", e))?;
    if layers.iter().any(|l| l.layer_name_as_c_str().is_ok_and(|n| n == VALIDATION)) {
        return Ok(());
    }
    Err(Error::device(
        "the Vulkan validation layer",
        "it is not installed",
        "install it (Debian: vulkan-validationlayers), or run without validation",
    ))
}

fn messenger_info(messages: &AtomicU32) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::{
        DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Kind,
    };
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Kind::GENERAL | Kind::VALIDATION)
        .pfn_user_callback(Some(on_message))
        .user_data(std::ptr::from_ref(messages).cast_mut().cast())
}

unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    kind: vk::DebugUtilsMessageTypeFlagsEXT,
    message: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan hands over a valid record for the time of the call.
    let text = unsafe { message.as_ref().and_then(|m| m.message_as_c_str()) };
    let text = text.unwrap_or(c"").to_string_lossy();
    if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) {
        log::error!("Vulkan: {text}");
    } else {
        log::warn!("Vulkan: {text}");
    }
    if kind.contains(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION) {
        // SAFETY: `user` is the counter given to the messenger, which outlives the messenger.
        unsafe { &*user.cast::<AtomicU32>() }.fetch_add(1, Ordering::Relaxed);
    }
    vk::FALSE
}
