//! Moments of a view: the hash at the end, the scene that they belong to, the sizes of blocks, and
//! strips that follow one another.

use crate::{RAW_HASHES, RAW_HEADER, RAW_LENGTHS, put_u32, u32_at};
use sha2::{Digest, Sha256};

const HEADER: usize = 56;
const HASH: usize = 32;
const BLOCK: usize = 24;
const STRIP: usize = 48;
const CELL: usize = 60;
const ORDERED: usize = 108;

/// The file with the header of moments of `scene`, blocks that lie within it, and its hash.
/// `words`: those of a ray's moments.
pub fn repaired(control: u8, file: &[u8], scene: &[u8], words: u32) -> Vec<u8> {
    let mut file = file.to_vec();
    if control & RAW_HEADER == 0 {
        file.resize(file.len().max(HEADER + HASH), 0);
        file[..16].copy_from_slice(b"beamlet moments\0");
        put_u32(&mut file, 16, 2);
        put_u32(&mut file, 20, words);
        file[24..HEADER].copy_from_slice(&Sha256::digest(scene));
    }
    if file.len() < HEADER + HASH {
        return file;
    }
    file.truncate(file.len() - HASH);
    if control & RAW_LENGTHS == 0 {
        repair_blocks(&mut file, words as usize);
    }
    let hash = match control & RAW_HASHES {
        0 => Sha256::digest(&file).to_vec(),
        _ => vec![0; HASH],
    };
    file.extend(hash);
    file
}

fn repair_blocks(file: &mut Vec<u8>, words: usize) {
    let mut at = HEADER;
    while at + BLOCK <= file.len() {
        let mut left = file.len() - at - BLOCK;
        let mut claim = |file: &mut [u8], word: usize, size: usize| {
            let count = (u32_at(file, at + 4 * word) as usize).min(left / size);
            left -= count * size;
            put_u32(file, at + 4 * word, u32::try_from(count).unwrap_or(u32::MAX));
            count
        };
        let strips = claim(file, 0, STRIP);
        let cells = claim(file, 1, CELL + 8 * words);
        let ordered = claim(file, 3, ORDERED);
        let first_strip = at + BLOCK;
        let mut first = 0;
        for strip in 0..strips {
            let place = first_strip + STRIP * strip;
            // Each strip that is still to come has a cell.
            let most = cells.saturating_sub(first + strips - 1 - strip);
            let count = match strip + 1 == strips {
                true => cells - first,
                false => (u32_at(file, place + 4) as usize).min(most),
            };
            put_u32(file, place, u32::try_from(first).unwrap_or(u32::MAX));
            put_u32(file, place + 4, u32::try_from(count).unwrap_or(u32::MAX));
            first += count;
        }
        at = first_strip + STRIP * strips + (CELL + 8 * words) * cells + ORDERED * ordered;
    }
    file.truncate(at.min(file.len()));
}

/// Short files of one block each, of a few strips in a row of a file: a whole view is long, and
/// fuzzing changes few bytes at a time.
pub fn pieces(file: &[u8], words: usize) -> Vec<Vec<u8>> {
    const STRIPS: usize = 3;
    let at = HEADER;
    let [strips, cells, ordered] = [0, 1, 3].map(|word| u32_at(file, at + 4 * word) as usize);
    let first_strip = at + BLOCK;
    let first_cell = first_strip + STRIP * strips;
    let first_ends = first_cell + CELL * cells;
    let first_ordered = first_ends + 8 * words * cells;
    let piece = |from: usize| {
        let taken = from..(from + STRIPS).min(strips);
        let of = |strip: usize, word: usize| {
            u32_at(file, first_strip + STRIP * strip + 4 * word) as usize
        };
        let range = of(taken.start, 0)..of(taken.end - 1, 0) + of(taken.end - 1, 1);
        let part = |first: usize, size: usize, range: &std::ops::Range<usize>| {
            &file[first + size * range.start..first + size * range.end]
        };
        let of_ordered = |index: &usize| {
            range.contains(&(u32_at(file, first_ordered + ORDERED * index) as usize))
        };
        let some: Vec<usize> = (0..ordered).filter(of_ordered).collect();
        let mut out = file[..first_strip].to_vec();
        for (word, count) in [(0, taken.len()), (1, range.len()), (3, some.len())] {
            put_u32(&mut out, at + 4 * word, u32::try_from(count).unwrap_or(u32::MAX));
        }
        out.extend(part(first_strip, STRIP, &taken));
        for strip in 0..taken.len() {
            let place = first_strip + STRIP * strip;
            let first = u32_at(&out, place) - u32::try_from(range.start).unwrap_or(0);
            put_u32(&mut out, place, first);
        }
        out.extend(part(first_cell, CELL, &range));
        out.extend(part(first_ends, 8 * words, &range));
        for index in some {
            let start = out.len();
            out.extend(part(first_ordered, ORDERED, &(index..index + 1)));
            let cell = u32_at(&out, start) - u32::try_from(range.start).unwrap_or(0);
            put_u32(&mut out, start, cell);
        }
        out.extend([0; HASH]);
        out
    };
    (0..strips).step_by(STRIPS).map(piece).collect()
}
