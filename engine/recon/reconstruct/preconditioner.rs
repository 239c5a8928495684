//! The filter 1/|k| of slices: it makes steps of refraction angles about the same size at all frequencies.

use super::stream::Stream;
use super::vectors::{Vector, Vectors, value_address};
use beamlet_core::numbers::{count, single};
use beamlet_core::{Cancel, Result};
use beamlet_gpu::{Buffer, Device, Kernel, Memory, push_bytes};
use beamlet_interface::{
    FOURIER_CHUNK, FOURIER_FOURS, FOURIER_PACK, FOURIER_PAIRS, FOURIER_UNPACK, FourierPush,
};
use bytemuck::Zeroable;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Complex numbers that are transformed at once, unless a plane has more.
const AT_ONCE: usize = 1 << 21;
/// Complex numbers that are transformed in a submission.
const SUBMITTED: usize = 1 << 25;

/// Filter of planes that are padded with zeros to twice their sides, two planes as one of complex numbers.
#[derive(Debug)]
pub(super) struct Preconditioner {
    kernel: Arc<Kernel>,
    _roots: Buffer,
    /// Complex numbers before and after a pass.
    numbers: [Arc<Buffer>; 2],
    size: [usize; 3],
    padded: [usize; 2],
    /// Pairs of planes at once.
    pairs: usize,
    /// Constants; what differs from dispatch to dispatch is 0.
    push: FourierPush,
}

fn padded(size: [usize; 3]) -> [usize; 2] {
    [size[0], size[1]].map(|side| (2 * side).next_power_of_two())
}

/// Pairs of planes that are transformed at once.
fn pairs([x, y, z]: [usize; 3]) -> usize {
    let [wide, high] = padded([x, y, z]);
    (AT_ONCE / (wide * high)).clamp(1, z.div_ceil(2))
}

/// Bytes of the filter on the device.
pub(super) fn filter_bytes(size: [usize; 3]) -> u64 {
    let [wide, high] = padded(size);
    let bytes = |complex: usize| 8 * complex as u64;
    2 * bytes(wide * high).saturating_mul(pairs(size) as u64) + bytes(wide.max(high))
}

impl Preconditioner {
    /// A filter of volumes of this size along x, y and z.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub(super) fn new(device: &Arc<Device>, size: [usize; 3]) -> Result<Self> {
        let ([wide, high], pairs) = (padded(size), pairs(size));
        let most = wide.max(high);
        let root = |n: usize| {
            let angle = TAU * n as f64 / most as f64;
            [single(libm::cos(angle)), single(-libm::sin(angle))]
        };
        let roots: Vec<[f32; 2]> = (0..most).map(root).collect();
        let roots = device.upload("roots of one", &roots)?;
        let bytes = 8 * (pairs * wide * high) as u64;
        let numbers = || device.buffer("planes", bytes, Memory::Device).map(Arc::new);
        let push = FourierPush {
            roots: roots.address(),
            log_roots: most.ilog2(),
            log_wide: wide.ilog2(),
            log_high: high.ilog2(),
            size_x: count(size[0]),
            size_y: count(size[1]),
            least: single(0.25 / size[0].max(size[1]) as f64),
            ..FourierPush::zeroed()
        };
        Ok(Self {
            kernel: Arc::new(device.kernel("fourier", push_bytes::<FourierPush>())?),
            _roots: roots,
            numbers: [numbers()?, numbers()?],
            size,
            padded: [wide, high],
            pairs,
            push,
        })
    }

    /// Filters each plane of `[z][y][x]`.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`], [`beamlet_core::Error::Device`].
    pub(super) fn apply(
        &self,
        volume: &Vector,
        to: &Vector,
        vectors: &mut Vectors,
        cancel: &Cancel,
    ) -> Result<()> {
        let [x, y, z] = self.size;
        let pair = 2 * x * y;
        let mut waiting = 0;
        for first in (0..z.div_ceil(2)).step_by(self.pairs) {
            cancel.check()?;
            waiting += self.pairs * self.padded[0] * self.padded[1];
            if waiting > SUBMITTED {
                vectors.stream.submit(&mut [])?;
                waiting = 0;
            }
            let pairs = self.pairs.min(z.div_ceil(2) - first);
            let voxels = (x * y * z - first * pair).min(pairs * pair);
            let at = [volume, to].map(|vector| value_address(vector, first * pair));
            [volume, to].into_iter().for_each(|vector| vectors.stream.keep(vector));
            self.filter(&mut vectors.stream, [pairs, voxels], at);
        }
        Ok(())
    }

    fn filter(&self, stream: &mut Stream, [pairs, voxels]: [usize; 2], [from, to]: [u64; 2]) {
        let [x, y, _] = self.size;
        let [wide, high] = self.padded;
        let push = FourierPush { from, voxels: count(voxels), ..self.push };
        let mut at = 0;
        let mut step = |push: FourierPush, items: usize| {
            let push = FourierPush { count: count(items), ..push };
            stream.dispatch(&self.kernel, &push, push.count.div_ceil(FOURIER_CHUNK));
        };
        let address = |at: usize| self.numbers[at].address();
        let quarter = pairs * wide * high / 4;
        step(FourierPush { kind: FOURIER_PACK, to: address(at), ..push }, quarter);
        let rows = FourierPush { log_numbers: wide.ilog2(), log_stride: 0, ..push };
        let columns = FourierPush { log_numbers: high.ilog2(), log_stride: wide.ilog2(), ..push };
        let all = pairs * wide * high;
        for (lines, numbers, valid, is_inverse) in [
            (rows, all / 2, x, false),
            (columns, all, y, false),
            (columns, all, high, true),
            (rows, all / 2, wide, true),
        ] {
            let FourierPush { log_numbers, log_stride, .. } = lines;
            let mut log_joined = 0;
            while log_joined < log_numbers {
                let is_first = log_joined == 0;
                let is_odd = is_first && log_numbers % 2 == 1;
                let (radix, kind) = if is_odd { (1, FOURIER_PAIRS) } else { (2, FOURIER_FOURS) };
                let push = FourierPush {
                    from: address(at),
                    to: address(1 - at),
                    kind,
                    log_joined,
                    valid: if is_first { count(valid) } else { 1 << log_numbers },
                    is_inverse: is_inverse.into(),
                    is_filtered: (is_first && is_inverse && log_stride > 0).into(),
                    ..lines
                };
                step(push, numbers >> radix);
                (log_joined, at) = (log_joined + radix, 1 - at);
            }
        }
        step(FourierPush { kind: FOURIER_UNPACK, from: address(at), to, ..push }, quarter);
        self.numbers.iter().for_each(|buffer| stream.keep(buffer));
    }
}
