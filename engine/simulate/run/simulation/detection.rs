//! What blur and scatter of a detector take, from a few rows.

use crate::detector::DetectorModel;
use beamlet_core::cancel::Cancel;
use beamlet_core::{Result, reserve};
use beamlet_model::scene::Exposure;
use ndarray::Array3;
use std::time::Instant;

/// Rows timed first: more than one, since they are summed side by side.
const FEW: u32 = 16;
/// Rows timed next.
const MORE: u32 = 64;

/// Seconds for one exposure of `steps` mask steps in bands of `height` rows. Each band takes a time of
/// its own, for the light within reach of the kernel, and one for each of its rows.
pub(super) fn detection_seconds(
    detector: &DetectorModel,
    steps: usize,
    height: u32,
    cancel: &Cancel,
) -> Result<f64> {
    if !detector.spreads_light() {
        return Ok(0.0);
    }
    let [_, rows] = detector.grid().pixels;
    let timed = |count: u32| {
        let first = (rows - count) / 2;
        let band = first..first + count;
        let shape = [detector.grid().lit_rows(&band).len(), detector.grid().size()[0] as usize];
        let values = reserve::filled(1.0, shape.iter().product(), "light of some rows")?;
        let light = Array3::from_shape_vec((1, shape[0], shape[1]), values);
        let light = light.unwrap_or_default();
        let begin = Instant::now();
        detector.intensities(Exposure::Sample(0), &band, light, cancel)?;
        Ok(begin.elapsed().as_secs_f64())
    };
    let [few, more] = [FEW, MORE].map(|count| count.min(rows));
    let first = timed(few)?;
    let of_row = if more > few { (timed(more)? - first) / f64::from(more - few) } else { 0.0 };
    let of_row = of_row.clamp(0.0, first / f64::from(few));
    let of_band = first - of_row * f64::from(few);
    let band_count = f64::from(rows.div_ceil(height));
    Ok((of_row * f64::from(rows) + of_band * band_count) * steps as f64)
}
