//! Pixels that measure nothing: dead or hot ones, and the gaps between the modules of a detector.

use super::Input;
use beamlet_core::array_file::Format;
use beamlet_core::csv_table::cells;
use beamlet_core::{Error, Result, input_file, numbers, reserve};
use beamlet_files::StackFile;
use ndarray::Array2;
use std::path::Path;

impl Input {
    /// Leaves out the pixels that a file names, in all frames; they are flagged [`BAD_PIXEL`], and their
    /// images hold NaN. The file is an image of the frame's shape (NPY, EXR, TIFF), where every value but
    /// 0 is a bad pixel, or a text with `row,column` on each line, counted from 0, row 0 at the top.
    ///
    /// # Errors
    /// [`Error::File`] where it cannot be read, has another shape, names a pixel outside of the frame, or
    /// leaves no pixel; [`Error::Memory`].
    ///
    /// [`BAD_PIXEL`]: crate::retrieve::flags::BAD_PIXEL
    pub fn with_bad_pixels(mut self, path: &Path) -> Result<Self> {
        let frame = self.whole_frame();
        let bad = match Format::of(path) {
            Some(_) => of_image(path, frame)?,
            None => of_list(path, frame)?,
        };
        let count = bad.iter().filter(|bad| **bad).count();
        if count == bad.len() {
            let problem = "names every pixel of the frame; allowed: 0 for pixels that are good";
            return Err(Error::file(path, problem, None));
        }
        if 2 * count > bad.len() {
            log::warn!(
                "{}: {count} of {} pixels are bad; in a mask of bad pixels 0 is a good pixel",
                path.display(),
                bad.len()
            );
        }
        self.read.push(path.to_path_buf());
        self.correction.bad = Some((path.to_path_buf(), bad));
        Ok(self)
    }

    /// Bad pixels of those that are kept, `[row][column]`, where a file names them.
    pub(crate) fn bad_pixels(&self) -> Option<Array2<bool>> {
        self.correction.bad_pixels().map(|bad| self.selection.of_mask(bad))
    }

    /// File of the bad pixels.
    pub(crate) fn bad_pixels_source(&self) -> Option<String> {
        self.correction.bad.as_ref().map(|(path, _)| path.display().to_string())
    }
}

/// Pixels of an image that are not 0.
fn of_image(path: &Path, [rows, columns]: [usize; 2]) -> Result<Array2<bool>> {
    let stack = StackFile::open(path)?;
    if stack.shape() != [1, 1, rows, columns] {
        let [views, steps, found_rows, found_columns] = stack.shape();
        let problem = format!(
            "has {} images of {found_rows} x {found_columns} pixels; allowed: one of {rows} x {columns}, \
             as the frames",
            views * steps
        );
        return Err(Error::file(path, problem, None));
    }
    let image = stack.frame(0, 0, 0..numbers::count(rows))?;
    let is_good = |value: &f32| value.abs() <= 0.0;
    Ok(image.map(|value| !is_good(value)))
}

/// Pixels of a list of rows and columns.
fn of_list(path: &Path, [rows, columns]: [usize; 2]) -> Result<Array2<bool>> {
    let text = input_file::text(path).map_err(|error| {
        let problem = "cannot be read as an image or a list of row,column";
        Error::file(path, problem, Some(error))
    })?;
    let values = reserve::zeroed::<u8>(rows * columns, "the mask of bad pixels")?;
    let mut bad = Array2::from_shape_vec((rows, columns), values)
        .map_err(|error| Error::file(path, error.to_string(), None))?
        .mapv(|_| false);
    for (index, line) in text.lines().enumerate() {
        let words = line.split('#').next().unwrap_or_default().trim();
        if words.is_empty() {
            continue;
        }
        let places: Option<Vec<usize>> =
            cells(words).iter().map(|word| word.parse().ok()).collect();
        let pixel = match places.as_deref() {
            Some([row, column]) => bad.get_mut([*row, *column]),
            _ => None,
        };
        let Some(pixel) = pixel else {
            let shown: String = words.chars().take(40).collect();
            let problem = format!(
                "line {}: {shown:?}; allowed: row,column, rows 0 to {}, columns 0 to {}",
                index + 1,
                rows.saturating_sub(1),
                columns.saturating_sub(1)
            );
            return Err(Error::file(path, problem, None));
        };
        *pixel = true;
    }
    Ok(bad)
}
