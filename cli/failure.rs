//! How a command fails, and its exit code.

use beamlet::cli_support::printed;
use std::fmt;
use std::path::PathBuf;

/// Why a command did not end well.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The engine's error.
    Engine(beamlet::Error),
    /// A file that the command itself reads or writes.
    File { path: PathBuf, problem: String },
    /// Meshes that a run would refuse, or damaged parts of a run, each with its reason.
    Refused(Vec<String>),
    /// Arguments that do not go together, found after parsing.
    Usage(String),
    /// Two things that were compared differ: by what.
    Differs(String),
    /// Two things cannot be compared, or the answer cannot be given: why.
    Trouble(Box<Self>),
    /// The user stopped the run; what to enter to go on.
    Interrupted { advice: String },
    /// Stdout cannot be written.
    Stdout(std::io::Error),
}

impl Failure {
    /// The failure of a command whose exit code 1 is an answer.
    pub(crate) fn of_comparison(self) -> Self {
        match self {
            Self::Engine(_) | Self::File { .. } | Self::Refused(_) | Self::Stdout(_) => {
                Self::Trouble(Box::new(self))
            }
            Self::Differs(_) | Self::Usage(_) | Self::Trouble(_) | Self::Interrupted { .. } => self,
        }
    }

    /// The failure of options that do not go together.
    pub(crate) fn of_options(error: beamlet::Error) -> Self {
        match error {
            beamlet::Error::Argument { .. } => Self::Usage(error.to_string()),
            other => Self::Engine(other),
        }
    }

    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Engine(_) | Self::File { .. } | Self::Refused(_) | Self::Stdout(_) => 1,
            // As cmp and diff have it: 1 is an answer, 2 is trouble.
            Self::Differs(_) => 1,
            Self::Usage(_) | Self::Trouble(_) => 2,
            Self::Interrupted { .. } => crate::interrupt::EXIT_CODE,
        }
    }
}

/// Kind of an error, as `beamlet explain` names it; `None` where the message says all.
fn explained(error: &beamlet::Error) -> Option<&'static str> {
    match error {
        beamlet::Error::Device { .. } => Some("device"),
        beamlet::Error::Memory { .. } => Some("memory"),
        beamlet::Error::Mesh { .. } => Some("mesh"),
        beamlet::Error::Tally(_) => Some("rays"),
        _ => None,
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Trouble(failure) => failure.fmt(f),
            Self::Engine(error) => {
                for (index, error) in error.each().iter().enumerate() {
                    write!(f, "{}error: {error}", if index == 0 { "" } else { "\n" })?;
                }
                let kind = error.each().iter().find_map(explained);
                kind.map_or(Ok(()), |kind| {
                    write!(f, "\ncauses and remedies: beamlet explain {kind}")
                })
            }
            Self::Differs(what) => write!(f, "they differ: {what}"),
            Self::File { path, problem } => {
                write!(f, "error: {}: {problem}", printed::path(path))
            }
            Self::Refused(reasons) => write!(f, "error: {}", reasons.join("\nerror: ")),
            Self::Usage(problem) => write!(f, "error: {problem}\n\nFor more, try '--help'."),
            Self::Interrupted { advice } if advice.is_empty() => write!(f, "interrupted"),
            Self::Interrupted { advice } => write!(f, "interrupted\n{advice}"),
            Self::Stdout(error) => write!(f, "error: stdout cannot be written: {error}"),
        }
    }
}

impl From<beamlet::Error> for Failure {
    fn from(error: beamlet::Error) -> Self {
        Self::Engine(error)
    }
}

/// Only writes to stdout reach this one; other files carry their path.
impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Stdout(error)
    }
}
