//! Volumes read back from their folder.

use super::grid::Volume;
use super::quantity::Quantity;
use super::record::VolumeRecord;
use super::write::{VolumeFormat, meta_sample};
use beamlet_core::array_file::{LONGEST_SIDE, Sample};
use beamlet_core::{Error, Result, input_file, reserve};
use beamlet_files::{StackFile, layout, refuse_changed};
use ndarray::{Array2, Array3, s};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// A folder of volumes, opened to be read.
#[derive(Debug)]
pub struct OpenVolumes {
    path: PathBuf,
    record: VolumeRecord,
}

impl OpenVolumes {
    /// Opens a folder of `beamlet reconstruct`.
    ///
    /// # Errors
    /// [`Error::File`] where there is no volume.json, or it is not of beamlet, or an input has another hash
    /// than in it: names the command that makes the volumes again.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::reconstruct::{OpenVolumes, Quantity};
    ///
    /// let volumes = OpenVolumes::open("volume")?;
    /// let middle = volumes.slice("mu", volumes.record().size[2] / 2)?;
    /// println!("{:?} {}", middle.dim(), Quantity::Mu.unit());
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref().to_path_buf();
        let record = VolumeRecord::read(&path)?;
        refuse_changed(&path, layout::VOLUME, "reconstruct")?;
        let is_name = |name: &String| !name.contains(['/', '\\']);
        if record.size.iter().any(|side| *side == 0 || *side > LONGEST_SIDE as usize)
            || !record.units.keys().all(is_name)
        {
            let problem =
                format!("claims volumes {:?} of {:?} voxels", record.units.keys(), record.size);
            return Err(Error::file(path.join(layout::VOLUME), problem, None));
        }
        Ok(Self { path, record })
    }

    /// volume.json.
    #[must_use]
    pub const fn record(&self) -> &VolumeRecord {
        &self.record
    }

    /// Length k with which kμ was added to δ, m.
    pub(super) const fn gradient_bias(&self) -> Option<f64> {
        self.record.gradient_bias_m
    }

    /// A slice of a volume by its number from the bottom, `[y][x]`, both ascending.
    ///
    /// # Errors
    /// [`Error::File`] for a name or slice that is not there, or a file of another shape.
    pub fn slice(&self, name: &str, slice: usize) -> Result<Array2<f32>> {
        let [x, y, z] = self.record.size;
        if !self.record.units.contains_key(name) || slice >= z {
            let names: Vec<&str> = self.record.units.keys().map(String::as_str).collect();
            let problem = format!(
                "has no slice {slice} of {name}: it has {z} slices, counted from 0, of {}",
                names.join(", ")
            );
            return Err(Error::file(&self.path, problem, None));
        }
        if self.record.format == VolumeFormat::Mhd {
            return self.raw_slice(name, slice);
        }
        let format = self.record.format.of_images();
        let file = StackFile::open(layout::array(&self.path, name, format))?;
        let [views, steps, rows, columns] = file.shape();
        if [views * steps, rows, columns] != [z, y, x] {
            let problem = format!(
                "has {:?} slices, rows and columns; volume.json has {:?}",
                [views * steps, rows, columns],
                [z, y, x]
            );
            return Err(Error::file(file.path(), problem, None));
        }
        let rows = 0..beamlet_core::numbers::count(y);
        file.frame(slice / steps, slice % steps, rows)
    }

    fn raw_slice(&self, name: &str, slice: usize) -> Result<Array2<f32>> {
        let [x, y, _] = self.record.size;
        let [header, raw] = layout::meta_image(name).map(|name| self.path.join(name));
        let text = input_file::text(&header)
            .map_err(|error| Error::file(&header, "cannot be read", Some(error)))?;
        let Some(sample) = meta_sample(&text) else {
            let problem = "has no ElementType of MET_FLOAT, MET_USHORT or MET_UINT";
            return Err(Error::file(header, problem, None));
        };
        let path = raw;
        let failed = |error| Error::file(&path, "cannot be read", Some(error));
        let of_slice = beamlet_core::numbers::length(sample.bytes()) * x * y;
        let mut bytes: Vec<u8> = reserve::zeroed(of_slice, "a slice")?;
        let mut file = input_file::open(&path).map_err(failed)?;
        file.seek(SeekFrom::Start((of_slice * slice) as u64)).map_err(failed)?;
        file.read_exact(&mut bytes).map_err(failed)?;
        let values = match sample {
            Sample::F32 => bytes.as_chunks().0.iter().map(|it| f32::from_le_bytes(*it)).collect(),
            Sample::U16 => {
                let short = |it: &[u8; 2]| f32::from(u16::from_le_bytes(*it));
                bytes.as_chunks().0.iter().map(short).collect()
            }
            Sample::U32 => {
                let whole = |it: &[u8; 4]| f64::from(u32::from_le_bytes(*it));
                let values = bytes.as_chunks().0.iter().map(whole);
                values.map(beamlet_core::numbers::single).collect()
            }
        };
        Array2::from_shape_vec((y, x), values)
            .map_err(|error| Error::file(&path, error.to_string(), None))
    }

    /// A whole volume.
    ///
    /// # Errors
    /// As [`OpenVolumes::slice`]; [`Error::Memory`].
    pub fn volume(&self, quantity: Quantity) -> Result<Volume> {
        let [x, y, z] = self.record.size;
        let values = reserve::zeroed(x * y * z, "a volume")?;
        let mut values = Array3::from_shape_vec((z, y, x), values)
            .map_err(|error| Error::file(&self.path, error.to_string(), None))?;
        for slice in 0..z {
            values.slice_mut(s![slice, .., ..]).assign(&self.slice(quantity.name(), slice)?);
        }
        Ok(Volume::new(self.record.grid(), quantity, values))
    }
}
