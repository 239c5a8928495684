//! Frames behind a single directory, as `ImageJ` and Fiji write stacks beyond 4 GiB: not compressed, one
//! after another.

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

/// Number of images in the description of `ImageJ` for the page in turn; `None` for other pages.
pub(super) fn images(pages: &mut Pages) -> TiffResult<Option<u64>> {
    let Some(value) = pages.find_tag(Tag::ImageDescription)? else { return Ok(None) };
    let Ok(text) = value.into_string() else { return Ok(None) };
    let mut lines = text.lines();
    let is_its_own = lines.next().is_some_and(|line| line.starts_with("ImageJ="));
    let images = lines.find_map(|line| line.strip_prefix("images=")?.trim().parse().ok());
    Ok(images.filter(|images| is_its_own && *images > 0))
}
