//! The images of one name, view after view, in one of the formats.

use super::ImageFormat;
use crate::{Error, Result};
use exr::prelude::*;
use ndarray::{ArrayBase, ArrayView2, Data, Ix2};
use std::fmt;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use tiff::encoder::colortype::Gray32Float;
use tiff::encoder::{TiffEncoder, TiffKind};
use tiff::tags::Tag;

/// Files above this many bytes are `BigTIFF`.
const CLASSIC: u64 = 4_000_000_000;

type Out = BufWriter<File>;

/// Images in the making.
pub(crate) struct Sheet {
    path: PathBuf,
    about: serde_json::Value,
    views: usize,
    next: usize,
    file: Kind,
}

enum Kind {
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
        let file = match format {
            ImageFormat::Exr => {
                std::fs::create_dir_all(&path).map_err(|error| written(&path, error))?;
                Kind::Exr
            }
            ImageFormat::Npy => {
                let mut file = create(&path)?;
                let header = crate::stack::npy_header(&[views, rows, columns]);
                file.write_all(&header).map_err(|error| written(&path, error))?;
                Kind::Npy(file)
            }
            ImageFormat::Tiff if bytes < CLASSIC => {
                let encoder = TiffEncoder::new(create(&path)?).map_err(|e| refused(&path, e))?;
                Kind::Tiff(Box::new(encoder))
            }
            ImageFormat::Tiff => {
                let encoder =
                    TiffEncoder::new_big(create(&path)?).map_err(|e| refused(&path, e))?;
                Kind::BigTiff(Box::new(encoder))
            }
        };
        Ok(Self { path, about, views, next: 0, file })
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
            Kind::Exr => {
                let width = self.views.saturating_sub(1).max(1).ilog10().max(3) as usize + 1;
                let path = self.path.join(format!("view_{:0width$}.exr", self.next));
                write_exr(&path, image, &about)?;
            }
            Kind::Npy(file) => {
                let bytes: Vec<u8> = image.iter().flat_map(|value| value.to_le_bytes()).collect();
                file.write_all(&bytes).map_err(|error| written(&self.path, error))?;
            }
            Kind::Tiff(encoder) => page(&self.path, encoder, image, &about)?,
            Kind::BigTiff(encoder) => page(&self.path, encoder, image, &about)?,
        }
        self.next += 1;
        Ok(())
    }

    /// The last view was put.
    pub(crate) fn finish(self) -> Result<()> {
        match self.file {
            Kind::Npy(mut file) => file.flush().map_err(|error| written(&self.path, error)),
            // Encoders write through; the buffer below them is flushed as they are dropped.
            _ => Ok(()),
        }
    }
}

fn page<K: TiffKind>(
    path: &Path,
    encoder: &mut TiffEncoder<Out, K>,
    image: ArrayView2<'_, f32>,
    about: &serde_json::Value,
) -> Result<()> {
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let values: Vec<f32> = image.iter().copied().collect();
    let mut write = || {
        let mut page =
            encoder.new_image::<Gray32Float>(side(image.ncols()), side(image.nrows()))?;
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
    let channel = AnyChannel::new("Y", FlatSamples::F32(image.iter().copied().collect()));
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let channels = AnyChannels::sort([channel].into_iter().collect());
    let layer = Layer::new((image.ncols(), image.nrows()), attributes, encoding, channels);
    let done = Image::from_layer(layer).write().to_buffered(create(path)?);
    done.map_err(|error| Error::output(path, format!("cannot be written: {error}"), None))
}

fn create(path: &Path) -> Result<Out> {
    File::create(path).map(BufWriter::new).map_err(|error| written(path, error))
}

fn written(path: &Path, error: std::io::Error) -> Error {
    Error::output(path, "cannot be written", Some(error))
}

fn refused(path: &Path, error: tiff::TiffError) -> Error {
    Error::output(path, format!("cannot be written: {error}"), None)
}
