//! Files of pages that come one after another, each with its own description.

use crate::array_file::parts::{Append, Sample, unwritten};
use crate::{Error, Result, numbers, reserve};
use ndarray::ArrayView2;
use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tiff::encoder::colortype::{ColorType, Gray16, Gray32, Gray32Float};
use tiff::encoder::{Rational, TiffEncoder, TiffKind, TiffValue};
use tiff::tags::{ResolutionUnit, Tag};

/// Files above this many bytes are `BigTIFF`.
const CLASSIC: u64 = 4_000_000_000;

/// A file that the encoder writes to and that is flushed and synced behind its back: it gives no
/// writer back, and a buffer that is dropped keeps its last error to itself.
#[derive(Clone)]
struct Out(Arc<Mutex<BufWriter<File>>>);

impl Out {
    fn lock(&self) -> MutexGuard<'_, BufWriter<File>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Write for Out {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.lock().write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.lock().flush()
    }
}

impl Seek for Out {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.lock().seek(to)
    }
}

struct TiffWriter<K: TiffKind> {
    path: PathBuf,
    encoder: TiffEncoder<Out, K>,
    out: Out,
    /// Size of a pixel, x and z, m; `None` where it has none.
    pitch: Option<[f64; 2]>,
    sample: Sample,
}

/// Begins a file of pages: their number, rows and columns. With a pitch (x and z, m) `ImageJ` shows
/// lengths.
pub(crate) fn append(
    path: &Path,
    sides: [u32; 3],
    pitch: Option<[f64; 2]>,
    sample: Sample,
) -> Result<Box<dyn Append>> {
    let file = File::create(path).map_err(|error| unwritten(path, error))?;
    let out = Out(Arc::new(Mutex::new(BufWriter::new(file))));
    let failed = |error| refused(path, error);
    let (path, file) = (path.to_path_buf(), out.clone());
    let bytes = sides.iter().fold(4, |bytes: u64, side| bytes.saturating_mul((*side).into()));
    Ok(if bytes < CLASSIC {
        let encoder = TiffEncoder::new(file).map_err(failed)?;
        Box::new(TiffWriter { path, encoder, out, pitch, sample })
    } else {
        let encoder = TiffEncoder::new_big(file).map_err(failed)?;
        Box::new(TiffWriter { path, encoder, out, pitch, sample })
    })
}

impl<K: TiffKind> TiffWriter<K> {
    /// Adds a page of these columns and rows.
    fn page<C: ColorType>(
        &mut self,
        [columns, rows]: [u32; 2],
        values: &[C::Inner],
        about: &str,
    ) -> Result<()>
    where
        [C::Inner]: TiffValue,
    {
        let mut write = || {
            let mut page = self.encoder.new_image::<C>(columns, rows)?;
            page.encoder().write_tag(Tag::ImageDescription, about)?;
            if let Some(pitch) = self.pitch {
                let [x, z] = pitch.map(per_centimetre);
                page.resolution_unit(ResolutionUnit::Centimeter);
                page.x_resolution(x);
                page.y_resolution(z);
            }
            page.write_data(values)
        };
        write().map_err(|error| refused(&self.path, error))
    }
}

impl<K: TiffKind + Send + 'static> Append for TiffWriter<K> {
    fn put(&mut self, frame: ArrayView2<'_, f32>, about: &str) -> Result<()> {
        let sides = [frame.ncols(), frame.nrows()].map(numbers::count);
        let values = frame.iter().copied();
        let rounded = frame.iter().map(|value| f64::from(*value).round());
        match self.sample {
            Sample::F32 => {
                let values = reserve::collected(values, "an image")?;
                self.page::<Gray32Float>(sides, &values, about)
            }
            Sample::U16 => {
                let values = reserve::collected(rounded.map(numbers::whole), "an image")?;
                self.page::<Gray16>(sides, &values, about)
            }
            Sample::U32 => {
                let values = reserve::collected(rounded.map(numbers::whole), "an image")?;
                self.page::<Gray32>(sides, &values, about)
            }
        }
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let Self { path, encoder, out, .. } = *self;
        // Output of the encoder.
        drop(encoder);
        let mut file = out.lock();
        let synced = file.flush().and_then(|()| file.get_ref().sync_all());
        synced.map_err(|error| unwritten(&path, error))
    }
}

/// Pixels per centimetre. The tags alone calibrate: with a description of `ImageJ` readers take the values
/// of all pages to follow one another, which they do not here.
fn per_centimetre(pitch: f64) -> Rational {
    let n = 1_000_000_000_u32;
    let d = numbers::whole::<u32>((100.0 * pitch * f64::from(n)).round()).max(1);
    Rational { n, d }
}

fn refused(path: &Path, error: tiff::TiffError) -> Error {
    Error::file(path, format!("cannot be written: {error}"), None)
}
