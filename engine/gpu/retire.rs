//! Destruction of objects that a submission may still use, once that submission has ended.

use ash::vk;
use gpu_allocator::vulkan::Allocation;
use std::collections::BTreeSet;

/// Something to destroy.
pub(super) enum Retired {
    Buffer(vk::Buffer, Allocation),
    Pipeline(vk::Pipeline, vk::PipelineLayout),
    AccelerationStructure(vk::AccelerationStructureKHR),
}

/// Which submissions run, and what waits for them.
#[derive(Default)]
pub(super) struct Retirement {
    /// Number of the latest submission.
    latest: u64,
    running: BTreeSet<u64>,
    /// With the latest submission that may use it.
    waiting: Vec<(u64, Retired)>,
}

impl Retirement {
    /// Counts a submission in and numbers it.
    pub(super) fn begin(&mut self) -> u64 {
        self.latest += 1;
        self.running.insert(self.latest);
        self.latest
    }

    /// Counts a submission out; what no running submission can use is handed back.
    pub(super) fn end(&mut self, number: u64) -> Vec<Retired> {
        self.running.remove(&number);
        let oldest = self.running.first().copied().unwrap_or(u64::MAX);
        let ready = self.waiting.extract_if(.., |(last, _)| *last < oldest);
        ready.map(|(_, retired)| retired).collect()
    }

    /// Takes an object that is no longer needed; returns it at once if nothing runs.
    pub(super) fn retire(&mut self, retired: Retired) -> Option<Retired> {
        if self.running.is_empty() {
            return Some(retired);
        }
        self.waiting.push((self.latest, retired));
        None
    }

    /// Everything that waits, whatever runs.
    pub(super) fn drain(&mut self) -> Vec<Retired> {
        self.waiting.drain(..).map(|(_, retired)| retired).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pipeline() -> Retired {
        Retired::Pipeline(vk::Pipeline::null(), vk::PipelineLayout::null())
    }

    #[test]
    fn what_an_older_submission_may_use_outlives_a_newer_one() {
        let mut retirement = Retirement::default();
        let (first, second) = (retirement.begin(), retirement.begin());
        assert!(retirement.retire(pipeline()).is_none());
        assert!(retirement.end(second).is_empty());
        let third = retirement.begin();
        assert_eq!(retirement.end(first).len(), 1);
        assert!(retirement.retire(pipeline()).is_none());
        assert_eq!(retirement.end(third).len(), 1);
        assert!(retirement.retire(pipeline()).is_some());
    }
}
