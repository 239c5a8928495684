//! NPY: one file per stack, preallocated, views written at their offsets.
//!
//! Version 1.0 of the format with the header padded to 64 bytes, f32 little endian, C order:
//! numpy, and everything that memory-maps, reads it as it is. Until a run is done the views
//! that are not committed read as zero or as a part; progress.log lists those that count.

use super::{Exposure, StackShape};
use crate::{Error, Result, input_file, reserve};
use ndarray::ArrayView3;
use sha2::{Digest, Sha256};
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// File of the flat, (S, R, C).
pub(super) const FLAT: &str = "flat.npy";
/// File of the sample stacks, (V, S, R, C).
pub(super) const SAMPLE: &str = "sample.npy";

/// Bytes hashed at a time.
const BLOCK: usize = 1 << 20;

/// File of the dark frames, (S, R, C).
pub(super) const DARK: &str = "dark.npy";

/// flat.npy, sample.npy and dark.npy of a run directory.
#[derive(Debug)]
pub(super) struct NpyFrames {
    root: PathBuf,
    extent: StackShape,
    flat: Array,
    sample: Array,
    dark: Option<Array>,
}

#[derive(Debug)]
struct Array {
    file: File,
    path: PathBuf,
    /// Bytes before the first value.
    header: u64,
}

impl NpyFrames {
    /// Creates the files, or opens those of a run that is resumed; with one for dark frames where
    /// there are any.
    pub(super) fn begin(root: &Path, extent: StackShape, dark: bool) -> Result<Self> {
        let flat_bytes = extent.view_bytes();
        let sample_bytes = flat_bytes * u64::from(extent.views);
        let [flat, sample] = headers(extent);
        Ok(Self {
            root: root.to_path_buf(),
            extent,
            flat: Array::open(root.join(FLAT), &flat, flat_bytes)?,
            sample: Array::open(root.join(SAMPLE), &sample, sample_bytes)?,
            dark: match dark {
                true => Some(Array::open(root.join(DARK), &flat, flat_bytes)?),
                false => None,
            },
        })
    }

    pub(super) fn write(
        &mut self,
        view: Exposure,
        rows: &Range<u32>,
        data: ArrayView3<'_, f32>,
    ) -> Result<()> {
        let row_bytes = 4 * u64::from(self.extent.columns);
        let frame_bytes = self.extent.frame_bytes();
        let (array, start) = self.locate(view)?;
        let mut offset = start + row_bytes * u64::from(rows.start);
        for frame in data.outer_iter() {
            let bytes = le_bytes(frame.iter().copied())?;
            array
                .file
                .seek(SeekFrom::Start(offset))
                .and_then(|_| array.file.write_all(&bytes))
                .map_err(|error| Error::file(&array.path, "cannot be written", Some(error)))?;
            offset += frame_bytes;
        }
        Ok(())
    }

    /// Syncs the view; its checksum.
    pub(super) fn commit(&mut self, view: Exposure) -> Result<String> {
        let (array, _) = self.locate(view)?;
        let synced = array.file.sync_data();
        synced.map_err(|error| Error::file(&array.path, "cannot be synced", Some(error)))?;
        checksum(&self.root, self.extent, view)
    }

    /// The file of a view and the offset of its first value.
    fn locate(&mut self, view: Exposure) -> Result<(&mut Array, u64)> {
        let (array, index) = match view {
            Exposure::Flat => (&mut self.flat, 0),
            Exposure::Sample(index) => (&mut self.sample, index),
            Exposure::Dark => match &mut self.dark {
                Some(dark) => (dark, 0),
                None => return Err(Error::file(&self.root, "has no dark frames", None)),
            },
        };
        let start = array.header + self.extent.view_bytes() * u64::from(index);
        Ok((array, start))
    }
}

impl Array {
    fn open(path: PathBuf, header: &[u8], value_bytes: u64) -> Result<Self> {
        let len = header.len() as u64 + value_bytes;
        let create = || {
            let mut options = OpenOptions::new();
            let mut file = options.create(true).truncate(false).write(true).open(&path)?;
            // Of a file that is longer or shorter the views stay that are whole.
            if file.metadata()?.len() != len {
                file.set_len(len)?;
            }
            file.write_all(header)?;
            Ok(file)
        };
        let file =
            create().map_err(|error| Error::file(&path, "cannot be created", Some(error)))?;
        Ok(Self { file, path, header: header.len() as u64 })
    }
}

