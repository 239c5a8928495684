//! Retrieved images as ASTRA takes projections, with their geometry and a script that loads both.

use super::geometry_file::GeometryFile;
use super::image_folder::{ImageDirectory, Kind};
use super::layout::{ASTRA_SCRIPT, RECORD};
use super::read::{Maps, StackFile};
use crate::array_file::Format;
use crate::cancel::Cancel;
use crate::whole_file::write_file;
use crate::{Error, Result, input_file, numbers};
use ndarray::{Array3, s};
use serde::Serialize;
use std::collections::BTreeMap;
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
/// `[row][view][column]`, with `astra.json` and `load_astra.py`. `progress` takes the rows that are done, and
/// all.
///
/// # Errors
/// [`Error::File`] where the folder has no images or no vectors of their views, or the place is taken or
/// cannot be written; [`Error::Interrupted`]. Nothing is left behind then.
pub fn write_astra(
    images: &Path,
    to: &Path,
    overwrite: bool,
    progress: &mut dyn FnMut(u64, u64),
    cancel: &Cancel,
) -> Result<AstraFile> {
    let (geometry, maps) = (GeometryFile::read(images)?, Maps::open(images)?);
    let mut about = begun(images, &geometry)?;
    let stacks: Vec<(String, StackFile)> = maps
        .into_stacks()
        .into_iter()
        .filter(|(name, stack)| of_views(name, stack, &about.shape))
        .collect();
    about.units.retain(|name, _| stacks.iter().any(|(other, _)| other == name));
    let metadata = serde_json::json!({ "order": about.order });
    let mut folder = ImageDirectory::begin(to, Kind::Astra, Format::Npy, overwrite, metadata)?;
    let [rows, views, columns] = about.shape;
    let height = (BAND / (4 * views * columns)).max(1);
    let (mut done, all) = (0, (stacks.len() * rows) as u64);
    for (name, stack) in &stacks {
        let unit = about.units.get(name).map_or("", String::as_str);
        for start in (0..rows).step_by(height) {
            let band = start..rows.min(start + height);
            let mut values = Array3::zeros((views, band.len(), columns));
            for view in 0..views {
                cancel.check()?;
                let band = numbers::count(band.start)..numbers::count(band.end);
                values.slice_mut(s![view, .., ..]).assign(&stack.frame(0, view, band)?);
            }
            for row in 0..band.len() {
                folder.put(name, unit, rows, values.slice(s![.., row, ..]))?;
            }
            done += band.len() as u64;
            progress(done, all);
        }
    }
    write_file(&folder.file(ASTRA_SCRIPT)?, SCRIPT.as_bytes())?;
    let mut text = serde_json::to_string_pretty(&about)
        .map_err(|error| Error::file(to, format!("cannot be written: {error}"), None))?;
    text.push('\n');
    folder.finish(Some(&text))?;
    Ok(about)
}

/// Whether an image has the views of the geometry, and is not an image of the flat.
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
        beamlet: env!("CARGO_PKG_VERSION").to_owned(),
        order: "[row][view][column]".to_owned(),
        units,
        files: vec![ASTRA_SCRIPT.to_owned()],
        shape: [rows, vectors.len(), columns],
        cone_vec_mm: vectors,
        volume_size: [columns, columns, rows],
        volume_mm: [-across, across, -across, across, -up, up],
    })
}
