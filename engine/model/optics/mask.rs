//! Openings and bars of a mask: the only place that computes where they are.

use super::DetectorPlane;
use crate::scene::{MaskBody, MaskSpec};

/// Ends of an opening along an axis on which it has no edge.
const ENDLESS: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// An opening of a mask: light passes between its ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Opening {
    /// Ends along x, from the centre of the period, and along z, from the optical axis; infinite
    /// where it has no edge.
    pub(crate) ends: [[f64; 2]; 2],
}

/// Openings of a mask seen in a plane, for one period, which repeats. Lengths are metres in that plane,
/// or columns of pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Openings {
    /// Distances from a period to the next along x and z; infinite where no edge repeats.
    pub period: [f64; 2],
    /// Displacement of the mask along x.
    pub offset: f64,
    /// Openings of a period, ascending along x; one at least.
    of_period: Vec<Opening>,
    /// Width of the narrowest bar across the slits; 0 without bars.
    bar: f64,
}

impl Openings {
    /// Openings side by side without bars, as pixels are.
    pub(super) fn side_by_side(width: f64) -> Self {
        let half = width / 2.0;
        let of_period = vec![Opening { ends: [[-half, half], ENDLESS] }];
        Self { period: [width, f64::INFINITY], offset: 0.0, of_period, bar: 0.0 }
    }

    /// Ends along x of the openings of a period, from its centre, ascending.
    pub fn ends(&self) -> impl DoubleEndedIterator<Item = [f64; 2]> + Clone + '_ {
        self.of_period.iter().map(|opening| opening.ends[0])
    }

    /// The same while the mask is displaced by `shift`, wider by `margin` on either side.
    pub fn displaced(&self, shift: f64, margin: f64) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.ends().map(move |[low, high]| [shift - (margin - low), shift + (high + margin)])
    }

    /// Width along x (0) or z (1) of the narrowest opening; infinite without edges.
    pub fn narrowest(&self, axis: usize) -> f64 {
        let widths = self.of_period.iter().map(|opening| opening.ends[axis]);
        widths.map(|[low, high]| high - low).fold(f64::INFINITY, f64::min)
    }

    /// Width along x from the first opening of a period to the last.
    pub fn span(&self) -> f64 {
        let [first, last] = [self.ends().next(), self.ends().next_back()];
        first.zip(last).map_or(0.0, |([low, _], [_, high])| high - low)
    }

    /// Width of the narrowest bar across the slits; 0 without bars.
    pub const fn bar(&self) -> f64 {
        self.bar
    }
}

/// A mask on the beam. Aperture k is at (k + 1/2 - C/2) periods, with C columns of pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    name: &'static str,
    spec: MaskSpec,
    /// Columns of pixels.
    columns: u32,
    /// Rows of pixels of the detector.
    rows: u32,
}

impl Mask {
    /// The mask before `columns` of pixels; `shifted`: their number is odd for an even detector, or the
    /// other way round.
    pub fn new(name: &'static str, spec: &MaskSpec, columns: u32, shifted: bool) -> Self {
        let mut spec = spec.clone();
        if shifted {
            spec.offset += 0.5 * spec.period;
        }
        Self { name, spec, columns, rows: 1 }
    }

    /// The mask before `rows` rows of pixels of the detector.
    #[must_use]
    pub const fn before_rows(mut self, rows: u32) -> Self {
        self.rows = rows;
        self
    }

    /// The mask of the scene.
    pub(super) const fn spec(&self) -> &MaskSpec {
        &self.spec
    }

    /// Rows of pixels of the detector.
    pub(super) const fn rows(&self) -> u32 {
        self.rows
    }

    /// True if apertures end along z.
    pub fn has_heights(&self) -> bool {
        self.spec.heights().is_some()
    }

    /// Its key in the scene.
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Source to mask, m.
    pub const fn distance(&self) -> f64 {
        self.spec.distance
    }

    /// Form of the bars.
    pub(super) const fn body(&self) -> &MaskBody {
        &self.spec.body
    }

    /// How much larger the mask is as seen from the source in the plane at `plane`.
    pub(super) fn scale_at(&self, plane: f64) -> f64 {
        plane / self.spec.distance
    }

    /// Openings seen in the plane at `plane`, m there.
    pub fn openings(&self, plane: f64) -> Openings {
        self.seen(self.scale_at(plane), 0.0)
    }

    /// Openings seen on the detector, columns of pixels, while the mask is displaced by `shift` (m)
    /// besides its own offset.
    pub fn openings_in_columns(&self, detector: &DetectorPlane, shift: f64) -> Openings {
        self.seen(detector.columns_per_metre(self.spec.distance), shift)
    }

