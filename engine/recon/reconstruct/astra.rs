//! Retrieved images as ASTRA takes projections, with their geometry and a script that loads both.

use super::prepare::Preparation;
use super::quantity::Quantity;
use crate::retrieve::FLAGS;
use beamlet_core::array_file::{Format, Sample};
use beamlet_core::cancel::Cancel;
use beamlet_core::whole_file::write_file;
use beamlet_core::{Error, Result, input_file, numbers};
use beamlet_files::layout::{ASTRA_SCRIPT, RECORD};
use beamlet_files::{GeometryFile, ImageDirectory, Kind, Maps, StackFile};
use ndarray::{Array2, Array3, s};
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// Bytes of a band of rows of all views.
const BAND: usize = 64 << 20;
/// Reads the files written here, relative to its own folder.
const SCRIPT: &str = include_str!("astra/load_astra.py");

/// Contents of astra.json. Lengths are in mm, in the frame of the sample, whose axis of rotation is z.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AstraFile {
    /// Version of beamlet.
    pub beamlet: String,
    /// Order of the sides of the arrays.
    pub order: String,
    /// Unit of each array by its name.
    pub units: BTreeMap<String, String>,
    /// Number of filled pixels of transmission, refraction and dark field; empty where arrays are as
    /// retrieved.
    pub filled_pixels: BTreeMap<String, u64>,
    /// Files beside the arrays.
    pub files: Vec<String>,
    /// Rows, views and columns of the arrays.
    pub shape: [usize; 3],
    /// Row of `cone_vec` for each view: source, centre of the detector, from a column to the next, from a
    /// row to the next.
    pub cone_vec_mm: Vec<[f64; 12]>,
    /// Voxels along x, y and z of a volume that the field of view sweeps, as wide as columns and rows at
    /// the axis of rotation.
    pub volume_size: [usize; 3],
    /// Least and greatest x, y and z of that volume.
    pub volume_mm: [f64; 6],
}

/// Writes the images of a folder of retrieved images into another folder: each as `NAME.npy`
/// `[row][view][column]`, with `astra.json` and `load_astra.py`. With `fill`, transmission, refraction and dark
/// field have the values of a reconstruction in pixels that lack one, see [`super::fill_images`]; all other
/// images are as retrieved. `progress` takes the rows that are done, and all.
///
/// # Errors
/// [`Error::File`] where the folder has no images or no vectors of their views, or images of other views,
/// rows or columns than its geometry, or with `fill` a view without any value, or the place is taken or
/// cannot be written; [`Error::Interrupted`]. Nothing is left behind then.
pub fn write_astra(
    images: &Path,
    to: &Path,
    fill: bool,
    overwrite: bool,
    progress: &mut dyn FnMut(u64, u64),
    cancel: &Cancel,
) -> Result<AstraFile> {
    let (geometry, maps) = (GeometryFile::read(images)?, Maps::open(images)?);
    geometry.refuse_other_images(images, maps.sides())?;
    let mut about = begun(images, &geometry)?;
    let stacks: BTreeMap<String, StackFile> = maps
        .into_stacks()
        .into_iter()
        .filter(|(name, stack)| of_views(name, stack, &about.shape))
        .collect();
    about.units.retain(|name, _| stacks.contains_key(name));
    let metadata = serde_json::json!({ "order": about.order });
    let mut folder = ImageDirectory::begin(to, Kind::Astra, Format::Npy, overwrite, metadata)?;
    let [rows, views, columns] = about.shape;
    let height = (BAND / (4 * views * columns)).max(1);
    let (mut done, all) = (0, (stacks.len() * rows) as u64);
    for (name, stack) in &stacks {
        let quantity = Quantity::ALL.into_iter().find(|of| fill && of.image() == name);
        let gaps = quantity.map(|quantity| Gaps {
            stack,
            flags: stacks.get(FLAGS),
            geometry: &geometry,
            is_transmission: quantity == Quantity::Mu,
        });
        let mut filled = 0;
        let unit = about.units.get(name).map_or("", String::as_str);
        for start in (0..rows).step_by(height) {
            let band = start..rows.min(start + height);
            let mut values = Array3::zeros((views, band.len(), columns));
            for view in 0..views {
                cancel.check()?;
                let image = match &gaps {
                    None => frame(stack, view, &band)?,
                    Some(gaps) => gaps.filled(view, &band, &mut filled)?,
                };
                values.slice_mut(s![view, .., ..]).assign(&image);
            }
            for row in 0..band.len() {
                folder.put(name, unit, Sample::F32, rows, values.slice(s![.., row, ..]))?;
            }
            done += band.len() as u64;
            progress(done, all);
        }
        if gaps.is_some() {
            about.filled_pixels.insert(name.clone(), filled);
        }
    }
    write_file(&folder.file(ASTRA_SCRIPT)?, SCRIPT.as_bytes())?;
    let mut text = serde_json::to_string_pretty(&about)
        .map_err(|error| Error::file(to, format!("cannot be written: {error}"), None))?;
    text.push('\n');
    folder.finish(Some(&text))?;
    Ok(about)
}

