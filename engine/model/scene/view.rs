//! Views: positions of source, masks and detector at each angle, in world coordinates.

use super::{Exposure, MaskSpec, Motion, Scene};
use serde::Serialize;

/// Positions in one view, in world coordinates (m). The sample never moves.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct View {
    /// Centre of the focal spot.
    pub source: [f64; 3],
    /// Centre of the detector.
    pub detector: [f64; 3],
    /// From a pixel to the next column.
    pub column: [f64; 3],
    /// From a pixel to the next row, downwards.
    pub row: [f64; 3],
    /// Pose of the sample mask.
    pub sample_mask: Option<Pose>,
    /// Pose of the detector mask.
    pub detector_mask: Option<Pose>,
    /// The sample as this view sees it: from the world to the beam frame, in which the beam runs along
    /// +y and columns along +x.
    #[serde(skip)]
    pub motion: Motion,
}

/// Pose of a mask: the centre of its lattice at mask offset 0, and its two directions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Pose {
    /// Centre of the lattice, in the middle of the bars' thickness.
    pub centre: [f64; 3],
    /// Across the slits, unit vector.
    pub across: [f64; 3],
    /// Along the slits, unit vector.
    pub along: [f64; 3],
}

impl Scene {
    /// The view of this index, at the middle of its sweep in a fly scan: source, masks and detector turned by its angle about +z around the sample
    /// that its motion moved, in the coordinates of the sample.
    #[must_use]
    #[doc(hidden)]
    pub fn view(&self, index: usize) -> View {
        let angle = self.scan.angle_of(index);
        let set_up = Motion::about_z(angle);
        let after = self.scan.after(index, angle);
        let set_up = if after == Motion::IDENTITY { set_up } else { after.inverse().then(&set_up) };
        let moved = self.scan.before(index);
        let world_from_beam = moved.map_or(set_up, |moved| set_up.then(&moved.inverse()));
        let centre = self.source.distance;
        let pose = |mask: &MaskSpec| Pose {
            centre: world_from_beam.point([mask.offset, mask.distance - centre, 0.0]),
            across: world_from_beam.direction([1.0, 0.0, 0.0]),
            along: world_from_beam.direction([0.0, 0.0, 1.0]),
        };
        let column = self.detector.pitch[0];
        View {
            source: world_from_beam.point([0.0, -centre, 0.0]),
            detector: world_from_beam.point([0.0, self.detector.distance - centre, 0.0]),
            column: world_from_beam.direction([column, 0.0, 0.0]),
            row: world_from_beam.direction([0.0, 0.0, -self.detector.pitch[1]]),
            sample_mask: self.sample_mask.as_ref().map(pose),
            detector_mask: self.detector_mask.as_ref().map(pose),
            motion: self.motion(index, angle, column),
        }
    }

    /// The motion from the world to the beam frame of a pose of the sample, whose x runs along the columns
    /// of a detector of this pitch: its rounding depends on the pitch.
    #[doc(hidden)]
    pub fn pose(&self, pose: usize, pitch: f64) -> Motion {
        self.motion(self.scan.view_of(pose), self.scan.angle_of_pose(pose), pitch)
    }

    /// The motions of all poses.
    #[doc(hidden)]
    pub fn poses(&self) -> impl Iterator<Item = Motion> + '_ {
        (0..self.scan.poses()).map(|pose| self.pose(pose, self.detector.pitch[0]))
    }

    /// Displacement of the sample (x, z), m, equivalent to a displaced source.
    /// The shear that takes the source back to the optical axis and keeps the detector in its place
    /// displaces a plane at the distance y from the source by `-s (1 - y/z_d)`, with the displacement s of the
    /// source and the distance `z_d` of the detector. The origin of the sample has it exactly.
    fn drift(&self, view: usize) -> Option<[f64; 2]> {
        let by = self.scan.errors.source.get(view)?;
        let origin = self.source.distance + self.scan.origin(view)[1];
        let share = 1.0 - origin / self.detector.distance;
        Some(by.map(|by| -by * share))
    }

    /// Displacements of the sample mask along x and along z in an exposure as they are, m: with their errors, and
    /// with the displacement -s (M - 1)/M equivalent to a source displaced by s. No list along z where neither moves
    /// a mask whose apertures end along z.
    #[must_use]
    pub fn applied_offsets(&self, exposure: Exposure) -> [Vec<f64>; 2] {
        let [mut x, mut z] = self.scan.moved_offsets(exposure);
        let Some(mask) = &self.sample_mask else { return [x, z] };
        if mask.heights().is_none() {
            z.clear();
        }
        let view = self.scan.view_of_errors(exposure);
        if let Some(source) = view.and_then(|view| self.scan.errors.source.get(view)) {
            if z.is_empty() && mask.heights().is_some() {
                z.resize(x.len(), 0.0);
            }
            let share = 1.0 - self.magnification().recip();
            for (offsets, source) in [&mut x, &mut z].into_iter().zip(source) {
                offsets.iter_mut().for_each(|offset| *offset = libm::fma(-share, *source, *offset));
            }
        }
        [x, z]
    }

    /// The motion of a view at an angle.
    fn motion(&self, index: usize, angle: f64, pitch: f64) -> Motion {
        let [x, y, _] = Motion::about_z(angle).direction([pitch, 0.0, 0.0]);
        let turn = Motion::onto_x([x, y]);
        let mut after = self.scan.after(index, angle);
        if let Some([x, z]) = self.drift(index) {
            after = after.then(&Motion::translation([x, 0.0, z]));
        }
        let turn = if after == Motion::IDENTITY { turn } else { turn.then(&after) };
        self.scan.before(index).map_or(turn, |moved| moved.then(&turn))
    }

    /// The views of the scan, in order.
    pub fn views(&self) -> impl Iterator<Item = View> + '_ {
        (0..self.scan.views()).map(|index| self.view(index))
    }

    /// How far views move the rotation centre at most, m.
    #[doc(hidden)]
    pub fn displacement(&self) -> f64 {
        let moved = self.poses().map(|pose| pose.offset().length());
        moved.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_puts_the_source_on_plus_x() {
        let text = r#"
            [source]
            distance = "1 m"
            spot = "0 um"
            energy = "30 keV"
            [detector]
            distance = "2 m"
            pixels = [4, 2]
            pitch = "100 um"
        "#;
        let mut scene = Scene::from_toml(text, ".").unwrap();
        scene.scan.angles = vec![std::f64::consts::FRAC_PI_2];
        let view = scene.view(0);
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15);
        // ASTRA's convention: the source starts on -y and turns towards +x.
        assert!(near(view.source, [1.0, 0.0, 0.0]), "{:?}", view.source);
        assert!(near(view.detector, [-1.0, 0.0, 0.0]));
        assert!(near(view.column, [0.0, 1e-4, 0.0]));
        assert!(near(view.row, [0.0, 0.0, -1e-4]));
        // A source displaced by 1 mm displaces a sample halfway to the detector by half, and one at 1.5 m by
        // a quarter.
        scene.scan.errors.source = vec![[1e-3, 0.0]];
        assert!((scene.view(0).motion.point([0.0; 3])[0] + 0.5e-3).abs() < 1e-12);
        scene.scan.axis.shift[1] = 0.5;
        assert!((scene.view(0).motion.point([0.0; 3])[0] + 0.25e-3).abs() < 1e-12);
        // A point at +x is nearer the source.
        assert!(near(view.motion.point([0.1, 0.0, 0.2]), [0.0, -0.1, 0.2]));
    }
}
