//! Samples of a TIFF page as they are stored. The decoder inverts pages whose white is zero, floats with
//! a loss; so it reads that tag as black is zero. And frames behind a single directory, which the decoder
//! reads as the frame of that directory.

use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};
use std::ops::Range;
use tiff::TiffResult;
use tiff::decoder::Decoder;
use tiff::tags::{ByteOrder, PhotometricInterpretation, Tag};

/// A file in which one byte reads as 1, and a range as one of the same length behind it.
#[derive(Debug)]
pub(super) struct Replaced<R> {
    inner: R,
    /// Place of the next byte.
    at: u64,
    /// Place of the inner reader.
    inner_at: u64,
    /// Place of the byte that reads as 1.
    one: Option<u64>,
    /// Range that reads as the bytes so far behind it.
    moved: Option<(Range<u64>, u64)>,
}

impl<R: Read + Seek> Replaced<R> {
    /// A file at its beginning, as it is.
    pub(super) const fn new(inner: R) -> Self {
        Self { inner, at: 0, inner_at: 0, one: None, moved: None }
    }

    /// Reads a range as the bytes that lie `by` behind it.
    pub(super) fn read_behind(&mut self, range: Range<u64>, by: u64) {
        self.moved = Some((range, by));
    }

    /// Place in the file of the next byte, and the bytes that follow it there.
    fn place(&self) -> (u64, u64) {
        match &self.moved {
            Some((range, by)) if range.contains(&self.at) => (self.at + by, range.end - self.at),
            Some((range, _)) if self.at < range.start => (self.at, range.start - self.at),
            _ => (self.at, u64::MAX),
        }
    }
}

impl<R: Read + Seek> Read for Replaced<R> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        let (place, most) = self.place();
        if place != self.inner_at {
            self.inner_at = self.inner.seek(SeekFrom::Start(place))?;
        }
        let length = usize::try_from(most).map_or(bytes.len(), |most| most.min(bytes.len()));
        let count = self.inner.read(&mut bytes[..length])?;
        let one = self.one.and_then(|one| usize::try_from(one.checked_sub(self.at)?).ok());
        if let Some(byte) = one.and_then(|one| bytes[..count].get_mut(one)) {
            *byte = 1;
        }
        self.at += count as u64;
        self.inner_at += count as u64;
        Ok(count)
    }
}

impl<R: Seek> Seek for Replaced<R> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.at = match to {
            SeekFrom::Start(place) => place,
            SeekFrom::Current(by) => self
                .at
                .checked_add_signed(by)
                .ok_or_else(|| Error::from(ErrorKind::InvalidInput))?,
            SeekFrom::End(_) => {
                self.inner_at = self.inner.seek(to)?;
                self.inner_at
            }
        };
        Ok(self.at)
    }
}

/// Goes to a page, so that its samples are decoded as they are stored.
pub(super) fn seek<R: Read + Seek>(
    pages: &mut Decoder<Replaced<R>>,
    page: usize,
) -> TiffResult<()> {
    pages.seek_to_image(page)?;
    let white_is_zero = PhotometricInterpretation::WhiteIsZero.to_u16();
    if pages.find_tag_unsigned(Tag::PhotometricInterpretation)? == Some(white_is_zero)
        && let Some(place) = interpretation(pages)?
    {
        pages.inner().one = Some(place);
        pages.seek_to_image(page)?;
    }
    Ok(())
}

/// Place of the low byte of the interpretation of a page's samples.
fn interpretation<R: Read + Seek>(pages: &mut Decoder<Replaced<R>>) -> TiffResult<Option<u64>> {
    let Some(directory) = pages.ifd_pointer() else { return Ok(None) };
    pages.goto_offset_u64(2)?;
    let is_big = pages.read_short()? == 43;
    pages.goto_offset_u64(directory.0)?;
    let [count, first, length, value] = match is_big {
        true => [pages.read_long8()?, directory.0 + 8, 20, 12],
        false => [pages.read_short()?.into(), directory.0 + 2, 12, 8],
    };
    for entry in (0..count).map(|index| first + length * index) {
        pages.goto_offset_u64(entry)?;
        if pages.read_short()? != Tag::PhotometricInterpretation.to_u16() {
            continue;
        }
        // Bytes of a value, by its type: BYTE, SHORT, LONG, LONG8.
        let bytes = match pages.read_short()? {
            1 => 1,
            4 => 4,
            16 => 8,
            _ => 2,
        };
        let low = match pages.byte_order() {
            ByteOrder::LittleEndian => 0,
            ByteOrder::BigEndian => bytes - 1,
        };
        return Ok(Some(entry + value + low));
    }
    Ok(None)
}
