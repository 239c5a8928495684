//! A log for arrays that a test put into a run.

use sha2::{Digest, Sha256};
use std::fs;
use std::path::Path;

/// Records the arrays of a run as committed.
pub(crate) fn commit(run: &Path) {
    let values = |name: &str| {
        let bytes = fs::read(run.join(name)).ok()?;
        let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        Some(bytes[header..].to_vec())
    };
    let line = |name: &str, values: &[u8]| {
        let hash: String = Sha256::digest(values).iter().map(|b| format!("{b:02x}")).collect();
        let tally = if name.starts_with("counts/") { "" } else { " tally:{}" };
        format!("{name} {} sha256:{hash}{tally}\n", values.len())
    };
    let mut log = String::new();
    for counts in ["counts/", ""] {
        let Some(flat) = values(&format!("{counts}flat.npy")) else { continue };
        log += &line(&format!("{counts}flat"), &flat);
        let sample = values(&format!("{counts}sample.npy")).expect("the samples beside the flat");
        for (index, view) in sample.chunks(flat.len()).enumerate() {
            log += &line(&format!("{counts}sample/{index}"), view);
        }
    }
    if let Some(dark) = values("dark.npy") {
        log += &line("dark", &dark);
    }
    fs::write(run.join("progress.log"), log).expect("the log is written");
}
