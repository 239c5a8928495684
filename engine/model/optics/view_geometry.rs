//! Places of source, detector and sample in the views of a scene, as geometry.json and reconstruction
//! take them.

use super::Optics;
use crate::scene::{Motion, ScanErrors, Scene};

/// Geometry of the views of a scene as planned, without errors of the scan: retrieval and reconstruction do
/// not know these. Frame and signs: docs/physics.md.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewGeometry {
    /// Angle of each view, rad: source and detector turn by it about +z.
    pub angles: Vec<f64>,
    /// Distance from the source to the axis of rotation along the optical axis, m; where views move the
    /// sample, to the mean place of its origin.
    pub source_to_axis: f64,
    /// Distance from the source to the detector, m.
    pub source_to_detector: f64,
    /// Distance from the source to the plane where displacements are analysed, m: the detector mask, or the
    /// detector.
    pub source_to_analyser: f64,
    /// Motion of the sample in each view, in the frame of the set-up at rest with the origin at
    /// `source_to_axis`; `None` where the views are a circle.
    pub motions: Option<Vec<Motion>>,
    /// Place of each column on the detector: x from the optical axis, m, ascending.
    pub columns: Vec<f64>,
    /// z of each row on the detector, m, descending.
    pub rows: Vec<f64>,
}

impl ViewGeometry {
    /// The geometry of all views of a scene, whose columns measure the light through the openings of its
    /// detector mask.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self::with_columns(scene, Optics::of(scene).column_places(), scene.scan.views())
    }

    /// The geometry of the first `views` views of a scene with columns at these places, x from the
    /// optical axis on the detector, m.
    #[must_use]
    pub fn with_columns(scene: &Scene, columns: Vec<f64>, views: usize) -> Self {
        let scan = &scene.scan;
        let views = scan.views().min(views);
        let source_to_axis = scene.axis_distance();
        let [_, rows] = scene.detector.pixels;
        let row =
            |row: u32| (f64::from(rows) / 2.0 - f64::from(row) - 0.5) * scene.detector.pitch[1];
        let motions = || {
            let to_axis = Motion::translation([0.0, scene.source.distance - source_to_axis, 0.0]);
            let mut planned = scene.clone();
            planned.scan.errors = ScanErrors::default();
            planned.views().take(views).map(|view| view.motion.then(&to_axis)).collect()
        };
        Self {
            angles: (0..views).map(|view| scan.angle_of(view)).collect(),
            source_to_axis,
            source_to_detector: scene.detector.distance,
            source_to_analyser: scene.analyser_distance(),
            motions: (!scan.is_circle()).then(motions),
            columns,
            rows: (0..rows).map(row).collect(),
        }
    }
}
