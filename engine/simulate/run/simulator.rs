//! An open device with the kernels of simulations.

use crate::illuminate::{CellKernels, RandomKernels};
use crate::trace::TraceKernels;
use crate::wave::WaveKernels;
use beamlet_gpu::{Compute, Device, EngineOptions};
use std::sync::Arc;

/// An open device and the kernels that its simulations share. Clones share both.
#[derive(Debug, Clone)]
pub struct Simulator {
    trace: Arc<TraceKernels>,
    illuminate: Arc<CellKernels>,
    random: Arc<RandomKernels>,
    wave: Arc<WaveKernels>,
    compute: Compute,
}

impl Simulator {
    /// Prepares the kernels of simulations; each is made when it is first wanted.
    pub fn new(compute: Compute) -> Self {
        let device = compute.device();
        Self {
            trace: Arc::new(TraceKernels::new(device)),
            illuminate: Arc::new(CellKernels::new(device)),
            random: Arc::new(RandomKernels::new(device)),
            wave: Arc::new(WaveKernels::new(device)),
            compute,
        }
    }

    /// Drops it. Returns whether the device is destroyed: `false` while somebody uses it.
    pub fn close(self) -> bool {
        let compute = self.compute.clone();
        drop(self);
        compute.close()
    }

    /// The same device and kernels under other options ([`Compute::with_options`]).
    #[must_use]
    pub fn with_options(&self, options: EngineOptions) -> Self {
        Self { compute: self.compute.with_options(options), ..self.clone() }
    }

    /// The device and how it was opened.
    pub const fn compute(&self) -> &Compute {
        &self.compute
    }

    /// How the device was opened.
    pub(crate) fn options(&self) -> &EngineOptions {
        self.compute.options()
    }

    /// The open device.
    pub(crate) const fn device(&self) -> &Arc<Device> {
        self.compute.device()
    }

    pub(crate) fn trace_kernels(&self) -> &Arc<TraceKernels> {
        &self.trace
    }

    pub(crate) fn random_kernels(&self) -> &Arc<RandomKernels> {
        &self.random
    }

    pub(crate) fn wave_kernels(&self) -> &Arc<WaveKernels> {
        &self.wave
    }

    pub(crate) fn illuminate_kernels(&self) -> &Arc<CellKernels> {
        &self.illuminate
    }
}
