//! Inputs of derived files: their hashes are in the record of the files, and are compared where the files
//! are read.

use super::apart::canonical;
use super::layout::{self, LOG, RETRIEVED, SCENE};
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result, folder, input_file, printed};
use beamlet_model::scene::{hash_until, text_hash};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Hashes of inputs by path, as a record has them.
#[derive(Debug, Clone, Default)]
pub struct InputHashes {
    /// SHA-256 of a file, or of the contents of a folder (`path_hash`).
    pub hashes: BTreeMap<String, String>,
    /// Hashes of size and time of modification. An input with the same stamp is not read again.
    pub stamps: BTreeMap<String, String>,
}

impl InputHashes {
    /// Hashes of files and folders.
    ///
    /// # Errors
    /// [`Error::File`] for one that cannot be read; [`Error::Interrupted`].
    pub fn of(paths: &[PathBuf], cancel: &Cancel) -> Result<Self> {
        let mut found = Self::default();
        for path in paths {
            let name = path.display().to_string();
            // The stamp first: a later change of the contents changes it.
            if let Ok(stamp) = stamp(path) {
                found.stamps.insert(name.clone(), stamp);
            }
            found.hashes.insert(name, path_hash(path, cancel)?);
        }
        Ok(found)
    }

    /// Adds the inputs of the files in `folder`, as their record has them: the files are inputs of others
    /// in turn. Relative paths start from the present working directory then.
    ///
    /// # Errors
    /// [`Error::File`] for a record that cannot be read.
    pub fn inherit(&mut self, folder: &Path, record: &str) -> Result<()> {
        let Some(recorded) = Recorded::read(&folder.join(record))? else { return Ok(()) };
        let from = recorded.elsewhere().map(Path::to_path_buf);
        let moved = |path: String| match &from {
            Some(from) => from.join(path).display().to_string(),
            None => path,
        };
        self.hashes.extend(recorded.inputs.into_iter().map(|(path, it)| (moved(path), it)));
        self.stamps.extend(recorded.input_stamps.into_iter().map(|(path, it)| (moved(path), it)));
        Ok(())
    }
}

/// Directory from which relative paths of a record start.
pub fn working_directory() -> Option<String> {
    std::env::current_dir().ok().map(|path| path.display().to_string())
}

fn is_working_directory(path: &Path) -> bool {
    std::env::current_dir().is_ok_and(|here| here == path)
}

/// Entries of a record that concern inputs.
#[derive(Debug, Deserialize)]
struct Recorded {
    #[serde(default)]
    command: Option<String>,
    #[serde(default)]
    inputs: BTreeMap<String, String>,
    #[serde(default)]
    input_stamps: BTreeMap<String, String>,
    #[serde(default)]
    working_directory: Option<PathBuf>,
}

impl Recorded {
    /// Directory that relative paths start from, where it is not the working directory.
    fn elsewhere(&self) -> Option<&Path> {
        self.working_directory.as_deref().filter(|from| !is_working_directory(from))
    }

