//! Files that are read: regular ones, and no longer than memory bears.

use crate::numbers;
use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Most bytes of a text: scenes, tables, lists. The longest that is of use is the resolved scene of
/// ten million angles.
pub(crate) const TEXT: u64 = 512 << 20;

/// Opens a regular file that is not empty.
pub(crate) fn open(path: &Path) -> Result<File> {
    match length(path)? {
        0 => Err(Error::new(ErrorKind::UnexpectedEof, "it is empty")),
        _ => File::open(path),
    }
}

/// Length of a regular file. Others are refused by their kind before they are opened: a pipe waits for
/// its writer, and a device may have no end. System files (`/proc/kmsg`) are regular by their kind and 0
/// bytes long, and may block or never end all the same: files of no length are not opened.
fn length(path: &Path) -> Result<u64> {
    let found = std::fs::metadata(path)?;
    if found.is_file() {
        return Ok(found.len());
    }
    let problem = format!("it is {}; allowed: a regular file", kind(&found));
    Err(Error::new(ErrorKind::InvalidInput, problem))
}

/// A regular file as a whole.
pub(crate) fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let refused = |length: u64| {
        let problem = format!("it has {length} bytes; allowed: up to {most}");
        Err(Error::new(ErrorKind::FileTooLarge, problem))
    };
    let length = match length(path)? {
        0 => return Ok(Vec::new()),
        length if length > most => return refused(length),
        length => length,
    };
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(numbers::length(length))?;
    // It may grow while it is read.
    match File::open(path)?.take(most + 1).read_to_end(&mut bytes)? as u64 {
        length if length > most => refused(length),
        _ => Ok(bytes),
    }
}

/// A regular file of UTF-8.
pub(crate) fn text(path: &Path) -> Result<String> {
    let problem = "stream did not contain valid UTF-8";
    String::from_utf8(read(path, TEXT)?).map_err(|_| Error::new(ErrorKind::InvalidData, problem))
}

#[cfg(unix)]
fn kind(found: &Metadata) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    let kind = found.file_type();
    match () {
        () if kind.is_dir() => "a directory",
        () if kind.is_fifo() => "a pipe",
        () if kind.is_char_device() => "a character device",
        () if kind.is_block_device() => "a block device",
        () if kind.is_socket() => "a socket",
        () => "no file",
    }
}

#[cfg(not(unix))]
fn kind(found: &Metadata) -> &'static str {
    if found.is_dir() { "a directory" } else { "no file" }
}
