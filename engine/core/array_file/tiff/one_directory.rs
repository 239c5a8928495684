//! Frames behind a single directory, not compressed, one after another: as `ImageJ` and Fiji write stacks beyond
//! 4 GiB, and others with a description that counts them.

use super::read::Pages;
use crate::numbers;
use std::ops::Range;
use std::path::Path;
use tiff::tags::Tag;
use tiff::{ColorType, TiffResult};

/// Places of frames behind one another.
#[derive(Debug)]
pub(super) struct Behind {
    pub(super) frames: usize,
    /// Bytes of the first in the file.
    first: Range<u64>,
}

impl Behind {
    /// The frames of a file whose description counts `images` and whose one directory is the page in turn.
    /// The inner error is the reason why it cannot hold them.
    pub(super) fn of(
        pages: &mut Pages,
        path: &Path,
        images: u64,
    ) -> TiffResult<Result<Self, String>> {
        if pages.find_tag_unsigned::<u16>(Tag::Compression)?.unwrap_or(1) != 1 {
            return Ok(Err("one directory of compressed values".into()));
        }
        if pages.find_tag(Tag::StripOffsets)?.is_none() {
            return Ok(Err("one directory of tiles".into()));
        }
        let offsets = pages.get_tag_u64_vec(Tag::StripOffsets)?;
        let lengths = pages.get_tag_u64_vec(Tag::StripByteCounts)?;
        let (columns, rows) = pages.dimensions()?;
        let ColorType::Gray(bits) = pages.colortype()? else {
            return Ok(Err("pixels of several samples".into()));
        };
        let bytes = u64::from(columns) * u64::from(rows) * u64::from(bits / 8);
        let ends = offsets.iter().zip(&lengths).map(|(at, length)| at.saturating_add(*length));
        let are_behind = ends.zip(offsets.iter().skip(1)).all(|(end, next)| end == *next);
        let length = lengths.iter().fold(0_u64, |sum, length| sum.saturating_add(*length));
        if !are_behind || length != bytes || bytes == 0 {
            return Ok(Err("one directory of scattered strips".into()));
        }
        let start = offsets[0];
        let there = path.metadata().map_or(0, |found| found.len()).saturating_sub(start) / bytes;
        if there < images {
            return Ok(Err(format!("one directory and the values of {there}")));
        }
        Ok(Ok(Self { frames: numbers::length(images), first: start..start + bytes }))
    }

    /// Makes the page in turn, the first frame, read as another one.
    pub(super) fn go_to(&self, pages: &mut Pages, frame: usize) {
        let bytes = self.first.end - self.first.start;
        pages.inner().read_behind(self.first.clone(), bytes * frame as u64);
    }
}

/// Least bytes of a frame behind which any values are looked for: what else files hold there is shorter. Behind
/// shorter frames only whole frames up to the end count.
const LONG: u64 = 1 << 16;
/// Least bytes of a frame behind which values are looked for at all.
const SHORT: u64 = 64;

/// Frames for which a file of one directory, the page in turn, has values behind the first, or in its strips; 0
/// where its description need not count them.
pub(super) fn unread(pages: &mut Pages, path: &Path) -> TiffResult<u64> {
    let is_plain = pages.find_tag_unsigned::<u16>(Tag::Compression)?.unwrap_or(1) == 1;
    if !is_plain || pages.find_tag(Tag::StripOffsets)?.is_none() {
        return Ok(0);
    }
    let offsets = pages.get_tag_u64_vec(Tag::StripOffsets)?;
    let lengths = pages.get_tag_u64_vec(Tag::StripByteCounts)?;
    let ((columns, rows), ColorType::Gray(bits)) = (pages.dimensions()?, pages.colortype()?) else {
        return Ok(0);
    };
    let bytes = u64::from(columns) * u64::from(rows) * u64::from(bits / 8);
    if bytes < SHORT {
        return Ok(0);
    }
    let sum = lengths.iter().fold(0_u64, |sum, length| sum.saturating_add(*length));
    let ends = offsets.iter().zip(&lengths).map(|(at, length)| at.saturating_add(*length));
    let end = ends.max().unwrap_or_default();
    let directory = pages.ifd_pointer().map(|pointer| pointer.0).filter(|at| *at >= end);
    let next = directory.unwrap_or_else(|| path.metadata().map_or(0, |found| found.len()));
    let behind = next.saturating_sub(end);
    let frames = if bytes >= LONG || behind % bytes == 0 { behind / bytes } else { 0 };
    Ok(((sum / bytes).max(1) - 1).max(frames))
}
