//! progress.log: views of a run that are safely on disk.
//!
//! Append-only text, one line per committed view, synced after each. A view counts when its
//! line is there and its frames still have the checksum of that line; a line cut short by a
//! crash does not count. The checksum is the SHA-256 of the view's f32 values, little endian,
//! `[step][row][column]`: the same for every file format, and in Python
//! `hashlib.sha256(sample[v].tobytes()).hexdigest()`. Where there are counts, a line of theirs
//! (`counts/sample/0`) stands before the line of the view, and the view counts with both.
//! Its fourth word, `tally:` and JSON, has the counts of the view's rays that are not zero.

use super::layout;
use beamlet_core::locked_file::LockedFile;
use beamlet_core::whole_file::refuse_link;
use beamlet_core::{Error, Result, Tally, input_file, open_file};
use beamlet_model::scene::{Exposure, text_hash};
use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Most bytes of a log: two lines for each of the most views that a scene may have.
const MOST: u64 = 4 << 30;
/// Beginning of the word with a view's tally.
const TALLY: &str = "tally:";

/// A committed view as the log knows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Entry {
    /// Bytes of its values.
    pub(crate) bytes: u64,
    /// SHA-256 of its values, hexadecimal.
    pub(crate) sha256: String,
    /// SHA-256 of the counts, where the view has them beside its intensities.
    pub(crate) counts: Option<String>,
    /// Counts of its rays.
    pub(crate) tally: Tally,
}

/// The open log. It is locked while it is open: one writer per run directory.
#[derive(Debug)]
pub(super) struct ProgressLog {
    file: LockedFile,
    path: PathBuf,
}

impl ProgressLog {
    /// Opens and locks the log, which is made where it is missing.
    pub(super) fn lock(path: &Path) -> Result<Self> {
        Self::locked(path, true)
    }

    /// As [`ProgressLog::lock`]; `None` where there is no log, or none that may be written.
    pub(super) fn lock_if_there(path: &Path) -> Result<Option<Self>> {
        match Self::locked(path, false) {
            Ok(log) => Ok(Some(log)),
            Err(Error::File { source: Some(source), .. })
                if matches!(
                    source.kind(),
                    ErrorKind::NotFound
                        | ErrorKind::NotADirectory
                        | ErrorKind::PermissionDenied
                        | ErrorKind::ReadOnlyFilesystem
                ) =>
            {
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    fn locked(path: &Path, create: bool) -> Result<Self> {
        let log = Self::try_locked(path, create)?;
        log.ok_or_else(|| Error::file(path, "another beamlet process is using this run", None))
    }

    /// `None` where another process has the lock.
    fn try_locked(path: &Path, create: bool) -> Result<Option<Self>> {
        refuse_link(path)?;
        let mut options = OpenOptions::new();
        let file = options
            .create(create)
            .truncate(false)
            .read(true)
            .write(true)
            .open(path)
            .map_err(|error| Error::file(path, "cannot be opened", Some(error)))?;
        let file = LockedFile::exclusive(file).filter(|file| open_file::is_at(file, path));
        Ok(file.map(|file| Self { file, path: path.to_path_buf() }))
    }

    /// Cuts off an incomplete last line after a crash, and continues behind the whole lines.
    pub(super) fn mend(&mut self) -> Result<()> {
        let fail = |what: &str, error| Error::file(&self.path, what, Some(error));
        let mut text = Vec::new();
        self.file
            .seek(SeekFrom::Start(0))
            .and_then(|_| self.file.read_to_end(&mut text))
            .map_err(|error| fail("cannot be read", error))?;
        let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at as u64 + 1);
        if whole < text.len() as u64 {
            self.file.set_len(whole).map_err(|error| fail("cannot be mended", error))?;
        }
        self.file
            .seek(SeekFrom::Start(whole))
            .map(drop)
            .map_err(|error| fail("cannot be opened", error))
    }

    /// Removes every line: nothing is committed then. The lock stays.
    pub(super) fn clear(&mut self) -> Result<()> {
        self.file
            .set_len(0)
            .and_then(|()| self.file.seek(SeekFrom::Start(0)))
            .and_then(|_| self.file.sync_all())
            .map_err(|error| Error::file(&self.path, "cannot be cleared", Some(error)))
    }

    /// Refuses to go on with a run whose log is no longer at its path: frames that are written by
    /// their paths would be in another folder than those before.
    pub(super) fn refuse_moved(&self) -> Result<()> {
        open_file::refuse_moved(&self.file, &self.path, open_file::RESUME)
    }

    /// Appends a line and syncs it.
    pub(super) fn append(&mut self, view: Exposure, entry: &Entry) -> Result<()> {
        let lines = lines(view, entry);
        self.file
            .write_all(lines.as_bytes())
            .and_then(|()| self.file.sync_data())
            .map_err(|error| Error::file(&self.path, "cannot be written", Some(error)))
    }
}

/// The lines of a view: of its counts, and of itself.
fn lines(view: Exposure, entry: &Entry) -> String {
    let [counts, own] = [true, false].map(|counts| layout::view(view, counts));
    let bytes = entry.bytes;
    let counts = entry.counts.as_ref().map(|sha256| format!("{counts} {bytes} sha256:{sha256}\n"));
    let tally = tally_word(&entry.tally);
    counts.unwrap_or_default() + &format!("{own} {bytes} sha256:{}{tally}\n", entry.sha256)
}

/// Contents of a log.
#[derive(Debug, Default)]
pub(super) struct Contents {
    /// SHA-256 of the text, hexadecimal.
    pub(crate) sha256: String,
    /// Views that are committed.
    pub(super) views: BTreeMap<Exposure, Entry>,
}

/// The committed views of a log; a missing log is an empty one.
pub(super) fn read(path: &Path) -> Result<BTreeMap<Exposure, Entry>> {
    read_all(path).map(|contents| contents.views)
}

/// Reads a log; the last line of a view counts. A missing log is an empty one.
pub(super) fn read_all(path: &Path) -> Result<Contents> {
    let bytes = match input_file::read(path, MOST) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Contents::default()),
        Err(error) => return Err(Error::file(path, "cannot be read", Some(error))),
    };
    let mut contents = Contents { sha256: text_hash(&bytes), ..Contents::default() };
    // Bytes that are no text are no line, and named below.
    let text = String::from_utf8_lossy(&bytes);
    // Lines before the line that they belong to.
    let mut counts = BTreeMap::new();
    for (index, line) in text.split_inclusive('\n').enumerate() {
        let Some(line) = line.strip_suffix('\n') else { break };
        let ((view, is_counts), mut entry) = parse(line).ok_or_else(|| {
            let problem = format!(
                "line {} is not \"view bytes sha256:checksum tally:{{…}}\": found {line:?}",
                index + 1
            );
            Error::file(path, problem, None)
        })?;
        if is_counts {
            counts.insert(view, entry.sha256);
        } else {
            entry.counts = counts.remove(&view);
            contents.views.insert(view, entry);
        }
    }
    Ok(contents)
}

