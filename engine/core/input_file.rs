//! Files that are read: regular ones, and no longer than memory bears; and their text, whatever editor
//! wrote it.

use crate::numbers;
use std::borrow::Cow;
use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Most bytes of a text: scenes, tables, lists. The longest that is of use is the resolved scene of
/// ten million angles.
pub const TEXT: u64 = 512 << 20;

/// Opens a regular file that is not empty.
///
/// # Errors
///
/// Errors of the file system; a file that is empty or not regular.
pub fn open(path: &Path) -> Result<File> {
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
///
/// # Errors
///
/// Errors of the file system; a file that is not regular or longer than `most`.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
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

/// A regular file of UTF-8, as [`plain`].
///
/// # Errors
///
/// As [`read`]; bytes that are not UTF-8.
pub fn text(path: &Path) -> Result<String> {
    let problem = "it is not UTF-8";
    let invalid = |_| Error::new(ErrorKind::InvalidData, problem);
    String::from_utf8(lines(path)?).map_err(invalid)
}

/// A regular file of text in any encoding of 8 bits, as [`plain`].
///
/// # Errors
///
/// As [`read`]; text of 16 or 32 bits.
pub(crate) fn lines(path: &Path) -> Result<Vec<u8>> {
    let bytes = read(path, TEXT)?;
    match plain(&bytes).map_err(|problem| Error::new(ErrorKind::InvalidData, problem))? {
        Cow::Borrowed(same) if same.len() == bytes.len() => Ok(bytes),
        other => Ok(other.into_owned()),
    }
}

/// Text without a byte order mark and without the zeros and Ctrl-Z that some programs end files with.
/// Carriage returns that end lines become line feeds; lengths stay.
///
/// # Errors
/// UTF-16, by its mark.
pub fn plain(bytes: &[u8]) -> std::result::Result<Cow<'_, [u8]>, &'static str> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err("it is UTF-16; save it as UTF-8");
    }
    let bytes = without_mark(bytes);
    let end = bytes.iter().rposition(|byte| !matches!(byte, 0 | 0x1a)).map_or(0, |last| last + 1);
    let bytes = &bytes[..end];
    let is_old = |at: usize| bytes[at] == b'\r' && bytes.get(at + 1) != Some(&b'\n');
    let Some(first) = (0..end).find(|at| is_old(*at)) else { return Ok(Cow::Borrowed(bytes)) };
    let mut owned = bytes.to_vec();
    (first..end).filter(|at| is_old(*at)).for_each(|at| owned[at] = b'\n');
    Ok(Cow::Owned(owned))
}

/// The bytes behind a byte order mark of UTF-8.
pub fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_has_no_marks_and_one_kind_of_line_end() {
        for (bytes, wanted) in [
            (b"\xef\xbb\xbfa\nb".as_slice(), b"a\nb".as_slice()),
            (b"a\rb\r", b"a\nb\n"),
            (b"a\r\nb\rc", b"a\r\nb\nc"),
            (b"a\n\x1a", b"a\n"),
            (b"a\n\0\0", b"a\n"),
            (b"\0", b""),
            (b"", b""),
        ] {
            assert_eq!(plain(bytes).unwrap(), wanted);
        }
        assert!(matches!(plain(b"a\r\nb").unwrap(), Cow::Borrowed(_)));
        for bytes in [b"\xff\xfea\0", b"\xfe\xff\0a"] {
            assert!(plain(bytes).unwrap_err().contains("UTF-16"));
        }
    }
}
