//! The moments of a view, read: its blocks found and checked, then any rows of them.

use super::super::content::Bounds;
use super::{BLOCK, END, EXACT_WORDS, HASH, HEADER, MAGIC, RAY, RESULT, VERSION, WORDS};
use crate::interface::{Cell, CellRow, Ray, RayResult};
use crate::sampling::{CellBatch, CellMoments, ExactCell};
use crate::{Error, Result, input_file, layout};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The moments of one view, to be read.
#[derive(Debug)]
pub(in crate::moments) struct MomentFile {
    path: PathBuf,
    words: usize,
    blocks: Vec<Block>,
    bytes: u64,
}

#[derive(Debug)]
struct Block {
    at: u64,
    head: [u32; BLOCK],
}

impl Block {
    const fn rows(&self) -> Range<i64> {
        self.head[4].cast_signed() as i64..self.head[5].cast_signed() as i64 + 1
    }

    /// `words` is at most [`WORDS`]: the sum stays below 2^63.
    const fn bytes(&self, words: usize) -> u64 {
        let [cell_rows, cells, _, exact, ..] = self.head;
        cell_rows as u64 * size_of::<CellRow>() as u64
            + cells as u64 * (size_of::<Cell>() + 8 * words) as u64
            + exact as u64 * 4 * EXACT_WORDS as u64
    }
}

impl MomentFile {
    /// Opens the file of a view, checks its hash and finds its blocks.
    pub(in crate::moments) fn open(
        directory: &Path,
        view: u32,
        scene_digest: &[u8; 32],
    ) -> Result<Self> {
        let path = layout::moments(directory, view);
        let failed = |error| Error::file(&path, "cannot be read", Some(error));
        let damaged = |what: &str| Error::file(&path, format!("{what}: simulate again"), None);
        let file = input_file::open(&path).map_err(failed)?;
        let bytes = file.metadata().map_err(failed)?.len();
        if bytes < (HEADER + HASH) as u64 {
            return Err(damaged("is cut off"));
        }
        check_hash(&path, &file, bytes - HASH as u64)?;
        let mut file = BufReader::new(file);
        file.seek(SeekFrom::Start(0)).map_err(failed)?;
        let mut head = [0_u8; HEADER];
        file.read_exact(&mut head).map_err(failed)?;
        if head[..16] != MAGIC {
            return Err(damaged("holds no moments"));
        }
        let word =
            |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        if word(16) != VERSION {
            let found = word(16);
            return Err(damaged(&format!("has version {found} of moments, this is {VERSION}")));
        }
        if head[24..] != *scene_digest {
            let problem = format!("belongs to another scene than the run's {}", layout::SCENE);
            return Err(damaged(&problem));
        }
        let words = word(20) as usize;
        if words > WORDS {
            return Err(damaged(&format!("claims {words} words of moments a ray")));
        }
        let mut blocks = Vec::new();
        let mut at = HEADER as u64;
        let end = bytes - HASH as u64;
        while at < end {
            if end - at < 4 * BLOCK as u64 {
                return Err(damaged("ends within a block"));
            }
            let mut words_of_head = [0_u8; 4 * BLOCK];
            file.seek(SeekFrom::Start(at)).map_err(failed)?;
            file.read_exact(&mut words_of_head).map_err(failed)?;
            let head: [u32; BLOCK] = bytemuck::pod_read_unaligned(&words_of_head);
            let block = Block { at: at + 4 * BLOCK as u64, head };
            if block.bytes(words) > end - block.at {
                return Err(damaged("claims a block that is longer than the file"));
            }
            at = block.at + block.bytes(words);
            blocks.push(block);
        }
        Ok(Self { path, words, blocks, bytes })
    }

    pub(in crate::moments) const fn bytes(&self) -> u64 {
        self.bytes
    }

    pub(in crate::moments) fn has_wide(&self) -> bool {
        self.blocks.iter().any(|block| block.head[2] > 0)
    }

    /// Hands over the blocks that have cell rows in some rows.
    pub(in crate::moments) fn read(
        &self,
        rows: &Range<i64>,
        words: usize,
        bounds: Bounds,
        mut take: impl FnMut(CellBatch) -> Result<()>,
    ) -> Result<()> {
        let failed = |error| Error::file(&self.path, "cannot be read", Some(error));
        if self.words != words {
            let problem = format!(
                "has {} words of moments a ray, the scene's materials have {words}",
                self.words
            );
            return Err(Error::file(&self.path, problem, None));
        }
        let mut file = File::open(&self.path).map_err(failed)?;
        for block in &self.blocks {
            let there = block.rows();
            if there.start >= rows.end || there.end <= rows.start {
                continue;
            }
            file.seek(SeekFrom::Start(block.at)).map_err(failed)?;
            let cell_rows = unpack(block, words, &mut file).map_err(failed)?;
            bounds.check(&cell_rows, &there).map_err(|problem| {
                let problem = format!("holds {problem}: simulate again");
                Error::file(&self.path, problem, None)
            })?;
            take(cell_rows)?;
        }
        Ok(())
    }
}

fn unpack(block: &Block, words: usize, file: &mut File) -> std::io::Result<CellBatch> {
    fn take<T: bytemuck::Pod>(file: &mut File, count: usize) -> std::io::Result<Vec<T>> {
        let lacks = |()| std::io::Error::from(ErrorKind::OutOfMemory);
        let mut items = bytemuck::allocation::try_zeroed_vec(count).map_err(lacks)?;
        file.read_exact(bytemuck::cast_slice_mut(&mut items))?;
        Ok(items)
    }
    let [cell_rows, cells, _, exact, ..] = block.head.map(|n| n as usize);
    Ok(CellBatch {
        cell_rows: take(file, cell_rows)?,
        cells: take(file, cells)?,
        moments: CellMoments {
            ends: take(file, 2 * words * cells)?,
            exact: take(file, exact * EXACT_WORDS)?
                .chunks_exact(EXACT_WORDS)
                .map(exact_of)
                .collect(),
        },
        ..CellBatch::default()
    })
}

fn check_hash(path: &Path, mut file: &File, bytes: u64) -> Result<()> {
    let failed = |error| Error::file(path, "cannot be read", Some(error));
    let mut hash = Sha256::new();
    let mut rest = bytes;
    let mut buffer = vec![0_u8; 1 << 20];
    while rest > 0 {
        let n = usize::try_from(rest.min(1 << 20)).unwrap_or(1 << 20);
        file.read_exact(&mut buffer[..n]).map_err(failed)?;
        hash.update(&buffer[..n]);
        rest -= n as u64;
    }
    let mut recorded = [0_u8; HASH];
    file.read_exact(&mut recorded).map_err(failed)?;
    if hash.finalize()[..] != recorded {
        return Err(Error::file(path, "does not match its hash: simulate again", None));
    }
    Ok(())
}

fn exact_of(words: &[u32]) -> ExactCell {
    let end = |i: usize| &words[1 + END * i..1 + END * (i + 1)];
    let ray = |i: usize| {
        let mut words = [0_u32; size_of::<Ray>() / 4];
        words[..RAY].copy_from_slice(&end(i)[..RAY]);
        bytemuck::cast(words)
    };
    let result = |i: usize| {
        let mut words = [0_u32; size_of::<RayResult>() / 4];
        words[..RESULT].copy_from_slice(&end(i)[RAY..]);
        bytemuck::cast(words)
    };
    ExactCell {
        cell: words[0],
        ends: [ray(0), ray(1)],
        results: [result(0), result(1)],
        range: [0.0, 1.0],
    }
}