/// View and entry of a line, and whether it is the line of the view's counts.
fn parse(line: &str) -> Option<((Exposure, bool), Entry)> {
    let mut words = line.split(' ');
    let what = layout::view_named(words.next()?)?;
    let bytes = words.next()?.parse().ok()?;
    let sha256 = words.next()?.strip_prefix("sha256:")?.to_owned();
    // Lines of counts have none.
    let tally = match (&what, words.next()) {
        (_, Some(word)) => serde_json::from_str(word.strip_prefix(TALLY)?).ok()?,
        ((_, is_counts), None) => is_counts.then(Tally::default)?,
    };
    let whole = sha256.len() == 64 && words.next().is_none();
    whole.then_some((what, Entry { bytes, sha256, counts: None, tally }))
}

/// The counts that are not zero, as the word that ends a line.
fn tally_word(tally: &Tally) -> String {
    let counts = serde_json::to_value(tally).unwrap_or_default();
    let counts = counts.as_object().into_iter().flatten();
    let counted: serde_json::Map<_, _> = counts
        .filter(|(_, count)| count.as_u64() != Some(0))
        .map(|(name, count)| (name.clone(), count.clone()))
        .collect();
    format!(" {TALLY}{}", serde_json::Value::Object(counted))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(path: &Path) -> ProgressLog {
        let mut log = ProgressLog::lock(path).unwrap();
        log.mend().unwrap();
        log
    }

    fn entry(digit: char) -> Entry {
        Entry {
            bytes: 44,
            sha256: digit.to_string().repeat(64),
            counts: None,
            tally: Tally::default(),
        }
    }

    #[test]
    fn a_view_counts_with_the_line_of_its_counts_before_its_own() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("progress.log");
        let whole = Entry { counts: Some("d".repeat(64)), ..entry('a') };
        let mut log = open(&path);
        log.append(Exposure::Sample(3), &whole).unwrap();
        log.append(Exposure::Dark(0), &entry('b')).unwrap();
        let there = read(&path).unwrap();
        assert_eq!(there[&Exposure::Sample(3)], whole);
        assert_eq!(there[&Exposure::Dark(0)], entry('b'));
        // Cut after the line of the counts: nothing is committed.
        let text = std::fs::read_to_string(&path).unwrap();
        let first = text.find('\n').unwrap() + 1;
        std::fs::write(&path, &text[..first]).unwrap();
        assert!(read(&path).unwrap().is_empty());
    }

    #[test]
    fn what_is_appended_is_read_back_and_the_last_line_of_a_view_counts() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("progress.log");
        let mut log = open(&path);
        log.append(Exposure::Flat(0), &entry('a')).unwrap();
        log.append(Exposure::Sample(12345), &entry('b')).unwrap();
        let counted = Entry { tally: Tally { rays: 7, ..Tally::default() }, ..entry('d') };
        log.append(Exposure::Sample(0), &counted).unwrap();
        log.append(Exposure::Flat(0), &entry('c')).unwrap();
        let read = read(&path).unwrap();
        assert_eq!(read.len(), 3);
        assert_eq!(read[&Exposure::Sample(0)], counted);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(" tally:{\"rays\":7}\n"), "{text}");
        assert_eq!(read[&Exposure::Flat(0)], entry('c'));
        assert_eq!(read[&Exposure::Sample(12345)], entry('b'));
    }

    #[test]
    fn a_line_cut_short_does_not_count_and_is_not_appended_to() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("progress.log");
        open(&path).append(Exposure::Flat(0), &entry('a')).unwrap();
        let mut text = std::fs::read_to_string(&path).unwrap();
        text.push_str("sample/0 44 sha256:bbbb");
        std::fs::write(&path, &text).unwrap();
        assert_eq!(read(&path).unwrap().len(), 1);
        open(&path).append(Exposure::Sample(1), &entry('c')).unwrap();
        let views: Vec<Exposure> = read(&path).unwrap().into_keys().collect();
        assert_eq!(views, [Exposure::Flat(0), Exposure::Sample(1)]);
    }

    #[test]
    fn a_damaged_line_is_an_error_with_its_number() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("progress.log");
        std::fs::write(&path, "flat forty-four sha256:aa\n").unwrap();
        let message = read(&path).unwrap_err().to_string();
        assert!(message.contains("progress.log") && message.contains("line 1"), "{message}");
    }

    #[test]
    fn a_second_writer_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("progress.log");
        let _first = open(&path);
        assert!(ProgressLog::lock(&path).is_err());
    }
}
