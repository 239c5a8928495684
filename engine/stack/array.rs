//! Stacks in memory, for callers that go on computing with them.

use super::record::{RunRecord, RunStart};
use super::shape::StackShape;
use super::sink::Sink;
use crate::scene::{Exposure, Scene};
use crate::{Error, Result};
use ndarray::{Array3, Array4, ArrayView3, ArrayViewMut3, Axis, s};
use std::ops::Range;

/// Stacks in memory, with the record of their run.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Stacks {
    /// Without the sample, `[step][row][column]`.
    pub flat: Array3<f32>,
    /// With the sample, `[view][step][row][column]`.
    pub sample: Array4<f32>,
    /// Detector numbers, if the scene has noise.
    pub counts: Option<CountStacks>,
    /// Provenance and counts.
    pub record: RunRecord,
}

/// Detector numbers in memory.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct CountStacks {
    /// Without the sample, `[step][row][column]`.
    pub flat: Array3<f32>,
    /// With the sample, `[view][step][row][column]`.
    pub sample: Array4<f32>,
    /// Without light, `[step][row][column]`.
    pub dark: Array3<f32>,
}

/// Collects a run into `ndarray` arrays. All views are held at once.
#[derive(Debug, Default)]
pub struct ArraySink {
    flat: Array3<f32>,
    sample: Array4<f32>,
    counts: Option<CountStacks>,
    record: Option<RunRecord>,
}

impl ArraySink {
    /// An empty sink; the arrays are made when the run begins.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The stacks of the finished run; `None` before it has finished.
    #[must_use]
    pub fn into_stacks(self) -> Option<Stacks> {
        let Self { flat, sample, counts, record } = self;
        record.map(|record| Stacks { flat, sample, counts, record })
    }
}

impl Sink for ArraySink {
    fn begin(&mut self, scene: &Scene, _start: &RunStart) -> Result<()> {
        let extent = StackShape::of(scene)?;
        let [views, steps, rows, columns] =
            [extent.views, extent.steps, extent.rows, extent.columns].map(|n| n as usize);
        let zeros = |len: usize| {
            let mut values = Vec::new();
            values.try_reserve_exact(len).map_err(|_| Error::Memory {
                purpose: "holding the stacks in arrays".into(),
                needed: extent.output_bytes(scene),
                available: None,
                remedy: "write them to a run directory instead, or simulate fewer views".into(),
            })?;
            values.resize(len, 0.0_f32);
            Ok(values)
        };
        let frames = steps * rows * columns;
        self.record = None;
        let one = || Ok(shaped(Array3::from_shape_vec((steps, rows, columns), zeros(frames)?)));
        let all = || {
            let values = zeros(frames.saturating_mul(views))?;
            Ok(shaped(Array4::from_shape_vec((views, steps, rows, columns), values)))
        };
        (self.flat, self.sample) = (one()?, all()?);
        self.counts = match scene.detector.counts {
            Some(_) => Some(CountStacks { flat: one()?, sample: all()?, dark: one()? }),
            None => None,
        };
        Ok(())
    }

    fn write(&mut self, view: Exposure, rows: Range<u32>, data: ArrayView3<'_, f32>) -> Result<()> {
        let stack = match view {
            Exposure::Flat => self.flat.view_mut(),
            Exposure::Sample(index) => self.sample.index_axis_mut(Axis(0), index as usize),
            Exposure::Dark => return Ok(()),
        };
        put(stack, rows, data);
        Ok(())
    }

    fn write_counts(
        &mut self,
        view: Exposure,
        rows: Range<u32>,
        numbers: ArrayView3<'_, f32>,
    ) -> Result<()> {
        let Some(counts) = &mut self.counts else { return Ok(()) };
        let stack = match view {
            Exposure::Flat => counts.flat.view_mut(),
            Exposure::Sample(index) => counts.sample.index_axis_mut(Axis(0), index as usize),
            Exposure::Dark => counts.dark.view_mut(),
        };
        put(stack, rows, numbers);
        Ok(())
    }

    fn commit(&mut self, _view: Exposure) -> Result<()> {
        Ok(())
    }

    fn finish(&mut self, record: &RunRecord) -> Result<()> {
        self.record = Some(record.clone());
        Ok(())
    }
}

fn put(mut stack: ArrayViewMut3<'_, f32>, rows: Range<u32>, band: ArrayView3<'_, f32>) {
    let rows = rows.start as usize..rows.end as usize;
    stack.slice_mut(s![.., rows, ..]).assign(&band);
}

/// The array of a vector that was made for its shape.
fn shaped<A>(array: std::result::Result<A, ndarray::ShapeError>) -> A {
    array.unwrap_or_else(|error| unreachable!("the vector was made for this shape: {error}"))
}
