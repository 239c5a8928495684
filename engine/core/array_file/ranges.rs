//! Files whose values have their places before any is written: a header, and the frames behind it.
//!
//! A file is made at its full length. Ranges of rows are written at their offsets in any order, also
//! by several processes.

use super::file::{header, volume_header};
use super::format::Format;
use super::parts::{Sample, unwritten};
use crate::{Error, Result, input_file, numbers, open_file};
use ndarray::ArrayView2;
use sha2::{Digest, Sha256};
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Bytes hashed at a time.
const BLOCK: usize = 1 << 20;

/// Places of the values of a file.
#[derive(Debug, Clone)]
pub struct RangeLayout {
    /// Bytes before the values; none in memory once a file was opened.
    header: Vec<u8>,
    /// Their number.
    start: u64,
    sample: Sample,
    frames: u64,
    rows: u32,
    columns: u32,
}

impl RangeLayout {
    /// The layout of an array with these sides, the slowest first, two at least, and pixels of this
    /// size, x and z, m; `None` where the format has no such files.
    pub fn new(format: Format, sides: &[u32], pitch: [f64; 2], sample: Sample) -> Option<Self> {
        let [before @ .., rows, columns] = sides else { return None };
        let frames = before.iter().map(|side| u64::from(*side)).product();
        let header = header(format, sides, pitch, sample)?;
        let start = header.len() as u64;
        Some(Self { header, start, sample, frames, rows: *rows, columns: *columns })
    }

    /// The layout of a volume `[z][y][x]` with these sides and voxels, x, y, z, m; `None` where the format
    /// has no such files.
    pub fn volume(
        format: Format,
        sides: [u32; 3],
        voxel: [f64; 3],
        sample: Sample,
    ) -> Option<Self> {
        let header = volume_header(format, sides, voxel, sample)?;
        let (start, [slices, rows, columns]) = (header.len() as u64, sides);
        Some(Self { header, start, sample, frames: slices.into(), rows, columns })
    }

    fn row_bytes(&self) -> u64 {
        self.sample.bytes() * u64::from(self.columns)
    }

    fn frame_bytes(&self) -> u64 {
        self.row_bytes() * u64::from(self.rows)
    }

    /// Bytes of the file.
    fn len(&self) -> u64 {
        self.start + self.frames * self.frame_bytes()
    }

    /// Creates the file, or opens one that was made with this layout.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn open(mut self, path: PathBuf) -> Result<RangeFile> {
        let create = || {
            let mut options = OpenOptions::new();
            let mut file = options.create(true).truncate(false).write(true).open(&path)?;
            // Of a file that is longer or shorter the views stay that are whole.
            if file.metadata()?.len() != self.len() {
                file.set_len(self.len())?;
            }
            file.write_all(&self.header)?;
            Ok(file)
        };
        let file =
            create().map_err(|error| Error::file(&path, "cannot be created", Some(error)))?;
        self.header = Vec::new();
        Ok(RangeFile { file, path, layout: self })
    }

    /// Difference of a file from this layout in header or length, without its name.
    pub fn problem(&self, path: &Path) -> Option<String> {
        let read = || {
            let mut file = input_file::open(path)?;
            let mut found = vec![0_u8; self.header.len()];
            let found_len = file.metadata()?.len();
            file.read_exact(&mut found).map(|()| (found_len, found == self.header))
        };
        let problem = match read() {
            Ok((found, true)) if found == self.len() => return None,
            Ok((found, true)) => format!("has {found} bytes; {} were written", self.len()),
            Ok((_, false)) => "has another header than was written".to_owned(),
            Err(error) => format!("cannot be read: {error}"),
        };
        Some(problem)
    }

    /// Adds some frames of a file to a checksum, as f32 values whatever the samples.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn hash(&self, path: &Path, frames: Range<u64>, to: &mut Sha256) -> Result<()> {
        let mut left = (frames.end - frames.start) * self.frame_bytes();
        let mut read = || {
            let mut file = input_file::open(path)?;
            let mut block = vec![0_u8; BLOCK];
            file.seek(SeekFrom::Start(self.start + frames.start * self.frame_bytes()))?;
            while left > 0 {
                let len = usize::try_from(left).map_or(BLOCK, |left| left.min(BLOCK));
                file.read_exact(&mut block[..len])?;
                match self.sample {
                    Sample::F32 => to.update(&block[..len]),
                    Sample::U16 => block[..len].as_chunks().0.iter().for_each(|bytes| {
                        to.update(f32::from(u16::from_le_bytes(*bytes)).to_le_bytes());
                    }),
                    Sample::U32 => block[..len].as_chunks().0.iter().for_each(|bytes| {
                        let value = f64::from(u32::from_le_bytes(*bytes));
                        to.update(numbers::single(value).to_le_bytes());
                    }),
                }
                left -= len as u64;
            }
            Ok(())
        };
        read().map_err(|error| Error::file(path, "cannot be read", Some(error)))
    }
}

/// A file that takes ranges of rows.
#[derive(Debug)]
pub struct RangeFile {
    file: File,
    path: PathBuf,
    layout: RangeLayout,
}

impl RangeFile {
    /// Writes rows of a frame, from `row` on.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::Memory`].
    pub fn write(&mut self, frame: u64, row: u32, rows: ArrayView2<'_, f32>) -> Result<()> {
        let layout = &self.layout;
        let bytes = layout.sample.encode(rows.iter().copied())?;
        let offset =
            layout.start + frame * layout.frame_bytes() + u64::from(row) * layout.row_bytes();
        self.file
            .seek(SeekFrom::Start(offset))
            .and_then(|_| self.file.write_all(&bytes))
            .map_err(|error| unwritten(&self.path, error))
    }

    /// Copies frames from a file with frames of the same shape and samples to those from `first` on.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn copy(
        &mut self,
        first: u64,
        (path, layout): (&Path, &RangeLayout),
        frames: Range<u64>,
    ) -> Result<()> {
        let unread = |error| Error::file(path, "cannot be read", Some(error));
        let mut from = input_file::open(path).map_err(unread)?;
        let bytes = layout.frame_bytes();
        from.seek(SeekFrom::Start(layout.start + frames.start * bytes)).map_err(unread)?;
        let to = self.layout.start + first * bytes;
        self.file.seek(SeekFrom::Start(to)).map_err(|error| unwritten(&self.path, error))?;
        let mut block = vec![0_u8; BLOCK];
        let mut left = (frames.end - frames.start) * bytes;
        while left > 0 {
            let len = usize::try_from(left).map_or(BLOCK, |left| left.min(BLOCK));
            from.read_exact(&mut block[..len]).map_err(unread)?;
            self.file.write_all(&block[..len]).map_err(|error| unwritten(&self.path, error))?;
            left -= len as u64;
        }
        Ok(())
    }

    /// Syncs the file; the checksum of some frames as they are in the file is added.
    ///
    /// # Errors
    /// [`Error::File`], also where the file is no longer at its path.
    pub fn sync(&self, frames: Range<u64>, to: &mut Sha256) -> Result<()> {
        self.refuse_moved()?;
        let synced = self.file.sync_data();
        synced.map_err(|error| Error::file(&self.path, "cannot be synced", Some(error)))?;
        self.layout.hash(&self.path, frames, to)
    }

    /// Refuses a file that is not where it was opened.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn refuse_moved(&self) -> Result<()> {
        open_file::refuse_moved(&self.file, &self.path, open_file::RESUME)
    }
}
