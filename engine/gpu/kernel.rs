//! A kernel: one compute shader, ready to dispatch.

use super::device::Device;
use super::faults::FaultyCall;
use super::physical::DeviceKind;
use super::retire::Retired;
use super::{PUSH_BYTES, failure};
use ash::vk;
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result};
use std::fmt;
use std::sync::{Arc, OnceLock};

/// Kernels that are made side by side at most.
const AT_ONCE: usize = 8;

/// Names of kernels and their SPIR-V.
pub(super) type KernelTable = &'static [(&'static str, &'static [u32])];

/// A compute shader with its push constants, ready to dispatch.
pub struct Kernel {
    device: Arc<Device>,
    pub(super) pipeline: vk::Pipeline,
    /// Its push constants.
    pub(super) layout: vk::PipelineLayout,
    /// Bytes of its push constants.
    pub(crate) push_bytes: u32,
    pub(super) name: Arc<str>,
}

/// A kernel that is made when it is first wanted: some take long, and few runs want all.
#[derive(Debug)]
pub struct LazyKernel {
    device: Arc<Device>,
    name: &'static str,
    push_bytes: u32,
    constant: Option<u32>,
    made: OnceLock<Kernel>,
}

impl LazyKernel {
    /// A kernel to be made as [`Device::kernel`] makes it.
    #[must_use]
    pub fn new(device: &Arc<Device>, name: &'static str, push_bytes: u32) -> Self {
        let (device, made) = (device.clone(), OnceLock::new());
        Self { device, name, push_bytes, constant: None, made }
    }

    /// The same with a value of its specialization constant 0.
    #[must_use]
    pub fn with_constant(self, constant: u32) -> Self {
        Self { constant: Some(constant), ..self }
    }

    /// The kernel.
    ///
    /// # Errors
    /// As [`Device::kernel`].
    pub fn get(&self) -> Result<&Kernel> {
        if let Some(kernel) = self.made.get() {
            return Ok(kernel);
        }
        let spirv = self.device.words_of(self.name)?;
        let made = self.device.special_kernel(self.name, spirv, self.push_bytes, self.constant)?;
        Ok(self.made.get_or_init(|| made))
    }

    /// Makes the missing ones of these kernels. On a GPU side by side, since drivers take seconds for large
    /// ones; on a CPU one by one, since its driver takes tens of MiB for each while it makes it.
    ///
    /// # Errors
    /// As [`Device::kernel`]; [`Error::Interrupted`] if `cancel` was set before one began: a single call
    /// of a driver is not interrupted.
    pub fn make_all(kernels: &[&Self], cancel: &Cancel) -> Result<()> {
        let is_cpu = |it: &&Self| it.device.description().kind == DeviceKind::Cpu;
        let at_once = if kernels.iter().any(is_cpu) { 1 } else { AT_ONCE };
        for some in kernels.chunks(at_once) {
            cancel.check()?;
            let (first, others) = some.split_at(1);
            std::thread::scope(|scope| {
                for kernel in others {
                    let thread =
                        std::thread::Builder::new().name(format!("kernel {}", kernel.name));
                    // Without a thread, or where it fails, the kernel is made below.
                    let _ = thread.spawn_scoped(scope, move || kernel.get().map(drop));
                }
                first.iter().try_for_each(|kernel| kernel.get().map(drop))
            })?;
            others.iter().try_for_each(|kernel| kernel.get().map(drop))?;
        }
        cancel.check()
    }
}

impl Device {
    /// A kernel by its name in the table that the device was opened with. `push_bytes` is the size of
    /// its push constants.
    ///
    /// # Errors
    /// [`Error::Device`] where the table lacks it or the device cannot run it.
    ///
    /// # Panics
    /// With more than [`PUSH_BYTES`] bytes of push constants, or not a multiple of 4.
    pub fn kernel(self: &Arc<Self>, name: &str, push_bytes: u32) -> Result<Kernel> {
        self.special_kernel(name, self.words_of(name)?, push_bytes, None)
    }

    /// A kernel from SPIR-V with the entry point `main`.
    ///
    /// # Errors
    /// [`Error::Device`] where the device cannot run it.
    ///
    /// # Panics
    /// As [`Self::kernel`].
    pub fn kernel_from(
        self: &Arc<Self>,
        name: &str,
        spirv: &[u32],
        push_bytes: u32,
    ) -> Result<Kernel> {
        self.special_kernel(name, spirv, push_bytes, None)
    }

