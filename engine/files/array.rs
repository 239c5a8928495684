//! Stacks in memory, for callers that go on computing with them.

use super::record::{RunRecord, RunStart};
use super::shape::StackShape;
use super::sink::Sink;
use beamlet_core::{Error, Result};
use beamlet_model::scene::{Exposure, Scene};
use ndarray::{Array3, Array4, ArrayView3, ArrayViewMut3, Axis, s};
use std::ops::Range;

/// Stacks in memory, with the record of their run.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Stacks {
    /// Without the sample, `[step][row][column]`: the first flat.
    pub flat: Array3<f32>,
    /// The flats behind it, `[flat][step][row][column]`; none without `scan.flats_every`.
    pub later_flats: Array4<f32>,
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
    /// Without the sample, `[step][row][column]`: the first flat.
    pub flat: Array3<f32>,
    /// The flats behind it, `[flat][step][row][column]`; none without `scan.flats_every`.
    pub later_flats: Array4<f32>,
    /// With the sample, `[view][step][row][column]`.
    pub sample: Array4<f32>,
    /// Without light, `[step][row][column]`: the first dark.
    pub dark: Array3<f32>,
    /// The darks behind it, `[dark][step][row][column]`; none without `scan.darks_every`.
    pub later_darks: Array4<f32>,
}

/// Collects a run into `ndarray` arrays. All views are held at once.
#[derive(Debug, Default)]
pub struct ArraySink {
    flat: Array3<f32>,
    later_flats: Array4<f32>,
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
        let Self { flat, later_flats, sample, counts, record } = self;
        record.map(|record| Stacks { flat, later_flats, sample, counts, record })
    }
}

impl Sink for ArraySink {
    fn begin(&mut self, scene: &Scene, _start: &RunStart) -> Result<()> {
        let extent = StackShape::of(scene)?;
        let StackShape { views, flats, darks, steps, rows, columns } = extent;
        let [steps, rows, columns] = [steps, rows, columns].map(|n| n as usize);
        // Pages come with their first value, so that a stop need not wait for gigabytes of zeros.
        let zeros = |len: usize| {
            bytemuck::allocation::try_zeroed_vec::<f32>(len).map_err(|()| Error::Memory {
                purpose: "holding the stacks in arrays".into(),
                needed: extent.output_bytes(scene),
                available: None,
                remedy: "write them to a run directory instead, or simulate fewer views".into(),
            })
        };
        let frames = steps * rows * columns;
        self.record = None;
        let one = || Ok(shaped(Array3::from_shape_vec((steps, rows, columns), zeros(frames)?)));
        let all = |count: u32| {
            let count = count as usize;
            let values = zeros(frames.saturating_mul(count))?;
            Ok(shaped(Array4::from_shape_vec((count, steps, rows, columns), values)))
        };
        (self.flat, self.later_flats, self.sample) = (one()?, all(flats - 1)?, all(views)?);
        self.counts = match scene.detector.counts {
            Some(_) => Some(CountStacks {
                flat: one()?,
                later_flats: all(flats - 1)?,
                sample: all(views)?,
                dark: one()?,
                later_darks: all(darks - 1)?,
            }),
            None => None,
        };
        Ok(())
    }

    fn write(&mut self, view: Exposure, rows: Range<u32>, data: ArrayView3<'_, f32>) -> Result<()> {
        let stack = match view {
            Exposure::Flat(index) => one_of(&mut self.flat, &mut self.later_flats, index),
            Exposure::Sample(index) => self.sample.index_axis_mut(Axis(0), index as usize),
            Exposure::Dark(_) => return Ok(()),
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
            Exposure::Flat(index) => one_of(&mut counts.flat, &mut counts.later_flats, index),
            Exposure::Sample(index) => counts.sample.index_axis_mut(Axis(0), index as usize),
            Exposure::Dark(index) => one_of(&mut counts.dark, &mut counts.later_darks, index),
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

/// The first of a stack, or one behind it.
fn one_of<'a>(
    first: &'a mut Array3<f32>,
    later: &'a mut Array4<f32>,
    index: u32,
) -> ArrayViewMut3<'a, f32> {
    match index {
        0 => first.view_mut(),
        _ => later.index_axis_mut(Axis(0), index as usize - 1),
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