    fn seen(&self, scale: f64, shift: f64) -> Openings {
        let MaskSpec { period, aperture, offset, .. } = self.spec;
        let half = aperture * scale / 2.0;
        Openings {
            period: [period * scale, f64::INFINITY],
            offset: (offset + shift) * scale,
            of_period: vec![Opening { ends: [[-half, half], ENDLESS] }],
            bar: (period - aperture) * scale,
        }
    }

    /// Distance of a straight line from the source to the centre of the nearest period, m in the
    /// plane at `plane`, which it reaches at this dx/dy.
    pub fn off_centre(&self, slope: f64, plane: f64) -> f64 {
        let period = self.spec.period * self.scale_at(plane);
        let first = slope * plane - self.spec.offset * self.scale_at(plane);
        let at = first / period + f64::from(self.columns) / 2.0 - 0.5;
        (at - at.round()) * period
    }

    /// Its lengths by name, m: what files record of it.
    pub const fn lengths(&self) -> [(&'static str, f64); 4] {
        let MaskSpec { distance, period, aperture, offset, .. } = self.spec;
        [("distance", distance), ("period", period), ("aperture", aperture), ("offset", offset)]
    }

    /// Its lengths along z by name, m; none of slits.
    pub fn lengths_z(&self) -> Vec<(&'static str, f64)> {
        let of = |[height, period]: [f64; 2]| {
            vec![("aperture_z", height), ("period_z", period), ("offset_z", self.spec.offset_z)]
        };
        self.spec.heights().map_or_else(Vec::new, of)
    }

    /// Reduction of each side of an aperture by the shadow of bars with a thickness, m in the plane of
    /// the mask per unit of dx/dy.
    pub fn side_shadow(&self) -> Option<f64> {
        match &self.spec.body {
            MaskBody::Bars { thickness, .. } => Some(*thickness),
            MaskBody::Sheet { .. } => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(offset: f64) -> Mask {
        let body = MaskBody::Sheet { transmission: 0.1 };
        let spec = MaskSpec { distance: 0.5, period: 80e-6, aperture: 20e-6, offset, body };
        Mask::new("sample_mask", &spec, 8, false)
    }

    /// The aperture, period and offset of the key, times two in the plane at twice the distance; a
    /// slit has no end along z.
    #[test]
    fn a_period_of_slits_has_one_opening_without_ends_along_z() {
        let openings = mask(3e-6).openings(1.0);
        let [[low, high]] = openings.ends().collect::<Vec<_>>()[..] else {
            panic!("{openings:?}");
        };
        assert!((low + 20e-6).abs() < 1e-18 && (high - 20e-6).abs() < 1e-18);
        assert!((openings.period[0] - 160e-6).abs() < 1e-18);
        assert!((openings.offset - 6e-6).abs() < 1e-18 && (openings.bar() - 120e-6).abs() < 1e-18);
        assert!(openings.period[1].is_infinite() && openings.narrowest(1).is_infinite());
    }

    #[test]
    fn a_step_displaces_the_edges_and_a_margin_parts_them() {
        let openings = mask(0.0).openings(0.5);
        let [low, high] = openings.displaced(5e-6, 1e-6).next().expect("an opening");
        assert!((low + 6e-6).abs() < 1e-18 && (high - 16e-6).abs() < 1e-18);
    }

    #[test]
    fn openings_in_columns_are_those_on_the_detector_over_the_pitch() {
        let detector = DetectorPlane { distance: 1.0, pixels: [8, 4], pitch: [40e-6; 2] };
        let openings = mask(3e-6).openings_in_columns(&detector, 2e-6);
        assert!((openings.period[0] - 4.0).abs() < 1e-12 && (openings.span() - 1.0).abs() < 1e-12);
        assert!((openings.offset - 0.25).abs() < 1e-12);
    }

    /// Several openings of a period: the narrowest, and the distance over all of them.
    #[test]
    fn widths_are_those_of_the_openings_of_a_period() {
        let mut openings = Openings::side_by_side(10.0);
        openings.of_period = [[-4.0, -1.0], [0.0, 1.0], [2.0, 4.5]]
            .map(|ends| Opening { ends: [ends, [-2.0, 2.0]] })
            .to_vec();
        assert!((openings.narrowest(0) - 1.0).abs() < 1e-12);
        assert!((openings.narrowest(1) - 4.0).abs() < 1e-12);
        assert!((openings.span() - 8.5).abs() < 1e-12);
    }
}
