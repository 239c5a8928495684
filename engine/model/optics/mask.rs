//! Openings and bars of a mask: the only place that computes where they are.

use super::DetectorPlane;
use crate::scene::{MaskBody, MaskSpec, Strip, Substrate};

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
    /// Width along x of the narrowest opening of a list, whose openings here are columns.
    narrowest: Option<f64>,
    /// Width of the narrowest bar across the slits; 0 without bars.
    bar: f64,
}

impl Openings {
    /// Openings side by side without bars, as pixels are.
    pub(super) fn side_by_side(width: f64) -> Self {
        let half = width / 2.0;
        let of_period = vec![Opening { ends: [[-half, half], ENDLESS] }];
        Self { period: [width, f64::INFINITY], offset: 0.0, of_period, narrowest: None, bar: 0.0 }
    }

    /// Ends along x of the openings of a period, from its centre, ascending.
    pub fn ends(&self) -> impl DoubleEndedIterator<Item = [f64; 2]> + Clone + '_ {
        self.of_period.iter().map(|opening| opening.ends[0])
    }

    /// Openings of a strip, seen in the same plane, in each of these periods.
    #[must_use]
    pub fn of_strip(&self, strip: &Strip) -> Self {
        let of_period = strip.x.iter().map(|x| Opening { ends: [*x, ENDLESS] }).collect();
        Self { of_period, narrowest: None, ..self.clone() }
    }

    /// The same while the mask is displaced by `shift`, wider by `margin` on either side.
    pub fn displaced(&self, shift: f64, margin: f64) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.ends().map(move |[low, high]| [shift - (margin - low), shift + (high + margin)])
    }

    /// Width along x (0) or z (1) of the narrowest opening; infinite without edges.
    pub fn narrowest(&self, axis: usize) -> f64 {
        if let (0, Some(narrowest)) = (axis, self.narrowest) {
            return narrowest;
        }
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
    /// Displacement of the pattern, which repeats after the periods of all shifts, m in its own plane.
    pattern_offset: f64,
    /// Columns of pixels.
    columns: u32,
    /// Rows of pixels of the detector.
    rows: u32,
}

