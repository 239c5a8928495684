//! EXR: a frame per file, 32-bit float, for every image viewer. Of files of others the channel `Y`, or
//! the only channel, is the frame; files of several parts are refused.

use super::limits::{refuse_hollow, refuse_shape};
use super::parts::{Append, Sample, Value, unwritten};
use crate::{Error, Result, input_file, numbers, parallel, reserve};
use exr::block::lines::LineRef;
use exr::block::reader::{ChunksReader, Reader};
use exr::compression::Compression;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, Text, WritableImage, f16,
};
use ndarray::ArrayView2;
use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

type FrameReader = Reader<BufReader<File>>;

/// A frame whose header was read.
#[derive(Debug)]
pub struct ExrFrame {
    path: PathBuf,
    /// Rows and columns.
    shape: [usize; 2],
}

impl ExrFrame {
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let reader = open(path)?;
        let header = first(path, reader.headers())?;
        channel(path, header)?;
        let shape = [header.layer_size.height(), header.layer_size.width()];
        refuse_hollow(path, shape)?;
        Ok(Self { path: path.to_path_buf(), shape })
    }

    pub(super) const fn shape(&self) -> [usize; 2] {
        self.shape
    }

    pub(super) fn read<T: Value>(&self, rows: Range<usize>) -> Result<Vec<T>> {
        read(&self.path, self.shape, rows)
    }
}

/// Some rows of a frame that has this shape.
pub(super) fn read<T: Value>(path: &Path, shape: [usize; 2], rows: Range<usize>) -> Result<Vec<T>> {
    let reader = open(path)?;
    let header = first(path, reader.headers())?;
    refuse_shape(path, [header.layer_size.height(), header.layer_size.width()], shape)?;
    let (wanted, _) = channel(path, header)?;
    let columns = shape[1];
    let mut values =
        reserve::filled(T::rounded(f64::NAN), rows.len() * columns, "rows of a frame")?;
    let mut found = vec![0; rows.len()];
    let unread = |error| failed(path, error);
    let meets = |top: usize, height: usize| top < rows.end && top + height > rows.start;
    let mut chunks = reader
        .filter_chunks(true, |_, tile, block| {
            block.layer == 0
                && tile.level_index == exr::math::Vec2(0, 0)
                && meets(block.pixel_position.y(), block.pixel_size.height())
        })
        .map_err(unread)?
        .sequential_decompressor(true);
    while let Some(block) = chunks.decompress_next_block() {
        let block = block.map_err(unread)?;
        let channels = &chunks.meta_data().headers[0].channels;
        for line in block.lines(channels) {
            let at = line.location;
            let y = at.position.y();
            if at.channel != wanted || !rows.contains(&y) {
                continue;
            }
            let start = (y - rows.start) * columns + at.position.x();
            let to = &mut values[start..start + at.sample_count];
            let kind = channels.list[wanted].sample_type;
            copy(line, kind, to).map_err(unread)?;
            found[y - rows.start] += at.sample_count;
        }
    }
    // Which of two blocks at one place counts depends on the rows that are read.
    if let Some(row) = found.iter().position(|count| *count != columns) {
        let problem = format!("has row {} twice or not at all", rows.start + row);
        return Err(Error::file(path, problem, None));
    }
    Ok(values)
}

/// Copies a line of samples.
fn copy<T: Value>(line: LineRef<'_>, kind: SampleType, to: &mut [T]) -> exr::error::UnitResult {
    fn all<S: exr::io::Data, T: Value>(
        line: LineRef<'_>,
        to: &mut [T],
        wide: impl Fn(S) -> f64,
    ) -> exr::error::UnitResult {
        for (to, from) in to.iter_mut().zip(line.read_samples::<S>()) {
            *to = T::rounded(wide(from?));
        }
        Ok(())
    }
    match kind {
        SampleType::F32 => all::<f32, T>(line, to, f64::from),
        SampleType::F16 => all::<f16, T>(line, to, |sample| sample.to_f32().into()),
        SampleType::U32 => all::<u32, T>(line, to, f64::from),
    }
}

fn open(path: &Path) -> Result<FrameReader> {
    let file =
        input_file::open(path).map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
    Reader::read_from_buffered(BufReader::new(file), true).map_err(|error| failed(path, error))
}

