//! EXR: the table of offsets, the sizes of chunks, and the checksums of deflated ones.

use super::{RAW_HASHES, RAW_LENGTHS, put_u32, u32_at, zlib};
use exr::prelude::*;
use std::io::Cursor;

/// Most chunks that are repaired.
const CHUNKS: usize = 64;
/// Flag of the version: tiles.
const TILES: u32 = 1 << 9;
/// Flags of the version: several parts, deep data.
const UNKNOWN: u32 = 1 << 12 | 1 << 11;

/// The file (of one part, scan lines or tiles) with a table that leads to its chunks, chunks that
/// fill the rest of the file, and deflated ones that are whole streams.
pub fn repaired(control: u8, file: &[u8]) -> Vec<u8> {
    let version = u32_at(file, 4);
    if control & RAW_LENGTHS != 0 || version & UNKNOWN != 0 {
        return file.to_vec();
    }
    let Some(header) = Header::of(file) else { return file.to_vec() };
    let head = if version & TILES != 0 { 16 } else { 4 };
    let mut out = file[..header.end].to_vec();
    out.resize(header.end + 8 * header.chunks, 0);
    let mut rest = &file[(header.end + 8 * header.chunks).min(file.len())..];
    for chunk in 0..header.chunks {
        if rest.len() < head + 4 {
            break;
        }
        let left = rest.len() - head - 4;
        let size = (u32_at(rest, head) as usize).min(left / (header.chunks - chunk).max(1));
        let (mut place, data) = (rest[..head].to_vec(), &rest[head + 4..head + 4 + size]);
        rest = &rest[head + 4 + size..];
        if head == 4 {
            let row = header.top.wrapping_add((chunk * header.lines) as u32);
            put_u32(&mut place, 0, row);
        }
        let data = match header.deflated && control & RAW_HASHES == 0 {
            true => zlib(data),
            false => data.to_vec(),
        };
        let offset = (out.len() as u64).to_le_bytes();
        out[header.end + 8 * chunk..][..8].copy_from_slice(&offset);
        out.extend(place);
        out.extend((data.len() as u32).to_le_bytes());
        out.extend(data);
    }
    out
}

/// Parts of a header that the repair needs.
struct Header {
    /// Bytes up to the table of offsets.
    end: usize,
    chunks: usize,
    /// Rows of a chunk.
    lines: usize,
    /// First row.
    top: u32,
    deflated: bool,
}

impl Header {
    fn of(file: &[u8]) -> Option<Self> {
        let text = |at: usize| {
            let length = file.get(at..)?.iter().position(|byte| *byte == 0)?;
            Some((&file[at..at + length], at + length + 1))
        };
        let (mut compression, mut window, mut tile) = (0, None, None);
        let mut at = 8;
        let end = loop {
            let (name, next) = text(at)?;
            if name.is_empty() {
                break next;
            }
            let (_, next) = text(next)?;
            let size = u32_at(file, next) as usize;
            let value = next + 4;
            file.get(value..value.checked_add(size)?)?;
            match name {
                b"compression" => compression = *file.get(value)?,
                b"dataWindow" => {
                    window = Some([0, 4, 8, 12].map(|word| u32_at(file, value + word)))
                }
                b"tiles" => tile = Some([0, 4].map(|word| u32_at(file, value + word))),
                _ => {}
            }
            at = value + size;
        };
        let [left, top, right, bottom] = window?;
        let side = |low: u32, high: u32| {
            usize::try_from(i64::from(high.cast_signed()) - i64::from(low.cast_signed()) + 1).ok()
        };
        let [columns, rows] = [side(left, right)?, side(top, bottom)?];
        let lines = match compression {
            3 | 5 => 16,
            4 | 6 | 7 | 8 => 32,
            9 => 256,
            _ => 1,
        };
        let chunks = match (u32_at(file, 4) & TILES != 0, tile) {
            (true, Some([x, y])) => {
                columns.div_ceil(x.max(1) as usize) * rows.div_ceil(y.max(1) as usize)
            }
            _ => rows.div_ceil(lines),
        };
        let deflated = [2, 3].contains(&compression);
        Some(Self { end, chunks: chunks.min(CHUNKS), lines, top, deflated })
    }
}

/// Files of every compression, sample type and arrangement, of one channel and of three.
pub fn seeds() -> Vec<(u8, Vec<u8>)> {
    const SIZE: (usize, usize) = (5, 18);
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
    ];
    let pixels = SIZE.0 * SIZE.1;
    let samples: [fn(usize) -> FlatSamples; 3] = [
        |n| FlatSamples::F32((0..n).map(|at| at as f32 / 7.0).collect()),
        |n| FlatSamples::F16((0..n).map(|at| f16::from_f32(at as f32)).collect()),
        |n| FlatSamples::U32((0..n).map(|at| at as u32).collect()),
    ];
    let mut made = Vec::new();
    for compression in compressions {
        for (blocks, of) in [
            (Blocks::ScanLines, samples[0]),
            (Blocks::ScanLines, samples[1]),
            (Blocks::Tiles(Vec2(4, 7)), samples[2]),
        ] {
            for names in [&["Y"][..], &["A", "Y", "Z"]] {
                let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> =
                    names.iter().map(|name| AnyChannel::new(*name, of(pixels))).collect();
                let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
                let attributes = LayerAttributes::named("x");
                let layer = Layer::new(SIZE, attributes, encoding, AnyChannels::sort(channels));
                let mut bytes = Cursor::new(Vec::new());
                let written = Image::from_layer(layer).write().to_buffered(&mut bytes);
                if written.is_ok() {
                    let bytes = bytes.into_inner();
                    made.push((0, bytes.clone()));
                    made.push((RAW_HASHES, bytes));
                }
            }
        }
    }
    made
}
