//! Places on the detector that the columns of an image measure.

use super::{Openings, Optics};

/// Widths below this share of a column are rounding, and no opening.
const LEAST_PART: f64 = 1e-6;

impl Optics {
    /// Centres of the light of the columns, x from the optical axis on the detector, m, ascending: of
    /// the parts of the pixels behind openings of the detector mask; of whole pixels without a mask, and
    /// where a pixel lies behind bars.
    pub fn column_places(&self) -> Vec<f64> {
        self.column_lights().into_iter().map(|[place, _]| place).collect()
    }

    /// As [`Optics::column_places`], each with the width of the openings, in pixels: 1 without a mask, 0
    /// behind bars.
    pub fn column_lights(&self) -> Vec<[f64; 2]> {
        let (half, columns) = (self.detector.half(0), self.detector.pixels[0]);
        let windows =
            self.detector_mask.as_ref().map(|mask| mask.openings_in_columns(&self.detector, 0.0));
        let place = |column: u32| {
            let left = f64::from(column) - half;
            let [centre, width] = match &windows {
                None => [left + 0.5, 1.0],
                Some(windows) => centre(windows, left, half).unwrap_or([left + 0.5, 0.0]),
            };
            [centre * self.detector.pitch[0], width]
        };
        (0..columns).map(place).collect()
    }

    /// Openings of the detector mask before a column, columns from the optical axis; the whole column without a
    /// mask.
    pub fn windows_of_column(&self, column: u32) -> Vec<[f64; 2]> {
        let half = self.detector.half(0);
        let left = f64::from(column) - half;
        match &self.detector_mask {
            None => vec![[left, left + 1.0]],
            Some(mask) => before_pixel(
                &mask.openings_in_columns(&self.detector, 0.0),
                left,
                half,
                f64::INFINITY,
            ),
        }
    }

    /// Parts of each column that light reaches straight through aligned masks, x from the optical axis on
    /// the detector, m: openings of the detector mask, no wider than the narrowest of the sample mask is
    /// seen; openings of the sample mask at `offset` (m) without a detector mask; whole pixels without masks.
    pub fn column_openings(&self, offset: f64) -> Vec<Vec<[f64; 2]>> {
        let (half, pitch) = (self.detector.half(0), self.detector.pitch[0]);
        let of = |mask: &super::Mask, shift| mask.openings_in_columns(&self.detector, shift);
        let (windows, widest) = match (&self.detector_mask, &self.sample_mask) {
            (Some(mask), None) => (Some(of(mask, 0.0)), f64::INFINITY),
            (Some(mask), Some(other)) => (Some(of(mask, 0.0)), of(other, 0.0).narrowest(0)),
            (None, Some(mask)) => (Some(of(mask, offset)), f64::INFINITY),
            (None, None) => (None, f64::INFINITY),
        };
        let parts = |column: u32| {
            let left = f64::from(column) - half;
            let parts = match &windows {
                None => vec![[left, left + 1.0]],
                Some(windows) => before_pixel(windows, left, half, widest),
            };
            parts.into_iter().map(|ends| ends.map(|end| end * pitch)).collect()
        };
        (0..self.detector.pixels[0]).map(parts).collect()
    }
}

/// Centre and width of the openings between `left` and `left` + 1, columns from the optical axis. `half`: of the
/// apertures, which number as the columns do.
fn centre(windows: &Openings, left: f64, half: f64) -> Option<[f64; 2]> {
    let (mut width, mut moment) = (0.0, 0.0);
    for [low, high] in before_pixel(windows, left, half, f64::INFINITY) {
        width += high - low;
        moment += (high - low) * f64::midpoint(low, high);
    }
    (width > LEAST_PART).then(|| [moment / width, width])
}

