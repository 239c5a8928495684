//! Size of the work of an invocation, so that a dispatch fills the device.

use beamlet_core::numbers;
use beamlet_gpu::DeviceKind;

/// Invocations that fill a GPU.
const INVOCATIONS: u64 = 1 << 17;

/// Items of an invocation, at most `most`, in a dispatch of `items`: fewer where a GPU would not be full. A
/// processor is full with few invocations.
pub(super) fn items_each(kind: DeviceKind, items: u64, most: u32) -> u32 {
    match kind {
        DeviceKind::Cpu => most,
        _ => numbers::at_most(numbers::length(items / INVOCATIONS)).clamp(1, most),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_dispatches_have_small_invocations_on_a_gpu() {
        let gpu = |items| items_each(DeviceKind::Discrete, items, 16);
        assert_eq!([0, 1 << 17, 1 << 18, 1 << 20, 1 << 30].map(gpu), [1, 1, 2, 8, 16]);
        assert_eq!(items_each(DeviceKind::Cpu, 1, 16), 16);
    }

    /// Random rays of the octagon in docs/experiments: 13 to 52 pixels of 5,000 rays.
    #[test]
    fn larger_dispatches_fill_a_gpu() {
        for items in [1 << 17, 200_000, (1 << 18) - 1, 260_000, 1 << 20, 1 << 30] {
            let each = u64::from(items_each(DeviceKind::Discrete, items, 16));
            assert!(items / each >= 100_000, "{items} items, {each} each");
        }
    }
}
