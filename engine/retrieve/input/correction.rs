//! Corrections of values before curves are fitted: the dark, saturated values, bad pixels.

use crate::stack::StackFile;
use crate::{Error, Result, numbers, reserve};
use ndarray::{Array2, Array3, ArrayView2, Zip, s};
use std::ops::Range;
use std::path::PathBuf;

/// Code of an excluded value: finite, and above every saturation.
pub(super) const LEFT_OUT: f32 = f32::MAX;

/// A dark with the file or folder of its frames.
#[derive(Debug)]
pub(super) struct Dark {
    pub(super) path: PathBuf,
    /// Mean of the frames.
    pub(super) mean: Array2<f32>,
}

/// Corrections of the values of frames, `[row][column]` as the files have them.
#[derive(Debug, Default)]
pub(super) struct Correction {
    pub(super) dark: Option<Dark>,
    /// File of bad pixels, and these.
    pub(super) bad: Option<(PathBuf, Array2<bool>)>,
    /// Values from here on, before the dark is subtracted, are left out.
    pub(super) saturation: Option<f32>,
}

impl Dark {
    /// # Errors
    /// As [`StackFile::frame`]; [`Error::Memory`].
    pub(super) fn of(stack: &StackFile) -> Result<Self> {
        Ok(Self { path: stack.path().to_path_buf(), mean: mean(stack)? })
    }
}

impl Correction {
    /// Bad pixels, where a file names them.
    pub(super) fn bad_pixels(&self) -> Option<&Array2<bool>> {
        self.bad.as_ref().map(|(_, bad)| bad)
    }

    /// Refuses a dark without a value in a pixel that is not a bad one.
    pub(super) fn check(&self) -> Result<()> {
        let Some(Dark { path, mean }) = &self.dark else { return Ok(()) };
        let is_bad = |at| self.bad_pixels().is_some_and(|bad| bad[at]);
        match mean.indexed_iter().find(|(at, value)| !value.is_finite() && !is_bad(*at)) {
            None => Ok(()),
            Some(((row, column), _)) => {
                let problem = format!(
                    "is not finite in row {row}, column {column}: --bad-pixels leaves out such pixels"
                );
                Err(Error::file(path, problem, None))
            }
        }
    }

    /// Marks saturated and bad values in rows of frames, and subtracts the dark.
    pub(super) fn apply(&self, data: &mut Array3<f32>, rows: &Range<u32>) {
        let part = s![rows.start as usize..rows.end as usize, ..];
        let dark: Option<ArrayView2<'_, f32>> =
            self.dark.as_ref().map(|dark| dark.mean.slice(part));
        let bad = self.bad_pixels().map(|bad| bad.slice(part));
        for mut frame in data.outer_iter_mut() {
            if let Some(saturation) = self.saturation {
                frame.mapv_inplace(|y| if y >= saturation { LEFT_OUT } else { y });
            }
            if let Some(dark) = &dark {
                Zip::from(&mut frame).and(dark).for_each(|y, dark| {
                    if *y < LEFT_OUT {
                        *y -= dark;
                    }
                });
            }
            if let Some(bad) = &bad {
                Zip::from(&mut frame).and(bad).for_each(|y, bad| {
                    if *bad {
                        *y = f32::NAN;
                    }
                });
            }
        }
    }
}

/// Mean of all frames.
fn mean(stack: &StackFile) -> Result<Array2<f32>> {
    let [views, steps, rows, columns] = stack.shape();
    let sums = reserve::zeroed::<f64>(rows * columns, "the mean of dark frames")?;
    let mut sum = Array2::from_shape_vec((rows, columns), sums)
        .map_err(|error| Error::file(stack.path(), format!("cannot be read: {error}"), None))?;
    let all = 0..numbers::count(rows);
    for view in 0..views {
        for step in 0..steps {
            let frame = stack.frame(view, step, all.clone())?;
            Zip::from(&mut sum).and(&frame).for_each(|sum, y| *sum += f64::from(*y));
        }
    }
    let count = (views * steps) as f64;
    Ok(sum.mapv(|sum| numbers::single(sum / count)))
}
