//! geometry.json: where source, detector and the columns of the images are in each view, for beamlet
//! and other reconstruction tools.

use super::layout;
use beamlet_core::numbers::whole;
use beamlet_core::{Error, Result, input_file};
use beamlet_model::optics::{Optics, ViewGeometry};
use beamlet_model::scene::{Motion, Scene};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Contents of geometry.json. Frame and signs: docs/physics.md.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct GeometryFile {
    /// Version of beamlet.
    pub version: String,
    /// Order of the sides of arrays, by kind.
    pub order: Order,
    /// Angle of each view in degrees: source and detector turn by it about +z.
    pub angles_deg: Vec<f64>,
    /// The same in radians.
    pub angles_rad: Vec<f64>,
    /// Source to axis of rotation along the optical axis, m; where views move the sample, to the mean place
    /// of its origin.
    pub source_to_axis_m: f64,
    /// Source to detector, m.
    pub source_to_detector_m: f64,
    /// Source to the centre plane of the sample mask, m; `null` without the mask.
    pub source_to_sample_mask_m: Option<f64>,
    /// Source to the plane where displacements are analysed, m: the detector mask, or the detector.
    pub source_to_analyser_m: f64,
    /// Column of the axis of rotation, counted from 0 at the centre of the first; `null` where views
    /// move the sample: these have no axis in common.
    pub axis_column: Option<f64>,
    /// For each view the matrix `[R | t]` of the motion of the sample, row after row, t in m: a point p of
    /// the sample is at R p + t in the frame of the set-up at rest, with the origin at
    /// `source_to_axis_m` and the source on -y. `null` where `angles_rad` and `axis_column` say all.
    #[serde(default)]
    pub sample_motions: Option<Vec<[f64; 12]>>,
    /// For each flat of a run the view before which it is taken, the number of views for a flat behind the
    /// last; left out where one flat serves all views.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flats_before_views: Option<Vec<u32>>,
    /// The same of the darks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub darks_before_views: Option<Vec<u32>>,
    /// Place u of each column: x from the optical axis on the detector, m, ascending.
    pub columns_m: Vec<f64>,
    /// z of each row on the detector, m, descending.
    pub rows_m: Vec<f64>,
    /// Row of ASTRA's `cone_vec` for each view, mm: source, centre of the detector, from a column to
    /// the next, from a row to the next. `null` where the columns are uneven.
    pub astra_cone_vec_mm: Option<Vec<[f64; 12]>>,
}

/// Order of the sides of arrays.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Order {
    /// Frames of the sample.
    pub sample: String,
    /// Retrieved images.
    pub images: String,
    /// Projections as ASTRA takes them.
    pub astra_projections: String,
    /// Volumes of ASTRA and of beamlet: every side ascending.
    pub volumes: String,
}

