//! Offsets so low that electronic noise is clipped at 0.

use beamlet_model::scene::Scene;

/// Deviations of the electronic noise that an offset should have at least: 3e-5 of the numbers
/// without light lie lower.
const DEVIATIONS: f64 = 4.0;

/// Warning of an offset below `DEVIATIONS` of the electronic noise, where a bit depth clips.
pub fn offset_warning(scene: &Scene) -> Option<String> {
    let counts = scene.detector.counts?;
    counts.bit_depth?;
    let (offset, noise) = (counts.number_without_light(), counts.electronic_noise);
    let least = DEVIATIONS * noise;
    if offset >= least {
        return None;
    }
    // A number is clipped where it rounds to less than 0.
    let deviations = (offset + 0.5) / noise;
    let share = 0.5 * libm::erfc(deviations * std::f64::consts::FRAC_1_SQRT_2);
    let omitted = counts.with_offset(None).number_without_light();
    Some(format!(
        "detector.offset is {offset}, below {DEVIATIONS} standard deviations of the electronic noise \
         ({least}): {:.2} % of the numbers without light are clipped at 0, and means of dark frames and \
         dim pixels are too large; set {least} or more, or omit it ({omitted})",
        100.0 * share
    ))
}
