//! Stacks in memory, what is retrieved from them, and offsets that tests share.

use crate::support::{Checked, engine};
use beamlet::retrieve::{
    Images, Input, RetrieveOptions, RetrievedArrays, Retriever, retrieve_arrays,
};
use beamlet::scene::Scene;
use beamlet::stack::StackFile;
use beamlet::{Backend, Result, RowsControl};
use ndarray::{Array4, ArrayView3};
use std::ops::Range;

/// Even offsets over ±`half`.
pub(super) fn even(count: usize, half: f64) -> Vec<f64> {
    (0..count).map(|i| half * (2.0 * i as f64 / (count - 1) as f64 - 1.0)).collect()
}

/// The masks of the paper as sheets, at these offsets in um.
pub(super) fn sheets([columns, rows]: [usize; 2], offsets: &[f64]) -> String {
    let list: Vec<String> = offsets.iter().map(|f| format!("\"{f} um\"")).collect();
    format!(
        "[source]\ndistance = \"1.21 m\"\nspot = \"30 um\"\nenergy = \"30 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [{columns}, {rows}]\npitch = \"150 um\"\n\
         [sample_mask]\ndistance = \"1.2 m\"\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
         [detector_mask]\ndistance = \"1.8 m\"\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
         [scan]\nmask_offsets = [{}]\n",
        list.join(", ")
    )
}

/// A stack of frames `[view][step][row][column]`.
pub(super) fn stack(name: &str, values: Array4<f32>) -> StackFile {
    let (views, steps, rows, columns) = values.dim();
    let read = move |frame: usize, rows: Range<usize>| {
        let frame = values.slice(ndarray::s![frame / steps, frame % steps, rows, ..]);
        Ok(frame.iter().copied().collect())
    };
    StackFile::of_values(name, [views, steps, rows, columns], read).unwrap()
}

/// What is retrieved from an input.
pub(super) fn retrieved(input: Input, options: &RetrieveOptions) -> Result<RetrievedArrays> {
    retrieve_arrays(&engine(Backend::Bvh), input, options, &mut RowsControl::default())
}

/// What is retrieved from measured frames of flat and sample.
pub(super) fn measured(
    scene: &Scene,
    [flat, sample]: [&Array4<f32>; 2],
    options: &RetrieveOptions,
) -> Result<RetrievedArrays> {
    let [flat, sample] = [("flat", flat), ("sample", sample)].map(|(n, of)| stack(n, of.clone()));
    retrieved(Input::measured(scene, flat, sample, None)?, options)
}

/// Images of frames of flat and sample.
pub(super) fn images_of(
    engine: &Checked,
    scene: &Scene,
    options: &RetrieveOptions,
    [flat, sample]: [ArrayView3<'_, f32>; 2],
) -> Images {
    let mut retriever = Retriever::new(engine, scene, options).unwrap();
    retriever.set_flat_array(flat).unwrap();
    retriever.retrieve_array(sample).unwrap()
}
