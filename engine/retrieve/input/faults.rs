//! Faults of measured stacks that no curve shows: a stack in the place of another, offsets in the unit of
//! another.

use super::Scene;
use crate::stack::StackFile;
use crate::{Error, Result, numbers};
use ndarray::Array2;

/// Fewest and most periods of the sample mask that offsets span.
const SPAN: [f64; 2] = [0.1, 10.0];
/// Share of the range of the flat's frame means that the mean of the dark may exceed the darkest frame by.
const DARK: f64 = 0.1;

/// Refuses mask offsets whose span is no scan of the sample mask.
pub(super) fn check_offsets(scene: &Scene) -> Result<()> {
    let offsets = &scene.scan.mask_offsets;
    let Some(mask) = &scene.sample_mask else { return Ok(()) };
    if offsets.len() < 2 {
        return Ok(());
    }
    let [low, high] = offsets
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(*at), high.max(*at)]);
    let periods = (high - low) / mask.period;
    let [least, most] = SPAN;
    if (least..=most).contains(&periods) {
        return Ok(());
    }
    let um = 1e6;
    Err(Error::argument(
        "offsets",
        format!("a span of {:.4} um", um * (high - low)),
        format!(
            "{least} to {most} periods of the sample mask ({:.4} um): check the unit of the offsets, \
             and sample_mask.period",
            um * mask.period
        ),
    ))
}

/// Refuses a sample with the values of the flat.
pub(super) fn check_sample(flat: &StackFile, sample: &StackFile) -> Result<()> {
    if flat.shape() != sample.shape() {
        return Ok(());
    }
    let [_, steps, rows, _] = flat.shape();
    for step in 0..steps {
        let rows = 0..numbers::count(rows);
        if flat.frame(0, step, rows.clone())? != sample.frame(0, step, rows)? {
            return Ok(());
        }
    }
    let problem = format!("has the values of the flat, {}: name the sample", flat.path().display());
    Err(Error::file(sample.path(), problem, None))
}

/// Refuses a dark that is brighter than the flat in its darkest steps.
pub(super) fn check_dark(flat: &StackFile, dark: &StackFile, mean: &Array2<f32>) -> Result<()> {
    let [_, steps, rows, _] = flat.shape();
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    for step in 0..steps {
        let level = level(&flat.frame(0, step, 0..numbers::count(rows))?);
        ends = [ends[0].min(level), ends[1].max(level)];
    }
    let [darkest, brightest] = ends;
    let of_dark = level(mean);
    if !(darkest.is_finite() && brightest.is_finite()) {
        // Reported where curves are read, with the pixel.
        return Ok(());
    }
    // Also where all frames are equal: a dark as bright as the flat leaves nothing.
    if of_dark <= darkest + DARK * (brightest - darkest) && of_dark < brightest {
        return Ok(());
    }
    let problem = format!(
        "has a mean of {of_dark:.4}; the frames of the flat, {}, have {darkest:.4} to {brightest:.4}: \
         a dark is taken without beam",
        flat.path().display()
    );
    Err(Error::file(dark.path(), problem, None))
}

/// Mean over the pixels of a frame.
fn level(frame: &Array2<f32>) -> f64 {
    frame.iter().map(|value| f64::from(*value)).sum::<f64>() / frame.len() as f64
}
