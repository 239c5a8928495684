//! The geometry of a scan.

use beamlet_core::printed::counted;
use beamlet_core::{Error, Result};
use beamlet_model::optics::ViewGeometry;
use beamlet_model::scene::{Motion, Scene};

/// A scan: on a circle, where source and detector turn about an axis along z at right angles to the
/// optical axis, or with any rigid motion of the sample in each view. Lengths in m, angles in rad; frame
/// and signs as in docs/physics.md.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ScanGeometry {
    /// Source to axis of rotation along the optical axis. Infinite: a parallel beam.
    pub source_distance: f64,
    /// Source to detector; counts for nothing in a parallel beam.
    pub detector_distance: f64,
    /// x of the centres of the columns on the detector from the optical axis, ascending. They may be
    /// uneven: sinograms are interpolated linearly at even places then.
    pub columns: Vec<f64>,
    /// z of the centres of the rows on the detector, top row first, even.
    pub rows: Vec<f64>,
    /// x of the axis of rotation from the optical axis; with `motions`, the mean of the origin of the volume.
    pub axis: f64,
    /// `source_distance` to the plane in which displacements are measured (the detector mask, or the
    /// detector without one): refraction angles are displacements there over this length. Infinite: voxels
    /// before and behind the axis count alike.
    pub lever: f64,
    /// Angles of the views, in any order. They count for nothing where there are `motions`.
    pub angles: Vec<f64>,
    /// Motion of the sample in each view, from the frame of the volume to that of the set-up at rest: its
    /// origin is on the optical axis at `source_distance` behind the source, which is on -y; the shift
    /// by `axis` along x follows. `None`: a circle by `angles`.
    pub motions: Option<Vec<Motion>>,
}

impl ScanGeometry {
    /// A scan with its axis of rotation on the optical axis. Distances: source to axis, source to
    /// detector.
    #[must_use]
    pub const fn new(
        distances: [f64; 2],
        columns: Vec<f64>,
        rows: Vec<f64>,
        angles: Vec<f64>,
    ) -> Self {
        let [source_distance, detector_distance] = distances;
        let lever = f64::INFINITY;
        let (axis, motions) = (0.0, None);
        Self { source_distance, detector_distance, columns, rows, axis, lever, angles, motions }
    }

    /// The scan of a scene: columns are the centres of the openings of the detector mask before each
    /// pixel, rows those of the pixels, and the axis is where `scan.axis` has it. Views that move the sample
    /// have their motions.
    #[must_use]
    pub fn of_scene(scene: &Scene) -> Self {
        let views = ViewGeometry::of(scene);
        let distances = [views.source_to_axis, views.source_to_detector];
        let lever = views.source_to_analyser - views.source_to_axis;
        let made = Self::new(distances, views.columns, views.rows, views.angles);
        match views.motions {
            None => Self { axis: scene.scan.axis.shift[0], lever, ..made },
            Some(motions) => Self { lever, ..made }.with_motions(motions),
        }
    }

    /// Magnification from the axis of rotation to the detector.
    #[must_use]
    pub fn magnification(&self) -> f64 {
        if self.is_parallel() { 1.0 } else { self.detector_distance / self.source_distance }
    }

    /// One over the distance from the source to the axis, 0 in a parallel beam.
    pub(super) fn per_distance(&self) -> f64 {
        if self.is_parallel() { 0.0 } else { 1.0 / self.source_distance }
    }

    fn is_parallel(&self) -> bool {
        self.source_distance.is_infinite()
    }

    /// Views, rows and columns, as arrays have them.
    pub(super) const fn dim(&self) -> (usize, usize, usize) {
        (self.angles.len(), self.rows.len(), self.columns.len())
    }

    /// Length of a line through a place on the detector, per depth along the optical axis.
    pub(super) fn length(&self, place: f64, row: usize) -> f64 {
        let per = self.per_distance() / self.magnification();
        (place * per).hypot(self.rows[row] * per).hypot(1.0)
    }

    /// Tangent of a refraction angle in the plane of a row: less its change per change along x of the
    /// integral of δ over the depth, and per integral over the lever arm.
    pub(super) fn tangents(&self, place: f64, row: usize) -> [f64; 2] {
        let tangent = place * self.per_distance() / self.magnification();
        let square = self.length(place, row).powi(2);
        [square * (1.0 + tangent * tangent), square * tangent]
    }

    /// Checks the values of the fields.
    ///
    /// # Errors
    /// [`Error::Argument`].
    pub(super) fn check(&self) -> Result<()> {
        let wrong =
            |name: &str, found: String, allowed: &str| Err(Error::argument(name, found, allowed));
        let [near, far] = [self.source_distance, self.detector_distance];
        if !(near > 0.0 && (self.is_parallel() || (far.is_finite() && far > near))) {
            let found = format!("the axis at {near} m, the detector at {far} m");
            return wrong("distances", found, "the axis behind the source, the detector behind it");
        }
        if !self.axis.is_finite() {
            return wrong("axis", self.axis.to_string(), "a finite number");
        }
        if self.lever.is_nan() || self.lever <= 0.0 {
            return wrong("lever", self.lever.to_string(), "a length above zero");
        }
        let is_finite = |list: &[f64]| list.iter().all(|value| value.is_finite());
        if self.columns.len() < 2
            || !is_finite(&self.columns)
            || !self.columns.is_sorted_by(|a, b| a < b)
        {
            let found = format!("{} columns", self.columns.len());
            return wrong("columns", found, "two or more finite places, ascending");
        }
        let pitch = self.row_pitch();
        let is_even = |pair: &[f64]| (pair[0] - pair[1] - pitch).abs() <= 1e-6 * pitch;
        if self.rows.is_empty() || !is_finite(&self.rows) || !self.rows.windows(2).all(is_even) {
            let found = format!("{} rows", self.rows.len());
            return wrong("rows", found, "one or more finite places, descending and even");
        }
        if self.angles.len() < 3 || !is_finite(&self.angles) {
            let found = counted(self.angles.len(), "view");
            let allowed = "three or more views at finite angles: a scan (scan.angles)";
            return wrong("angles", found, allowed);
        }
        if let Some(motions) = self.motions.as_ref().filter(|m| m.len() != self.angles.len()) {
            let found = format!(
                "{} for {}",
                counted(motions.len(), "motion"),
                counted(self.angles.len(), "view")
            );
            return wrong("motions", found, "one for each view");
        }
        Ok(())
    }

    /// Distance of the rows on the detector; of the columns, where there is one row.
    pub(super) fn row_pitch(&self) -> f64 {
        match self.rows[..] {
            [first, .., last] => (first - last) / (self.rows.len() - 1) as f64,
            _ => self.column_pitch(),
        }
    }

    /// Mean distance of the columns on the detector.
    pub(super) fn column_pitch(&self) -> f64 {
        match self.columns[..] {
            [first, .., last] => (last - first) / (self.columns.len() - 1) as f64,
            _ => 0.0,
        }
    }
}

/// # Errors
/// [`Error::Argument`] for an array of another shape.
pub(super) fn same_shape(
    name: &str,
    found: (usize, usize, usize),
    needed: (usize, usize, usize),
) -> Result<()> {
    if found == needed {
        return Ok(());
    }
    Err(Error::argument(name, format!("shape {found:?}"), format!("{needed:?}")))
}
