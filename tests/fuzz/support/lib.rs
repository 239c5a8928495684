//! Files to read, runs to damage, and repairs, for fuzz targets and for tests/inputs/garbage.rs.
//!
//! A reader that compares a hash or a length first refuses nearly every damaged file there, and
//! nothing behind it is tested. So most targets make hashes and lengths good again before the
//! reader sees the file. The first byte of an input, its *control*, says which repairs are left
//! out ([`RAW_HEADER`] …): an input of a control of 0 is repaired throughout.

pub mod exr;
pub mod frames;
pub mod meshes;
pub mod npy;
pub mod readers;
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
/// process; goes on where there is no such variable.
pub fn seeds(make: impl FnOnce() -> Vec<Vec<u8>>) {
    let Some(folder) = std::env::var_os("BEAMLET_FUZZ_SEEDS") else { return };
    fs::create_dir_all(&folder).expect("the folder of seeds can be made");
    for (number, bytes) in make().into_iter().enumerate() {
        write(&Path::new(&folder).join(format!("seed_{number:03}")), &bytes);
    }
    let _ = fs::remove_dir_all(&*PLACE);
    std::process::exit(0);
}

/// Seeds of a control and the bytes of a file.
pub fn with_control(files: Vec<(u8, Vec<u8>)>) -> Vec<Vec<u8>> {
    files.into_iter().map(|(control, bytes)| [&[control], bytes.as_slice()].concat()).collect()
}

/// Words that readers trip over.
const WORDS: [&str; 36] = [
    "nan",
    "-inf",
    "1e999",
    "-0",
    "1e-400",
    "18446744073709551616",
    "4294967297",
    "0",
    "\"",
    "'",
    "[",
    "]]",
    "{",
    "}",
    "=",
    ",",
    ".",
    "#",
    "\n",
    "\r",
    "\u{feff}",
    "\u{b5}m",
    "\0",
    "\\u0000",
    " m",
    "\"-1 mm\"",
    "true",
    "null",
    "1979-05-27",
    "v ",
    "f 1 2 3\n",
    "//",
    "endloop",
    "solid",
    "[[object]]\n",
    "\u{1f600}",
];

/// A file with one to four places changed; `number` chooses places, bytes that go and bytes that come.
pub fn damaged(file: &[u8], number: u64) -> Vec<u8> {
    let draws = tiny_run::drawn(number);
    let mut bytes = file.to_vec();
    for draw in draws.chunks_exact(8).take(1 + usize::from(draws[0] % 4)) {
        let from = (bytes.len() * usize::from(u16::from_le_bytes([draw[1], draw[2]]))) >> 16;
        let end = bytes.len().min(from + usize::from(draw[3] % 12));
        let word = match draw[4] % 6 {
            0 => &draw[5..8],
            1 => &[],
            _ => WORDS[usize::from(draw[5]) % WORDS.len()].as_bytes(),
        };
        bytes.splice(from..end, word.iter().copied());
    }
    bytes
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
