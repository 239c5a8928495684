//! TIFF: one file per stack that any viewer opens, calibrated for `ImageJ` and Fiji.
//!
//! Little endian, not compressed. The directories of all pages come first and the values of all
//! pages behind them without a gap, as `ImageJ` expects of its own stacks: its description has slices
//! (mask steps), frames (views) and the unit of the resolution. Beyond 4 GiB it is a `BigTIFF`.

use crate::array_file::parts::Sample;
use std::fmt::Write;

/// Bytes of a strip, at most, unless a single row has more.
const STRIP: u64 = 16 << 20;

/// Everything before the values of an array `[view][step][row][column]`, or of the last two or three
/// sides of one. `pitch`: of a pixel, x and z, m.
pub(crate) fn header(sides: &[u32], pitch: [f64; 2], sample: Sample) -> Vec<u8> {
    TiffHeader::new(sides, pitch, sample, None).bytes()
}

/// Everything before the values of a volume `[z][y][x]` with these sides and voxels, x, y, z, m.
pub(crate) fn volume_header(sides: [u32; 3], [x, y, z]: [f64; 3], sample: Sample) -> Vec<u8> {
    TiffHeader::new(&sides, [x, y], sample, Some(z)).bytes()
}

/// The pages of a file.
struct TiffHeader {
    rows: u32,
    columns: u32,
    pages: u64,
    sample: Sample,
    /// Offsets of 8 bytes.
    big: bool,
    description: String,
    /// Pixels per micrometre, as fractions.
    resolution: [[u32; 2]; 2],
    rows_per_strip: u32,
}

/// Types of values by their code.
const ASCII: u16 = 2;
const SHORT: u16 = 3;
const LONG: u16 = 4;
const RATIONAL: u16 = 5;
const LONG8: u16 = 16;

/// Entries of a directory without a description, which only the first page has.
const ENTRIES: u64 = 15;

impl TiffHeader {
    /// `spacing`: of the pages, m, where these are slices of a volume.
    fn new(sides: &[u32], pitch: [f64; 2], sample: Sample, spacing: Option<f64>) -> Self {
        let mut sides = sides.iter().rev().copied();
        let [columns, rows, steps, views] = [0; 4].map(|_| sides.next().unwrap_or(1));
        let row = sample.bytes() * u64::from(columns);
        let rows_per_strip = (STRIP / row.max(1)).clamp(1, u64::from(rows.max(1)));
        let mut header = Self {
            rows,
            columns,
            pages: u64::from(views) * u64::from(steps),
            sample,
            big: false,
            description: description(steps, views, spacing),
            resolution: pitch.map(per_micrometre),
            rows_per_strip: u32::try_from(rows_per_strip).unwrap_or(u32::MAX),
        };
        header.big = header.len() + header.pages * header.page_bytes() > u64::from(u32::MAX);
        header
    }

    /// Bytes of the values of a page.
    fn page_bytes(&self) -> u64 {
        self.sample.bytes() * u64::from(self.rows) * u64::from(self.columns)
    }

    fn strips(&self) -> u64 {
        u64::from(self.rows.div_ceil(self.rows_per_strip))
    }

    /// Bytes of an offset.
    const fn word(&self) -> u64 {
        if self.big { 8 } else { 4 }
    }

    /// Bytes of a directory: the number of its entries, the entries, and the offset of the next.
    const fn directory_bytes(&self, entries: u64) -> u64 {
        if self.big { 8 + 20 * entries + 8 } else { 2 + 12 * entries + 4 }
    }

    /// Bytes of the lists of strips of a page, which are inside its directory for a single strip.
    fn list_bytes(&self) -> u64 {
        if self.strips() > 1 { 2 * self.word() * self.strips() } else { 0 }
    }

    const fn first_directory(&self) -> u64 {
        if self.big { 16 } else { 8 }
    }

    /// Where what all pages share begins: resolutions, then the description.
    fn shared(&self) -> u64 {
        let directories = self.directory_bytes(ENTRIES + 1)
            + (self.pages - 1) * self.directory_bytes(ENTRIES)
            + self.pages * self.list_bytes();
        self.first_directory() + directories
    }