/// Files under `root` that do not have the header and the length that they were made with, one
/// message each; with the file of dark frames where there is one.
pub(super) fn header_problems(root: &Path, extent: StackShape, dark: bool) -> Vec<String> {
    let [flat, sample] = headers(extent);
    let flat_bytes = extent.view_bytes();
    let mut files =
        vec![(FLAT, &flat, flat_bytes), (SAMPLE, &sample, flat_bytes * u64::from(extent.views))];
    if dark {
        files.push((DARK, &flat, flat_bytes));
    }
    let problem = |(name, header, bytes): (&str, &Vec<u8>, u64)| {
        let path = root.join(name);
        let len = header.len() as u64 + bytes;
        let read = || {
            let mut file = input_file::open(&path)?;
            let mut found = vec![0_u8; header.len()];
            let found_len = file.metadata()?.len();
            file.read_exact(&mut found).map(|()| (found_len, found == *header))
        };
        match read() {
            Ok((found, true)) if found == len => None,
            Ok((found, true)) => Some(format!("has {found} bytes; {len} were written")),
            Ok((_, false)) => Some("has another header than was written".to_owned()),
            Err(error) => Some(format!("cannot be read: {error}")),
        }
        .map(|problem| format!("{}: {problem}", path.display()))
    };
    files.into_iter().filter_map(problem).collect()
}

/// SHA-256 of a view as it stands in the files under `root`.
pub(super) fn checksum(root: &Path, extent: StackShape, view: Exposure) -> Result<String> {
    let [flat, sample] = headers(extent);
    let (name, header, start) = match view {
        Exposure::Flat => (FLAT, flat, 0),
        Exposure::Dark => (DARK, flat, 0),
        Exposure::Sample(index) => (SAMPLE, sample, extent.view_bytes() * u64::from(index)),
    };
    let path = root.join(name);
    let read = || {
        let mut file = input_file::open(&path)?;
        let mut hasher = Sha256::new();
        let mut block = vec![0_u8; BLOCK];
        let mut left = extent.view_bytes();
        file.seek(SeekFrom::Start(header.len() as u64 + start))?;
        while left > 0 {
            let len = usize::try_from(left).map_or(BLOCK, |left| left.min(BLOCK));
            file.read_exact(&mut block[..len])?;
            hasher.update(&block[..len]);
            left -= len as u64;
        }
        Ok(hex(&hasher.finalize()))
    };
    read().map_err(|error| Error::file(&path, "cannot be read", Some(error)))
}

/// Headers of flat.npy and sample.npy.
fn headers(extent: StackShape) -> [Vec<u8>; 2] {
    let StackShape { views, steps, rows, columns } = extent;
    let flat = format!("{steps}, {rows}, {columns}");
    [header(&flat), header(&format!("{views}, {flat}"))]
}

/// Header of version 1.0: magic, version, length, a Python dict padded with spaces so that the
/// values start at a multiple of 64 bytes. `shape` has commas between its numbers, at least two.
fn header(shape: &str) -> Vec<u8> {
    const BEFORE_DICT: usize = 10;
    let mut dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
    let end = (BEFORE_DICT + dict.len() + 1).next_multiple_of(64);
    dict.push_str(&" ".repeat(end - BEFORE_DICT - dict.len() - 1));
    dict.push('\n');
    // At most four numbers of ten digits each: the dict never comes near 64 KiB.
    let len = u16::try_from(dict.len()).unwrap_or(u16::MAX);
    [b"\x93NUMPY\x01\x00".as_slice(), &len.to_le_bytes(), dict.as_bytes()].concat()
}

/// Header of an array with two sides or more.
pub(crate) fn npy_header(sides: &[usize]) -> Vec<u8> {
    let shape: Vec<String> = sides.iter().map(usize::to_string).collect();
    header(&shape.join(", "))
}

/// Values as little-endian bytes.
///
/// # Errors
/// [`Error::Memory`].
pub(crate) fn le_bytes(values: impl ExactSizeIterator<Item = f32>) -> Result<Vec<u8>> {
    let mut bytes = reserve::room(4 * values.len(), "a frame as bytes")?;
    bytes.extend(values.flat_map(f32::to_le_bytes));
    Ok(bytes)
}

/// Lower-case hexadecimal.
pub(super) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
