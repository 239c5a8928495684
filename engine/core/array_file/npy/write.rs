//! Headers of version 1.0, padded to 64 bytes, f32, u16 or u32 little endian, C order: numpy, and everything
//! that memory-maps, reads such a file without conversion.

use crate::Result;
use crate::array_file::parts::{Append, Sample, unwritten};
use ndarray::ArrayView2;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Magic, version, length, and a Python dict padded with spaces so that the values start at a multiple
/// of 64 bytes. Sides, the slowest first, at least two.
pub(crate) fn header(sides: &[u32], sample: Sample) -> Vec<u8> {
    const BEFORE_DICT: usize = 10;
    let kind = match sample {
        Sample::F32 => "<f4",
        Sample::U16 => "<u2",
        Sample::U32 => "<u4",
    };
    let shape = sides.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    let mut dict = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let end = (BEFORE_DICT + dict.len() + 1).next_multiple_of(64);
    dict.push_str(&" ".repeat(end - BEFORE_DICT - dict.len() - 1));
    dict.push('\n');
    // At most four numbers of ten digits each: the dict never comes near 64 KiB.
    let len = u16::try_from(dict.len()).unwrap_or(u16::MAX);
    [b"\x93NUMPY\x01\x00".as_slice(), &len.to_le_bytes(), dict.as_bytes()].concat()
}

/// Begins a file of frames that come one after another.
pub(crate) fn append(path: &Path, sides: [u32; 3], sample: Sample) -> Result<Box<dyn Append>> {
    let failed = |error| unwritten(path, error);
    let mut file = BufWriter::new(File::create(path).map_err(failed)?);
    file.write_all(&header(&sides, sample)).map_err(failed)?;
    Ok(Box::new(NpyWriter { path: path.to_path_buf(), file, sample }))
}

struct NpyWriter {
    path: PathBuf,
    file: BufWriter<File>,
    sample: Sample,
}

impl Append for NpyWriter {
    fn put(&mut self, frame: ArrayView2<'_, f32>, _about: &str) -> Result<()> {
        let bytes = self.sample.encode(frame.iter().copied())?;
        self.file.write_all(&bytes).map_err(|error| unwritten(&self.path, error))
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        let synced = self.file.flush().and_then(|()| self.file.get_ref().sync_all());
        synced.map_err(|error| unwritten(&self.path, error))
    }
}
