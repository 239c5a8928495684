//! What the fuzz targets share: files to read, runs to damage, and repairs.
//!
//! A reader that compares a hash or a length first refuses nearly every damaged file there, and
//! nothing behind it is tested. So most targets make hashes and lengths good again before the
//! reader sees the file. The first byte of an input, its *control*, says which repairs are left
//! out ([`RAW_HEADER`] …): an input of a control of 0 is repaired throughout.

pub mod exr;
pub mod frames;
pub mod meshes;
pub mod npy;
pub mod run;
pub mod tiff;
pub mod tiny_run;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Control: leaves the header as it is.
pub const RAW_HEADER: u8 = 1;
/// Control: leaves lengths and counts as they are.
pub const RAW_LENGTHS: u8 = 2;
/// Control: leaves hashes and checksums as they are.
pub const RAW_HASHES: u8 = 4;
/// Control: the choice that a target has besides.
pub const OTHER: u8 = 8;

/// A folder of this process.
pub static PLACE: LazyLock<PathBuf> = LazyLock::new(|| {
    let place = std::env::temp_dir().join(format!("beamlet-fuzz-{}", std::process::id()));
    fs::create_dir_all(&place).expect("the temporary folder can be written");
    place
});

/// Puts a file into the folder of this process.
pub fn put(name: &str, bytes: &[u8]) -> PathBuf {
    let path = PLACE.join(name);
    write(&path, bytes);
    path
}

/// Writes a file of a fixture.
pub fn write(path: &Path, bytes: &[u8]) {
    fs::write(path, bytes).expect("the temporary folder can be written");
}

/// Reads a file of a fixture.
pub fn read(path: &Path) -> Vec<u8> {
    fs::read(path).expect("the fixture is there")
}

/// Writes the seeds of a target into the folder that `BEAMLET_FUZZ_SEEDS` names, and ends the
/// process; goes on where there is no such variable. A seed is a control and the bytes of a file.
pub fn seeds(make: impl FnOnce() -> Vec<(u8, Vec<u8>)>) {
    let with_control = |(control, bytes): (u8, Vec<u8>)| [&[control], bytes.as_slice()].concat();
    bare_seeds(|| make().into_iter().map(with_control).collect());
}

/// As [`seeds`], for targets whose inputs have no control.
pub fn bare_seeds(make: impl FnOnce() -> Vec<Vec<u8>>) {
    let Some(folder) = std::env::var_os("BEAMLET_FUZZ_SEEDS") else { return };
    fs::create_dir_all(&folder).expect("the folder of seeds can be made");
    for (number, bytes) in make().into_iter().enumerate() {
        write(&Path::new(&folder).join(format!("seed_{number:03}")), &bytes);
    }
    let _ = fs::remove_dir_all(&*PLACE);
    std::process::exit(0);
}

/// Little-endian number at a place; zero where the bytes end before.
pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    match bytes.get(at..at + 4) {
        Some(four) => u32::from_le_bytes([four[0], four[1], four[2], four[3]]),
        None => 0,
    }
}

/// Puts a little-endian number at a place that is there.
pub(crate) fn put_u32(bytes: &mut [u8], at: usize, value: u32) {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

/// The bytes as a zlib stream without compression, with the checksum that it has to have.
pub(crate) fn zlib(bytes: &[u8]) -> Vec<u8> {
    miniz_oxide::deflate::compress_to_vec_zlib(bytes, 0)
}
