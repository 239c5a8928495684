//! Frames in one file per stack: preallocated, views written at their offsets, as NPY or TIFF.
//!
//! A file is a header and the values `[view][step][row][column]` behind it. Until a run is done the
//! views that are not committed read as zero or as a part; progress.log lists those that count.

use super::exr_frames::Values;
use super::npy::{self, hex, le_bytes};
use super::tiff_header::{self, Sample};
use super::{Exposure, Format, StackShape};
use crate::scene::Scene;
use crate::{Error, Result, input_file, numbers, open_file, reserve};
use ndarray::ArrayView3;
use sha2::{Digest, Sha256};
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Bytes hashed at a time.
const BLOCK: usize = 1 << 20;

/// Names of the files of a run directory, and of its counts.
pub(super) const FILES: [&str; 6] =
    ["flat.npy", "sample.npy", "dark.npy", "flat.tif", "sample.tif", "dark.tif"];

/// How the stacks of a run lie in their files.
#[derive(Debug, Clone, Copy)]
pub(super) struct ArrayLayout {
    extent: StackShape,
    kind: Kind,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Npy,
    Tiff {
        /// Of a pixel, x and z, m.
        pitch: [f64; 2],
        intensities: Sample,
        numbers: Sample,
    },
}

impl ArrayLayout {
    /// The layout of a run of `scene`; `None` where the format has a file for every frame.
    pub(super) fn of(format: Format, extent: StackShape, scene: &Scene) -> Option<Self> {
        let kind = match format {
            Format::Exr => return None,
            Format::Npy => Kind::Npy,
            Format::Tiff => {
                let bits = scene.detector.counts.and_then(|counts| counts.bit_depth);
                let is_short = bits.is_some_and(|bits| bits <= 16);
                let numbers = if is_short { Sample::U16 } else { Sample::F32 };
                Kind::Tiff { pitch: scene.detector.pitch, intensities: Sample::F32, numbers }
            }
        };
        Some(Self { extent, kind })
    }

    /// The file of a view.
    fn name(self, view: Exposure) -> &'static str {
        let [flat, sample, dark] = match self.kind {
            Kind::Npy => [FILES[0], FILES[1], FILES[2]],
            Kind::Tiff { .. } => [FILES[3], FILES[4], FILES[5]],
        };
        match view {
            Exposure::Flat => flat,
            Exposure::Sample(_) => sample,
            Exposure::Dark => dark,
        }
    }

    /// Samples of a stack. Dark frames are numbers, and stand beside the intensities.
    fn sample(self, view: Exposure, values: Values) -> Sample {
        match self.kind {
            Kind::Npy => Sample::F32,
            Kind::Tiff { numbers, .. } if view == Exposure::Dark || values == Values::Numbers => {
                numbers
            }
            Kind::Tiff { intensities, .. } => intensities,
        }
    }

    fn header(self, view: Exposure, values: Values) -> Vec<u8> {
        let views = match view {
            Exposure::Sample(_) => Some(self.extent.views),
            Exposure::Flat | Exposure::Dark => None,
        };
        match self.kind {
            Kind::Npy => npy::stack_header(self.extent, views),
            Kind::Tiff { pitch, .. } => {
                let sample = self.sample(view, values);
                tiff_header::header(self.extent, views.unwrap_or(1), pitch, sample)
            }
        }
    }

    /// Bytes of a view.
    fn view_bytes(self, sample: Sample) -> u64 {
        self.extent.view_bytes() / 4 * sample.bytes()
    }

    /// Bytes of all views of a file.
    fn value_bytes(self, view: Exposure, values: Values) -> u64 {
        let views = if matches!(view, Exposure::Sample(_)) { self.extent.views } else { 1 };
        self.view_bytes(self.sample(view, values)) * u64::from(views)
    }
}

/// The stacks under a folder of a run, in one file each.
#[derive(Debug)]
pub(super) struct ArrayFrames {
    root: PathBuf,
    layout: ArrayLayout,
    values: Values,
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

impl ArrayFrames {
    /// Creates the files, or opens those of a run that is resumed; with one for dark frames where
    /// there are any.
    pub(super) fn begin(
        root: &Path,
        layout: ArrayLayout,
        values: Values,
        dark: bool,
    ) -> Result<Self> {
        let open = |view| {
            let path = root.join(layout.name(view));
            Array::open(path, &layout.header(view, values), layout.value_bytes(view, values))
        };
        Ok(Self {
            flat: open(Exposure::Flat)?,
            sample: open(Exposure::Sample(0))?,
            dark: if dark { Some(open(Exposure::Dark)?) } else { None },
            root: root.to_path_buf(),
            layout,
            values,
        })
    }

