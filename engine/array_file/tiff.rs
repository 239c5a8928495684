//! TIFF pages: one sample per pixel, strips or tiles, classic or `BigTIFF`.

use super::{LEAST, Value, refuse_hollow, refuse_shape};
use crate::numbers;
use crate::{Error, Result, input_file, reserve};
use std::fmt;
use std::fs::File;
use std::io::BufReader;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::{ColorType, TiffError};

type Pages = Decoder<BufReader<File>>;

/// A file of pages, each a frame of the same shape.
pub(crate) struct TiffPages {
    path: PathBuf,
    /// Rows and columns.
    frame: [usize; 2],
    count: usize,
    /// Knows where every page begins, so that seeking does not walk the file again.
    pages: Mutex<Pages>,
}

impl fmt::Debug for TiffPages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TiffPages")
            .field("path", &self.path)
            .field("frame", &self.frame)
            .field("count", &self.count)
            .finish_non_exhaustive()
    }
}

impl TiffPages {
    /// All pages of a file, which have one shape.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let unread = |error| failed(path, error);
        let (mut pages, frame) = first_page(path)?;
        let mut count = 1;
        while pages.more_images() {
            pages.next_image().map_err(unread)?;
            let found = frame_of(path, &mut pages)?;
            if found != frame {
                let problem = format!(
                    "has {} rows of {} columns in page {count}, counted from 0; its first page \
                     has {} rows of {}",
                    found[0], found[1], frame[0], frame[1]
                );
                return Err(Error::file(path, problem, None));
            }
            count += 1;
        }
        Ok(Self { path: path.to_path_buf(), frame, count, pages: Mutex::new(pages) })
    }

    /// The first page alone; others may have any shape.
    pub(crate) fn first(path: &Path) -> Result<Self> {
        let (pages, frame) = first_page(path)?;
        Ok(Self { path: path.to_path_buf(), frame, count: 1, pages: Mutex::new(pages) })
    }

    /// Rows and columns of a page.
    pub(crate) const fn frame_shape(&self) -> [usize; 2] {
        self.frame
    }

    /// Pages.
    pub(crate) const fn count(&self) -> usize {
        self.count
    }

    /// Some rows of a page.
    pub(crate) fn read<T: Value>(&self, page: usize, rows: Range<usize>) -> Result<Vec<T>> {
        let mut pages = self.pages.lock().unwrap_or_else(PoisonError::into_inner);
        let unread = |error| failed(&self.path, error);
        pages.seek_to_image(page).map_err(unread)?;
        refuse_shape(&self.path, frame_of(&self.path, &mut pages)?, self.frame)?;
        let columns = self.frame[1];
        let (width, height) = pages.chunk_dimensions();
        let [width, height] = [width as usize, height as usize].map(|side| side.max(1));
        let across = columns.div_ceil(width);
        let mut values =
            reserve::filled(T::rounded(f64::NAN), rows.len() * columns, "rows of a frame")?;
        for down in rows.start / height..rows.end.div_ceil(height) {
            for right in 0..across {
                let chunk = numbers::count(down * across + right);
                let wide = pages.chunk_data_dimensions(chunk).0 as usize;
                let samples: Vec<T> = numbers(pages.read_chunk(chunk).map_err(unread)?)
                    .ok_or_else(|| refused(&self.path, "samples of another type"))?;
                for (y, line) in (down * height..).zip(samples.chunks_exact(wide.max(1))) {
                    if rows.contains(&y) {
                        let start = (y - rows.start) * columns + right * width;
                        values[start..start + wide].copy_from_slice(line);
                    }
                }
            }
        }
        Ok(values)
    }
}

/// A decoder at the first page, and its rows and columns.
fn first_page(path: &Path) -> Result<(Pages, [usize; 2])> {
    let file =
        input_file::open(path).map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
    let mut limits = Limits::default();
    // Frames of 4 GiB in one strip do exist; a small file that claims one does not hold it.
    let most = 64 * file.metadata().map_or(0, |found| found.len()).max(LEAST >> 6);
    limits.decoding_buffer_size = numbers::length(most.min(1 << 32));
    let decoder = Decoder::new(BufReader::new(file)).map_err(|error| failed(path, error))?;
    let mut pages = decoder.with_limits(limits);
    let frame = frame_of(path, &mut pages)?;
    refuse_hollow(path, frame)?;
    Ok((pages, frame))
}

/// Rows and columns of the page in turn; refuses what is not one number per pixel.
fn frame_of(path: &Path, pages: &mut Pages) -> Result<[usize; 2]> {
    match pages.colortype().map_err(|error| failed(path, error))? {
        ColorType::Gray(8 | 16 | 32 | 64) => {}
        other => return Err(refused(path, &format!("{other:?} pixels"))),
    }
    let (columns, rows) = pages.dimensions().map_err(|error| failed(path, error))?;
    Ok([rows as usize, columns as usize])
}

fn numbers<T: Value>(samples: DecodingResult) -> Option<Vec<T>> {
    fn all<S: Into<f64>, T: Value>(samples: Vec<S>) -> Vec<T> {
        samples.into_iter().map(|sample| T::rounded(sample.into())).collect()
    }
    Some(match samples {
        DecodingResult::F32(samples) => all(samples),
        DecodingResult::F64(samples) => all(samples),
        DecodingResult::U8(samples) => all(samples),
        DecodingResult::U16(samples) => all(samples),
        DecodingResult::U32(samples) => all(samples),
        DecodingResult::I8(samples) => all(samples),
        DecodingResult::I16(samples) => all(samples),
        DecodingResult::I32(samples) => all(samples),
        _ => return None,
    })
}

fn refused(path: &Path, found: &str) -> Error {
    let problem = format!(
        "has {found}; allowed is one sample per pixel: f32, f64, or whole numbers of 8, 16 or 32 bits"
    );
    Error::file(path, problem, None)
}

fn failed(path: &Path, error: TiffError) -> Error {
    match error {
        TiffError::IoError(source) => {
            Error::file(path, "cannot be read (cut short?)", Some(source))
        }
        other => Error::file(path, format!("is no TIFF that can be read: {other}"), None),
    }
}