impl Mask {
    /// The mask of a detector of `before` columns, before `columns` of smaller pixels or the same.
    pub fn new(name: &'static str, spec: &MaskSpec, columns: u32, before: u32) -> Self {
        let mut spec = spec.clone();
        // Half periods from pattern k of the columns to the apertures that follow k times the repeats.
        let repeats = i64::from(spec.repeats());
        let halves = i64::from(columns) * repeats - i64::from(before);
        let halves = halves.rem_euclid(2 * repeats);
        let halves = if halves > repeats { halves - 2 * repeats } else { halves };
        let mut pattern_offset = spec.offset;
        if halves != 0 {
            pattern_offset += 0.5 * halves as f64 * spec.period;
        }
        if !(columns + before).is_multiple_of(2) {
            spec.offset += 0.5 * spec.period;
        }
        Self { name, spec, pattern_offset, columns, rows: 1 }
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

    /// dx/dy of the walls of the bars; slits are wider at the face towards the detector where it is above 0.
    pub fn wall_slope(&self) -> f64 {
        self.spec.wall_slope()
    }

    /// True if both edges of a slit have soft edges of their own: walls are slanted, or bars have several layers.
    pub fn has_walls(&self) -> bool {
        self.is_tapered() || self.has_layers()
    }

    /// True if bars have several layers.
    pub fn has_layers(&self) -> bool {
        self.spec.body.layers().len() > 1
    }

    /// True if the walls of the bars are slanted.
    pub fn is_tapered(&self) -> bool {
        self.spec.taper != 0.0
    }

    /// Plate that carries the bars.
    pub(super) const fn substrate(&self) -> Option<&Substrate> {
        self.spec.substrate.as_ref()
    }

    /// True if light passes a plate that carries the bars.
    pub const fn has_substrate(&self) -> bool {
        self.spec.substrate.is_some()
    }

    /// How much larger the mask is as seen from the source in the plane at `plane`.
    pub(super) fn scale_at(&self, plane: f64) -> f64 {
        plane / self.spec.distance
    }

    /// Openings seen in the plane at `plane`, m there; a period contains all shifts.
    pub fn openings(&self, plane: f64) -> Openings {
        self.seen(self.scale_at(plane), 0.0)
    }

    /// Openings seen in the plane at `plane`, m there, whose edges cut light on the detector as the mask's do: of a
    /// list the strip with most of them.
    pub fn windows(&self, plane: f64) -> Openings {
        self.seen_through(self.scale_at(plane), 0.0, self.spec.listed_row())
    }

    /// Openings of a single period without shifts seen in the plane at `plane`, m there: beamlets are at these
    /// places.
    pub fn without_shifts(&self, plane: f64) -> Openings {
        self.unshifted().openings(plane)
    }

    /// Places of beamlets in the plane at `plane`, m there: periods without shifts, or their parts where a period
    /// has slits before several pixels, which are as wide as `pixel`.
    pub fn beamlets(&self, plane: f64, pixel: f64) -> Openings {
        let mut openings = self.without_shifts(plane);
        if self.has_several() {
            openings.period[0] /= (openings.period[0] / pixel).round().max(1.0);
        }
        openings
    }

    /// The mask without shifts.
    #[must_use]
    pub fn unshifted(&self) -> Self {
        let mut spec = self.spec.clone();
        spec.shifts.clear();
        let pattern_offset = spec.offset;
        Self { name: self.name, spec, pattern_offset, columns: self.columns, rows: self.rows }
    }

    /// Share of the mask that is open.
    pub fn open_share(&self) -> f64 {
        self.spec.open_share()
    }

    /// Number of periods after which openings repeat.
    pub fn repeats(&self) -> u32 {
        self.spec.repeats()
    }

    /// Displacements of the slits of successive periods, m in its own plane; empty: none.
    pub fn shifts(&self) -> &[f64] {
        &self.spec.shifts
    }

    /// True if a period has several slits.
    pub fn has_several(&self) -> bool {
        self.spec.apertures.len() > 1 || self.spec.list_key().is_some()
    }

    /// Openings seen on the detector, columns of pixels, while the mask is displaced by `shift` (m)
    /// besides its own offset.
    pub fn openings_in_columns(&self, detector: &DetectorPlane, shift: f64) -> Openings {
        self.seen(detector.columns_per_metre(self.spec.distance), shift)
    }

    fn seen(&self, scale: f64, shift: f64) -> Openings {
        self.seen_through(scale, shift, self.spec.listed_columns())
    }

    /// `of_list`: ends along x of the openings of a list, in the plane of the mask.
    fn seen_through(&self, scale: f64, shift: f64, of_list: Option<Vec<[f64; 2]>>) -> Openings {
        let spec = &self.spec;
        let along_z = spec
            .heights()
            .map_or(ENDLESS, |[height, _]| [-0.5, 0.5].map(|end| end * height * scale));
        let period_z = spec.pattern_z().map_or(f64::INFINITY, |period| period * scale);
        let opening = |ends: [f64; 2]| Opening { ends: [ends.map(|end| end * scale), along_z] };
        let of_period = if let Some(ends) = of_list {
            ends.into_iter().map(opening).collect()
        } else if spec.apertures.is_empty() && spec.shifts.is_empty() {
            let half = spec.aperture * scale / 2.0;
            let displaced = 0.5 * spec.period * scale;
            let of_rows = [0.0, displaced].into_iter().take(spec.rows_of_period() as usize);
            of_rows.map(|at| Opening { ends: [[at - half, at + half], along_z] }).collect()
        } else {
            spec.slits().into_iter().map(opening).collect()
        };
        Openings {
            period: [spec.pattern() * scale, period_z],
            offset: (self.pattern_offset + shift) * scale,
            of_period,
            narrowest: spec.list_key().map(|_| spec.aperture * scale),
            bar: spec.narrowest_bar() * scale,
        }
    }

    /// Distance of a straight line from the source to the centre of the nearest period (of all shifts), m in
    /// the plane at `plane`, which it reaches at this dx/dy.
    pub fn off_centre(&self, slope: f64, plane: f64) -> f64 {
        let period = self.spec.pattern() * self.scale_at(plane);
        let first = slope * plane - self.pattern_offset * self.scale_at(plane);
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
            MaskBody::Sheet { .. } => None,
            body => Some(body.thickness()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(offset: f64) -> Mask {
        let body = MaskBody::Sheet { transmission: 0.1 };
        let mut spec = MaskSpec::new(0.5, 80e-6, 20e-6, body);
        spec.offset = offset;
        Mask::new("sample_mask", &spec, 8, 8)
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

    /// Aperture k, with the shift k modulo 3, at (k + 1/2 - C/2) periods, for odd and even numbers of columns and
    /// on finer grids.
    #[test]
    fn shifted_apertures_are_before_their_columns() {
        let body = MaskBody::Sheet { transmission: 0.0 };
        let mut spec = MaskSpec::new(1.0, 100e-6, 20e-6, body);
        spec.shifts = vec![0.0, 10e-6, -5e-6];
        for (before, columns) in [(8, 8), (7, 7), (9, 9), (8, 36), (7, 36), (8, 33), (7, 33)] {
            let mask = Mask::new("sample_mask", &spec, columns, before);
            let openings = mask.openings(1.0);
            for k in 0..before {
                let shift = spec.shifts[k as usize % 3];
                let centre = (f64::from(k) + 0.5 - f64::from(before) / 2.0) * 100e-6 + shift;
                let off = mask.off_centre(centre, 1.0);
                let nearest = openings.ends().map(|[low, high]| f64::midpoint(low, high) - off);
                let period = openings.period[0];
                let least = nearest.map(|it| libm::remainder(it, period).abs()).fold(1.0, f64::min);
                assert!(least < 1e-15, "column {k} of {before}, {columns}: {least:e}");
            }
        }
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
