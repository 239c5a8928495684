//! TIFF pages: one sample per pixel, strips or tiles, classic or `BigTIFF`. Samples are the numbers
//! that are stored, whether black or white is zero. Pages that are reduced copies of others are no
//! frames. Files with a single directory may have further frames behind the first, where the description
//! has their number (`described`).

use super::described::Described;
use super::one_directory::{self, Behind};
use super::stored::{self, Replaced};
use crate::array_file::limits::{LEAST, refuse_hollow, refuse_shape};
use crate::array_file::parts::Value;
use crate::{Error, Result, input_file, numbers, reserve};
use std::fmt;
use std::fs::File;
use std::io::BufReader;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError, TiffResult};

pub(super) type Pages = Decoder<Replaced<BufReader<File>>>;

/// A file of pages, each a frame of the same shape.
pub struct TiffPages {
    path: PathBuf,
    /// Rows and columns.
    frame: [usize; 2],
    /// Places of the frames among all pages.
    frames: Vec<usize>,
    /// Frames behind the first, which have no directory.
    behind: Option<Behind>,
    /// Pages that are reduced copies of others.
    reduced: usize,
    /// True if values of the first frame have 8 bits.
    has_bytes: bool,
    /// Knows where every page begins, so that seeking does not walk the file again.
    pages: Mutex<Pages>,
}

impl fmt::Debug for TiffPages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TiffPages")
            .field("path", &self.path)
            .field("frame", &self.frame)
            .field("count", &self.count())
            .finish_non_exhaustive()
    }
}

