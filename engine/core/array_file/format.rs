//! Formats of array files, and the abilities of each.

use crate::options::{Choice, Word};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;

/// File format of arrays: stacks of frames, and retrieved images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Format {
    /// A 32-bit float EXR file per frame, channel `Y`.
    #[default]
    Exr,
    /// An array for numpy per stack or image, f32.
    Npy,
    /// A file of pages per stack or image, 32-bit float; stacks are calibrated for `ImageJ`, with
    /// counts of up to 16 bits as such.
    Tiff,
}

/// Abilities of a format, as beamlet uses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Abilities {
    /// Name on the command line and in records.
    pub name: &'static str,
    /// The format in a few words, for the command line.
    pub summary: &'static str,
    /// Endings of file names in lower case; the first is written.
    pub endings: &'static [&'static str],
    /// Bits of counts that are stored as whole numbers; 0: every value is a 32-bit float.
    pub integers: u32,
    /// A file holds all frames; a folder holds a file per frame otherwise.
    pub pages: bool,
    /// Each frame that is appended carries its metadata.
    pub metadata: bool,
    /// Frames can be appended without their number being known in advance.
    pub appending: bool,
    /// Every value has its place before any is written, so that several processes may write ranges
    /// of rows of one file.
    pub ranges: bool,
    /// Files keep all sides of an array; pages are one side otherwise.
    pub sides: bool,
    /// A folder of files of one frame each is read as a stack.
    pub folders: bool,
}

const EXR: Abilities = Abilities {
    name: "exr",
    summary: "One 32-bit float EXR file per frame or view",
    endings: &["exr"],
    integers: 0,
    pages: false,
    metadata: true,
    appending: true,
    ranges: false,
    sides: true,
    folders: true,
};

const NPY: Abilities = Abilities {
    name: "npy",
    summary: "One array for numpy per stack or image",
    endings: &["npy"],
    integers: 0,
    pages: true,
    metadata: false,
    appending: false,
    ranges: true,
    sides: true,
    folders: false,
};

const TIFF: Abilities = Abilities {
    name: "tiff",
    summary: "One TIFF of pages per stack or image; stacks are calibrated for Fiji and other viewers",
    endings: &["tif", "tiff"],
    integers: 16,
    pages: true,
    metadata: true,
    appending: true,
    ranges: true,
    sides: false,
    folders: true,
};

impl Format {
    /// Every format, the default first.
    pub const ALL: [Self; 3] = [Self::Exr, Self::Npy, Self::Tiff];

    /// Abilities of the format.
    #[must_use]
    pub const fn abilities(self) -> &'static Abilities {
        match self {
            Self::Exr => &EXR,
            Self::Npy => &NPY,
            Self::Tiff => &TIFF,
        }
    }

    /// The format of a file by the ending of its name.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_lowercase();
        Self::ALL.into_iter().find(|format| format.abilities().endings.contains(&ending.as_str()))
    }

    /// Ending of the files that are written.
    #[must_use]
    pub const fn ending(self) -> &'static str {
        self.abilities().endings[0]
    }
}

impl Choice for Format {
    const CHOICES: &'static [Self] = &Self::ALL;

    fn word(self) -> Word {
        let Abilities { name, summary, .. } = *self.abilities();
        Word { name, help: summary }
    }
}

/// Endings of some formats, for a message: `.npy, .tif, .tiff`.
pub fn endings(of: impl Fn(Format) -> bool) -> String {
    let formats = Format::ALL.into_iter().filter(|format| of(*format));
    let endings = formats.flat_map(|format| format.abilities().endings);
    endings.map(|ending| format!(".{ending}")).collect::<Vec<_>>().join(", ")
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.abilities().name)
    }
}
