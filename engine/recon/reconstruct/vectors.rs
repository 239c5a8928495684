//! Volumes and sinograms of an iterative method: on the device as a whole, or on the host, piece by piece on
//! the device. Kernels do the arithmetic in both cases, so that no bit depends on the place.

use super::stream::Stream;
use beamlet_core::numbers::{count, length};
use beamlet_core::{Result, reserve};
use beamlet_gpu::{Buffer, Device, Download, Kernel, Memory, push_bytes};
use beamlet_interface::{
    CHUNK, COMBINE_BOUND, COMBINE_INVERSE, COMBINE_PRODUCT, COMBINE_SUM, COMBINE_WHERE,
    CombinePush, DOT_CHUNK, DotPush, DotSum,
};
use bytemuck::Zeroable;
use std::ops::Range;
use std::sync::Arc;

/// Most values of a piece of vectors that are on the device as a whole.
const LARGEST: usize = 1 << 27;
/// Values of a piece of vectors on the host: three of them are on the device at once.
const PIECE: usize = 1 << 20;
/// Scalar products between two submissions, at most.
const DOTS: usize = 6;

/// Values of a volume or of sinograms.
#[derive(Debug)]
pub(super) enum Vector {
    Device(Arc<Buffer>),
    Host(Vec<f32>),
}

impl Vector {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Device(buffer) => length(buffer.len() / 4),
            Self::Host(values) => values.len(),
        }
    }
}

/// A vector of an operation.
pub(super) enum Operand<'a> {
    Read(&'a Vector),
    Write(&'a mut Vector),
    /// Read and written.
    Change(&'a mut Vector),
}

impl Operand<'_> {
    fn vector(&self) -> &Vector {
        match self {
            Self::Read(vector) => vector,
            Self::Write(vector) | Self::Change(vector) => vector,
        }
    }
}

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
    is_resident: bool,
    /// Pieces of vectors on the host.
    pieces: Vec<Arc<Buffer>>,
    /// Values of a piece.
    piece: usize,
    sums: Arc<Buffer>,
    /// End of the records of each scalar product that was begun.
    ends: Vec<usize>,
}