/// The one layer. B44 halves the precision of f16, and its decoder is written for arithmetic
/// that wraps: where overflow is checked it panics on files that are right.
fn first<'a>(path: &Path, headers: &'a [Header]) -> Result<&'a Header> {
    let [header] = headers else {
        let problem = format!("has {} parts; allowed: one, a frame", headers.len());
        return Err(Error::file(path, problem, None));
    };
    match header.compression {
        Compression::B44 | Compression::B44A => {
            let problem = "has the lossy compression B44; allowed: none, RLE, ZIP, PIZ, PXR24";
            Err(Error::file(path, problem, None))
        }
        _ => Ok(header),
    }
}

/// Index and type of the channel of intensities.
fn channel(path: &Path, header: &Header) -> Result<(usize, SampleType)> {
    let list = &header.channels.list;
    let found = match list.len() {
        1 => Some(0),
        _ => list.iter().position(|channel| channel.name.eq("Y")),
    };
    let sampled = |at: usize| list[at].sampling == exr::math::Vec2(1, 1);
    match found {
        Some(at) if sampled(at) => Ok((at, list[at].sample_type)),
        _ => {
            let names: Vec<String> = list.iter().map(|channel| channel.name.to_string()).collect();
            let problem = format!(
                "has the channels {}; allowed: one channel, or one that is named Y",
                names.join(", ")
            );
            Err(Error::file(path, problem, None))
        }
    }
}

fn failed(path: &Path, error: exr::error::Error) -> Error {
    match error {
        exr::error::Error::Io(source) => {
            Error::file(path, "cannot be read (cut short?)", Some(source))
        }
        other => Error::file(path, format!("is not a readable EXR frame: {other}"), None),
    }
}

/// A file that takes one frame, which is flushed at once and synced at the end.
pub(crate) fn append(path: &Path, sample: Sample) -> Box<dyn Append> {
    Box::new(ExrWriter { path: path.to_path_buf(), sample })
}

struct ExrWriter {
    path: PathBuf,
    sample: Sample,
}

/// Frames of fewer bytes are compressed sooner than threads are started for it.
const SMALL: usize = 1 << 20;

/// Zip, lossless: noise-free frames shrink to a fifth (measured on the bracket of the examples, 512
/// x 256 pixels) and take 0.2 s instead of 0.08 s per 22 MiB on two cores.
const ENCODING: Encoding = Encoding {
    compression: Compression::ZIP16,
    blocks: Blocks::ScanLines,
    line_order: LineOrder::Increasing,
};

impl Append for ExrWriter {
    fn put(&mut self, frame: ArrayView2<'_, f32>, about: &str) -> Result<()> {
        let path = &self.path;
        let software_name = Some(Text::from(concat!("beamlet ", env!("CARGO_PKG_VERSION"))));
        let mut attributes = LayerAttributes { software_name, ..LayerAttributes::default() };
        // One attribute, not many: the crate writes custom ones in the random order of a hash
        // map, and the same frame is to be the same bytes.
        let text = Text::new_or_none(about).unwrap_or_default();
        attributes.other.insert(Text::from("beamlet"), AttributeValue::Text(text));
        let samples = match self.sample {
            Sample::F32 => FlatSamples::F32(reserve::collected(frame.iter().copied(), "a frame")?),
            Sample::U16 | Sample::U32 => {
                let rounded = frame.iter().map(|it| numbers::whole(f64::from(*it).round()));
                FlatSamples::U32(reserve::collected(rounded, "a frame")?)
            }
        };
        let channel = AnyChannel::new("Y", samples);
        let channels = AnyChannels::sort([channel].into_iter().collect());
        let image = Image::from_layer(Layer::new(
            (frame.ncols(), frame.nrows()),
            attributes,
            ENCODING,
            channels,
        ));
        let mut out = BufWriter::new(File::create(path).map_err(|error| unwritten(path, error))?);
        // The crate starts threads for every file.
        let write = image.write();
        let alone = 4 * frame.len() < SMALL || !parallel::is_bounded();
        let write = if alone { write.non_parallel() } else { write };
        let written = write.to_buffered(&mut out);
        // A buffer that is dropped keeps its last error to itself.
        written.and_then(|()| Ok(out.flush()?)).map_err(|error| match error {
            exr::error::Error::Io(source) => unwritten(path, source),
            other => Error::file(path, format!("cannot be written: {other}"), None),
        })
    }

    fn finish(self: Box<Self>) -> Result<()> {
        crate::whole_file::sync_path(&self.path)
    }
}