/// Rows of a view.
fn frame(stack: &StackFile, view: usize, rows: &Range<usize>) -> Result<Array2<f32>> {
    stack.frame(0, view, numbers::count(rows.start)..numbers::count(rows.end))
}

/// An image whose gaps are filled.
struct Gaps<'a> {
    stack: &'a StackFile,
    flags: Option<&'a StackFile>,
    geometry: &'a GeometryFile,
    is_transmission: bool,
}

impl Gaps<'_> {
    /// Rows of a view, filled; adds the number of their gaps to `filled`.
    fn filled(&self, view: usize, band: &Range<usize>, filled: &mut u64) -> Result<Array2<f32>> {
        let (mut image, mut preparation) = self.read(view, band)?;
        let gaps = preparation.gaps(image.view());
        *filled += gaps.iter().sum::<usize>() as u64;
        if !gaps.contains(&image.ncols()) {
            // Every row has values, so that it needs no other rows.
            return preparation
                .fill(&mut image.view_mut())
                .map(|()| image)
                .map_err(self.lack(view));
        }
        let (mut whole, mut preparation) = self.read(view, &(0..self.geometry.rows_m.len()))?;
        preparation.fill(&mut whole.view_mut()).map_err(self.lack(view))?;
        Ok(whole.slice_move(s![band.clone(), ..]))
    }

    fn read(&self, view: usize, rows: &Range<usize>) -> Result<(Array2<f32>, Preparation<'_>)> {
        let places = &self.geometry.rows_m[rows.clone()];
        let columns = &self.geometry.columns_m;
        let mut preparation = Preparation::of_places(columns, places, self.is_transmission);
        if let Some(flags) = self.flags {
            let flags = frame(flags, view, rows)?;
            for (column, flags) in flags.columns().into_iter().enumerate() {
                preparation.flags_of_column(column, flags);
            }
        }
        Ok((frame(self.stack, view, rows)?, preparation))
    }

    fn lack(&self, view: usize) -> impl Fn(&'static str) -> Error {
        let path = self.stack.path().to_owned();
        move |problem| {
            let problem = format!("view {view} {problem}, from which its pixels could be filled");
            Error::file(&path, problem, None)
        }
    }
}

/// True if an image has the views of the geometry, and is not an image of the flat.
fn of_views(name: &str, stack: &StackFile, [_, views, _]: &[usize; 3]) -> bool {
    stack.shape()[1] == *views && !name.starts_with("flat_") && name != "residual_flat"
}

fn begun(images: &Path, geometry: &GeometryFile) -> Result<AstraFile> {
    let Some(vectors) = geometry.astra_cone_vec_mm.clone() else {
        let problem = "has unevenly spaced columns; ASTRA needs even spacing";
        return Err(Error::file(images, problem, None));
    };
    let record = images.join(RECORD);
    let text = input_file::text(&record)
        .map_err(|error| Error::file(&record, "cannot be read", Some(error)))?;
    let units = serde_json::from_str::<serde_json::Value>(&text)
        .ok()
        .and_then(|mut value| serde_json::from_value(value["units"].take()).ok())
        .ok_or_else(|| Error::file(&record, "is not the record of a retrieval", None))?;
    let (rows, columns) = (geometry.rows_m.len(), geometry.columns_m.len());
    let scale = 1e3 * geometry.source_to_axis_m / geometry.source_to_detector_m;
    let pitch = |places: &[f64]| match places {
        [first, .., last] => ((last - first) / (places.len() - 1) as f64).abs(),
        _ => geometry.columns_m.windows(2).map(|pair| pair[1] - pair[0]).sum::<f64>(),
    };
    let across = 0.5 * scale * columns as f64 * pitch(&geometry.columns_m);
    let up = 0.5 * scale * rows as f64 * pitch(&geometry.rows_m);
    Ok(AstraFile {
        beamlet: beamlet_core::program::VERSION.to_owned(),
        order: "[row][view][column]".to_owned(),
        units,
        filled_pixels: BTreeMap::new(),
        files: vec![ASTRA_SCRIPT.to_owned()],
        shape: [rows, vectors.len(), columns],
        cone_vec_mm: vectors,
        volume_size: [columns, columns, rows],
        volume_mm: [-across, across, -across, across, -up, up],
    })
}
