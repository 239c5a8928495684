//! Requirements on the distances of source, masks and detector, and on the lengths that follow from them.

use super::derived::AT_DETECTOR;
use super::keys::faults::Faults;
use super::validate::has_place;
use super::{MaskSpec, Scene, limits};
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result};

/// End of a message about a length that is far from others.
const UNIT: &str = ": is its unit right?";

/// True of lengths that differ as those in different units do.
fn is_far(a: f64, b: f64) -> bool {
    a > 7.0 * b || b > 7.0 * a
}

impl Scene {
    pub(super) fn validate_order(&self, faults: &mut Faults) {
        let (source, detector) = (&self.source, &self.detector);
        let [own, centre] = [detector.distance, source.distance];
        if !(own > 0.0 && own <= centre) {
            return;
        }
        let [found, allowed] = [own, centre].map(|length| Length.rounded(length));
        // A sample mask before the detector shows which of both distances is off.
        let mask = self.sample_mask.as_ref().map(|mask| mask.distance);
        if mask.is_some_and(|mask| mask > 0.0 && mask < own && is_far(centre, mask)) {
            let between = format!("between sample_mask and detector, {found}{UNIT}");
            faults.add(Error::scene("source.distance", allowed, between));
            return;
        }
        let hint = match is_far(own, centre) {
            true => UNIT.to_owned(),
            false => format!(
                ": distances count from the source, and {found} behind the sample is {}",
                Length.rounded(own + centre)
            ),
        };
        let allowed = format!("more than source.distance, {allowed}{hint}");
        faults.add(Error::scene("detector.distance", found, allowed));
    }

    /// Masks in the place of one another.
    fn has_swapped_masks(&self) -> bool {
        let centre = self.source.distance;
        let [sample, detector] = [&self.sample_mask, &self.detector_mask]
            .map(|mask| mask.as_ref().map_or(centre, |mask| mask.distance));
        detector > 0.0 && detector < centre && centre < sample && sample <= self.detector.distance
    }

    /// Apertures are no wider than the period. Where that follows from the pixels of a detector whose every mask has
    /// wider apertures, the pixels are the fault.
    pub(super) fn validate_apertures(&self, faults: &mut Faults) {
        let detector = &self.detector;
        let on_detector = |mask: &MaskSpec, length: f64| length * detector.distance / mask.distance;
        let is_wide = |mask: &MaskSpec| mask.aperture > mask.period;
        let is_of_pixels = |mask: &MaskSpec| {
            (on_detector(mask, mask.period) / detector.pitch[0] - 1.0).abs() < 1e-9
        };
        let widest = self.masks().map(|(_, mask)| on_detector(mask, mask.aperture));
        let widest = widest.fold(0.0, f64::max);
        let masks = || self.masks().map(|(_, mask)| mask);
        let is_tiny = masks().count() > 1 || is_far(detector.pitch[0], widest);
        if is_tiny && masks().count() > 0 && masks().all(|it| is_wide(it) && is_of_pixels(it)) {
            let found = Length.rounded(detector.pitch[0]);
            let allowed = format!(
                "at least the width of projected apertures, {}, or masks with a period{UNIT}",
                Length.rounded(widest)
            );
            faults.add(Error::scene("detector.pitch", found, allowed));
            return;
        }
        for (table, mask) in self.masks().filter(|(_, mask)| is_wide(mask)) {
            let found = format!("{} in the mask plane", Length.rounded(mask.aperture));
            let allowed = format!(
                "no more than the period, {}{UNIT} Both follow from lengths on the detector \
                 (projected_aperture, detector.pitch) where they have no value",
                Length.rounded(mask.period)
            );
            faults.add(Error::scene(format!("{table}.aperture"), found, allowed));
        }
    }

    /// The sample mask lies between the source and the rotation centre, with its bars.
    pub(super) fn validate_sample_mask(&self) -> Result<()> {
        let Some(mask) = &self.sample_mask else { return Ok(()) };
        let centre = self.source.distance;
        if let Some(other) = self.detector_mask.as_ref().filter(|_| self.has_swapped_masks()) {
            let [found, other] = [mask, other].map(|mask| Length.rounded(mask.distance));
            let found = format!("{found}, behind the sample, and detector_mask before it, {other}");
            let allowed = "the mask before the sample as [sample_mask]: the two masks are swapped";
            return Err(Error::scene("sample_mask.distance", found, allowed));
        }
        let [front, back] = mask.faces();
        // Values that cannot be have errors of their own.
        let is_out = centre > 0.0 && has_place(mask) && (front <= 0.0 || back >= centre);
        if !is_out {
            return Ok(());
        }
        if mask.distance < self.detector.distance && is_far(centre, mask.distance) {
            let [found, mask] = [centre, mask.distance].map(|length| Length.rounded(length));
            let allowed = format!("more than sample_mask.distance, {mask}{UNIT}");
            return Err(Error::scene("source.distance", found, allowed));
        }
        let allowed = format!(
            "bars between the source and the rotation centre at source.distance, {}",
            Length.rounded(centre)
        );
        misplaced("sample_mask", mask, [0.0, centre], allowed)
    }

    /// The detector mask lies between the rotation centre and the detector, with its bars.
    pub(super) fn validate_detector_mask(&self) -> Result<()> {
        let Some(mask) = &self.detector_mask else { return Ok(()) };
        let (centre, end) = (self.source.distance, self.detector.distance);
        let [front, back] = mask.faces();
        let is_out = centre > 0.0
            && end > centre
            && has_place(mask)
            && (front <= centre || back > end + AT_DETECTOR)
            && !self.has_swapped_masks();
        if !is_out {
            return Ok(());
        }
        let allowed = format!(
            "bars between the rotation centre at source.distance, {}, and the detector at {}; the \
             distance is measured to the centre plane of the bars",
            Length.rounded(centre),
            Length.rounded(end)
        );
        misplaced("detector_mask", mask, [centre, end], allowed)
    }
}

/// The error of a mask whose bars do not lie between two planes: of its thickness if its own plane does
/// and the bars are thick, else of its distance.
fn misplaced(table: &str, mask: &MaskSpec, [low, high]: [f64; 2], allowed: String) -> Result<()> {
    let (distance, thickness) = (mask.distance, mask.body.thickness());
    if distance > low && distance < high - AT_DETECTOR && thickness > limits::THICK_BARS {
        let most = 2.0 * (distance - low).min(high - distance);
        // Without the rounding of a difference.
        let most = Length.rounded((most * 1e9).round() / 1e9);
        let key = format!("{table}.{}", mask.body.thickness_key());
        let allowed =
            format!("up to {most} at {table}.distance = {}: {allowed}", Length.rounded(distance));
        return Err(Error::scene(key, Length.rounded(thickness), allowed));
    }
    let hint = if is_far(distance, low) && is_far(distance, high) { UNIT } else { "" };
    let allowed = format!("{allowed}{hint}");
    Err(Error::scene(format!("{table}.distance"), Length.rounded(distance), allowed))
}
