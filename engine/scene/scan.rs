//! The scan: mask offsets and views, with the motion of the sample in each.

use super::Motion;
use std::f64::consts::TAU;

/// Mask offsets, angles and motions. A view is one angle, or one dither of an angle.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Scan {
    /// Displacements of the sample mask along +x in its own plane, m. At least one.
    pub mask_offsets: Vec<f64>,
    /// Rotation of source, masks and detector about +z, rad. At least one.
    pub angles: Vec<f64>,
    /// Motion of the sample at each angle, before source, masks and detector turn: one for each angle, or
    /// none where the sample rests.
    pub motions: Vec<Motion>,
    /// Displacements of the sample mask at each angle, m: one list for each angle, with as many steps as
    /// `mask_offsets`, which serve the flat then; or none where they serve all views.
    pub view_offsets: Vec<Vec<f64>>,
    /// Where the axis of rotation is.
    pub axis: RotationAxis,
    /// Displacement of the sample for each full turn of the angle (x, y, z), m, tilted as the axis is: along
    /// z of a helical scan, along x of a cycloidal one.
    pub travel: [f64; 3],
    /// Displacements of the sample along +x in the frame of the set-up, m: each angle has a view for each
    /// of them, in this order. Without any, each angle is one view.
    pub dithers: Vec<f64>,
}

/// The axis of rotation in the frame of the set-up, in which +y is the optical axis. The origin of the
/// sample is on the axis, and its z runs along it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct RotationAxis {
    /// Displacement from the optical axis at the rotation centre, m.
    pub shift: [f64; 3],
    /// Rotation of the axis about +x, after `tilt_y`, rad.
    pub tilt_x: f64,
    /// Rotation of the axis about +y, rad.
    pub tilt_y: f64,
}

impl RotationAxis {
    /// An axis at this displacement (m), rotated about +y by `tilt_y` and then about +x by `tilt_x` (rad).
    #[must_use]
    pub const fn new(shift: [f64; 3], tilt_x: f64, tilt_y: f64) -> Self {
        Self { shift, tilt_x, tilt_y }
    }

    /// The motion of what stands on the axis, from an upright axis through the rotation centre.
    fn motion(&self) -> Motion {
        let about_y = Motion::about_x_or_y([0.0, 1.0, 0.0], self.tilt_y);
        let tilted = about_y.then(&Motion::about_x_or_y([1.0, 0.0, 0.0], self.tilt_x));
        tilted.then(&Motion::translation(self.shift))
    }
}

impl Default for Scan {
    /// Aligned masks and one view at angle 0.
    fn default() -> Self {
        Self::new(vec![0.0], vec![0.0])
    }
}

impl Scan {
    /// Mask offsets (m) and angles (rad), at least one each.
    #[must_use]
    pub const fn new(mask_offsets: Vec<f64>, angles: Vec<f64>) -> Self {
        Self {
            mask_offsets,
            angles,
            motions: Vec::new(),
            view_offsets: Vec::new(),
            axis: RotationAxis::new([0.0; 3], 0.0, 0.0),
            travel: [0.0; 3],
            dithers: Vec::new(),
        }
    }

    /// Views: one for each angle and dither.
    #[must_use]
    pub const fn views(&self) -> usize {
        self.angles.len() * self.dithers_of_angle()
    }

    /// Views of each angle.
    #[must_use]
    pub const fn dithers_of_angle(&self) -> usize {
        if self.dithers.is_empty() { 1 } else { self.dithers.len() }
    }

    /// Index of the angle of a view.
    #[must_use]
    pub const fn angle_index(&self, view: usize) -> usize {
        view / self.dithers_of_angle()
    }

    /// Angle of a view, rad; 0 for a view that the scan does not have.
    #[must_use]
    pub fn angle_of(&self, view: usize) -> f64 {
        self.angles.get(self.angle_index(view)).copied().unwrap_or(0.0)
    }

    /// Displacement of the sample in a view by its dither, m.
    #[must_use]
    pub fn dither_of(&self, view: usize) -> f64 {
        self.dithers.get(view % self.dithers_of_angle()).copied().unwrap_or(0.0)
    }

    /// Displacements of the sample mask in a view, m.
    #[must_use]
    pub fn offsets_of(&self, view: usize) -> &[f64] {
        self.view_offsets.get(self.angle_index(view)).unwrap_or(&self.mask_offsets)
    }

    /// Motion of the sample in a view before the set-up turns.
    pub(super) fn before(&self, view: usize) -> Option<&Motion> {
        self.motions.get(self.angle_index(view))
    }

    /// Motion of the sample in a view after the turn, in the frame of the set-up: travel along the axis
    /// as it is without shift and tilt, then that of the axis, then the dither.
    pub(super) fn after(&self, view: usize) -> Motion {
        let turns = self.angle_of(view) / TAU;
        let travel = Motion::translation(self.travel.map(|length| length * turns + 0.0));
        let dither = Motion::translation([self.dither_of(view), 0.0, 0.0]);
        travel.then(&self.axis.motion()).then(&dither)
    }

    /// Whether another scan moves the sample as far in a turn.
    pub(crate) fn has_travel_of(&self, other: &Self) -> bool {
        self.travel.map(f64::to_bits) == other.travel.map(f64::to_bits)
    }

    /// Whether the sample does anything but turn about z.
    #[must_use]
    pub fn moves(&self) -> bool {
        let any = |lengths: &[f64]| lengths.iter().any(|length| *length != 0.0);
        self.motions.iter().any(|motion| *motion != Motion::IDENTITY)
            || self.axis != RotationAxis::default()
            || any(&self.travel)
            || any(&self.dithers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dithers_of_an_angle_are_views_side_by_side() {
        let mut scan = Scan::new(vec![0.0], vec![0.5, 1.5]);
        assert_eq!((scan.views(), scan.angle_of(1), scan.dither_of(1)), (2, 1.5, 0.0));
        assert!(!scan.moves());
        scan.dithers = vec![-1e-5, 0.0, 1e-5];
        assert_eq!(scan.views(), 6);
        let of = |view| (scan.angle_of(view), scan.dither_of(view));
        assert_eq!([2, 3].map(of), [(0.5, 1e-5), (1.5, -1e-5)]);
        assert_eq!(scan.after(2), Motion::translation([1e-5, 0.0, 0.0]));
        assert!(scan.moves());
    }

    #[test]
    fn axis_tilts_about_y_then_x_and_travel_follows_the_angle() {
        let mut scan = Scan::new(vec![0.0], vec![TAU / 2.0]);
        scan.travel = [0.0, 0.0, 4e-3];
        scan.axis = RotationAxis::new([1e-3, 2e-3, 0.0], 0.1, 0.2);
        let [x, y, z] = scan.after(0).point([0.0; 3]);
        // Travel is along the tilted axis: half of 4 mm.
        let up = [0.2_f64.sin(), -0.2_f64.cos() * 0.1_f64.sin(), 0.2_f64.cos() * 0.1_f64.cos()];
        let want = [1e-3 + 2e-3 * up[0], 2e-3 + 2e-3 * up[1], 2e-3 * up[2]];
        let near = [x, y, z].iter().zip(want).all(|(got, want)| (got - want).abs() < 1e-17);
        assert!(near, "{:?} for {want:?}", [x, y, z]);
    }
}
