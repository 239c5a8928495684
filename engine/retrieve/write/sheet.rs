//! The images of one name, view after view, in one of the formats.

use super::ImageFormat;
use crate::numbers;
use crate::whole_file::{sync_directory, sync_path};
use crate::{Error, Result, folder, parallel, reserve};
use exr::prelude::*;
use ndarray::{ArrayBase, ArrayView2, Data, Ix2};
use rayon::prelude::*;
use std::fmt;
use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tiff::encoder::colortype::Gray32Float;
use tiff::encoder::{TiffEncoder, TiffKind};
use tiff::tags::Tag;

/// Files above this many bytes are `BigTIFF`.
const CLASSIC: u64 = 4_000_000_000;

/// A file that encoders write to and that is flushed and synced behind their backs: they give no
/// writer back, and a buffer that is dropped keeps its last error to itself.
#[derive(Clone)]
struct Out(Arc<Mutex<BufWriter<File>>>);

impl Out {
    fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(|error| written(path, error))?;
        Ok(Self(Arc::new(Mutex::new(BufWriter::new(file)))))
    }

    fn lock(&self) -> MutexGuard<'_, BufWriter<File>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Everything is on disk.
    fn sync(&self) -> std::io::Result<()> {
        let mut file = self.lock();
        file.flush()?;
        file.get_ref().sync_all()
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

/// Images in the making.
pub(crate) struct Sheet {
    path: PathBuf,
    about: serde_json::Value,
    views: usize,
    next: usize,
    file: SheetKind,
    /// The file of all views, but for EXR, which has one for each.
    out: Option<Out>,
}

enum SheetKind {
    Exr,
    Npy(Out),
    Tiff(Box<TiffEncoder<Out>>),
    BigTiff(Box<TiffEncoder<Out, tiff::encoder::TiffKindBig>>),
}

impl fmt::Debug for Sheet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Sheet").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Sheet {
    /// Begins the images of `name`: views, rows and columns.
    pub(crate) fn begin(
        folder: &Path,
        name: &str,
        format: ImageFormat,
        shape: [usize; 3],
        about: serde_json::Value,
    ) -> Result<Self> {
        let [views, rows, columns] = shape;
        let path = match format {
            ImageFormat::Exr => folder.join(name),
            ImageFormat::Npy => folder.join(format!("{name}.npy")),
            ImageFormat::Tiff => folder.join(format!("{name}.tif")),
        };
        let bytes = 4 * (views * rows * columns) as u64;
        if format == ImageFormat::Exr {
            folder::make(&path).map_err(|error| written(&path, error))?;
            return Ok(Self { path, about, views, next: 0, file: SheetKind::Exr, out: None });
        }
        let out = Out::create(&path)?;
        let mut file = out.clone();
        let file = match format {
            ImageFormat::Tiff if bytes < CLASSIC => {
                let encoder = TiffEncoder::new(file).map_err(|e| refused(&path, e))?;
                SheetKind::Tiff(Box::new(encoder))
            }
            ImageFormat::Tiff => {
                let encoder = TiffEncoder::new_big(file).map_err(|e| refused(&path, e))?;
                SheetKind::BigTiff(Box::new(encoder))
            }
            _ => {
                let header = crate::stack::npy_header(&[views, rows, columns]);
                file.write_all(&header).map_err(|error| written(&path, error))?;
                SheetKind::Npy(file)
            }
        };
        Ok(Self { path, about, views, next: 0, file, out: Some(out) })
    }

    /// The next view, in C order.
    pub(crate) fn put<S: Data<Elem = f32>>(&mut self, image: &ArrayBase<S, Ix2>) -> Result<()> {
        let image = image.view();
        let mut about = self.about.clone();
        if self.views > 1
            && let Some(about) = about.as_object_mut()
        {
            about.insert("view".into(), self.next.into());
        }
        match &mut self.file {
            SheetKind::Exr => {
                write_exr(&self.view_path(self.next), image, &about)?;
            }
            SheetKind::Npy(file) => {
                let bytes = crate::stack::le_bytes(image.iter().copied())?;
                file.write_all(&bytes).map_err(|error| written(&self.path, error))?;
            }
            SheetKind::Tiff(encoder) => page(&self.path, encoder, image, &about)?,
            SheetKind::BigTiff(encoder) => page(&self.path, encoder, image, &about)?,
        }
        self.next += 1;
        Ok(())
    }

    /// EXR: the file of a view.
    fn view_path(&self, view: usize) -> PathBuf {
        let width = self.views.saturating_sub(1).max(1).ilog10().max(3) as usize + 1;
        self.path.join(format!("view_{view:0width$}.exr"))
    }

    /// The last view was put: everything is on disk.
    pub(crate) fn finish(mut self) -> Result<()> {
        let Some(out) = self.out.take() else {
            let paths: Vec<PathBuf> = (0..self.next).map(|view| self.view_path(view)).collect();
            // Journalling file systems settle syncs that wait at the same time together.
            paths.par_iter().try_for_each(|path| sync_path(path))?;
            return sync_directory(&self.path);
        };
        // What the encoder writes as it goes.
        self.file = SheetKind::Exr;
        out.sync().map_err(|error| written(&self.path, error))
    }
}

fn page<K: TiffKind>(
    path: &Path,
    encoder: &mut TiffEncoder<Out, K>,
    image: ArrayView2<'_, f32>,
    about: &serde_json::Value,
) -> Result<()> {
    let values = reserve::collected(image.iter().copied(), "an image")?;
    let mut write = || {
        let mut page = encoder.new_image::<Gray32Float>(
            numbers::count(image.ncols()),
            numbers::count(image.nrows()),
        )?;
        page.encoder().write_tag(Tag::ImageDescription, about.to_string().as_str())?;
        page.write_data(&values)
    };
    write().map_err(|error| refused(path, error))
}

fn write_exr(path: &Path, image: ArrayView2<'_, f32>, about: &serde_json::Value) -> Result<()> {
    let software_name = Some(Text::from(concat!("beamlet ", env!("CARGO_PKG_VERSION"))));
    let mut attributes = LayerAttributes { software_name, ..LayerAttributes::default() };
    let text = Text::new_or_none(about.to_string()).unwrap_or_default();
    attributes.other.insert(Text::from("beamlet"), AttributeValue::Text(text));
    let values = reserve::collected(image.iter().copied(), "an image")?;
    let channel = AnyChannel::new("Y", FlatSamples::F32(values));
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let channels = AnyChannels::sort([channel].into_iter().collect());
    let layer = Layer::new((image.ncols(), image.nrows()), attributes, encoding, channels);
    let image = Image::from_layer(layer);
    // The crate starts threads for every file.
    let write = image.write();
    let write = if parallel::is_bounded() { write } else { write.non_parallel() };
    write
        .to_buffered(Out::create(path)?)
        .map_err(|error| Error::file(path, format!("cannot be written: {error}"), None))
}

fn written(path: &Path, error: std::io::Error) -> Error {
    Error::file(path, "cannot be written", Some(error))
}

fn refused(path: &Path, error: tiff::TiffError) -> Error {
    Error::file(path, format!("cannot be written: {error}"), None)
}
