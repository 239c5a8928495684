//! Where the apertures and bars of a mask stand: the only place that computes it.

use super::DetectorPlane;
use crate::scene::{MaskBody, MaskSpec};

/// A mask on the beam. Aperture k stands at (k + 1/2 - C/2) periods, with C columns of pixels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mask {
    name: &'static str,
    spec: MaskSpec,
    /// Columns of pixels.
    columns: u32,
}

impl Mask {
    /// The mask before `columns` of pixels; `shifted`: their number is odd where that of the
    /// detector is even, or the other way round.
    pub(super) fn new(name: &'static str, spec: &MaskSpec, columns: u32, shifted: bool) -> Self {
        let mut spec = spec.clone();
        if shifted {
            spec.offset += 0.5 * spec.period;
        }
        Self { name, spec, columns }
    }

    /// Its key in the scene.
    pub(crate) const fn name(&self) -> &'static str {
        self.name
    }

    /// Period in the plane of the mask, m.
    pub(crate) const fn period(&self) -> f64 {
        self.spec.period
    }

    /// Aperture width in the plane of the mask, m.
    pub(crate) const fn aperture(&self) -> f64 {
        self.spec.aperture
    }

    /// Displacement along x in the plane of the mask, m.
    pub(crate) const fn offset(&self) -> f64 {
        self.spec.offset
    }

    /// Source to mask, m.
    pub(crate) const fn distance(&self) -> f64 {
        self.spec.distance
    }

    /// What the bars are.
    pub(super) const fn body(&self) -> &MaskBody {
        &self.spec.body
    }

    /// How much larger the mask is as seen from the source in the plane at `plane`.
    pub(super) fn scale_at(&self, plane: f64) -> f64 {
        plane / self.spec.distance
    }

    /// Period seen in the plane at `plane`, m.
    pub(crate) fn period_at(&self, plane: f64) -> f64 {
        self.spec.period * self.scale_at(plane)
    }

    /// Aperture width seen in the plane at `plane`, m.
    pub(crate) fn aperture_at(&self, plane: f64) -> f64 {
        self.spec.aperture * self.scale_at(plane)
    }

    /// Width of the bars seen in the plane at `plane`, m.
    pub(super) fn bar_at(&self, plane: f64) -> f64 {
        (self.spec.period - self.spec.aperture) * self.scale_at(plane)
    }

    /// Distance of a straight line from the source to the centre of the nearest aperture, m in
    /// the plane at `plane`, which it reaches at this dx/dy.
    pub(crate) fn off_aperture(&self, slope: f64, plane: f64) -> f64 {
        let period = self.period_at(plane);
        let first = slope * plane - self.spec.offset * self.scale_at(plane);
        let at = first / period + f64::from(self.columns) / 2.0 - 0.5;
        (at - at.round()) * period
    }

    /// Columns of pixels from the light of one aperture to that of the next.
    pub(crate) fn period_columns(&self, detector: &DetectorPlane) -> f64 {
        self.spec.period * detector.columns_per_metre(self.spec.distance)
    }

    /// Width of the light of an aperture, columns of pixels.
    pub(crate) fn aperture_columns(&self, detector: &DetectorPlane) -> f64 {
        self.spec.aperture * detector.columns_per_metre(self.spec.distance)
    }

    /// Columns that the light is displaced by while the mask is displaced by `shift` (m) besides
    /// its own offset.
    pub(crate) fn offset_columns(&self, detector: &DetectorPlane, shift: f64) -> f64 {
        (self.spec.offset + shift) * detector.columns_per_metre(self.spec.distance)
    }

    /// Its lengths by name, m: what files record of it.
    pub(crate) const fn lengths(&self) -> [(&'static str, f64); 4] {
        let MaskSpec { distance, period, aperture, offset, .. } = self.spec;
        [("distance", distance), ("period", period), ("aperture", aperture), ("offset", offset)]
    }

    /// What the shadow of bars with a thickness takes of each side of an aperture, m in the plane
    /// of the mask per unit of dx/dy.
    pub(crate) fn side_shadow(&self) -> Option<f64> {
        match &self.spec.body {
            MaskBody::Bars { thickness, .. } => Some(*thickness),
            MaskBody::Sheet { .. } => None,
        }
    }
}