impl GeometryFile {
    /// The geometry of the views of a scene, whose columns measure the light through the openings of its
    /// detector mask.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let scan = &scene.scan;
        Self {
            flats_before_views: scan.flats_every.map(|_| scan.flat_places()),
            darks_before_views: scan.darks_every.map(|_| scan.dark_places()),
            ..Self::with_columns(scene, Optics::of(scene).column_places(), scan.views())
        }
    }

    /// The geometry of the first `views` views of a scene with columns at these places, x from the
    /// optical axis on the detector, m.
    #[must_use]
    pub fn with_columns(scene: &Scene, columns: Vec<f64>, views: usize) -> Self {
        let made = ViewGeometry::with_columns(scene, columns, views);
        let axis = scene.scan.axis.shift[0] * made.source_to_detector / made.source_to_axis;
        let is_circle = made.motions.is_none();
        let views = made.angles.len();
        let text = |sides: &str| sides.to_owned();
        Self {
            version: beamlet_core::program::VERSION.to_owned(),
            order: Order {
                sample: text("[view][step][row][column]"),
                images: text("[view][row][column], row 0 at the largest z"),
                astra_projections: text("[row][view][column]"),
                volumes: text("[z][y][x], each ascending"),
            },
            angles_deg: made.angles.iter().map(|angle| angle.to_degrees()).collect(),
            angles_rad: made.angles,
            source_to_axis_m: made.source_to_axis,
            source_to_detector_m: made.source_to_detector,
            source_to_sample_mask_m: scene.sample_mask.as_ref().map(|mask| mask.distance),
            source_to_analyser_m: made.source_to_analyser,
            axis_column: if is_circle { index_of(axis, &made.columns) } else { None },
            sample_motions: made.motions.map(|all| all.iter().map(Motion::matrix).collect()),
            flats_before_views: None,
            darks_before_views: None,
            astra_cone_vec_mm: even(&made.columns).map(|even| vectors(scene, even, views)),
            columns_m: made.columns,
            rows_m: made.rows,
        }
    }

    /// Reads the geometry.json of a folder.
    ///
    /// # Errors
    /// [`Error::File`] where it is missing or is no such file, or its lists have different numbers of views.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(layout::GEOMETRY);
        let text = input_file::text(&path)
            .map_err(|error| Error::file(&path, "cannot be read", Some(error)))?;
        let file: Self = serde_json::from_str(&text).map_err(|error| {
            Error::file(&path, format!("is not a geometry of views: {error}"), None)
        })?;
        file.check().map_err(|problem| Error::file(path, problem, None))?;
        Ok(file)
    }

    /// Checks the lengths of the lists.
    fn check(&self) -> std::result::Result<(), String> {
        let views = self.angles_rad.len();
        let of_views = [
            ("angles_deg", Some(self.angles_deg.len())),
            ("sample_motions", self.sample_motions.as_ref().map(Vec::len)),
            ("astra_cone_vec_mm", self.astra_cone_vec_mm.as_ref().map(Vec::len)),
        ];
        if let Some((name, found)) =
            of_views.into_iter().find(|(_, found)| found.is_some_and(|found| found != views))
        {
            let found = found.unwrap_or_default();
            return Err(format!(
                "{name}: found {found} views; allowed: {views}, the number of angles_rad"
            ));
        }
        let lists = [("angles_rad", views), ("columns_m", self.columns_m.len())];
        for (name, found) in lists.into_iter().chain([("rows_m", self.rows_m.len())]) {
            if found == 0 {
                return Err(format!("{name}: found an empty list; allowed: one or more numbers"));
            }
        }
        Ok(())
    }

    /// Refuses images in `folder` with other views, rows or columns than this geometry.
    ///
    /// # Errors
    /// [`Error::File`] with both numbers.
    #[doc(hidden)]
    pub fn refuse_other_images(&self, folder: &Path, sides: [usize; 3]) -> Result<()> {
        let own = [self.angles_rad.len(), self.rows_m.len(), self.columns_m.len()];
        let names = [("views", "angles"), ("rows", "rows_m"), ("columns", "columns_m")];
        for ((side, list), (found, own)) in names.into_iter().zip(sides.into_iter().zip(own)) {
            if found != own {
                let problem =
                    format!("has images of {found} {side}; {} has {own} {list}", layout::GEOMETRY);
                return Err(Error::file(folder, problem, None));
            }
        }
        Ok(())
    }

    /// Motions of the sample; `None` where the views are a circle.
    ///
    /// # Errors
    /// [`Error::File`] for a matrix that is no rigid motion, and another number of them than of angles.
    pub fn motions(&self) -> Result<Option<Vec<Motion>>> {
        let Some(matrices) = &self.sample_motions else { return Ok(None) };
        let wrong = |problem: String| Err(Error::file(layout::GEOMETRY, problem, None));
        if let Err(problem) = self.check() {
            return wrong(problem);
        }
        let mut motions = Vec::with_capacity(matrices.len());
        for (view, matrix) in matrices.iter().enumerate() {
            match Motion::of_matrix(*matrix) {
                Ok(motion) => motions.push(motion),
                Err(error) => return wrong(format!("sample_motions[{view}]: {error}")),
            }
        }
        Ok(Some(motions))
    }

    /// The text of the file, a key on each line.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where a value has no form in JSON.
    #[doc(hidden)]
    pub fn text(&self) -> Result<String> {
        let failed =
            |error| Error::file(layout::GEOMETRY, format!("cannot be written: {error}"), None);
        let value = serde_json::to_value(self).map_err(failed)?;
        let lines = value.as_object().into_iter().flatten();
        let lines: Vec<String> =
            lines.map(|(key, value)| format!("  \"{key}\": {value}")).collect();
        Ok(format!("{{\n{}\n}}\n", lines.join(",\n")))
    }
}

/// Centre and distance of even columns, m.
fn even(columns: &[f64]) -> Option<[f64; 2]> {
    let [first, .., last] = columns else { return None };
    let pitch = (last - first) / (columns.len() - 1) as f64;
    let is_even = |pair: &[f64]| (pair[1] - pair[0] - pitch).abs() <= 1e-6 * pitch.abs();
    columns.windows(2).all(is_even).then_some([f64::midpoint(*first, *last), pitch])
}

/// Index of a place among ascending ones, with its fraction; beyond the ends by the last distance.
pub fn index_of(place: f64, columns: &[f64]) -> Option<f64> {
    if columns.len() < 2 {
        return None;
    }
    let after = columns.partition_point(|column| *column < place).clamp(1, columns.len() - 1);
    let [before, behind] = [columns[after - 1], columns[after]];
    Some((after - 1) as f64 + (place - before) / (behind - before))
}

/// Place of an index among ascending places, the inverse of [`index_of`].
pub fn place_of(index: f64, columns: &[f64]) -> Option<f64> {
    let left = whole::<usize>(index.max(0.0)).min(columns.len().checked_sub(2)?);
    let [before, behind] = [columns[left], columns[left + 1]];
    Some(before + (index - left as f64) * (behind - before))
}

/// Rows of `cone_vec`, of columns with this centre and distance.
fn vectors(scene: &Scene, [centre, pitch]: [f64; 2], views: usize) -> Vec<[f64; 12]> {
    let of_view = |view: beamlet_model::scene::View| {
        let along = view.column.map(|part| part / scene.detector.pitch[0]);
        let detector = [0, 1, 2].map(|axis| view.detector[axis] + centre * along[axis]);
        let all = [view.source, detector, along.map(|part| part * pitch), view.row];
        let mut row = [0.0; 12];
        row.iter_mut().zip(all.as_flattened()).for_each(|(to, from)| *to = 1e3 * from);
        row
    };
    scene.views().take(views).map(of_view).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_of_uneven_columns_lead_back_to_their_places() {
        let columns = [-1.0, -0.95, 0.0, 0.05, 1.0, 1.05];
        for place in [-1.5, -1.0, -0.96, -0.3, 0.0, 0.02, 0.7, 1.05, 1.2] {
            let index = index_of(place, &columns).and_then(|index| place_of(index, &columns));
            assert!(index.is_some_and(|back| (back - place).abs() < 1e-12), "{place}: {index:?}");
        }
        assert_eq!(place_of(0.0, &columns[..1]), None);
    }
}
