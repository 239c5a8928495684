//! The geometry of a scan from geometry.json, and its axis by columns.

use super::geometry::ScanGeometry;
use beamlet_core::{Error, Result};
use beamlet_files::layout::GEOMETRY;
use beamlet_files::{GeometryFile, index_of, place_of};
use std::path::Path;

impl ScanGeometry {
    /// The scan of a geometry.json in `folder`.
    ///
    /// # Errors
    /// [`Error::File`] where it holds no scan, or neither an axis of rotation nor motions.
    pub fn of_file(file: &GeometryFile, folder: &Path) -> Result<Self> {
        let refused = |problem: String| Error::file(folder.join(GEOMETRY), problem, None);
        let mut made = Self::new(
            [file.source_to_axis_m, file.source_to_detector_m],
            file.columns_m.clone(),
            file.rows_m.clone(),
            file.angles_rad.clone(),
        );
        made.lever = file.source_to_analyser_m - file.source_to_axis_m;
        made.check().map_err(|error| refused(error.to_string()))?;
        if let Some(motions) = file.motions().map_err(|error| refused(error.to_string()))? {
            return Ok(made.with_motions(motions));
        }
        let Some(axis) = file.axis_column else {
            let problem = "has neither an axis of rotation (axis_column) nor sample_motions";
            return Err(refused(problem.into()));
        };
        // Beside the optical axis; on it places of columns are rounded.
        if (made.axis_column() - axis).abs() > 1e-6 {
            made.set_axis_column(axis);
        }
        Ok(made)
    }

    /// Views, rows and columns.
    #[must_use]
    pub const fn shape(&self) -> [usize; 3] {
        [self.angles.len(), self.rows.len(), self.columns.len()]
    }

    /// Column of the axis of rotation, counted from 0 at the centre of the first, with its fraction
    /// between the two columns around it; where views move the sample, the mean column of its origin.
    #[must_use]
    pub fn axis_column(&self) -> f64 {
        index_of(self.axis * self.magnification(), &self.columns).unwrap_or_default()
    }

    /// Puts the axis of rotation on a column.
    pub fn set_axis_column(&mut self, column: f64) {
        if let Some(place) = place_of(column, &self.columns) {
            self.axis = place / self.magnification();
        }
    }
}
