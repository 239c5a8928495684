//! Distances and counts that follow from the scene.

use super::Scene;

/// A detector mask whose back face is this close to the detector, m, counts as at the detector.
pub(super) const AT_DETECTOR: f64 = 1e-9;

impl Scene {
    /// Distance `z_a` from the source to the analyser, m: the centre plane of the detector mask,
    /// or the detector where there is none or where the mask's back face lies on it.
    pub fn analyser_distance(&self) -> f64 {
        let detector = self.detector.distance;
        match &self.detector_mask {
            Some(mask) => {
                let [_, back] = mask.faces();
                if (detector - back).abs() <= AT_DETECTOR { detector } else { mask.distance }
            }
            None => detector,
        }
    }

    /// Distance `z_1` from the source to the plane of the cells, m: the centre plane of the
    /// sample mask, or the rotation centre where there is none.
    pub fn cell_plane_distance(&self) -> f64 {
        self.sample_mask.as_ref().map_or(self.source.distance, |mask| mask.distance)
    }

    /// Mask magnification `M = z_a / z_1`, or the magnification of the rotation centre without a sample
    /// mask.
    pub fn magnification(&self) -> f64 {
        self.analyser_distance() / self.cell_plane_distance()
    }

    /// Offset of the sample mask at which its middle slit lies before the middle slit of the detector mask, m: the peak of
    /// the illumination curve. `None` without two masks.
    pub fn peak_offset(&self) -> Option<f64> {
        let (sample, detector) = (self.sample_mask.as_ref()?, self.detector_mask.as_ref()?);
        Some(detector.offset * sample.distance / detector.distance - sample.offset)
    }

    /// Distance `z_s` from the source to the axis of rotation along the optical axis, m: the rotation centre
    /// where `scan` leaves the sample there, else the mean place of the origin of the sample over the views.
    pub fn axis_distance(&self) -> f64 {
        self.source.distance + self.scan.depth()
    }

    /// Lever arm `z = z_a - z_s` of a deflection at the axis of rotation, m.
    pub fn lever_arm(&self) -> f64 {
        self.analyser_distance() - self.axis_distance()
    }

    /// Full angle that the detector rows span as seen from the source, rad.
    pub fn fan_angle(&self) -> f64 {
        let half = self.detector.size()[0] / 2.0;
        2.0 * libm::atan2(half, self.detector.distance)
    }

    /// Width and height at the axis of rotation that the detector covers, along x and z, m.
    pub fn field_of_view(&self) -> [f64; 2] {
        let shrink = self.axis_distance() / self.detector.distance;
        self.detector.size().map(|side| side * shrink)
    }

    /// Range of the sample: the nearest and farthest distance from the source, m, and the element there.
    pub fn clearance(&self) -> [(f64, &'static str); 2] {
        let before = self
            .sample_mask
            .as_ref()
            .map_or((0.0, "the source"), |mask| (mask.faces()[1], "the back of the sample mask"));
        let detector = (self.detector.distance, "the detector");
        let behind = self
            .detector_mask
            .as_ref()
            .map_or(detector, |mask| (mask.faces()[0], "the front of the detector mask"));
        [before, behind]
    }

    /// Number of mask steps: frames per view.
    pub const fn mask_steps(&self) -> usize {
        self.scan.mask_offsets.len()
    }
}
