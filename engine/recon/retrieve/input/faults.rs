//! Faults of measured stacks that no curve shows: a stack in the place of another, offsets in the unit of
//! another.

use super::Scene;
use super::correction::Dark;
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result, numbers};
use beamlet_files::StackFile;
use beamlet_model::optics::{Optics, ends};
use ndarray::Array2;

/// Fewest and most periods of the sample mask that offsets span.
const SPAN: [f64; 2] = [0.1, 10.0];
/// Greatest excess of the mean of the dark over the mean of the darkest frame of the flat, as a share of
/// the range of the means of the flat's frames.
const DARK: f64 = 0.1;

/// Refuses mask offsets whose span is no scan of the sample mask.
pub(super) fn check_offsets(scene: &Scene) -> Result<()> {
    let [low, high] = ends(&scene.scan.mask_offsets);
    let period = Optics::of(scene).curve_period();
    let [least, most] = SPAN;
    let is_scan = (least..=most).contains(&((high - low) / period));
    if scene.scan.mask_offsets.len() < 2 || !period.is_finite() || is_scan {
        return Ok(());
    }
    Err(Error::argument(
        "offsets",
        format!("a span of {}", Length.rounded(high - low)),
        format!(
            "{least} to {most} periods of the sample mask ({}): check the unit of the offsets, and \
             sample_mask.period",
            Length.rounded(period)
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
        let (flat, sample) = (flat.frame(0, step, rows.clone())?, sample.frame(0, step, rows)?);
        // Gaps of a detector hold NaN in both.
        let is_same =
            |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
        if !flat.iter().zip(&sample).all(is_same) {
            return Ok(());
        }
    }
    let problem =
        format!("has the same values as the flat, {}: give the sample", flat.path().display());
    Err(Error::file(sample.path(), problem, None))
}

/// Warnings about values of 8 bits: converted ones, each stack by a scale of its own.
pub(super) fn of_bytes(flat: &StackFile, sample: &StackFile) -> Vec<String> {
    let of = |(stack, other): (&StackFile, &StackFile)| {
        stack.has_bytes().then(|| {
            format!(
                "{}: has values of 8 bits{}; programs that convert to 8 bits scale each stack separately, which changes the transmission: give the values of the detector",
                stack.path().display(),
                if other.has_bytes() { "" } else { ", unlike the other stack" }
            )
        })
    };
    [(sample, flat), (flat, sample)].into_iter().filter_map(of).collect()
}

/// Warning about frames of another shape than the detector of the geometry.
pub(super) fn of_pixels(scene: &Scene, flat: &StackFile) -> Option<String> {
    let [_, _, rows, columns] = flat.shape();
    let [width, height] = scene.detector.pixels;
    ([width, height] != [numbers::count(columns), numbers::count(rows)]).then(|| {
        format!(
            "the geometry has {width} x {height} pixels, the frames {columns} x {rows}: is it the geometry of \
             these frames?"
        )
    })
}

/// Refuses a dark that is brighter than the flat in its darkest steps.
pub(super) fn check_dark(flat: &StackFile, dark: &Dark) -> Result<()> {
    let [_, steps, rows, _] = flat.shape();
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    for step in 0..steps {
        let level = level(&flat.frame(0, step, 0..numbers::count(rows))?);
        ends = [ends[0].min(level), ends[1].max(level)];
    }
    let [darkest, brightest] = ends;
    let of_dark = level(&dark.mean);
    if of_dark.is_nan() {
        return Err(Error::file(&dark.path, "is not finite in any pixel", None));
    }
    if !(darkest.is_finite() && brightest.is_finite()) {
        // No pixel has a value: reported where curves are read.
        return Ok(());
    }
    // Also where all frames are equal: a dark as bright as the flat leaves nothing.
    if of_dark <= darkest + DARK * (brightest - darkest) && of_dark < brightest {
        return Ok(());
    }
    let problem = format!(
        "has a mean of {of_dark:.4}; the frames of the flat, {}, have {darkest:.4} to {brightest:.4}: \
         the dark must be taken without beam",
        flat.path().display()
    );
    Err(Error::file(&dark.path, problem, None))
}

/// Mean over the pixels of a frame that have a value; NaN where none has.
fn level(frame: &Array2<f32>) -> f64 {
    let values = frame.iter().filter(|value| value.is_finite());
    let (sum, count) =
        values.fold((0.0, 0_usize), |(sum, count), value| (sum + f64::from(*value), count + 1));
    sum / count as f64
}
