//! Work handed to the device, and the wait for its end.

use super::command_batch::CommandBatch;
use super::device::{Device, lock};
use super::failure;
use super::faults::FaultyCall;
use super::profile::Dispatched;
use super::recorder::Recorder;
use ash::vk;
use beamlet_core::Result;
use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a submission may take before it counts as hung.
const PATIENCE: Duration = Duration::from_secs(30 * 60);
/// Waits are in parts: a clock that jumps ahead, as on a machine after sleep, ends one of them and not
/// the whole.
const PARTS: u32 = 180;

/// Work that the device does. Dropping it waits for its end.
pub struct Submission {
    device: Arc<Device>,
    /// `None` once it has ended.
    batch: Option<CommandBatch>,
    dispatched: Vec<Dispatched>,
    /// Timestamps that it writes.
    stamps: u32,
    number: u64,
    started: Instant,
}

/// Records commands; the second call records none. Behind a pointer, so that what submits is compiled once
/// rather than for each caller.
pub(super) type Recording<'a> = &'a mut dyn FnMut(&mut Recorder<'_>);

/// A [`Recording`] by a function that can be called once.
pub(super) fn once(record: impl FnOnce(&mut Recorder<'_>)) -> impl FnMut(&mut Recorder<'_>) {
    let mut record = Some(record);
    move |recorder| {
        if let Some(record) = record.take() {
            record(recorder);
        }
    }
}

impl Device {
    /// Records, submits and waits.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`] where a command cannot be recorded or the device fails;
    /// [`beamlet_core::Error::Memory`] where there is no memory for the commands.
    pub fn run(self: &Arc<Self>, record: impl FnOnce(&mut Recorder<'_>)) -> Result<Duration> {
        self.submit(record)?.wait()
    }

    /// Records and submits. Several submissions may be in flight; they run one after another.
    ///
    /// # Errors
    /// As [`Device::run`].
    pub fn submit(self: &Arc<Self>, record: impl FnOnce(&mut Recorder<'_>)) -> Result<Submission> {
        self.submit_recorded(&mut once(record))
    }

    fn submit_recorded(self: &Arc<Self>, record: Recording<'_>) -> Result<Submission> {
        let reused = lock(&self.batches).pop();
        let batch = match reused {
            Some(batch) => batch,
            None => CommandBatch::new(&self.raw, self.physical.queue_family, self.timed)?,
        };
        // What recording names may be dropped while it runs, even before this returns.
        let number = lock(&self.retirement).begin();
        let mut submission = Submission {
            device: self.clone(),
            batch: None,
            dispatched: Vec::new(),
            stamps: 0,
            number,
            started: Instant::now(),
        };
        match self.record(&batch, record) {
            Ok((dispatched, stamps)) => {
                lock(&self.counters).traffic.submissions += 1;
                (submission.dispatched, submission.stamps) = (dispatched, stamps);
                submission.batch = Some(batch);
                Ok(submission)
            }
            Err(error) => {
                // SAFETY: the batch was not submitted.
                unsafe { batch.destroy(&self.raw) };
                Err(error)
            }
        }
    }

    /// Records and submits: the dispatches, and the number of their timestamps.
    fn record(
        &self,
        batch: &CommandBatch,
        record: Recording<'_>,
    ) -> Result<(Vec<Dispatched>, u32)> {
        let failed = |e| failure::vulkan("submitting work to the device", e);
        let info = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: a batch in hand is in no other hand and not in flight.
        unsafe { self.raw.begin_command_buffer(batch.commands, &info) }.map_err(failed)?;
        let (dispatched, stamps) = (Vec::new(), 0);
        let mut recorder = Recorder { device: self, batch, dispatched, stamps, error: None };
        recorder.reset_stamps();
        recorder.barrier();
        record(&mut recorder);
        recorder.barrier_to_host();
        let Recorder { dispatched, stamps, error, .. } = recorder;
        if let Some(error) = error {
            return Err(error);
        }
        let commands = [batch.commands];
        let submits = [vk::SubmitInfo::default().command_buffers(&commands)];
        let queue = self.queue();
        // SAFETY: the command buffer is complete, the fence unsignalled, and the queue locked.
        unsafe {
            self.raw.end_command_buffer(batch.commands).map_err(failed)?;
            self.faults.check(FaultyCall::Submit).map_err(failed)?;
            self.raw.queue_submit(*queue, &submits, batch.fence).map_err(failed)?;
        }
        Ok((dispatched, stamps))
    }
}

impl Submission {
    /// Waits for the end; returns the time since the submission.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`] where the device was lost or hangs.
    pub fn wait(mut self) -> Result<Duration> {
        self.finish()?;
        Ok(self.started.elapsed())
    }

    fn finish(&mut self) -> Result<()> {
        let Some(batch) = self.batch.take() else { return Ok(()) };
        let raw = &self.device.raw;
        let ended = wait_patiently(raw, batch.fence);
        // A fault that a test set comes after the real end: the device did the work.
        match ended.and_then(|()| self.device.faults.check(FaultyCall::Wait)) {
            Ok(()) => {}
            Err(vk::Result::TIMEOUT) => {
                // It may still run: its objects, the batch included, are not destroyed.
                self.number = 0;
                lock(&self.device.stuck).push(batch);
                let found = format!("not finished after {} s", PATIENCE.as_secs());
                return Err(failure::hung("work on the device", found));
            }
            Err(vk::Result::ERROR_DEVICE_LOST) => {
                // SAFETY: a lost device runs nothing.
                unsafe { batch.destroy(raw) };
                let lost = vk::Result::ERROR_DEVICE_LOST;
                return Err(failure::vulkan("work on the device", lost));
            }
            Err(e) => {
                // As after the patience: nobody knows whether it still runs.
                self.number = 0;
                lock(&self.device.stuck).push(batch);
                return Err(failure::vulkan("work on the device", e));
            }
        }
        self.count(&batch);
        // SAFETY: the work has ended.
        let reset = unsafe {
            raw.reset_fences(&[batch.fence]).and_then(|()| {
                raw.reset_command_pool(batch.pool, vk::CommandPoolResetFlags::empty())
            })
        };
        match reset {
            Ok(()) => lock(&self.device.batches).push(batch),
            // SAFETY: the work has ended.
            Err(_) => unsafe { batch.destroy(raw) },
        }
        Ok(())
    }
}

impl Submission {
    /// Counts its work, which has ended.
    fn count(&self, batch: &CommandBatch) {
        let ticks = batch.ticks(&self.device.raw, self.stamps);
        let tick = f64::from(self.device.physical.limits.timestamp_period) * 1e-9;
        let seconds = |at: u32| {
            let at = at as usize;
            Some(ticks.get(at + 1)?.saturating_sub(*ticks.get(at)?) as f64 * tick)
        };
        let mut counters = lock(&self.device.counters);
        counters.traffic.waits += 1;
        counters.add(&self.dispatched, seconds);
    }
}

/// Waits for the end of the work that signals a fence.
fn wait_patiently(raw: &ash::Device, fence: vk::Fence) -> std::result::Result<(), vk::Result> {
    let part = u64::try_from((PATIENCE / PARTS).as_nanos()).unwrap_or(u64::MAX);
    // SAFETY: the fence was submitted with the work.
    let mut waits = (0..PARTS).map(|_| unsafe { raw.wait_for_fences(&[fence], true, part) });
    waits.find(|ended| *ended != Err(vk::Result::TIMEOUT)).unwrap_or(Err(vk::Result::TIMEOUT))
}

impl Drop for Submission {
    fn drop(&mut self) {
        if let Err(e) = self.finish() {
            log::error!("{e}");
        }
        let ready = lock(&self.device.retirement).end(self.number);
        self.device.destroy(ready);
    }
}

impl fmt::Debug for Submission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Submission").field("number", &self.number).finish_non_exhaustive()
    }
}
