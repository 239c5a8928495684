//! Volumes in files: TIFF, NPY, EXR, and `MetaImage`.

use super::grid::VolumeGrid;
use beamlet_core::array_file::{Format, RangeLayout, Sample};
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::count;
use beamlet_core::options::{Choice, Word};
use beamlet_core::whole_file::write_file;
use beamlet_core::{Error, Result};
use beamlet_files::{ImageDirectory, layout};
use ndarray::{Array2, Array3, Axis};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// File format of volumes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum VolumeFormat {
    /// A file of pages, one for each slice, calibrated for `ImageJ`.
    #[default]
    Tiff,
    /// An array for numpy.
    Npy,
    /// A file for each slice.
    Exr,
    /// A `MetaImage` header with raw values, for `ParaView` and `3D Slicer`.
    Mhd,
}

impl Choice for VolumeFormat {
    const CHOICES: &'static [Self] = &[Self::Tiff, Self::Npy, Self::Exr, Self::Mhd];

    fn word(self) -> Word {
        let (name, help) = match self {
            Self::Tiff => {
                ("tiff", "A TIFF with a page for each slice, calibrated for ImageJ and Fiji")
            }
            Self::Npy => ("npy", "An array for numpy"),
            Self::Exr => ("exr", "A folder with a 32-bit float EXR file for each slice"),
            Self::Mhd => ("mhd", "A MetaImage header with raw values, for ParaView and 3D Slicer"),
        };
        Word { name, help }
    }
}

impl VolumeFormat {
    /// Name on the command line and in records.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.word().name
    }

    /// Format of the images of a folder; those of `MetaImage` are files beside them.
    pub(super) const fn of_images(self) -> Format {
        match self {
            Self::Npy => Format::Npy,
            Self::Exr => Format::Exr,
            Self::Tiff | Self::Mhd => Format::Tiff,
        }
    }
}

impl fmt::Display for VolumeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Values of a volume, `[z][y][x]`.
#[derive(Debug, Clone, Copy)]
pub(super) enum Voxels<'a> {
    Values(&'a Array3<f32>),
    /// Labels of objects: 16-bit integers in formats that have them, 32-bit floats in EXR.
    Labels(&'a Array3<u16>),
}

impl Voxels<'_> {
    const fn sample(self) -> Sample {
        match self {
            Self::Values(_) => Sample::F32,
            Self::Labels(_) => Sample::U16,
        }
    }

    /// A slice, `[y][x]`.
    fn slice(self, z: usize) -> Array2<f32> {
        match self {
            Self::Values(values) => values.index_axis(Axis(0), z).to_owned(),
            Self::Labels(labels) => labels.index_axis(Axis(0), z).mapv(f32::from),
        }
    }
}

/// Writes a volume into a folder in the making; returns the files that the record has to list.
///
/// # Errors
/// [`Error::File`], [`Error::Memory`], [`Error::Interrupted`].
pub(super) fn write(
    to: &mut ImageDirectory,
    format: VolumeFormat,
    (name, unit): (&str, &str),
    grid: &VolumeGrid,
    voxels: Voxels<'_>,
    cancel: &Cancel,
) -> Result<Vec<String>> {
    if format == VolumeFormat::Mhd {
        return meta_image(to, name, grid, voxels, cancel);
    }
    let (of_images, slices) = (format.of_images(), 0..grid.size[2]);
    let sides = [2, 1, 0].map(|axis| count(grid.size[axis]));
    if let Some(layout) = RangeLayout::volume(of_images, sides, grid.voxel, voxels.sample()) {
        let path = layout::array(Path::new(""), name, of_images);
        let mut file = layout.open(to.file(&path.to_string_lossy())?)?;
        for slice in slices {
            cancel.check()?;
            file.write(slice as u64, 0, voxels.slice(slice).view())?;
        }
        file.refuse_moved()?;
    } else {
        for slice in slices {
            cancel.check()?;
            to.put(name, unit, Sample::F32, grid.size[2], voxels.slice(slice).view())?;
        }
    }
    Ok(Vec::new())
}

/// Writes header and values of a `MetaImage`; returns their names.
fn meta_image(
    to: &mut ImageDirectory,
    name: &str,
    grid: &VolumeGrid,
    voxels: Voxels<'_>,
    cancel: &Cancel,
) -> Result<Vec<String>> {
    let [header, raw] = layout::meta_image(name);
    let text = meta_header(grid, &raw, voxels.sample());
    write_file(&to.file(&header)?, text.as_bytes())?;
    let path = to.file(&raw)?;
    let failed = |error| Error::file(&path, "cannot be written", Some(error));
    let mut file = BufWriter::new(File::create(&path).map_err(failed)?);
    for slice in 0..grid.size[2] {
        cancel.check()?;
        let values = voxels.slice(slice);
        file.write_all(&voxels.sample().encode(values.iter().copied())?).map_err(failed)?;
    }
    file.flush().map_err(failed)?;
    Ok(vec![header, raw])
}

/// Line of a `MetaImage` header that states the type of its values.
const ELEMENT_TYPE: &str = "ElementType = ";

const fn meta_type(sample: Sample) -> &'static str {
    match sample {
        Sample::F32 => "MET_FLOAT",
        Sample::U16 => "MET_USHORT",
        Sample::U32 => "MET_UINT",
    }
}

/// Type of the values of a `MetaImage` by its header; `None` for a type that is not written here.
pub(super) fn meta_sample(header: &str) -> Option<Sample> {
    let found = header.lines().find_map(|line| line.strip_prefix(ELEMENT_TYPE))?.trim();
    [Sample::F32, Sample::U16, Sample::U32].into_iter().find(|sample| meta_type(*sample) == found)
}

/// Header of a `MetaImage` whose values are in another file. Lengths are mm, as its readers expect.
fn meta_header(grid: &VolumeGrid, raw: &str, sample: Sample) -> String {
    let list = |values: [f64; 3]| values.map(|value| format!("{}", 1e3 * value)).join(" ");
    let [x, y, z] = grid.size;
    format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
         CompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = {}\n\
         CenterOfRotation = 0 0 0\nElementSpacing = {}\nDimSize = {x} {y} {z}\n\
         {ELEMENT_TYPE}{}\nElementDataFile = {raw}\n",
        list(grid.origin),
        list(grid.voxel),
        meta_type(sample),
    )
}
