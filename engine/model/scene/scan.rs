//! The scan: mask offsets and views, with the motion of the sample in each.

use super::{Exposure, Motion, ScanErrors};
use beamlet_core::numbers;
use std::f64::consts::TAU;

/// Mask offsets, angles and motions. A view is one angle, or one dither of an angle.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Scan {
    /// Displacements of the sample mask along +x in its own plane, m. At least one.
    pub mask_offsets: Vec<f64>,
    /// Displacements of the sample mask along +z in its own plane, m: one for each of `mask_offsets`, at all
    /// views; empty where the mask does not move along z.
    pub mask_offsets_z: Vec<f64>,
    /// Rotation of source, masks and detector about +z, rad. At least one.
    pub angles: Vec<f64>,
    /// Motion of the sample at each angle, before source, masks and detector turn: one for each angle, or
    /// none where the sample rests.
    pub motions: Vec<Motion>,
    /// Displacements of the sample mask at each angle, m: one list for each angle, with the number of
    /// steps of `mask_offsets`, which then serve the flat only; empty if `mask_offsets` serve all views.
    pub view_offsets: Vec<Vec<f64>>,
    /// Where the axis of rotation is.
    pub axis: RotationAxis,
    /// Displacement of the sample for each full turn of the angle (x, y, z), m, tilted as the axis is: along
    /// z of a helical scan, along x of a cycloidal one.
    pub travel: [f64; 3],
    /// Displacements of the sample along +x in the frame of the set-up, m: each angle has a view for each
    /// of them, in this order. Without any, each angle is one view.
    pub dithers: Vec<f64>,
    /// Turn of the sample during the exposure of a view; `None` where it rests.
    pub fly: Option<Fly>,
    /// Views between one flat and the next, the first of which is taken before the first view, and the last
    /// behind the last view; `None`: one flat for all views.
    pub flats_every: Option<u32>,
    /// The same of the dark frames.
    pub darks_every: Option<u32>,
    /// Errors of the scan.
    pub errors: ScanErrors,
}

/// A turn during the exposure: a view is the mean of the intensities at even angles.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Fly {
    /// Angles of a view, in the middles of equal parts of the sweep.
    pub count: u32,
    /// Turn during the exposure, rad, with the angle of the view in its middle.
    pub sweep: f64,
}

impl Fly {
    /// A mean over `count` angles of a sweep (rad).
    #[must_use]
    pub const fn new(count: u32, sweep: f64) -> Self {
        Self { count, sweep }
    }
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

    /// The motion of a sample on the axis, from an upright axis through the rotation centre.
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
            mask_offsets_z: Vec::new(),
            angles,
            motions: Vec::new(),
            view_offsets: Vec::new(),
            axis: RotationAxis::new([0.0; 3], 0.0, 0.0),
            travel: [0.0; 3],
            dithers: Vec::new(),
            fly: None,
            flats_every: None,
            darks_every: None,
            errors: ScanErrors {
                mask_offsets: Vec::new(),
                mask_offsets_z: Vec::new(),
                intensities: Vec::new(),
                source: Vec::new(),
                drawn: None,
            },
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

    /// Poses of the sample in each view, whose intensities are averaged: one, but in fly scans.
    #[must_use]
    pub fn poses_of_view(&self) -> usize {
        self.fly.map_or(1, |fly| fly.count.max(1) as usize)
    }

    /// Poses of the sample in all views, the poses of a view one after the other.
    #[must_use]
    pub fn poses(&self) -> usize {
        self.views() * self.poses_of_view()
    }

    /// Index of the view of a pose.
    #[must_use]
    pub fn view_of(&self, pose: usize) -> usize {
        pose / self.poses_of_view()
    }

