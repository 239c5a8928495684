//! Slits of a mask: of its periods, and of the pattern that repeats.

use super::{MaskSpec, Scene};
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result, numbers};

/// Width of a bar over the period that is rounding of ends that touch.
const ROUNDING: f64 = 1e-12;

impl MaskSpec {
    /// Periods after which the mask repeats: the number of its shifts, or 1.
    #[must_use]
    pub fn repeats(&self) -> u32 {
        numbers::count(self.shifts.len().max(1))
    }

    /// Length after which the mask repeats in its own plane, m.
    #[must_use]
    pub fn pattern(&self) -> f64 {
        self.period * f64::from(self.repeats())
    }

    /// Length after which the mask repeats along z in its own plane, m; `None` of slits.
    #[must_use]
    pub fn pattern_z(&self) -> Option<f64> {
        self.heights().map(|[_, rows]| f64::from(self.rows_of_period()) * rows)
    }

    /// Ends of the slits of a period from its middle, m, ascending; without shifts.
    #[must_use]
    pub fn slits_of_period(&self) -> Vec<[f64; 2]> {
        match self.apertures.is_empty() {
            true => vec![[-self.aperture / 2.0, self.aperture / 2.0]],
            false => self.apertures.clone(),
        }
    }

    /// Ends of the slits of a pattern from its middle, m, ascending.
    #[must_use]
    pub fn slits(&self) -> Vec<[f64; 2]> {
        let own = self.slits_of_period();
        if self.shifts.is_empty() {
            return own;
        }
        let half = f64::from(self.repeats()) / 2.0;
        let of_period = |(number, shift): (u32, &f64)| {
            let middle = (f64::from(number) + 0.5 - half) * self.period + shift;
            own.iter().map(move |ends| ends.map(|end| middle + end)).collect::<Vec<_>>()
        };
        (0..).zip(&self.shifts).flat_map(of_period).collect()
    }

    /// Share of the area of the mask that is open.
    #[must_use]
    pub fn open_share(&self) -> f64 {
        if let Some(share) = self.listed_share() {
            return share;
        }
        let open: f64 = self.slits_of_period().iter().map(|[low, high]| high - low).sum();
        let along_z = self.heights().map_or(1.0, |[height, period]| height / period);
        open / self.period * along_z * self.shape.filled()
    }

    /// Width of the narrowest bar in the mask plane, m; 0 without bars, below 0 where slits overlap.
    #[must_use]
    pub fn narrowest_bar(&self) -> f64 {
        if let Some(bar) = self.listed_bar() {
            return bar;
        }
        let slits = self.slits();
        if let [[low, high]] = slits[..] {
            return self.period - (high - low);
        }
        self.bars().iter().map(|[low, high]| high - low).fold(f64::INFINITY, f64::min)
    }

    /// Ends of the bars behind the slits of a pattern, from its middle, m.
    #[must_use]
    pub fn bars(&self) -> Vec<[f64; 2]> {
        let slits = self.slits();
        let around = slits.first().map(|[low, _]| low + self.pattern());
        let next = slits.iter().skip(1).map(|[low, _]| *low).chain(around);
        slits.iter().zip(next).map(|([_, high], low)| [*high, low]).collect()
    }

    /// Refuses lists of slits that are no mask; `key` makes paths of the names of keys.
    pub(super) fn check_slits(&self, key: &dyn Fn(&str) -> String) -> Result<()> {
        let half = self.period / 2.0;
        let um =
            |[low, high]: [f64; 2]| format!("{} to {}", Length.rounded(low), Length.rounded(high));
        for (index, &[low, high]) in self.apertures.iter().enumerate() {
            let name = key(&format!("apertures[{index}]"));
            let is_within = low >= -half * (1.0 + 1e-12) && high <= half * (1.0 + 1e-12);
            if !(low < high && is_within) {
                let allowed = format!("ascending ends within a period, {}", um([-half, half]));
                return Err(Error::scene(name, um([low, high]), allowed));
            }
            if index > 0 && low <= self.apertures[index - 1][1] {
                let allowed = format!(
                    "slits in ascending order with bars between them: the one before ends at {}",
                    Length.rounded(self.apertures[index - 1][1])
                );
                return Err(Error::scene(name, um([low, high]), allowed));
            }
        }
        let is_one = self.apertures.is_empty() && self.shifts.is_empty();
        if is_one || self.narrowest_bar() > ROUNDING * self.period {
            return Ok(());
        }
        let name = key(if self.shifts.is_empty() { "apertures" } else { "shifts" });
        let found = "slits of neighbouring periods that touch or overlap";
        Err(Error::scene(name, found, "slits with bars between them"))
    }
}

impl Scene {
    /// Columns of a group, whose apertures have all the shifts of the masks; 1 without shifts.
    #[must_use]
    pub fn group(&self) -> usize {
        let repeats = |mask: &Option<MaskSpec>| mask.as_ref().map_or(1, MaskSpec::repeats);
        let [a, b] = [&self.sample_mask, &self.detector_mask].map(repeats);
        let common = (1..=a).find(|times| (times * b).is_multiple_of(a)).unwrap_or(1) * b;
        numbers::narrow::<usize>(i64::from(common))
    }