impl TiffPages {
    /// All frames of a file, which have one shape.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let unread = |error| failed(path, error);
        let mut all = Self::first(path)?;
        let pages = all.pages.get_mut().unwrap_or_else(PoisonError::into_inner);
        let described = Described::of(pages, all.frame).map_err(unread)?;
        let mut page = all.frames[0];
        while pages.more_images() {
            pages.next_image().map_err(unread)?;
            page += 1;
            if is_reduced(pages).map_err(unread)? {
                all.reduced += 1;
                continue;
            }
            let found = frame_of(path, pages)?;
            if found != all.frame {
                let problem = format!(
                    "has {} rows of {} columns in page {page}, counted from 0; its first frame \
                     has {} rows of {}",
                    found[0], found[1], all.frame[0], all.frame[1]
                );
                return Err(Error::file(path, problem, None));
            }
            all.frames.push(page);
        }
        all.take_described(described)?;
        Ok(all)
    }

    /// Adds the frames that have no directory, as far as the description counts them.
    fn take_described(&mut self, described: Option<Described>) -> Result<()> {
        let count = self.frames.len() as u64;
        let refused = |problem: String| Err(Error::file(&self.path, problem, None));
        let pages = self.pages.get_mut().unwrap_or_else(PoisonError::into_inner);
        let unread = |error| failed(&self.path, error);
        match described {
            Some(Described::Set(0)) => {
                return refused(format!(
                    "is a part of an OME set with {count} frames, which another file of it describes; allowed: \
                     all frames in one file"
                ));
            }
            Some(Described::Set(all)) if all > count => {
                return refused(format!(
                    "has {count} of the {all} frames that its OME-XML counts, the others in other files; \
                     allowed: all frames in one file"
                ));
            }
            Some(Described::Here(images, words)) if images != count => {
                if count > 1 && !words.starts_with("images") {
                    return Ok(());
                }
                stored::seek(pages, self.frames[0]).map_err(unread)?;
                let found = match count {
                    1 => Behind::of(pages, &self.path, images).map_err(unread)?,
                    count => Err(format!("it has directories of {count}")),
                };
                match found {
                    Ok(behind) => self.behind = Some(behind),
                    Err(found) => {
                        return refused(format!("has {words} in its description, and {found}"));
                    }
                }
            }
            Some(Described::Here(..)) | None if count == 1 => {
                stored::seek(pages, self.frames[0]).map_err(unread)?;
                let more = one_directory::unread(pages, &self.path).map_err(unread)?;
                if more > 0 {
                    return refused(format!(
                        "has one directory, of one frame, and values of {more} more behind it that its \
                         description does not count; allowed: a directory for each frame"
                    ));
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The first frame alone.
    fn first(path: &Path) -> Result<Self> {
        let unread = |error| failed(path, error);
        let mut pages = decoder(path)?;
        let mut reduced = 0;
        while is_reduced(&mut pages).map_err(unread)? {
            reduced += 1;
            if !pages.more_images() {
                let problem = format!(
                    "holds {reduced} reduced copies of pages (NewSubfileType 1, thumbnails) and no \
                     frame"
                );
                return Err(Error::file(path, problem, None));
            }
            pages.next_image().map_err(unread)?;
        }
        let frame = frame_of(path, &mut pages)?;
        refuse_hollow(path, frame)?;
        let frames = vec![reduced];
        let has_bytes = matches!(pages.colortype(), Ok(ColorType::Gray(8)));
        let (path, pages) = (path.to_path_buf(), Mutex::new(pages));
        Ok(Self { path, frame, frames, behind: None, reduced, has_bytes, pages })
    }

    /// Rows and columns of a frame.
    pub(crate) const fn frame_shape(&self) -> [usize; 2] {
        self.frame
    }

    /// Frames.
    pub(crate) const fn count(&self) -> usize {
        match &self.behind {
            Some(behind) => behind.frames,
            None => self.frames.len(),
        }
    }

    /// Pages that are reduced copies of others, and no frames.
    pub(crate) const fn reduced(&self) -> usize {
        self.reduced
    }

    /// True if values of the first frame have 8 bits.
    pub(crate) const fn has_bytes(&self) -> bool {
        self.has_bytes
    }

    /// Some rows of a frame.
    pub(crate) fn read<T: Value>(&self, frame: usize, rows: Range<usize>) -> Result<Vec<T>> {
        let mut pages = self.pages.lock().unwrap_or_else(PoisonError::into_inner);
        let unread = |error| failed(&self.path, error);
        let in_directory = if self.behind.is_some() { 0 } else { frame };
        let page = self.frames.get(in_directory).copied().unwrap_or(usize::MAX);
        stored::seek(&mut pages, page).map_err(unread)?;
        if let Some(behind) = &self.behind {
            behind.go_to(&mut pages, frame);
        }
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

/// A decoder at the first page.
fn decoder(path: &Path) -> Result<Pages> {
    let file =
        input_file::open(path).map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
    let mut limits = Limits::default();
    // Frames of 4 GiB in one strip do exist; a small file that claims one does not hold it.
    let most = 64 * file.metadata().map_or(0, |found| found.len()).max(LEAST >> 6);
    limits.decoding_buffer_size = numbers::length(most.min(1 << 32));
    let file = Replaced::new(BufReader::new(file));
    let decoder = Decoder::new(file).map_err(|error| failed(path, error))?;
    Ok(decoder.with_limits(limits))
}

/// True if the page in turn is a reduced copy of another: a thumbnail, or a level of a pyramid.
fn is_reduced(pages: &mut Pages) -> TiffResult<bool> {
    let kind = pages.find_tag_unsigned::<u32>(Tag::NewSubfileType)?;
    let old_kind = pages.find_tag_unsigned::<u32>(Tag::SubfileType)?;
    Ok(kind.is_some_and(|kind| kind & 1 != 0) || old_kind == Some(2))
}

/// Rows and columns of the page in turn; refuses pages without one number per pixel.
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
        "has {found}; allowed: one sample per pixel: f32, f64, or whole numbers of 8, 16 or 32 bits"
    );
    Error::file(path, problem, None)
}

fn failed(path: &Path, error: TiffError) -> Error {
    match error {
        TiffError::IoError(source) => {
            Error::file(path, "cannot be read (cut short?)", Some(source))
        }
        other => Error::file(path, format!("is not a readable TIFF file: {other}"), None),
    }
}