    /// Angle of a pose, rad.
    #[doc(hidden)]
    pub fn angle_of_pose(&self, pose: usize) -> f64 {
        let angle = self.angle_of(self.view_of(pose));
        match self.fly {
            Some(fly) if fly.count > 1 => {
                let part = (pose % self.poses_of_view()) as f64 + 0.5;
                angle + fly.sweep * (part / f64::from(fly.count) - 0.5)
            }
            _ => angle,
        }
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

    /// For each flat the view before which it is taken; the number of views for a flat behind the last.
    #[must_use]
    pub fn flat_places(&self) -> Vec<u32> {
        self.places(self.flats_every)
    }

    /// The same of the dark frames.
    #[must_use]
    pub fn dark_places(&self) -> Vec<u32> {
        self.places(self.darks_every)
    }

    fn places(&self, every: Option<u32>) -> Vec<u32> {
        let Some(every) = every else { return vec![0] };
        let views = numbers::count(self.views());
        (0..views).step_by(every.max(1) as usize).chain([views]).collect()
    }

    /// The view whose errors an exposure has: a flat has the errors of the view that follows, and a flat
    /// behind the last view the errors of the last view. `None` for darks, and for the flat of a scan that
    /// has one.
    #[must_use]
    pub fn view_of_errors(&self, exposure: Exposure) -> Option<usize> {
        match exposure {
            Exposure::Sample(view) => Some(view as usize),
            Exposure::Flat(flat) => self.flats_every.map(|every| {
                let place = (flat as usize).saturating_mul(every as usize);
                place.min(self.views().saturating_sub(1))
            }),
            Exposure::Dark(_) => None,
        }
    }

    /// Displacements of the sample mask that an exposure has by plan, m.
    #[must_use]
    pub fn planned_offsets(&self, exposure: Exposure) -> &[f64] {
        match exposure {
            Exposure::Sample(view) => self.offsets_of(view as usize),
            Exposure::Flat(_) | Exposure::Dark(_) => &self.mask_offsets,
        }
    }

    /// Displacements of the sample mask along x and along z as they are, with the errors of the mask, m; no list
    /// along z where the mask keeps its height.
    pub(super) fn moved_offsets(&self, exposure: Exposure) -> [Vec<f64>; 2] {
        let errors = [&self.errors.mask_offsets, &self.errors.mask_offsets_z];
        let errors = errors.map(|of| of.get(self.view_of_errors(exposure)?));
        let planned = [self.planned_offsets(exposure), &self.mask_offsets_z];
        [0, 1].map(|axis| match errors[axis] {
            None => planned[axis].to_vec(),
            Some(errors) if planned[axis].is_empty() => errors.clone(),
            Some(errors) => {
                planned[axis].iter().zip(errors).map(|(at, error)| at + error).collect()
            }
        })
    }

    /// Light of a frame of a view over the nominal one.
    #[must_use]
    pub fn intensity(&self, view: usize, step: usize) -> f64 {
        self.errors.intensities.get(view).and_then(|list| list.get(step)).copied().unwrap_or(1.0)
    }

    /// Takes these steps along x, m, in place of all others.
    #[doc(hidden)]
    pub fn replace_offsets(&mut self, offsets: Vec<f64>) {
        self.mask_offsets = offsets;
        self.mask_offsets_z.clear();
        self.view_offsets.clear();
    }

    /// Removes these mask steps from the offsets and from the errors of frames.
    #[doc(hidden)]
    pub fn omit_steps(&mut self, omitted: &[usize]) {
        let errors = &mut self.errors;
        let errors =
            [&mut errors.mask_offsets, &mut errors.mask_offsets_z, &mut errors.intensities];
        let lists = errors.into_iter().chain([&mut self.view_offsets]).flatten();
        let steps = [&mut self.mask_offsets, &mut self.mask_offsets_z];
        for list in lists.chain(steps) {
            let mut steps = 0..;
            list.retain(|_| steps.next().is_none_or(|step| !omitted.contains(&step)));
        }
    }

    /// Draws the errors that are to be drawn.
    pub(super) fn draw_errors(&mut self) {
        self.errors.draw([self.views(), self.mask_offsets.len(), self.mask_offsets_z.len()]);
    }

    /// Motion of the sample in a view before the set-up turns.
    pub(super) fn before(&self, view: usize) -> Option<&Motion> {
        self.motions.get(self.angle_index(view))
    }

    /// Motion of the sample in a view after the turn by an angle, in the frame of the set-up: travel
    /// along the axis before shift and tilt, then shift and tilt, then the dither.
    pub(super) fn after(&self, view: usize, angle: f64) -> Motion {
        let turns = angle / TAU;
        let travel = Motion::translation(self.travel.map(|length| length * turns + 0.0));
        let dither = Motion::translation([self.dither_of(view), 0.0, 0.0]);
        travel.then(&self.axis.motion()).then(&dither)
    }

    /// Origin of the sample in a view without errors, in the frame of the set-up, m.
    pub(super) fn origin(&self, view: usize) -> [f64; 3] {
        let angle = self.angle_of(view);
        let placed = self.before(view).map_or([0.0; 3], |moved| moved.point([0.0; 3]));
        self.after(view, angle).point(Motion::about_z(-angle).point(placed))
    }

    /// Mean of y of the origin of the sample over the views, in the frame of the set-up, m.
    pub(super) fn depth(&self) -> f64 {
        let views = self.views();
        let first = self.origin(0)[1];
        // Of equal places the mean is exact.
        let rest: f64 = (0..views).map(|view| self.origin(view)[1] - first).sum();
        first + rest / views.max(1) as f64
    }

    /// True if the sample only turns about an upright axis, which may be beside the optical axis.
    #[must_use]
    pub fn is_circle(&self) -> bool {
        let rests = self.motions.iter().all(|motion| *motion == Motion::IDENTITY);
        let RotationAxis { shift: [_, _, z], tilt_x, tilt_y } = self.axis;
        rests && is_zero(&self.travel) && is_zero(&self.dithers) && is_zero(&[z, tilt_x, tilt_y])
    }

    /// True if the sample does anything but turn about z.
    #[must_use]
    pub fn moves(&self) -> bool {
        !self.is_circle() || !is_zero(&self.axis.shift) || !self.errors.source.is_empty()
    }
}

fn is_zero(values: &[f64]) -> bool {
    values.iter().all(|value| *value == 0.0)
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
        assert_eq!(scan.after(2, 0.5), Motion::translation([1e-5, 0.0, 0.0]));
        assert!(scan.moves());
    }