    /// Mask offsets at which the columns of a group sample the curve of masks without shifts, m: for each of
    /// `offsets` one for each column. A slit of the detector mask moves the curve against one of the sample
    /// mask.
    #[must_use]
    pub fn offsets_of_group(&self, offsets: &[f64]) -> Vec<f64> {
        let shift = |mask: &Option<MaskSpec>, column: usize| {
            let mask = mask.as_ref().filter(|mask| !mask.shifts.is_empty());
            mask.map_or(0.0, |mask| mask.shifts[column % mask.shifts.len()])
        };
        let distance = |mask: &Option<MaskSpec>| mask.as_ref().map_or(1.0, |mask| mask.distance);
        let ratio = distance(&self.sample_mask) / distance(&self.detector_mask);
        let of_column = |column: usize| {
            shift(&self.sample_mask, column) - ratio * shift(&self.detector_mask, column)
        };
        let group = self.group();
        offsets.iter().flat_map(|offset| (0..group).map(move |at| offset + of_column(at))).collect()
    }

    /// The scene whose masks have no shifts and whose scan has the offsets of a group: its pixels see the curve
    /// that the columns of a group sample together.
    #[must_use]
    pub fn of_groups(&self) -> Self {
        let mut scene = self.clone();
        scene.scan.mask_offsets = self.offsets_of_group(&self.scan.mask_offsets);
        for offsets in &mut scene.scan.view_offsets {
            *offsets = self.offsets_of_group(offsets);
        }
        for mask in scene.sample_mask.iter_mut().chain(&mut scene.detector_mask) {
            mask.shifts.clear();
        }
        scene
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{ApertureShape, Beam, Detector, MaskBody, Source};

    fn mask() -> MaskSpec {
        MaskSpec::new(1.0, 100e-6, 20e-6, MaskBody::Sheet { transmission: 0.0 })
    }

    fn near(found: &[[f64; 2]], um: &[[f64; 2]]) {
        let is_near = |(a, b): (&f64, &f64)| (a * 1e6 - b).abs() < 1e-9;
        let same = found.as_flattened().iter().zip(um.as_flattened()).all(is_near);
        assert!(same && found.len() == um.len(), "{found:?}");
    }

    #[test]
    fn shifts_displace_the_slits_of_successive_periods() {
        let mut mask = mask();
        mask.shifts = vec![0.0, 10e-6, -5e-6];
        near(&mask.slits(), &[[-110.0, -90.0], [0.0, 20.0], [85.0, 105.0]]);
        assert!((mask.pattern() - 300e-6).abs() < 1e-18 && mask.repeats() == 3);
        // From the last slit to the first of the next pattern, and between the second and the third.
        assert!((mask.narrowest_bar() - 65e-6).abs() < 1e-12, "{}", mask.narrowest_bar());
        assert!((mask.open_share() - 0.2).abs() < 1e-12);
    }

    /// Areas of the outlines over the area of a row of a period.
    #[test]
    fn apertures_that_end_along_z_are_open_over_their_area() {
        let shapes = [
            (ApertureShape::Slit, 0.2),
            (ApertureShape::Rectangle, 0.1),
            (ApertureShape::Round, 0.1 * std::f64::consts::FRAC_PI_4),
            (ApertureShape::Cross, 0.1 * 5.0 / 9.0),
        ];
        for (shape, open) in shapes {
            let mut mask = mask();
            (mask.shape, mask.aperture_z, mask.period_z) = (shape, Some(30e-6), Some(60e-6));
            assert!((mask.open_share() - open).abs() < 1e-12, "{shape:?}: {}", mask.open_share());
        }
    }

    /// Two shifts before and three behind: six columns.
    #[test]
    fn columns_of_a_group_have_the_shifts_of_both_masks() {
        let source = Source::new(1.2, [0.0; 2], Beam::Energy(30.0));
        let mut scene = Scene::new(source, Detector::new(2.0, [8, 1], [100e-6; 2]));
        assert_eq!((scene.group(), scene.offsets_of_group(&[3.0])), (1, vec![3.0]));
        let mut first = mask();
        first.shifts = vec![0.0, 1.0];
        scene.sample_mask = Some(first.clone());
        assert_eq!(scene.offsets_of_group(&[0.0, 10.0]), [0.0, 1.0, 10.0, 11.0]);
        let mut second = mask();
        (second.distance, second.shifts) = (2.0, vec![0.0, 0.0, 4.0]);
        scene.detector_mask = Some(second);
        assert_eq!(scene.group(), 6);
        assert_eq!(scene.offsets_of_group(&[0.0]), [0.0, 1.0, -2.0, 1.0, 0.0, -1.0]);
        assert_eq!(scene.of_groups().group(), 1);
    }

    #[test]
    fn several_slits_of_a_period_repeat_with_it() {
        let mut mask = mask();
        mask.apertures = vec![[-30e-6, -10e-6], [5e-6, 25e-6]];
        near(&mask.slits(), &[[-30.0, -10.0], [5.0, 25.0]]);
        assert!((mask.narrowest_bar() - 15e-6).abs() < 1e-12);
        mask.shifts = vec![0.0, 0.0];
        near(&mask.slits(), &[[-80.0, -60.0], [-45.0, -25.0], [20.0, 40.0], [55.0, 75.0]]);
    }
}
