//! Views: where source, masks and detector stand at each angle, in world coordinates.

use super::{MaskSpec, Scene};
use serde::Serialize;

/// Where everything stands in one view, in world coordinates (m). The sample never moves.
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
    /// The view at an angle (rad): source, masks and detector turned by +angle about +z.
    #[must_use]
    pub(crate) fn view_at(&self, angle: f64) -> View {
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let turned = |x: f64, y: f64, z: f64| [x * cos - y * sin, x * sin + y * cos, z];
        let centre = self.source.distance;
        let pose = |mask: &MaskSpec| Pose {
            centre: turned(mask.offset, mask.distance - centre, 0.0),
            across: turned(1.0, 0.0, 0.0),
            along: [0.0, 0.0, 1.0],
        };
        View {
            source: turned(0.0, -centre, 0.0),
            detector: turned(0.0, self.detector.distance - centre, 0.0),
            column: turned(self.detector.pitch[0], 0.0, 0.0),
            row: [0.0, 0.0, -self.detector.pitch[1]],
            sample_mask: self.sample_mask.as_ref().map(pose),
            detector_mask: self.detector_mask.as_ref().map(pose),
        }
    }

    /// The views of the scan, in order.
    pub fn views(&self) -> impl Iterator<Item = View> + '_ {
        self.scan.angles.iter().map(|&angle| self.view_at(angle))
    }
}

impl View {
    /// Cosine and sine of the turn of the beam frame against the world.
    #[must_use]
    pub fn turn(&self) -> [f64; 2] {
        let length = libm::hypot(self.column[0], self.column[1]);
        [self.column[0] / length, self.column[1] / length]
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
        let view = Scene::from_toml(text, ".").unwrap().view_at(std::f64::consts::FRAC_PI_2);
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15);
        // ASTRA's convention: the source starts on -y and turns towards +x.
        assert!(near(view.source, [1.0, 0.0, 0.0]), "{:?}", view.source);
        assert!(near(view.detector, [-1.0, 0.0, 0.0]));
        assert!(near(view.column, [0.0, 1e-4, 0.0]));
        assert!(near(view.row, [0.0, 0.0, -1e-4]));
    }
}
