//! The moments of a view, read: its blocks found and checked, then any rows of them.

use super::{BLOCK, EXACT_WORDS, HASH, HEADER, MAGIC, VERSION, WORDS};
use crate::layout;
use beamlet_core::{Error, Result, input_file};
use beamlet_interface::{Cell, CellRow};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The moments of one view, to be read.
#[derive(Debug)]
pub struct MomentFile {
    path: PathBuf,
    words: usize,
    blocks: Vec<Block>,
    bytes: u64,
}

/// A block of a file: where its cell rows begin, and its header.
#[derive(Debug)]
pub struct Block {
    at: u64,
    /// Cell rows, cells, wide cells traced exactly, all of those, first and last row.
    pub head: [u32; BLOCK],
}

impl Block {
    /// Rows that its cell rows lie in.
    pub const fn rows(&self) -> Range<i64> {
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
    ///
    /// # Errors
    ///
    /// [`Error::File`] where it cannot be read, is damaged, or belongs to another scene.
    pub fn open(directory: &Path, view: u32, scene_digest: &[u8; 32]) -> Result<Self> {
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

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its bytes.
    pub const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// True if it has wide cells that were traced exactly.
    pub fn has_wide(&self) -> bool {
        self.blocks.iter().any(|block| block.head[2] > 0)
    }

    /// Hands over the blocks that have cell rows in some rows, each with the file at its first byte.
    ///
    /// # Errors
    /// [`Error::File`] for another number of words than a ray of the file has, and where it cannot be
    /// read; errors of `take`.
    pub fn read(
        &self,
        rows: &Range<i64>,
        words: usize,
        mut take: impl FnMut(&Block, &mut File) -> Result<()>,
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
            take(block, &mut file)?;
        }
        Ok(())
    }
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
