//! Pixels whose contrasts do not continue those of their neighbours: at the silhouette of an object, where a part of the
//! light is refracted out of the curve. The rule and its results: docs/retrieval.md.

use super::flags;
use super::images::{FLAGS, Images};
use beamlet_core::numbers::single;
use ndarray::Array2;

/// Standard deviations by which a pixel leaves the lines of both sides, from which on it is flagged.
const DEVIATIONS: f64 = 5.0;
/// Error of a contrast besides the noise of counts, in its unit.
const BIAS: f64 = 0.003;

/// Contrasts along an axis with their units: 1, the angle of a shift by the standard deviation of the flat's curves, and
/// twice its square.
pub(super) fn contrasts(axis: usize, angle: f64) -> [(&'static str, f64); 3] {
    let [refraction, dark_field] =
        [["refraction", "dark_field"], ["refraction_z", "dark_field_z"]][axis];
    [("transmission", 1.0), (refraction, angle), (dark_field, 2.0 * angle * angle)]
}

/// Sets the flag of misfits in the images of a view, by some contrasts with their units.
pub(super) fn mark(images: &mut Images, contrasts: &[(&str, f64)]) {
    let known: Vec<_> = contrasts
        .iter()
        .filter_map(|(name, unit)| {
            Some((images.get(name)?, images.get(&format!("{name}_sigma")), *unit))
        })
        .collect();
    let Some(shape) = known.first().map(|(values, ..)| values.dim()) else { return };
    let deviation = |at: (usize, usize), step: [isize; 2]| {
        let squares = known.iter().map(|(values, sigmas, unit)| {
            let sigma = sigmas.map_or(0.0, |sigmas| f64::from(sigmas[at]) / unit);
            let off = (off(values, at, step) / unit).max(0.0) / sigma.hypot(BIAS);
            if off.is_finite() { off * off } else { 0.0 }
        });
        squares.sum::<f64>().sqrt()
    };
    let is_misfit = |at: (usize, usize)| {
        let least = |[a, b]: [[isize; 2]; 2]| deviation(at, a).min(deviation(at, b));
        let [across, along] = [[[0, -1], [0, 1]], [[-1, 0], [1, 0]]].map(least);
        across.max(along) > DEVIATIONS
    };
    let marked = Array2::from_shape_fn(shape, is_misfit);
    if let Some(bits) = images.get_mut(FLAGS) {
        let flag = single(f64::from(flags::MISFIT));
        bits.zip_mut_with(&marked, |bits, marked| *bits += if *marked { flag } else { 0.0 });
    }
}

/// Distance of a pixel from the values between its next neighbour of a side and the line through the next two, widened
/// by their difference; 0 without a neighbour that has a value.
fn off(values: &Array2<f32>, (row, column): (usize, usize), [down, right]: [isize; 2]) -> f64 {
    let value = |count: isize| {
        let at = (row.checked_add_signed(count * down)?, column.checked_add_signed(count * right)?);
        values.get(at).map(|value| f64::from(*value)).filter(|value| value.is_finite())
    };
    let (Some(own), Some(next)) = (value(0), value(1)) else { return 0.0 };
    let slope = next - value(2).unwrap_or(next);
    let [low, high] = [next.min(next + slope), next.max(next + slope)];
    (low - own).max(own - high) - slope.abs()
}

/// The middle one of the finite values.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    let middle = values.len() / 2;
    (middle < values.len()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