/// Openings between `left` and `left` + 1, each no wider than `widest` about its centre, as [`centre`] has
/// them.
pub(super) fn before_pixel(windows: &Openings, left: f64, half: f64, widest: f64) -> Vec<[f64; 2]> {
    let period = windows.period[0];
    let number = |place: f64| (place - windows.offset) / period + half - 0.5;
    let mut number_of = number(left).floor() - 1.0;
    let (last, mut found) = (number(left + 1.0).ceil() + 1.0, Vec::new());
    while number_of <= last {
        let shift = (number_of + 0.5 - half) * period + windows.offset;
        for [low, high] in windows.displaced(shift, 0.0) {
            let cut = 0.5 * (high - low - widest).max(0.0);
            let [low, high] = [(low + cut).max(left), (high - cut).min(left + 1.0)];
            if high > low {
                found.push([low, high]);
            }
        }
        number_of += 1.0;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    fn places(columns: u32, mask: &str) -> Vec<f64> {
        let text = format!(
            "[source]\ndistance = \"1.2 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n\
             [detector]\ndistance = \"2 m\"\npixels = [{columns}, 1]\npitch = \"50 um\"\n{mask}"
        );
        let scene = Scene::from_toml(&text, ".").unwrap();
        Optics::of(&scene).column_places().iter().map(|place| place * 1e6).collect()
    }

    #[track_caller]
    fn assert_near(found: &[f64], expected: &[f64]) {
        let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(near && found.len() == expected.len(), "{found:?}");
    }

    /// A sample mask at half of the way whose openings are 10 um wide on the detector.
    const NARROW: &str = "[sample_mask]\ndistance = \"1 m\"\nmaterial = \"gold\"\naperture = \"5 um\"\n\
                          thickness = \"100 um\"\n";

    #[test]
    fn openings_are_those_of_aligned_masks_before_each_pixel() {
        let openings = |mask: &str, offset: f64| {
            let text = format!(
                "[source]\ndistance = \"1.2 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n\
                 [detector]\ndistance = \"2 m\"\npixels = [4, 1]\npitch = \"50 um\"\n{mask}"
            );
            let scene = Scene::from_toml(&text, ".").unwrap();
            let parts = Optics::of(&scene).column_openings(offset);
            parts.into_iter().map(|part| part.as_flattened().to_vec()).collect::<Vec<_>>()
        };
        let near = |found: &[f64], expected: &[f64]| {
            let um: Vec<f64> = found.iter().map(|place| place * 1e6).collect();
            assert_near(&um, expected);
        };
        near(&openings("", 0.0)[1], &[-50.0, 0.0]);
        // 16 um in the mask, 20 um on the detector.
        let wide = format!("{MASK}aperture = \"16 um\"\n");
        near(&openings(&wide, 0.0)[2], &[15.0, 35.0]);
        near(&openings(&format!("{NARROW}{wide}"), 0.0)[2], &[20.0, 30.0]);
        // Half of a narrowed opening at each border.
        let halves = format!("{NARROW}{MASK}aperture = \"16 um\"\nperiod = \"80 um\"\n");
        near(&openings(&halves, 0.0)[1], &[-50.0, -45.0]);
        near(&openings(NARROW, 3e-6)[0], &[-74.0, -64.0]);
        let skipped =
            format!("{MASK}aperture = \"8 um\"\nperiod = \"80 um\"\noffset = \"24 um\"\n");
        assert!(openings(&skipped, 0.0)[0].is_empty());
    }

    const MASK: &str =
        "[detector_mask]\ndistance = \"1.6 m\"\nmaterial = \"gold\"\nthickness = \"100 um\"\n";

    #[test]
    fn columns_lie_behind_the_openings_of_the_detector_mask() {
        let centres = [-75.0, -25.0, 25.0, 75.0];
        assert_near(&places(4, ""), &centres);
        assert_near(&places(3, ""), &[-50.0, 0.0, 50.0]);
        let with = |keys: &str| places(4, &format!("{MASK}{keys}"));
        assert_near(&with("aperture = \"8 um\""), &centres);
        // Moved by 8 um, which are 10 um on the detector.
        let moved = centres.map(|place| place + 10.0);
        assert_near(&with("aperture = \"8 um\"\noffset = \"8 um\""), &moved);
        // An opening of 10 um on the detector at each second border: half of it before each pixel.
        let halves = [-52.5, -47.5, 47.5, 52.5];
        assert_near(&with("aperture = \"8 um\"\nperiod = \"80 um\""), &halves);
        // One in each second pixel: the others lie behind bars, and keep their centres.
        let skipped = "aperture = \"8 um\"\nperiod = \"80 um\"\noffset = \"24 um\"";
        assert_near(&with(skipped), &[-75.0, -20.0, 25.0, 80.0]);
    }
}
