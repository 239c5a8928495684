//! Version and commit of the program, for records.

use std::sync::OnceLock;

/// Version of beamlet; all its crates have the same.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

static COMMIT: OnceLock<&str> = OnceLock::new();

/// Sets the commit that was built. Later calls change nothing.
pub fn set_commit(commit: Option<&'static str>) {
    if let Some(commit) = commit {
        COMMIT.get_or_init(|| commit);
    }
}

/// The commit that was built; `None` in builds from a package and for development.
pub fn commit() -> Option<String> {
    COMMIT.get().map(|&commit| commit.to_owned())
}
