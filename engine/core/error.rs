//! One error type, by who can act on it (scene, argument, mesh, device, memory, file).

use crate::printed;
use std::fmt;
use std::path::{Path, PathBuf};

/// Result of every fallible call of the engine.
pub type Result<T> = std::result::Result<T, Error>;

/// Where in a text file something was found. Lines and columns count from 1.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    /// The file, where the text came from one.
    pub file: Option<PathBuf>,
    /// Line and column, where they are known.
    pub line_column: Option<(usize, usize)>,
    /// The offending line of the text with a caret below it, where it is known.
    pub excerpt: Option<String>,
}

impl Place {
    /// Place of a word in a line of a file (or the line's start without the word).
    #[doc(hidden)]
    pub fn of_word(file: &Path, line: usize, text: &str, word: &str) -> Self {
        let column = text.find(word).map_or(1, |at| text[..at].chars().count() + 1);
        Self { file: Some(file.to_owned()), line_column: Some((line, column)), excerpt: None }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.file {
            Some(file) => write!(f, "{}", printed::path(file))?,
            None => write!(f, "scene")?,
        }
        if let Some((line, column)) = self.line_column {
            write!(f, ":{line}:{column}")?;
        }
        Ok(())
    }
}

/// What went wrong, by who can act on it.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// A value of the scene that is not possible.
    Scene {
        /// Place of the key.
        place: Box<Place>,
        /// Full path of the key, as `detector.pitch` or `object[2].unit`.
        key: String,
        /// The value found there.
        found: String,
        /// The values allowed there.
        allowed: String,
    },
    /// Several things are wrong with the scene: two or more errors, in the order of the file.
    Several(
        /// None of them is [`Error::Several`].
        Vec<Self>,
    ),
    /// A caller of the library gave what cannot be.
    #[non_exhaustive]
    Argument {
        /// The argument or option, as `gain`.
        name: String,
        /// The given value.
        found: String,
        /// The allowed values.
        allowed: String,
    },
    /// A mesh or shape cannot serve as a sample.
    Mesh {
        /// Name of the object, with its file where it has one.
        object: String,
        /// The problem.
        problem: String,
        /// Where: line, triangle, position; or a list of them, each on a line of its own.
        place: String,
    },
    /// No Vulkan device can serve, or the device failed.
    #[non_exhaustive]
    Device {
        /// The object sought, or the attempted step.
        wanted: String,
        /// The finding, or the failure.
        found: String,
        /// Advice on what to install or change.
        remedy: String,
    },
    /// Not enough memory.
    Memory {
        /// Purpose of the memory.
        purpose: String,
        /// Bytes needed; 0 where it is not known.
        needed: u64,
        /// Bytes available, where known.
        available: Option<u64>,
        /// Advice on what to change.
        remedy: String,
    },
    /// A file or directory cannot be read or written.
    #[non_exhaustive]
    File {
        /// The path.
        path: PathBuf,
        /// The attempted step, and the allowed values.
        problem: String,
        /// The system's own word, where there is one.
        source: Option<std::io::Error>,
    },
    /// Too many rays failed a check (see the tally); the result is not to be trusted.
    Tally(
        /// The count that passed its threshold.
        String,
    ),
    /// The caller asked the run to stop.
    Interrupted,
}

impl Error {
    /// A scene error at a key path without a known place in a file.
    pub fn scene(
        key: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self::scene_at(Place::default(), key, found, allowed)
    }

    /// A scene error at a known place.
    #[doc(hidden)]
    pub fn scene_at(
        place: Place,
        key: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Scene {
            place: Box::new(place),
            key: key.into(),
            found: found.into(),
            allowed: allowed.into(),
        }
    }

    /// One error for all of them, or `Ok` where there is none.
    ///
    /// # Errors
    ///
    /// The one error, or [`Error::Several`].
    #[doc(hidden)]
    pub fn of_all(mut errors: Vec<Self>) -> Result<()> {
        match errors.len() {
            0 => Ok(()),
            1 => Err(errors.remove(0)),
            _ => Err(Self::Several(errors)),
        }
    }

    /// The errors one by one: of [`Error::Several`] each, of any other itself.
    #[must_use]
    pub fn each(&self) -> &[Self] {
        match self {
            Self::Several(errors) => errors,
            one => std::slice::from_ref(one),
        }
    }

    /// An error of an argument.
    pub fn argument(
        name: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Argument { name: name.into(), found: found.into(), allowed: allowed.into() }
    }

    /// A mesh error.
    pub fn mesh(
        object: impl Into<String>,
        problem: impl Into<String>,
        place: impl Into<String>,
    ) -> Self {
        Self::Mesh { object: object.into(), problem: problem.into(), place: place.into() }
    }

    /// A device error.
    pub fn device(
        wanted: impl Into<String>,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Device { wanted: wanted.into(), found: found.into(), remedy: remedy.into() }
    }

    /// An error of reading or writing a path.
    pub fn file(
        path: impl Into<PathBuf>,
        problem: impl Into<String>,
        source: Option<std::io::Error>,
    ) -> Self {
        Self::File { path: path.into(), problem: problem.into(), source }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene { place, key, found, allowed } => {
                let found = printed::beginning(found);
                write!(f, "{place}: {key}: found {found}; allowed: {allowed}")?;
                if let Some(excerpt) = &place.excerpt {
                    write!(f, "\n{excerpt}")?;
                }
                Ok(())
            }
            Self::Several(errors) => {
                for (index, error) in errors.iter().enumerate() {
                    let separator = if index == 0 { "" } else { "\n" };
                    write!(f, "{separator}{error}")?;
                }
                Ok(())
            }
            Self::Argument { name, found, allowed } => {
                write!(f, "{name}: found {}; allowed: {allowed}", printed::beginning(found))
            }
            Self::Mesh { object, problem, place } => {
                write!(f, "{}: {problem}", printed::line(object))?;
                match place {
                    place if place.is_empty() => Ok(()),
                    place if place.starts_with('\n') => write!(f, "{place}"),
                    place => write!(f, " ({place})"),
                }
            }
            Self::Device { wanted, found, remedy } => {
                write!(f, "{wanted}: {found}")?;
                if remedy.is_empty() { Ok(()) } else { write!(f, "; {remedy}") }
            }
            Self::Memory { purpose, needed, available, remedy } => {
                match needed {
                    0 => write!(f, "no memory for {purpose}")?,
                    _ => write!(f, "{purpose} needs {} MiB", needed.div_ceil(1 << 20))?,
                }
                if let Some(available) = available {
                    write!(f, ", {} MiB are available", available >> 20)?;
                }
                write!(f, "; {remedy}")
            }
            Self::File { path, problem, source } => {
                write!(f, "{}: {problem}", printed::path(path))?;
                match source {
                    Some(source) => write!(f, ": {source}"),
                    None => Ok(()),
                }
            }
            Self::Tally(what) => write!(f, "too many rays failed a check: {what}"),
            Self::Interrupted => write!(f, "interrupted"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::File { source: Some(source), .. } => Some(source),
            _ => None,
        }
    }
}
