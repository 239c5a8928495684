//! Files of any format, by the format: the only place that chooses the code of one.

use super::exr::{self, ExrFrame};
use super::npy::{self, NpyFile};
use super::parts::{Append, Sample, Value};
use super::tiff::{self, TiffPages};
use super::{format::Format, limits};
use crate::{Error, Result, numbers};
use std::ops::Range;
use std::path::Path;

/// Frames of a file that was opened to be read.
#[derive(Debug)]
pub enum ArrayFile {
    /// OpenEXR.
    Exr(ExrFrame),
    /// NumPy.
    Npy(NpyFile),
    /// TIFF, one frame a page.
    Tiff(Box<TiffPages>),
}

impl ArrayFile {
    /// Opens a file of a format: reads its header, no values.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn open(path: &Path, format: Format) -> Result<Self> {
        Ok(match format {
            Format::Exr => Self::Exr(ExrFrame::open(path)?),
            Format::Npy => Self::Npy(NpyFile::open(path)?),
            Format::Tiff => Self::Tiff(Box::new(TiffPages::open(path)?)),
        })
    }

    /// Some rows of the one frame of a file, which has this shape.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn read_frame<T: Value>(
        path: &Path,
        format: Format,
        frame: [usize; 2],
        rows: Range<usize>,
    ) -> Result<Vec<T>> {
        let file = match format {
            Format::Exr => return exr::read(path, frame, rows),
            _ => Self::open(path, format)?,
        };
        let (count, found) = file.frames();
        if count != 1 {
            let problem =
                format!("has {count} frames; allowed in a folder of frames: one per file");
            return Err(Error::file(path, problem, None));
        }
        limits::refuse_shape(path, found, frame)?;
        file.read(0, rows)
    }

    /// Sides of the array, the slowest first; pages are one side.
    pub fn sides(&self) -> Vec<u64> {
        let of_frames = |count: usize, [rows, columns]: [usize; 2]| {
            let sides = [count, rows, columns].map(|side| side as u64);
            sides[usize::from(count == 1)..].to_vec()
        };
        match self {
            Self::Exr(frame) => of_frames(1, frame.shape()),
            Self::Npy(file) => file.sides().to_vec(),
            Self::Tiff(pages) => of_frames(pages.count(), pages.frame_shape()),
        }
    }

    /// Number of frames, and the rows and columns of one.
    pub fn frames(&self) -> (usize, [usize; 2]) {
        let sides = self.sides();
        let mut sides = sides.iter().rev().map(|side| numbers::length(*side));
        let [columns, rows] = [sides.next(), sides.next()].map(|side| side.unwrap_or(1));
        (sides.product(), [rows, columns])
    }

    /// True if the first side is the fastest.
    pub const fn is_fortran(&self) -> bool {
        matches!(self, Self::Npy(file) if file.is_fortran())
    }

    /// Pages that are skipped: reduced copies of others.
    pub const fn skipped(&self) -> usize {
        match self {
            Self::Tiff(pages) => pages.reduced(),
            _ => 0,
        }
    }

    /// True if values have 8 bits.
    pub const fn has_bytes(&self) -> bool {
        match self {
            Self::Exr(_) => false,
            Self::Npy(file) => file.has_bytes(),
            Self::Tiff(pages) => pages.has_bytes(),
        }
    }

    /// True if a few rows cost no more than their share: nothing is decoded whole.
    pub const fn reads_any_rows(&self) -> bool {
        matches!(self, Self::Npy(_))
    }

    /// Some rows of a frame, counted over all sides but the last two.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::Memory`].
    pub fn read<T: Value>(&self, frame: usize, rows: Range<usize>) -> Result<Vec<T>> {
        match self {
            Self::Exr(file) => file.read(rows),
            Self::Npy(file) => {
                let (_, [row_count, columns]) = self.frames();
                let first = (frame * row_count + rows.start) as u64 * columns as u64;
                file.read(first, rows.len() * columns)
            }
            Self::Tiff(pages) => pages.read(frame, rows),
        }
    }
}

/// Begins a file that takes frames one after another: number, rows and columns. `pitch`: of a pixel, x
/// and z, m, where it has one and the format holds it.
///
/// # Errors
/// [`Error::File`].
pub fn append(
    path: &Path,
    format: Format,
    sides: [u32; 3],
    pitch: Option<[f64; 2]>,
    sample: Sample,
) -> Result<Box<dyn Append>> {
    match format {
        Format::Exr => Ok(exr::append(path, sample)),
        Format::Npy => npy::append(path, sides, sample),
        Format::Tiff => tiff::append(path, sides, pitch, sample),
    }
}