    /// Bytes before the first value.
    fn len(&self) -> u64 {
        (self.shared() + 16 + self.description.len() as u64 + 1).next_multiple_of(64)
    }

    fn bytes(&self) -> Vec<u8> {
        let end = self.len();
        let mut out = Vec::with_capacity(usize::try_from(end).unwrap_or(0));
        out.extend(if self.big { b"II\x2b\0\x08\0\0\0".as_slice() } else { b"II\x2a\0" });
        self.offset(&mut out, self.first_directory());
        let page_bytes = self.page_bytes();
        let mut at = self.first_directory();
        for page in 0..self.pages {
            let entries = ENTRIES + u64::from(page == 0);
            let lists = at + self.directory_bytes(entries);
            let next = lists + self.list_bytes();
            self.directory(&mut out, page, lists, end + page * page_bytes);
            self.offset(&mut out, if page + 1 < self.pages { next } else { 0 });
            self.lists(&mut out, end + page * page_bytes);
            at = next;
        }
        for [over, under] in self.resolution {
            out.extend(over.to_le_bytes());
            out.extend(under.to_le_bytes());
        }
        out.extend(self.description.as_bytes());
        out.resize(usize::try_from(end).unwrap_or(out.len()), 0);
        out
    }

    /// The entries of a page whose values begin at `data`.
    fn directory(&self, out: &mut Vec<u8>, page: u64, lists: u64, data: u64) {
        let Self { rows, columns, .. } = *self;
        let (bits, format) = match self.sample {
            Sample::F32 => (32, 3),
            Sample::U16 => (16, 1),
            Sample::U32 => (32, 1),
        };
        let entries = ENTRIES + u64::from(page == 0);
        match self.big {
            true => out.extend(entries.to_le_bytes()),
            false => out.extend(&entries.to_le_bytes()[..2]),
        }
        let word = if self.big { LONG8 } else { LONG };
        let strips = self.strips();
        let row_bytes = self.sample.bytes() * u64::from(columns);
        let (offsets, counts) = match strips {
            1 => (data, row_bytes * u64::from(rows)),
            _ => (lists, lists + self.word() * strips),
        };
        let shared = self.shared();
        let mut entry = |tag, kind, count, value| self.entry(out, tag, kind, count, value);
        entry(254, LONG, 1, 0); // NewSubfileType
        entry(256, LONG, 1, u64::from(columns)); // ImageWidth
        entry(257, LONG, 1, u64::from(rows)); // ImageLength
        entry(258, SHORT, 1, bits); // BitsPerSample
        entry(259, SHORT, 1, 1); // Compression: none
        entry(262, SHORT, 1, 1); // PhotometricInterpretation: black is zero
        if page == 0 {
            let text = self.description.len() as u64 + 1;
            entry(270, ASCII, text, shared + 16); // ImageDescription
        }
        entry(273, word, strips, offsets); // StripOffsets
        entry(277, SHORT, 1, 1); // SamplesPerPixel
        entry(278, LONG, 1, u64::from(self.rows_per_strip)); // RowsPerStrip
        entry(279, word, strips, counts); // StripByteCounts
        entry(282, RATIONAL, 1, shared); // XResolution
        entry(283, RATIONAL, 1, shared + 8); // YResolution
        entry(284, SHORT, 1, 1); // PlanarConfiguration
        entry(296, SHORT, 1, 1); // ResolutionUnit: that of the description
        entry(339, SHORT, 1, format); // SampleFormat
    }

    /// Tag, type, number of values, and the value or its offset.
    fn entry(&self, out: &mut Vec<u8>, tag: u16, kind: u16, count: u64, value: u64) {
        out.extend(tag.to_le_bytes());
        out.extend(kind.to_le_bytes());
        self.offset(out, count);
        // A fraction is inside the entry if there is room for it.
        match (kind, self.big) {
            (RATIONAL, true) => {
                let [over, under] = self.resolution[usize::from(tag == 283)];
                out.extend(over.to_le_bytes());
                out.extend(under.to_le_bytes());
            }
            _ => self.offset(out, value),
        }
    }

    fn offset(&self, out: &mut Vec<u8>, value: u64) {
        match self.big {
            true => out.extend(value.to_le_bytes()),
            false => out.extend(u32::try_from(value).unwrap_or(u32::MAX).to_le_bytes()),
        }
    }

