//! Samples of a TIFF page as they are stored. The decoder inverts pages whose white is zero, floats with
//! a loss; so it reads that tag as black is zero.

use std::io::{Read, Result, Seek, SeekFrom};
use tiff::TiffResult;
use tiff::decoder::Decoder;
use tiff::tags::{ByteOrder, PhotometricInterpretation, Tag};

/// A file in which one byte reads as 1.
#[derive(Debug)]
pub(super) struct Replaced<R> {
    inner: R,
    /// Place of the next byte.
    at: u64,
    /// Place of the byte that reads as 1.
    one: Option<u64>,
}

impl<R: Read + Seek> Replaced<R> {
    /// A file at its beginning, as it is.
    pub(super) const fn new(inner: R) -> Self {
        Self { inner, at: 0, one: None }
    }
}

impl<R: Read> Read for Replaced<R> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        let count = self.inner.read(bytes)?;
        let place = self.one.and_then(|one| usize::try_from(one.checked_sub(self.at)?).ok());
        if let Some(byte) = place.and_then(|place| bytes[..count].get_mut(place)) {
            *byte = 1;
        }
        self.at += count as u64;
        Ok(count)
    }
}

impl<R: Seek> Seek for Replaced<R> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.at = self.inner.seek(to)?;
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
