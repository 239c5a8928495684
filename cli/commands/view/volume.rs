//! Pictures of a reconstruction: slices through each volume, and residuals of its iterations.

use crate::args::{ValueRange, ViewOfRun};
use crate::commands::pictures::{PictureForm, Pictures};
use crate::failure::Failure;
use crate::picture::image::{self, Grid, ImagePlot, Key};
use crate::picture::objects::Objects;
use crate::picture::quantity::Quantity;
use crate::picture::scale::Scale;
use crate::picture::text::{capital, length, short};
use crate::picture::volume_scale;
use crate::{picture, residuals};
use beamlet::cli_support::require_memory;
use beamlet::reconstruct::{LABELS, OpenVolumes, VolumeGrid, VolumeRecord};
use ndarray::{Array2, Axis, s};
use std::path::Path;

/// Bytes for each voxel of a slice that is drawn: values, sorted for the scale, and colours.
const OF_VOXEL: u64 = 40;

/// A slice on its way to a picture.
struct Slice {
    /// `[row][column]`, row 0 on top, in the unit of the picture.
    values: Array2<f64>,
    grid: Grid,
    /// Axis, and place along it, m.
    at: (&'static str, f64),
}

/// Draws slices of the volumes of a folder: one at a number along z (the middle one), and through the
/// middle along x and y where there is more than one slice.
pub(super) fn of(path: &Path, asked: &ViewOfRun, form: PictureForm) -> Result<Pictures, Failure> {
    let ViewOfRun { show, maps, retrieved, ranges, view, step, row, pixel, slice } = asked;
    let numbers = [view, step, row].iter().any(|number| number.is_some());
    if numbers || !show.is_empty() || retrieved.is_some() || pixel.is_some() {
        let problem = "--show, --retrieved, --view, --step, --row and --pixel are for runs and retrieved \
                       images; this is a reconstruction, which takes --map, --slice and --range";
        return Err(Failure::Usage(problem.into()));
    }
    let volumes = OpenVolumes::open(path)?;
    let record = volumes.record();
    let names: Vec<&str> = record.units.keys().map(String::as_str).collect();
    let ranged = ranges.iter().map(|range| range.name.as_str());
    if let Some(unknown) =
        maps.iter().map(String::as_str).chain(ranged).find(|name| !names.contains(name))
    {
        return Err(Failure::Usage(format!(
            "no volume is named {unknown}; allowed: {}",
            names.join(", ")
        )));
    }
    let grid = record.grid();
    let number = slice.map_or(grid.size[2] / 2, |slice| slice as usize);
    let [x, y, z] = grid.size.map(|side| side as u64);
    require_memory(OF_VOXEL * x.max(y).saturating_mul(y.max(z)), "pictures of slices")?;
    let mut pictures = Pictures::new(form);
    for name in
        names.into_iter().filter(|name| maps.is_empty() || maps.iter().any(|map| map == name))
    {
        let quantity = Quantity::of_volume(name);
        let slices = slices(&volumes, name, &grid, number, quantity.factor)?;
        let key = key(record, name, &quantity, ranges, &slices);
        for Slice { values, grid: places, at: (axis, place) } in &slices {
            let about = format!("{axis} = {}, method {}", length(*place), record.method);
            let below = match key {
                Key::Scale(_) => vec![scale_words(&quantity, values)],
                Key::Objects(_) => Vec::new(),
            };
            let plot = ImagePlot {
                values: values.view(),
                quantity: &quantity,
                key: key.clone(),
                title: capital(&quantity.label),
                note: about,
                below,
            };
            let number = if *axis == "z" { format!("_{number:04}") } else { String::new() };
            pictures.add(format!("{name}_{axis}{number}"), &image::draw(places, &plot))?;
        }
    }
    let is_drawn = |name: &String| maps.is_empty() || maps.contains(name);
    for of in residuals::read(path).iter().filter(|of| is_drawn(&of.name)) {
        let name = format!("residuals_{}", of.name);
        pictures.add(name, &picture::residuals::draw(of, &record.method))?;
    }
    Ok(pictures)
}

/// Slices across z, y and x.
fn slices(
    volumes: &OpenVolumes,
    name: &str,
    grid: &VolumeGrid,
    number: usize,
    factor: f64,
) -> Result<Vec<Slice>, Failure> {
    let [x, y, z] = grid.size;
    let edges = |axis: usize| {
        let half = grid.voxel[axis] / 2.0;
        let [low, high] = grid.ends()[axis];
        [1e3 * (low - half), 1e3 * (high + half)]
    };
    // Upwards is the larger coordinate.
    let upright =
        |values: Array2<f32>| values.slice(s![..;-1, ..]).mapv(|value| f64::from(value) * factor);
    let made = |axes: [usize; 2], labels| Grid::of_slice(axes.map(edges), labels);
    let mut all = vec![Slice {
        values: upright(volumes.slice(name, number)?),
        grid: made([0, 1], ["x [mm]", "y [mm]"]),
        at: ("z", grid.centre((number, 0, 0))[2]),
    }];
    if z > 1 {
        let mut across_y = Array2::zeros((z, x));
        let mut across_x = Array2::zeros((z, y));
        for height in 0..z {
            let slice = volumes.slice(name, height)?;
            across_y.index_axis_mut(Axis(0), height).assign(&slice.index_axis(Axis(0), y / 2));
            across_x.index_axis_mut(Axis(0), height).assign(&slice.index_axis(Axis(1), x / 2));
        }
        let middle = grid.centre((0, y / 2, x / 2));
        all.push(Slice {
            values: upright(across_y),
            grid: made([0, 2], ["x [mm]", "z [mm]"]),
            at: ("y", middle[1]),
        });
        all.push(Slice {
            values: upright(across_x),
            grid: made([1, 2], ["y [mm]", "z [mm]"]),
            at: ("x", middle[0]),
        });
    }
    Ok(all)
}

/// One scale for the slices of a volume, or the objects of labels.
fn key(
    record: &VolumeRecord,
    name: &str,
    quantity: &Quantity,
    ranges: &[ValueRange],
    slices: &[Slice],
) -> Key {
    let values = || slices.iter().flat_map(|slice| slice.values.iter().copied());
    if let Some(range) = ranges.iter().find(|range| range.name == name) {
        return Key::Scale(Scale::between(quantity.map, range.ends, values()));
    }
    if name == LABELS {
        return Key::Objects(Objects::among(&record.labels, values()));
    }
    let views: Vec<_> = slices.iter().map(|slice| slice.values.view()).collect();
    Key::Scale(volume_scale::of(name, quantity.map, &views))
}

/// Least and largest value of a slice, in words.
fn scale_words(quantity: &Quantity, values: &Array2<f64>) -> String {
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let [low, high] =
        finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
    let unit = if quantity.unit.is_empty() { String::new() } else { format!(" {}", quantity.unit) };
    format!("values from {} to {}{unit}", short(low), short(high))
}