    /// Offsets and lengths of the strips of a page whose values begin at `data`.
    fn lists(&self, out: &mut Vec<u8>, data: u64) {
        if self.strips() == 1 {
            return;
        }
        let Self { rows, columns, .. } = *self;
        let row_bytes = self.sample.bytes() * u64::from(columns);
        let strip_bytes = row_bytes * u64::from(self.rows_per_strip);
        for strip in 0..self.strips() {
            self.offset(out, data + strip * strip_bytes);
        }
        for strip in 0..self.strips() {
            let left = row_bytes * u64::from(rows) - strip * strip_bytes;
            self.offset(out, left.min(strip_bytes));
        }
    }
}

/// The description by which `ImageJ` knows its own stacks: pages of steps (slices) of views (frames).
fn description(steps: u32, views: u32, spacing: Option<f64>) -> String {
    let mut text = String::from("ImageJ=1.53t\n");
    if u64::from(steps) * u64::from(views) > 1 {
        let _ = writeln!(text, "images={}", u64::from(steps) * u64::from(views));
    }
    if steps > 1 {
        let _ = writeln!(text, "slices={steps}");
    }
    if views > 1 {
        let _ = writeln!(text, "frames={views}");
    }
    if steps > 1 && views > 1 {
        text.push_str("hyperstack=true\nmode=grayscale\n");
    }
    text.push_str("unit=um\n");
    if let Some(spacing) = spacing {
        let _ = writeln!(text, "spacing={}", (spacing * 1e12).round() / 1e6);
    }
    text.push_str("loop=false\n");
    text
}

/// Pixels per micrometre of pixels this long (m), as a fraction.
fn per_micrometre(pitch: f64) -> [u32; 2] {
    let micrometres = pitch * 1e6;
    // The largest number of digits that fits.
    let mut over = 1_000_000_u32;
    while over > 1 && micrometres * f64::from(over) > f64::from(u32::MAX) {
        over /= 10;
    }
    [over, crate::numbers::whole::<u32>((micrometres * f64::from(over)).round()).max(1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array_file::tiff::TiffPages;
    use std::fs::File;
    use std::io::{Seek, SeekFrom, Write};

    /// Writes a file with this header, and 7 into the last value; as far as files may have holes it
    /// takes no room.
    fn file(header: &TiffHeader, path: &std::path::Path) -> u64 {
        let len = header.len() + header.pages * header.page_bytes();
        let mut file = File::create(path).unwrap();
        file.write_all(&header.bytes()).unwrap();
        file.set_len(len).unwrap();
        file.seek(SeekFrom::Start(len - 4)).unwrap();
        file.write_all(&7_f32.to_le_bytes()).unwrap();
        len
    }

    #[test]
    fn files_beyond_4_gib_are_big_tiff_and_their_last_value_is_found() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("big.tif");
        for (rows, is_big) in [(1024, false), (4096, true)] {
            let header = TiffHeader::new(&[20, 5, rows, 4096], [150e-6; 2], Sample::F32, None);
            let len = file(&header, &path);
            assert_eq!(len > u64::from(u32::MAX), is_big);
            assert_eq!(&header.bytes()[..4], if is_big { b"II\x2b\0" } else { b"II\x2a\0" });
            let pages = TiffPages::open(&path).unwrap();
            assert_eq!((pages.count(), pages.frame_shape()), (100, [rows as usize, 4096]));
            let last = pages.read::<f32>(99, rows as usize - 1..rows as usize).unwrap();
            assert_eq!((last[4094], last[4095]), (0.0, 7.0));
            let before = pages.read::<f32>(98, rows as usize - 1..rows as usize).unwrap();
            assert!(before[4095].abs() <= 0.0);
        }
    }

    #[test]
    fn pitches_of_any_size_are_fractions() {
        for pitch in [150e-6, 0.65e-6, 1.0 / 3.0 * 1e-6, 5e-3, 2.0] {
            let [over, under] = per_micrometre(pitch).map(f64::from);
            assert!((under / over / (pitch * 1e6) - 1.0).abs() < 2e-6, "{pitch}: {over}/{under}");
        }
    }
}