    /// The entries of a record; `None` where there is no record.
    fn read(path: &Path) -> Result<Option<Self>> {
        let text = match input_file::text(path) {
            Ok(text) => text,
            Err(error)
                if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) =>
            {
                return Ok(None);
            }
            Err(error) => return Err(Error::file(path, "cannot be read", Some(error))),
        };
        serde_json::from_str(&text).map(Some).map_err(|error| {
            Error::file(path, format!("is not a record of beamlet: {error}"), None)
        })
    }

    /// Existing files or folders that an input of the files in `folder` may be.
    fn places(&self, input: &str, folder: &Path) -> Vec<PathBuf> {
        let input = Path::new(input);
        let name = input.file_name().unwrap_or_default();
        let own = own_run(folder).filter(|_| [SCENE, LOG].iter().any(|own| name == *own));
        let mut places = match own {
            Some(run) => vec![run.join(name)],
            None => {
                let from = self.elsewhere().unwrap_or(Path::new(""));
                // Files that were moved together lie beside one another as before.
                let place = canonical(folder);
                let beside = place.parent().map(|parent| parent.join(input));
                std::iter::once(from.join(input)).chain(beside).collect()
            }
        };
        places.retain(|place| folder::is_there(place));
        places
    }

    /// True if a file or folder is an input as it was.
    fn is_same(&self, input: &str, hash: &str, place: &Path) -> Result<bool> {
        let recorded = self.input_stamps.get(input);
        if recorded.is_some_and(|recorded| stamp(place).is_ok_and(|found| found == *recorded)) {
            return Ok(true);
        }
        Ok(path_hash(place, &Cancel::default())? == hash)
    }

    /// The command that makes the files in `folder` again, by the verb that makes such files.
    fn command(&self, verb: &str, folder: &Path) -> String {
        let begin = format!("beamlet {verb} ");
        let Some(command) = self.command.as_ref().filter(|command| command.starts_with(&begin))
        else {
            let run = own_run(folder).map(|run| format!("{} ", printed::path(&run)));
            return format!("{begin}{}--overwrite", run.unwrap_or_default());
        };
        let end = if command.contains("--overwrite") { "" } else { " --overwrite" };
        match self.elsewhere() {
            Some(from) if from.is_dir() => {
                format!("cd {} && {command}{end}", printed::path(from))
            }
            _ => format!("{command}{end}"),
        }
    }
}

/// The run whose folder of retrieved images `folder` is.
fn own_run(folder: &Path) -> Option<PathBuf> {
    let place = canonical(folder);
    let run = place.parent().filter(|run| layout::is_run(run))?;
    let is_own = place.file_name().is_some_and(|name| name == RETRIEVED);
    // As it was named, where this has a parent.
    let named = folder.parent().filter(|parent| canonical(parent) == run);
    let named = named.filter(|parent| !parent.as_os_str().is_empty());
    is_own.then(|| named.unwrap_or(run).to_path_buf())
}

/// Refuses the files in `folder` where an input is there and has another hash than in their `record`.
/// `verb`: the command that makes such files.
///
/// # Errors
/// [`Error::File`] with the input, and the command that makes the files again.
pub fn refuse_changed(folder: &Path, record: &str, verb: &str) -> Result<()> {
    let Some(recorded) = Recorded::read(&folder.join(record))? else { return Ok(()) };
    for (input, hash) in &recorded.inputs {
        let places = recorded.places(input, folder);
        let mut is_found = false;
        for place in &places {
            is_found = is_found || recorded.is_same(input, hash, place)?;
        }
        if let (false, Some(place)) = (is_found, places.first()) {
            let problem = format!(
                "is out of date: {} has changed since; make it again with `{}`",
                printed::path(place),
                recorded.command(verb, folder)
            );
            return Err(Error::file(folder, problem, None));
        }
    }
    Ok(())
}

/// SHA-256 of a file, or of the contents of a folder or a pattern: lines of hash and name.
pub(crate) fn path_hash(path: &Path, cancel: &Cancel) -> Result<String> {
    if !path.is_dir() && !folder::is_pattern(path) {
        return hash_until(path, cancel);
    }
    let unread = |error| Error::file(path, "cannot be read", Some(error));
    let paths = folder::entries(path).map_err(unread)?;
    let line = |path: &PathBuf| Ok(line(&path_hash(path, cancel)?, path));
    let lines = paths.iter().map(line).collect::<Result<String>>()?;
    Ok(text_hash(&lines))
}

/// Hash of size and time of modification of a file, or of all files of a folder or a pattern.
fn stamp(path: &Path) -> io::Result<String> {
    if !path.is_dir() && !folder::is_pattern(path) {
        let found = fs::metadata(path)?;
        let since = found.modified()?.duration_since(UNIX_EPOCH).map_err(io::Error::other)?;
        return Ok(text_hash(format!("{} {}", found.len(), since.as_nanos())));
    }
    let line = |path: &PathBuf| Ok(line(&stamp(path)?, path));
    let lines = folder::entries(path)?.iter().map(line).collect::<io::Result<String>>()?;
    Ok(text_hash(&lines))
}

/// Line of a file in the listing of its folder.
fn line(hash: &str, path: &Path) -> String {
    format!("{hash}  {}\n", path.file_name().unwrap_or_default().display())
}
