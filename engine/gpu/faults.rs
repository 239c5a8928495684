//! Faults for tests: the failing call of Vulkan, and its answer.
//!
//! They are planned when a device is opened and counted by that device alone, so that tests
//! can run side by side. A device without any pays one comparison per call.

use ash::vk;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A kind of Vulkan call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultyCall {
    /// Memory for a buffer.
    Allocate,
    /// Making the pipeline of a kernel.
    MakeKernel,
    /// Handing work to the queue.
    Submit,
    /// Waiting for the end of work.
    Wait,
}

/// Answer of a failing call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultAnswer {
    /// `VK_ERROR_DEVICE_LOST`; every submission and wait afterwards answers the same.
    DeviceLost,
    /// `VK_ERROR_OUT_OF_DEVICE_MEMORY`
    OutOfDeviceMemory,
    /// `VK_ERROR_OUT_OF_HOST_MEMORY`
    OutOfHostMemory,
    /// `VK_TIMEOUT`: work that does not end.
    Timeout,
}

/// One call that fails. For tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// The kind of call.
    pub call: FaultyCall,
    /// Which of these calls, counted from 1.
    pub number: u64,
    /// Its answer.
    pub answer: FaultAnswer,
}

/// The faults of one device, with its counts.
#[derive(Debug, Default)]
pub(super) struct Faults {
    planned: Vec<Fault>,
    counts: [AtomicU64; 4],
    lost: AtomicBool,
}

impl Faults {
    pub(super) fn new(planned: &[Fault]) -> Self {
        Self { planned: planned.to_vec(), ..Self::default() }
    }

    /// Answer of the next call of this kind, before it is made.
    pub(super) fn check(&self, call: FaultyCall) -> Result<(), vk::Result> {
        if self.planned.is_empty() {
            return Ok(());
        }
        let number = self.counts[call as usize].fetch_add(1, Ordering::Relaxed) + 1;
        let queue = matches!(call, FaultyCall::Submit | FaultyCall::Wait);
        if queue && self.lost.load(Ordering::Relaxed) {
            return Err(vk::Result::ERROR_DEVICE_LOST);
        }
        let fault = self.planned.iter().find(|f| f.call == call && f.number == number);
        match fault.map(|f| f.answer) {
            None => Ok(()),
            Some(FaultAnswer::DeviceLost) => {
                self.lost.store(true, Ordering::Relaxed);
                Err(vk::Result::ERROR_DEVICE_LOST)
            }
            Some(FaultAnswer::OutOfDeviceMemory) => Err(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY),
            Some(FaultAnswer::OutOfHostMemory) => Err(vk::Result::ERROR_OUT_OF_HOST_MEMORY),
            Some(FaultAnswer::Timeout) => Err(vk::Result::TIMEOUT),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_call_that_is_named_fails_and_a_lost_device_stays_lost() {
        let fault = Fault { call: FaultyCall::Wait, number: 2, answer: FaultAnswer::DeviceLost };
        let faults = Faults::new(&[fault]);
        assert!(faults.check(FaultyCall::Submit).is_ok() && faults.check(FaultyCall::Wait).is_ok());
        assert!(
            faults.check(FaultyCall::Submit).is_ok() && faults.check(FaultyCall::Wait).is_err()
        );
        assert!(faults.check(FaultyCall::Submit).is_err());
        assert!(faults.check(FaultyCall::Allocate).is_ok());
    }
}