    pub(super) fn write(
        &mut self,
        view: Exposure,
        rows: &Range<u32>,
        data: ArrayView3<'_, f32>,
    ) -> Result<()> {
        let sample = self.layout.sample(view, self.values);
        let extent = self.layout.extent;
        let row_bytes = sample.bytes() * u64::from(extent.columns);
        let frame_bytes = row_bytes * u64::from(extent.rows);
        let (array, start) = self.locate(view)?;
        let mut offset = start + row_bytes * u64::from(rows.start);
        for frame in data.outer_iter() {
            let bytes = match sample {
                Sample::F32 => le_bytes(frame.iter().copied())?,
                Sample::U16 => short_bytes(frame.iter().copied())?,
            };
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
        array.refuse_moved()?;
        let synced = array.file.sync_data();
        synced.map_err(|error| Error::file(&array.path, "cannot be synced", Some(error)))?;
        checksum(&self.root, self.layout, self.values, view)
    }

    /// Refuses files that are not where they were opened.
    pub(super) fn refuse_moved(&self) -> Result<()> {
        let all = [Some(&self.flat), Some(&self.sample), self.dark.as_ref()];
        all.into_iter().flatten().try_for_each(Array::refuse_moved)
    }

    /// The file of a view and the offset of its first value.
    fn locate(&mut self, view: Exposure) -> Result<(&mut Array, u64)> {
        let bytes = self.layout.view_bytes(self.layout.sample(view, self.values));
        let (array, index) = match view {
            Exposure::Flat => (&mut self.flat, 0),
            Exposure::Sample(index) => (&mut self.sample, index),
            Exposure::Dark => match &mut self.dark {
                Some(dark) => (dark, 0),
                None => return Err(Error::file(&self.root, "has no dark frames", None)),
            },
        };
        let start = array.header + bytes * u64::from(index);
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

    fn refuse_moved(&self) -> Result<()> {
        open_file::refuse_moved(&self.file, &self.path, open_file::RESUME)
    }
}

/// Files under `root` that do not have the header and the length that they were made with, one
/// message each; with the file of dark frames where there is one.
pub(super) fn header_problems(
    root: &Path,
    layout: ArrayLayout,
    values: Values,
    dark: bool,
) -> Vec<String> {
    let mut stacks = vec![Exposure::Flat, Exposure::Sample(0)];
    if dark {
        stacks.push(Exposure::Dark);
    }
    let problem = |view: Exposure| {
        let path = root.join(layout.name(view));
        let header = layout.header(view, values);
        let len = header.len() as u64 + layout.value_bytes(view, values);
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
    stacks.into_iter().filter_map(problem).collect()
}

/// SHA-256 of a view, as f32 values whatever the samples, as it stands in the files under `root`.
pub(super) fn checksum(
    root: &Path,
    layout: ArrayLayout,
    values: Values,
    view: Exposure,
) -> Result<String> {
    let sample = layout.sample(view, values);
    let index = if let Exposure::Sample(index) = view { index } else { 0 };
    let path = root.join(layout.name(view));
    let header = layout.header(view, values).len() as u64;
    let start = header + layout.view_bytes(sample) * u64::from(index);
    let read = || {
        let mut file = input_file::open(&path)?;
        let mut hasher = Sha256::new();
        let mut block = vec![0_u8; BLOCK];
        let mut left = layout.view_bytes(sample);
        file.seek(SeekFrom::Start(start))?;
        while left > 0 {
            let len = usize::try_from(left).map_or(BLOCK, |left| left.min(BLOCK));
            file.read_exact(&mut block[..len])?;
            match sample {
                Sample::F32 => hasher.update(&block[..len]),
                Sample::U16 => block[..len].as_chunks().0.iter().for_each(|bytes| {
                    hasher.update(f32::from(u16::from_le_bytes(*bytes)).to_le_bytes());
                }),
            }
            left -= len as u64;
        }
        Ok(hex(&hasher.finalize()))
    };
    read().map_err(|error| Error::file(&path, "cannot be read", Some(error)))
}

/// Whole numbers of up to 16 bits as little-endian bytes.
fn short_bytes(values: impl ExactSizeIterator<Item = f32>) -> Result<Vec<u8>> {
    let mut bytes = reserve::room(2 * values.len(), "a frame as bytes")?;
    let short = |value: f32| numbers::whole::<u16>(f64::from(value).round()).to_le_bytes();
    bytes.extend(values.flat_map(short));
    Ok(bytes)
}
