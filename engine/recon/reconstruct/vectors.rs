//! Volumes and sinograms of an iterative method, on the device, and kernels that combine them.

use super::stream::Stream;
use beamlet_core::Result;
use beamlet_core::numbers::{count, length};
use beamlet_gpu::{Buffer, Device, Download, Kernel, Memory, push_bytes};
use beamlet_interface::{
    CHUNK, COMBINE_BOUND, COMBINE_INVERSE, COMBINE_PRODUCT, COMBINE_SUM, COMBINE_WHERE,
    CombinePush, DOT_CHUNK, DotPush, DotSum,
};
use bytemuck::Zeroable;
use std::sync::Arc;

/// Most values of a dispatch: a whole number of chunks.
const LARGEST: usize = 1 << 27;
/// Scalar products between two submissions, at most.
const DOTS: usize = 6;

/// Values of a volume or of sinograms, f32.
pub(super) type Vector = Arc<Buffer>;

/// A scalar product.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Dot {
    pub(super) sum: f64,
    /// Largest value of the first vector, at least 0.
    pub(super) most: f32,
}

/// Operations on vectors, and their device. Operations wait for a result that the host needs.
#[derive(Debug)]
pub(super) struct Vectors {
    pub(super) stream: Stream,
    combine: Arc<Kernel>,
    multiply: Arc<Kernel>,
    sums: Arc<Buffer>,
    /// End of the records of each scalar product that was begun.
    ends: Vec<usize>,
}

/// First value and number of values of each dispatch for a vector.
fn parts(vector: &Vector) -> impl Iterator<Item = [usize; 2]> + use<> {
    let values = length(vector.len() / 4);
    (0..values).step_by(LARGEST).map(move |first| [first, LARGEST.min(values - first)])
}

/// Address of a value of a vector.
pub(super) fn value_address(vector: &Vector, value: usize) -> u64 {
    vector.address() + 4 * value as u64
}

impl Vectors {
    /// For vectors of up to `longest` values.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub(super) fn new(device: &Arc<Device>, longest: usize) -> Result<Self> {
        let records = DOTS * longest.div_ceil(length(DOT_CHUNK.into()));
        let bytes = (records * size_of::<DotSum>()) as u64;
        Ok(Self {
            stream: Stream::new(device),
            combine: Arc::new(device.kernel("combine", push_bytes::<CombinePush>())?),
            multiply: Arc::new(device.kernel("dot", push_bytes::<DotPush>())?),
            sums: Arc::new(device.buffer("scalar products", bytes, Memory::Device)?),
            ends: Vec::new(),
        })
    }

    /// A vector of undefined values.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`].
    pub(super) fn vector(&self, values: usize, name: &str) -> Result<Vector> {
        self.stream.device().buffer(name, 4 * values as u64, Memory::Device).map(Arc::new)
    }

    /// A vector of these values.
    ///
    /// # Errors
    /// As [`beamlet_gpu::Buffer::write`].
    pub(super) fn with(&self, values: &[f32], name: &str) -> Result<Vector> {
        let vector = self.vector(values.len(), name)?;
        vector.write(0, values)?;
        Ok(vector)
    }

    /// Combines the values of `a` and `b`.
    fn combine(&mut self, (kind, factor): (u32, f32), to: &Vector, [a, b]: [&Vector; 2]) {
        [to, a, b].into_iter().for_each(|vector| self.stream.keep(vector));
        for [first, values] in parts(to) {
            let [to, a, b] = [to, a, b].map(|vector| value_address(vector, first));
            let push = CombinePush { to, a, b, count: count(values), kind, factor };
            self.stream.dispatch(&self.combine, &push, push.count.div_ceil(CHUNK));
        }
    }

    /// `to = a + factor b`; `to` may be one of them.
    pub(super) fn sum(&mut self, to: &Vector, a: &Vector, (factor, b): (f32, &Vector)) {
        self.combine((COMBINE_SUM, factor), to, [a, b]);
    }

    /// `to = to b`.
    pub(super) fn multiply(&mut self, to: &Vector, b: &Vector) {
        self.combine((COMBINE_PRODUCT, 0.0), to, [to, b]);
    }

    /// Sets values below zero to zero.
    pub(super) fn bound(&mut self, to: &Vector) {
        self.combine((COMBINE_BOUND, 0.0), to, [to, to]);
    }

    /// Sets values to zero where `b` is not above `least`.
    pub(super) fn keep_where(&mut self, to: &Vector, b: &Vector, least: f32) {
        self.combine((COMBINE_WHERE, least), to, [to, b]);
    }

    /// One over values above `least`, zero for others.
    pub(super) fn invert(&mut self, to: &Vector, least: f32) {
        self.combine((COMBINE_INVERSE, least), to, [to, to]);
    }

    /// A copy of a vector.
    pub(super) fn copy(&mut self, to: &Vector, from: &Vector) {
        self.stream.copy(from, to, from.len());
    }

    /// Sets all values to one number.
    pub(super) fn fill(&mut self, to: &Vector, value: f32) {
        self.stream.fill(to, to.len(), value);
    }

    /// Begins a scalar product, with factors of the values of `a` where there are weights; at most six before
    /// [`Self::dots`].
    pub(super) fn dot(&mut self, a: &Vector, b: &Vector, weights: Option<&Vector>) {
        let mut end = self.ends.last().copied().unwrap_or_default();
        let used = [Some(a), Some(b), weights, Some(&self.sums)];
        used.into_iter().flatten().for_each(|buffer| self.stream.keep(buffer));
        for [first, values] in parts(a) {
            let chunks = values.div_ceil(length(DOT_CHUNK.into()));
            let push = DotPush {
                a: value_address(a, first),
                b: value_address(b, first),
                weights: weights.map_or(0, |weights| value_address(weights, first)),
                sums: self.sums.address() + (end * size_of::<DotSum>()) as u64,
                count: count(values),
                is_weighted: weights.is_some().into(),
            };
            self.stream.dispatch(&self.multiply, &push, count(chunks));
            end += chunks;
        }
        self.ends.push(end);
    }

    /// The scalar products that were begun, in order.
    ///
    /// # Errors
    /// As [`Stream::submit`].
    pub(super) fn dots<const N: usize>(&mut self) -> Result<[Dot; N]> {
        let ends = std::mem::take(&mut self.ends);
        let all = ends.last().copied().unwrap_or_default();
        let mut records = vec![DotSum::zeroed(); all];
        self.stream.submit(&mut [Download::new(&self.sums, 0, &mut records)])?;
        let mut dots = [Dot::default(); N];
        let begins = std::iter::once(0).chain(ends.iter().copied());
        for ((dot, begin), end) in dots.iter_mut().zip(begins).zip(&ends) {
            for DotSum { high, low, exponent, most } in records[begin..*end].iter().copied() {
                dot.sum += (f64::from(high) + f64::from(low)) * libm::exp2(exponent.into());
                dot.most = dot.most.max(most);
            }
        }
        Ok(dots)
    }
}