/// Bytes before the values of a file whose values have their places in advance: an array with these
/// sides, the slowest first, and pixels of this size, x and z, m. `None` where the format has no such
/// files.
pub(super) fn header(
    format: Format,
    sides: &[u32],
    pitch: [f64; 2],
    sample: Sample,
) -> Option<Vec<u8>> {
    match format {
        Format::Exr => None,
        Format::Npy => Some(npy::header(sides, sample)),
        Format::Tiff => Some(tiff::header(sides, pitch, sample)),
    }
}

/// As [`header`], of a volume `[z][y][x]` with these sides and voxels, x, y, z, m.
pub(super) fn volume_header(
    format: Format,
    sides: [u32; 3],
    voxel: [f64; 3],
    sample: Sample,
) -> Option<Vec<u8>> {
    match format {
        Format::Exr => None,
        Format::Npy => Some(npy::header(&sides, sample)),
        Format::Tiff => Some(tiff::volume_header(sides, voxel, sample)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array_file::RangeLayout;
    use ndarray::{Array2, array};

    fn frames() -> [Array2<f32>; 2] {
        [array![[1.5, 2.0, 3.0], [4.0, 5.0, 6.0]], array![[7.0, 8.0, 9.0], [0.0, 1.0, 2.0]]]
    }

    /// Two frames of a file for which three were announced.
    fn appended(path: &Path, format: Format) -> Vec<u8> {
        let mut file = append(path, format, [3, 2, 3], None, Sample::F32).unwrap();
        frames().iter().for_each(|frame| file.put(frame.view(), "a word of its own").unwrap());
        file.finish().unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn formats_do_what_their_table_states() {
        let place = tempfile::tempdir().unwrap();
        for format in Format::ALL {
            let abilities = format.abilities();
            let path = place.path().join(format!("frames.{}", format.ending()));
            assert_eq!(Format::of(&path), Some(format));
            let bytes = appended(&path, format);
            let word = b"a word of its own";
            let words = bytes.windows(word.len()).filter(|part| part == word).count();
            let metadata = if abilities.pages { words == 2 } else { words == 1 };
            assert_eq!(metadata, abilities.metadata, "{format}: {words} words");
            let found = ArrayFile::open(&path, format).map(|file| file.frames().0).ok();
            // A format without pages takes a file for each frame.
            let expected = if abilities.pages { 2 } else { 1 };
            assert_eq!(found == Some(expected), abilities.appending, "{format}: {found:?}");
        }
    }

    #[test]
    fn ranges_that_two_writers_write_in_any_order_are_the_frames() {
        let place = tempfile::tempdir().unwrap();
        for format in Format::ALL {
            let abilities = format.abilities();
            let path = place.path().join(format!("ranges.{}", format.ending()));
            let layout = RangeLayout::new(format, &[2, 2, 3], [1e-6; 2], Sample::F32);
            assert_eq!(layout.is_some(), abilities.ranges, "{format}");
            let Some(layout) = layout else { continue };
            let [mut one, mut other] = [(); 2].map(|()| layout.clone().open(path.clone()).unwrap());
            let [first, second] = frames();
            for (index, frame) in [(1, second), (0, first)] {
                one.write(index, 1, frame.slice(ndarray::s![1.., ..])).unwrap();
                other.write(index, 0, frame.slice(ndarray::s![..1, ..])).unwrap();
            }
            let file = ArrayFile::open(&path, format).unwrap();
            assert_eq!(file.sides(), [2, 2, 3]);
            for (index, frame) in frames().iter().enumerate() {
                let values = frame.iter().copied().collect::<Vec<f32>>();
                assert_eq!(file.read::<f32>(index, 0..2).unwrap(), values, "{format}");
            }
        }
    }

    #[test]
    fn whole_numbers_are_written_where_the_table_states_it() {
        for format in Format::ALL.into_iter().filter(|format| format.abilities().integers > 0) {
            let place = tempfile::tempdir().unwrap();
            let path = place.path().join("counts");
            let layout = RangeLayout::new(format, &[1, 1, 2], [1e-6; 2], Sample::U16).unwrap();
            let mut file = layout.open(path.clone()).unwrap();
            file.write(0, 0, array![[65_535.0_f32, 2.4]].view()).unwrap();
            let values = ArrayFile::open(&path, format).unwrap().read::<f32>(0, 0..1).unwrap();
            assert_eq!(values, [65_535.0, 2.0], "{format}");
        }
    }
}
