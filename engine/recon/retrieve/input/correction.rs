//! Corrections of values before curves are fitted: the dark, saturated values, bad pixels.

use super::times::Times;
use beamlet_core::{Error, Result, numbers, reserve};
use beamlet_files::StackFile;
use ndarray::{Array2, Array3, ArrayView2, Zip, s};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Code of an excluded value: finite, and above every saturation.
pub(super) const LEFT_OUT: f32 = f32::MAX;

/// A dark with the file or folder of its frames.
#[derive(Debug)]
pub(super) struct Dark {
    pub(super) path: PathBuf,
    /// Mean of the frames.
    pub(super) mean: Array2<f32>,
    /// Darks between views.
    pub(super) series: Option<DarkSeries>,
}

/// Index of a dark, and its mean.
type KeptMean = (usize, Arc<Array2<f32>>);

/// Darks between views, each of several frames.
#[derive(Debug)]
pub(super) struct DarkSeries {
    stack: StackFile,
    times: Times,
    /// The means of two neighbours.
    kept: Mutex<[Option<KeptMean>; 2]>,
}

impl DarkSeries {
    /// Mean of the frames of a dark.
    fn mean(&self, index: usize) -> Result<Arc<Array2<f32>>> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, mean)) = kept[index % 2].as_ref().filter(|(of, _)| *of == index) {
            return Ok(mean.clone());
        }
        let mean = Arc::new(mean(&self.stack, index..index + 1)?);
        kept[index % 2] = Some((index, mean.clone()));
        Ok(mean)
    }

    /// Rows of the dark at a time, interpolated linearly.
    fn at(&self, time: f64, rows: &Range<u32>) -> Result<Array2<f32>> {
        let part = s![rows.start as usize..rows.end as usize, ..];
        let (before, share) = self.times.at(time);
        let mut dark = self.mean(before)?.slice(part).to_owned();
        if share > 0.0 {
            let next = self.mean(before + 1)?;
            dark.zip_mut_with(&next.slice(part), |a, b| *a += share * (b - *a));
        }
        Ok(dark)
    }
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
        let mean = mean(stack, 0..stack.shape()[0])?;
        Ok(Self { path: stack.path().to_path_buf(), mean, series: None })
    }

    /// Darks before every `every`-th of `views` views and behind the last.
    ///
    /// # Errors
    /// As [`Dark::of`].
    pub(super) fn between(stack: StackFile, every: u32, views: usize) -> Result<Self> {
        let times = Times::simulated(every, stack.shape()[0], views);
        let dark = Self::of(&stack)?;
        let series = Some(DarkSeries { stack, times, kept: Mutex::default() });
        Ok(Self { series, ..dark })
    }
}

impl Correction {
    /// Bad pixels, where a file names them.
    pub(super) fn bad_pixels(&self) -> Option<&Array2<bool>> {
        self.bad.as_ref().map(|(_, bad)| bad)
    }

    /// Refuses a dark without a value in a pixel that is not a bad one.
    pub(super) fn check(&self) -> Result<()> {
        let Some(Dark { path, mean, .. }) = &self.dark else { return Ok(()) };
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

    /// Marks saturated and bad values in rows of frames, and subtracts the dark at their time.
    pub(super) fn apply(&self, data: &mut Array3<f32>, rows: &Range<u32>, time: f64) -> Result<()> {
        let part = s![rows.start as usize..rows.end as usize, ..];
        let series = self.dark.as_ref().and_then(|dark| dark.series.as_ref());
        let between = series.map(|series| series.at(time, rows)).transpose()?;
        let mean = self.dark.as_ref().map(|dark| dark.mean.slice(part));
        let dark: Option<ArrayView2<'_, f32>> = between.as_ref().map(|dark| dark.view()).or(mean);
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
        Ok(())
    }
}

/// Mean of all frames of some views.
fn mean(stack: &StackFile, views: Range<usize>) -> Result<Array2<f32>> {
    let [_, steps, rows, columns] = stack.shape();
    let sums = reserve::zeroed::<f64>(rows * columns, "the mean of dark frames")?;
    let mut sum = Array2::from_shape_vec((rows, columns), sums)
        .map_err(|error| Error::file(stack.path(), format!("cannot be read: {error}"), None))?;
    let all = 0..numbers::count(rows);
    for view in views.clone() {
        for step in 0..steps {
            let frame = stack.frame(view, step, all.clone())?;
            Zip::from(&mut sum).and(&frame).for_each(|sum, y| *sum += f64::from(*y));
        }
    }
    let count = (views.len() * steps) as f64;
    Ok(sum.mapv(|sum| numbers::single(sum / count)))
}
