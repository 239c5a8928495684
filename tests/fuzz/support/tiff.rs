//! TIFF: where strips and tiles stand, how long they are, and the checksum of deflated ones.

use super::{RAW_HASHES, RAW_LENGTHS, put_u32, u32_at, zlib};
use std::io::Cursor;
use tiff::encoder::colortype::{ColorType, Gray8, Gray16, Gray32, Gray32Float, Gray64Float};
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, TiffValue};

/// Most pages, strips of a page, and bytes of a strip that are repaired: the file grows by them.
const PAGES: usize = 16;
const STRIPS: usize = 64;
const BYTES: usize = 1 << 10;
const COMPRESSION: u16 = 259;

/// The file (of little-endian words, not `BigTIFF`) with strips and tiles that lie within it, and
/// with deflated ones that are whole streams.
pub fn repaired(control: u8, file: &[u8]) -> Vec<u8> {
    let mut file = file.to_vec();
    if control & RAW_LENGTHS != 0 || file.len() < 8 || file[..4] != *b"II*\0" {
        return file;
    }
    let mut directory = u32_at(&file, 4) as usize;
    for _ in 0..PAGES {
        let Some(next) = repair_page(control, &mut file, directory) else { break };
        directory = next;
    }
    file
}

/// Repairs a page; the place of the next one.
fn repair_page(control: u8, file: &mut Vec<u8>, directory: usize) -> Option<usize> {
    let count = u16_at(file, directory)? as usize;
    let entries: Vec<usize> = (0..count).map(|entry| directory + 2 + 12 * entry).collect();
    file.get(..directory + 6 + 12 * count)?;
    let find = |file: &[u8], tags: [u16; 2]| {
        entries.iter().copied().find(|at| u16_at(file, *at).is_some_and(|tag| tags.contains(&tag)))
    };
    // Strips or tiles: where they stand, and their bytes.
    if let (Some(places), Some(lengths)) = (find(file, [273, 324]), find(file, [279, 325])) {
        let deflated = find(file, [COMPRESSION; 2])
            .and_then(|at| u16_at(file, at + 8))
            .is_some_and(|kind| [8, 32946].contains(&kind));
        let strips = u32_at(file, places + 4).min(u32_at(file, lengths + 4)) as usize;
        for strip in 0..strips.min(STRIPS) {
            let (Some(place), Some(length)) =
                (word(file, places, strip), word(file, lengths, strip))
            else {
                break;
            };
            let from = u32_at(file, place) as usize % file.len();
            let most = file.len() - from;
            let mut range = from..from + (u32_at(file, length) as usize).min(most);
            if deflated && control & RAW_HASHES == 0 {
                let stream = zlib(&file[from..range.end.min(from + BYTES)]);
                range = file.len()..file.len() + stream.len();
                file.extend(stream);
            }
            put_u32(file, place, u32::try_from(range.start).ok()?);
            put_u32(file, length, u32::try_from(range.len()).ok()?);
        }
    }
    match u32_at(file, directory + 2 + 12 * count) {
        0 => None,
        next => Some(next as usize),
    }
}

/// Where a word of 32 bits of an entry stands; none of entries of another type.
fn word(file: &[u8], entry: usize, index: usize) -> Option<usize> {
    let at = match (u16_at(file, entry + 2)?, u32_at(file, entry + 4)) {
        (4, 1) => entry + 8,
        (4, _) => u32_at(file, entry + 8) as usize + 4 * index,
        _ => return None,
    };
    file.get(at..at + 4).map(|_| at)
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..at.checked_add(2)?).map(|two| u16::from_le_bytes([two[0], two[1]]))
}

/// Files of every sample type and compression, of one page and of three.
pub fn seeds() -> Vec<(u8, Vec<u8>)> {
    fn pages<C: ColorType>(made: &mut Vec<(u8, Vec<u8>)>, value: C::Inner)
    where
        C::Inner: Copy,
        [C::Inner]: TiffValue,
    {
        let compressions = [
            Compression::Uncompressed,
            Compression::Lzw,
            Compression::Deflate(DeflateLevel::Fast),
            Compression::Packbits,
        ];
        for compression in compressions {
            for count in [1, 3] {
                let mut bytes = Cursor::new(Vec::new());
                let encoder = TiffEncoder::new(&mut bytes).expect("a header");
                let mut encoder = encoder.with_compression(compression);
                for _ in 0..count {
                    let mut image = encoder.new_image::<C>(4, 5).expect("a page");
                    image.rows_per_strip(2).expect("strips");
                    image.write_data(&[value; 20]).expect("values");
                }
                let bytes = bytes.into_inner();
                made.push((0, bytes.clone()));
                made.push((RAW_HASHES, bytes));
            }
        }
    }
    let mut made = Vec::new();
    pages::<Gray8>(&mut made, 7);
    pages::<Gray16>(&mut made, 700);
    pages::<Gray32>(&mut made, 70_000);
    pages::<Gray32Float>(&mut made, 0.5);
    pages::<Gray64Float>(&mut made, 0.5);
    // Tiles: the encoder makes none. Strips of all columns are tiles by other tags.
    let tiled = |file: &[u8]| {
        let mut file = file.to_vec();
        let directory = u32_at(&file, 4) as usize;
        for entry in 0..usize::from(u16_at(&file, directory).unwrap_or(0)) {
            let at = directory + 2 + 12 * entry;
            let tag = match u16_at(&file, at) {
                Some(273) => 324_u16,
                Some(279) => 325,
                Some(278) => 323,
                // A tag that nobody reads becomes the width of tiles.
                Some(305 | 282) => {
                    put_u32(&mut file, at + 2, 4);
                    put_u32(&mut file, at + 4, 1);
                    put_u32(&mut file, at + 8, 4);
                    322
                }
                _ => continue,
            };
            file[at..at + 2].copy_from_slice(&tag.to_le_bytes());
        }
        file
    };
    let tiles: Vec<_> = made.iter().map(|(control, file)| (*control, tiled(file))).collect();
    made.extend(tiles);
    made
}