impl Vectors {
    /// For vectors of up to `longest` values, on the device as a whole or not; pieces of others may have
    /// `least` values.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub(super) fn new(
        device: &Arc<Device>,
        longest: usize,
        least: usize,
        is_resident: bool,
    ) -> Result<Self> {
        let (chunk, piece) = (length(DOT_CHUNK.into()), Self::piece(longest, least));
        let buffer = |name: &str, bytes: usize| {
            device.buffer(name, bytes as u64, Memory::Device).map(Arc::new)
        };
        let pieces = if is_resident { 0 } else { 3 };
        let of_pieces =
            (0..pieces).map(|_| buffer("a piece of a vector", 4 * piece)).collect::<Result<_>>()?;
        let records = DOTS * longest.div_ceil(chunk);
        Ok(Self {
            stream: Stream::new(device),
            combine: Arc::new(device.kernel("combine", push_bytes::<CombinePush>())?),
            multiply: Arc::new(device.kernel("dot", push_bytes::<DotPush>())?),
            is_resident,
            pieces: of_pieces,
            piece,
            sums: buffer("scalar products", records * size_of::<DotSum>())?,
            ends: Vec::new(),
        })
    }

    /// Values of a piece of vectors on the host.
    pub(super) fn piece(longest: usize, least: usize) -> usize {
        longest.min(PIECE).max(least).next_multiple_of(length(DOT_CHUNK.into()))
    }

    /// A vector of undefined values.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`].
    pub(super) fn vector(&self, values: usize, name: &str) -> Result<Vector> {
        if self.is_resident {
            let buffer = self.stream.device().buffer(name, 4 * values as u64, Memory::Device)?;
            return Ok(Vector::Device(Arc::new(buffer)));
        }
        Ok(Vector::Host(reserve::zeroed(values, name)?))
    }

    /// A vector of these values.
    ///
    /// # Errors
    /// As [`beamlet_gpu::Buffer::write`].
    pub(super) fn with(&mut self, values: &[f32], name: &str) -> Result<Vector> {
        let mut vector = self.vector(values.len(), name)?;
        self.set(&mut vector, values)?;
        Ok(vector)
    }

    /// Sets the values.
    ///
    /// # Errors
    /// As [`beamlet_gpu::Buffer::write`].
    pub(super) fn set(&mut self, vector: &mut Vector, values: &[f32]) -> Result<()> {
        self.stream.submit(&mut [])?;
        match vector {
            Vector::Device(buffer) => buffer.write(0, values)?,
            Vector::Host(own) => own.copy_from_slice(values),
        }
        Ok(())
    }

    /// The values, after all work on them.
    ///
    /// # Errors
    /// As [`beamlet_gpu::Buffer::read_into`].
    pub(super) fn values(&mut self, vector: &Vector, into: &mut [f32]) -> Result<()> {
        self.stream.submit(&mut [])?;
        match vector {
            Vector::Device(buffer) => buffer.read_into(0, into),
            Vector::Host(values) => {
                into.copy_from_slice(values);
                Ok(())
            }
        }
    }

    /// Does `step` for a range of units of `unit` values of the operands, piece by piece: it gets the first
    /// unit of the piece, the number of units, and the address of each operand's piece.
    ///
    /// # Errors
    /// As [`Stream::submit`]; [`beamlet_core::Error::Interrupted`].
    pub(super) fn each(
        &mut self,
        operands: &mut [Operand<'_>],
        (unit, range): (usize, Range<usize>),
        mut step: impl FnMut(&mut Stream, [usize; 2], &[u64]),
    ) -> Result<()> {
        let most = if self.is_resident { LARGEST } else { self.piece };
        let most = (most / unit).max(1) * unit;
        let end = operands[0].vector().len().min(range.end * unit);
        for first in (range.start * unit..end).step_by(most) {
            if !self.is_resident {
                self.stream.cancel.check()?;
            }
            let here = first..end.min(first + most);
            let mut addresses = Vec::with_capacity(operands.len());
            for (operand, piece) in operands.iter().zip(0..) {
                addresses.push(match operand.vector() {
                    Vector::Device(buffer) => {
                        self.stream.keep(buffer);
                        buffer.address() + 4 * first as u64
                    }
                    Vector::Host(values) => {
                        let piece: &Arc<Buffer> = &self.pieces[piece];
                        if !matches!(operand, Operand::Write(_)) {
                            piece.write(0, &values[here.clone()])?;
                        }
                        piece.address()
                    }
                });
            }
            step(&mut self.stream, [first / unit, here.len().div_ceil(unit)], &addresses);
            if self.is_resident {
                continue;
            }
            let mut downloads = Vec::new();
            for (operand, piece) in operands.iter_mut().zip(&self.pieces) {
                if let Operand::Write(Vector::Host(values))
                | Operand::Change(Vector::Host(values)) = operand
                {
                    downloads.push(Download::new(piece, 0, &mut values[here.clone()]));
                }
            }
            self.stream.submit(&mut downloads)?;
        }
        Ok(())
    }

    /// Combines the values of operands: the first is written, `a` and `b` are the numbers of those read.
    fn combine(
        &mut self,
        operands: &mut [Operand<'_>],
        (kind, factor): (u32, f32),
        [a, b]: [usize; 2],
    ) -> Result<()> {
        let (kernel, unit) = (self.combine.clone(), length(DOT_CHUNK.into()));
        let values = operands[0].vector().len();
        let range = 0..values.div_ceil(unit);
        self.each(operands, (unit, range), |stream, [first, units], at| {
            let here = (values - first * unit).min(units * unit);
            let (to, a, b, count) = (at[0], at[a], at[b], count(here));
            let push = CombinePush { to, a, b, count, kind, factor };
            stream.dispatch(&kernel, &push, count.div_ceil(CHUNK));
        })
    }

    /// `to = a + factor b`.
    pub(super) fn sum(
        &mut self,
        to: &mut Vector,
        a: &Vector,
        (factor, b): (f32, &Vector),
    ) -> Result<()> {
        let operands = &mut [Operand::Write(to), Operand::Read(a), Operand::Read(b)];
        self.combine(operands, (COMBINE_SUM, factor), [1, 2])
    }

    /// `to = to + factor b`.
    pub(super) fn add(&mut self, to: &mut Vector, (factor, b): (f32, &Vector)) -> Result<()> {
        let operands = &mut [Operand::Change(to), Operand::Read(b)];
        self.combine(operands, (COMBINE_SUM, factor), [0, 1])
    }

    /// `to = a + factor to`.
    pub(super) fn add_to(&mut self, to: &mut Vector, a: &Vector, factor: f32) -> Result<()> {
        let operands = &mut [Operand::Change(to), Operand::Read(a)];
        self.combine(operands, (COMBINE_SUM, factor), [1, 0])
    }

    /// `to = to b`.
    pub(super) fn multiply(&mut self, to: &mut Vector, b: &Vector) -> Result<()> {
        let operands = &mut [Operand::Change(to), Operand::Read(b)];
        self.combine(operands, (COMBINE_PRODUCT, 0.0), [0, 1])
    }

    /// Sets values below zero to zero.
    pub(super) fn bound(&mut self, to: &mut Vector) -> Result<()> {
        self.combine(&mut [Operand::Change(to)], (COMBINE_BOUND, 0.0), [0, 0])
    }

    /// Sets values to zero where `b` is not above `least`.
    pub(super) fn keep_where(&mut self, to: &mut Vector, b: &Vector, least: f32) -> Result<()> {
        let operands = &mut [Operand::Change(to), Operand::Read(b)];
        self.combine(operands, (COMBINE_WHERE, least), [0, 1])
    }

    /// One over values above `least`, zero for others.
    pub(super) fn invert(&mut self, to: &mut Vector, least: f32) -> Result<()> {
        self.combine(&mut [Operand::Change(to)], (COMBINE_INVERSE, least), [0, 0])
    }

    /// A copy of a vector.
    pub(super) fn copy(&mut self, to: &mut Vector, from: &Vector) {
        match (to, from) {
            (Vector::Device(to), Vector::Device(from)) => self.stream.copy(from, to, from.len()),
            (Vector::Host(to), Vector::Host(from)) => to.copy_from_slice(from),
            // All vectors are in the same place.
            _ => {}
        }
    }

    /// Sets all values to one number.
    pub(super) fn fill(&mut self, to: &mut Vector, value: f32) {
        match to {
            Vector::Device(buffer) => self.stream.fill(buffer, buffer.len(), value),
            Vector::Host(values) => values.fill(value),
        }
    }

    /// Begins a scalar product, with factors of the values of `a` where there are weights; at most six before
    /// [`Self::dots`].
    pub(super) fn dot(&mut self, a: &Vector, b: &Vector, weights: Option<&Vector>) -> Result<()> {
        let begin = self.ends.last().copied().unwrap_or_default();
        let (kernel, unit) = (self.multiply.clone(), length(DOT_CHUNK.into()));
        let (sums, values) = (self.sums.clone(), a.len());
        let mut operands = vec![Operand::Read(a), Operand::Read(b)];
        operands.extend(weights.map(Operand::Read));
        let range = 0..values.div_ceil(unit);
        self.each(&mut operands, (unit, range), |stream, [first, units], at| {
            let record = (begin + first) * size_of::<DotSum>();
            let push = DotPush {
                a: at[0],
                b: at[1],
                weights: at.get(2).copied().unwrap_or_default(),
                sums: sums.address() + record as u64,
                count: count((values - first * unit).min(units * unit)),
                is_weighted: weights.is_some().into(),
            };
            stream.keep(&sums);
            stream.dispatch(&kernel, &push, count(units));
        })?;
        self.ends.push(begin + values.div_ceil(unit));
        Ok(())
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