    #[test]
    fn poses_of_a_view_are_the_middles_of_parts_of_its_sweep() {
        let mut scan = Scan::new(vec![0.0], vec![0.5, 1.5]);
        assert_eq!((scan.poses(), scan.angle_of_pose(1)), (2, 1.5));
        scan.fly = Some(Fly::new(4, 0.8));
        assert_eq!((scan.poses(), scan.view_of(3), scan.view_of(4)), (8, 0, 1));
        let near = |pose, angle: f64| (scan.angle_of_pose(pose) - angle).abs() < 1e-15;
        assert!(near(0, 0.2) && near(3, 0.8) && near(4, 1.2) && near(5, 1.4));
    }

    #[test]
    fn flats_are_taken_before_views_and_behind_the_last() {
        let mut scan = Scan::new(vec![0.0], vec![0.0; 10]);
        assert_eq!((scan.flat_places(), scan.view_of_errors(Exposure::Flat(0))), (vec![0], None));
        scan.flats_every = Some(4);
        assert_eq!(scan.flat_places(), [0, 4, 8, 10]);
        let views = (0..4).map(|flat| scan.view_of_errors(Exposure::Flat(flat)));
        assert_eq!(views.collect::<Vec<_>>(), [Some(0), Some(4), Some(8), Some(9)]);
        scan.darks_every = Some(20);
        assert_eq!(scan.dark_places(), [0, 10]);
    }

    #[test]
    fn axis_tilts_about_y_then_x_and_travel_follows_the_angle() {
        let mut scan = Scan::new(vec![0.0], vec![TAU / 2.0]);
        scan.travel = [0.0, 0.0, 4e-3];
        scan.axis = RotationAxis::new([1e-3, 2e-3, 0.0], 0.1, 0.2);
        let [x, y, z] = scan.after(0, TAU / 2.0).point([0.0; 3]);
        // Travel is along the tilted axis: half of 4 mm.
        let up = [0.2_f64.sin(), -0.2_f64.cos() * 0.1_f64.sin(), 0.2_f64.cos() * 0.1_f64.cos()];
        let want = [1e-3 + 2e-3 * up[0], 2e-3 + 2e-3 * up[1], 2e-3 * up[2]];
        let near = [x, y, z].iter().zip(want).all(|(got, want)| (got - want).abs() < 1e-17);
        assert!(near, "{:?} for {want:?}", [x, y, z]);
    }
}