    /// The SPIR-V of a kernel.
    fn words_of(&self, name: &str) -> Result<&'static [u32]> {
        let found = self.table.iter().find(|(of, _)| *of == name);
        found.map(|(_, words)| *words).ok_or_else(|| {
            let lacks = "it is not in the table that the device was opened with";
            Error::device(format!("the kernel {name}"), lacks, "open the device with its kernels")
        })
    }

    /// The same, with a value of specialization constant 0.
    fn special_kernel(
        self: &Arc<Self>,
        name: &str,
        spirv: &[u32],
        push_bytes: u32,
        constant: Option<u32>,
    ) -> Result<Kernel> {
        assert!(
            push_bytes <= PUSH_BYTES && push_bytes.is_multiple_of(4),
            "{name}: {push_bytes} push bytes"
        );
        self.check_kernel(name, spirv)?;
        let failed = |e| failure::vulkan(&format!("making the kernel {name}"), e);

        let range = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(push_bytes)];
        let mut info = vk::PipelineLayoutCreateInfo::default();
        if push_bytes > 0 {
            info = info.push_constant_ranges(&range);
        }
        // SAFETY: the device is alive; the range is within what every device has.
        let layout = unsafe { self.raw.create_pipeline_layout(&info, None) }.map_err(failed)?;
        // From here on dropping the kernel cleans up; null pipelines may be destroyed.
        let mut kernel = Kernel {
            device: self.clone(),
            pipeline: vk::Pipeline::null(),
            layout,
            push_bytes,
            name: name.into(),
        };

        let info = vk::ShaderModuleCreateInfo::default().code(spirv);
        // SAFETY: the words are SPIR-V for Vulkan 1.2 by the contract of this function.
        let module = unsafe { self.raw.create_shader_module(&info, None) }.map_err(failed)?;
        let entry = [vk::SpecializationMapEntry::default().size(size_of::<u32>())];
        let data = constant.unwrap_or_default().to_ne_bytes();
        let special = vk::SpecializationInfo::default().map_entries(&entry).data(&data);
        let mut stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main");
        if constant.is_some() {
            stage = stage.specialization_info(&special);
        }
        let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
        let faulty = self.faults.check(FaultyCall::MakeKernel).map_err(|e| (Vec::new(), e));
        // Before: a driver that cannot take a kernel may end the process.
        log::debug!("making the kernel {name}");
        // SAFETY: module and layout were just made by this device, as was the cache.
        let made = faulty.and_then(|()| unsafe {
            self.raw.create_compute_pipelines(self.cache.raw, &[info], None)
        });
        // SAFETY: a module is not needed once its pipeline is made.
        unsafe { self.raw.destroy_shader_module(module, None) };
        kernel.pipeline = made.map_err(|(_, e)| failed(e))?[0];
        self.cache.grow();
        self.name(kernel.pipeline, name);
        Ok(kernel)
    }

    fn check_kernel(&self, name: &str, spirv: &[u32]) -> Result<()> {
        let description = &self.physical.description;
        if uses_ray_query(spirv) && !description.ray_query {
            return Err(Error::device(
                format!("the kernel {name}"),
                format!("{} has no ray query", description.name),
                "choose the bvh backend or another device",
            ));
        }
        Ok(())
    }
}

/// True if SPIR-V declares the capability of ray queries.
fn uses_ray_query(spirv: &[u32]) -> bool {
    const CAPABILITY: [u32; 2] = [2 << 16 | 17, 4472];
    // Capabilities come first, right after the five words of the header.
    let mut rest = spirv.get(5..).unwrap_or(&[]);
    while let [opcode, capability, ..] = rest {
        if *opcode != CAPABILITY[0] {
            return false;
        }
        if *capability == CAPABILITY[1] {
            return true;
        }
        rest = &rest[2..];
    }
    false
}

impl Kernel {
    /// Purpose of the kernel.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Panics where push constants are not as long as the kernel's.
    pub(super) fn check(&self, push: &[u8]) {
        let expected = self.push_bytes as usize;
        assert!(
            push.len() == expected,
            "{}: {} push bytes, {expected} expected",
            self.name,
            push.len()
        );
    }
}

impl fmt::Debug for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Kernel").field("name", &self.name).finish_non_exhaustive()
    }
}

impl Drop for Kernel {
    fn drop(&mut self) {
        self.device.retire(Retired::Pipeline(self.pipeline, self.layout));
    }
}
