//! A reconstruction as one page: slices across three axes, values and histograms.

use super::tables::TableRow;
use super::thinning::Quantised;
use super::{
    COPIES, Page, PageOptions, date, encoded, name_of, now, program, rendered, script_json,
    table_of, words_of,
};
use crate::failure::Failure;
use crate::numbers;
use crate::picture::colour::Map;
use crate::picture::palette::colour_of_label;
use crate::picture::quantity::Quantity;
use crate::picture::volume_scale;
use crate::progress::Reporter;
use crate::residuals::{self, Residuals};
use beamlet::cli_support::{printed, require_memory};
use beamlet::reconstruct::{LABELS, OpenVolumes, VolumeRecord};
use beamlet::stack::layout::ERRORS;
use minijinja::context;
use ndarray::Array3;
use serde_json::{Map as Object, Value, json};
use std::path::Path;

/// The page of a reconstruction.
const VOLUME: Page =
    Page { body: include_str!("page/volume.html"), scripts: &[include_str!("page/volume.js")] };

/// The page of the volumes of a folder.
///
/// Fails where there is not the memory for it.
pub(crate) fn page(
    path: &Path,
    options: &PageOptions,
    reporter: &mut Reporter,
) -> Result<String, Failure> {
    let volumes = OpenVolumes::open(path)?;
    let record = volumes.record();
    let bins = Bins::of(record, options.most);
    let [x, y, z] = bins.size.map(|side| side as u64);
    let of_page = x * y * z * 2 * record.units.len() as u64;
    let [x, y, _] = record.size.map(|side| side as u64);
    require_memory(
        COPIES.saturating_mul(of_page).saturating_add(16 * x * y),
        "the page of a report",
    )?;
    reporter.doing("reading volumes");
    let mut arrays = Vec::new();
    let mut described = Object::new();
    for name in record.units.keys() {
        let quantity = Quantity::of_volume(name);
        let values = bins.binned(&volumes, name, quantity.factor)?;
        let views: Vec<_> = values.outer_iter().collect();
        let scale = volume_scale::of(name, quantity.map, &views);
        let values = values.iter().copied().collect::<Vec<f64>>();
        let Quantised { low, high, words } = Quantised::of(&values);
        arrays.push((name.clone(), words));
        let mut about = json!({
            "label": quantity.label,
            "unit": quantity.unit,
            "low": low,
            "high": high,
            "map": format!("{:?}", quantity.map),
            "scale": [scale.low, scale.high],
        });
        if name == LABELS {
            let named = record.labels.keys().max().copied().unwrap_or(0);
            let labels = 0..=named.max(numbers::whole(high)).min(u16::MAX.into());
            about["palette"] = labels.map(colour_of_label).collect::<Vec<_>>().into();
            about["objects"] = json!(record.labels);
            about["scale"] = json!([low, high.max(low + 1.0)]);
        }
        described.insert(name.clone(), about);
    }
    let maps = [Map::Grey, Map::Viridis, Map::Inferno, Map::Diverging];
    let tables: Object<String, Value> =
        maps.into_iter().map(|map| (format!("{map:?}"), table_of(map).into())).collect();
    let millimetres = |lengths: [f64; 3]| lengths.map(|length| 1e3 * length);
    let meta = json!({
        "size": bins.size,
        "whole": record.size,
        "bin": bins.bin,
        "voxel": millimetres(bins.voxel(record)),
        "origin": millimetres(bins.origin(record)),
        "names": names(record),
        "volumes": described,
        "residuals": residuals(path),
        "maps": tables,
    });
    let context = context! {
        title => name_of(path),
        summary => summary(record),
        facts => facts(record, &options.command),
        notes => notes(&bins, record, options.most),
        names => names(record),
        error_rows => table(path, ERRORS),
        provenance => provenance(path, record),
        reconstruction => reconstruction(record),
        meta => script_json(&meta)?,
        arrays => arrays.into_iter().map(encoded).collect::<Vec<TableRow>>(),
    };
    rendered(VOLUME, context)
}

/// Names of the volumes, the sample's first.
fn names(record: &VolumeRecord) -> Vec<String> {
    let first = ["mu", "delta", "dark-field"];
    let all = record.units.keys();
    let rest = all.filter(|name| !first.contains(&name.as_str())).cloned();
    let own = first.into_iter().filter(|name| record.units.contains_key(*name)).map(str::to_owned);
    own.chain(rest).collect()
}

/// Voxels of a page: blocks of voxels of the files.
struct Bins {
    /// Voxels of a block along x, y, z.
    bin: [usize; 3],
    /// Blocks along x, y, z.
    size: [usize; 3],
}

impl Bins {
    /// The smallest blocks with which all volumes take no more than `most` bytes.
    fn of(record: &VolumeRecord, most: u64) -> Self {
        let mut side = 1;
        loop {
            let bin = record.size.map(|all| side.min(all));
            let size = [0, 1, 2].map(|axis| record.size[axis].div_ceil(bin[axis]));
            let voxels = size.iter().fold(1_u64, |all, side| all.saturating_mul(*side as u64));
            let bytes = voxels.saturating_mul(2 * record.units.len().max(1) as u64);
            if bytes <= most || size == [1; 3] {
                return Self { bin, size };
            }
            side += 1;
        }
    }

    fn voxel(&self, record: &VolumeRecord) -> [f64; 3] {
        [0, 1, 2].map(|axis| record.voxel_m[axis] * self.bin[axis] as f64)
    }

    /// Centre of the first block, m.
    fn origin(&self, record: &VolumeRecord) -> [f64; 3] {
        [0, 1, 2].map(|axis| {
            let middle = (self.bin[axis] as f64 - 1.0) / 2.0;
            record.origin_m[axis] + middle * record.voxel_m[axis]
        })
    }

    /// Means over blocks, those at the ends smaller, `[z][y][x]`; of labels the first of each.
    fn binned(
        &self,
        volumes: &OpenVolumes,
        name: &str,
        factor: f64,
    ) -> Result<Array3<f64>, Failure> {
        let [wide, high, deep] = self.size;
        let [bin_x, bin_y, bin_z] = self.bin;
        let mut sums = Array3::<f64>::zeros((deep, high, wide));
        let mut counts = Array3::<u32>::zeros((deep, high, wide));
        for slice in 0..volumes.record().size[2] {
            if name == LABELS && slice % bin_z != 0 {
                continue;
            }
            for ((row, column), value) in volumes.slice(name, slice)?.indexed_iter() {
                if name == LABELS && (row % bin_y != 0 || column % bin_x != 0) {
                    continue;
                }
                let at = [slice / bin_z, row / bin_y, column / bin_x];
                sums[at] += f64::from(*value) * factor;
                counts[at] += 1;
            }
        }
        sums.zip_mut_with(&counts, |sum, count| *sum /= f64::from(*count));
        Ok(sums)
    }
}

/// Lines and fields of a table beside the volumes; empty where there is none.
fn table(folder: &Path, name: &str) -> Vec<Vec<String>> {
    let mut lines = csv::ReaderBuilder::new();
    lines.has_headers(false).flexible(true);
    let Ok(mut reader) = lines.from_path(folder.join(name)) else { return Vec::new() };
    let fields = |line: csv::StringRecord| line.iter().map(short).collect();
    reader.records().map_while(Result::ok).map(fields).collect()
}

/// A number to five digits; other texts as they are.
fn short(field: &str) -> String {
    match field.parse::<f64>() {
        Ok(value) if value.is_finite() => crate::picture::text::short(value),
        _ => field.to_owned(),
    }
}

/// Residuals of each quantity, and the iteration that was taken.
fn residuals(path: &Path) -> Value {
    let of = |it: Residuals| (it.name, json!({ "values": it.values, "best": it.best }));
    Value::Object(residuals::read(path).into_iter().map(of).collect())
}

/// The reconstruction in one line.
fn summary(record: &VolumeRecord) -> String {
    let [x, y, z] = record.size;
    let [views, rows, columns] = record.sinograms;
    format!(
        "voxels {x} × {y} × {z} · method {} · views {views} of {columns} × {rows} pixels · beamlet {}",
        record.method, record.version
    )
}

fn facts(record: &VolumeRecord, command: &str) -> Vec<TableRow> {
    let made = format!(
        "{} in {}, by {}",
        date(&record.written),
        words_of(record.duration_s),
        program(&record.version, record.commit.as_deref())
    );
    let mut facts = vec![TableRow::new("reconstructed", made)];
    facts.extend(record.command.iter().map(|line| TableRow::new("command", line.clone())));
    facts.push(TableRow::new("page written", date(&now())));
    facts.push(TableRow::new("by", command));
    facts
}

/// Notes to the reader about the data.
fn notes(bins: &Bins, record: &VolumeRecord, most: u64) -> Vec<String> {
    if bins.bin == [1; 3] {
        return Vec::new();
    }
    let [x, y, z] = bins.bin;
    let mebibytes = most as f64 / f64::from(1 << 20);
    vec![format!(
        "Voxels are means over blocks of {x} × {y} × {z} of the {:?} of the files. The page was limited to \
         {mebibytes:.1} MiB of volumes; `beamlet report --most SIZE` sets another limit.",
        record.size
    )]
}

fn provenance(path: &Path, record: &VolumeRecord) -> Vec<TableRow> {
    let mut rows = vec![
        TableRow::new("directory", printed::path(path)),
        TableRow::new("device", record.device.clone()),
        TableRow::new("driver", record.driver.clone()),
        TableRow::new("format", record.format.name()),
    ];
    let hash = |(path, hash): (&String, &String)| {
        TableRow::new("read", format!("{path}, SHA-256 {}…", hash.get(..16).unwrap_or(hash)))
    };
    rows.extend(record.inputs.iter().map(hash));
    rows
}

/// How the volumes were made.
fn reconstruction(record: &VolumeRecord) -> Vec<TableRow> {
    let short = crate::picture::text::short;
    let mut rows = vec![TableRow::new("method", record.method.clone())];
    for (key, value) in record.options.as_object().into_iter().flatten() {
        let text = match value {
            Value::Null => continue,
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        rows.push(TableRow::new(key.replace('_', " "), text));
    }
    let millimetres = |lengths: [f64; 3]| lengths.map(|length| short(1e3 * length)).join(", ");
    rows.push(TableRow::new("sides of a voxel, mm", millimetres(record.voxel_m)));
    rows.push(TableRow::new("centre of the first voxel, mm", millimetres(record.origin_m)));
    rows.push(TableRow::new("axis of rotation in column", short(record.axis_column)));
    if let Some(k) = record.gradient_bias_m {
        rows.push(TableRow::new("k of δ + kµ, m", short(k)));
    }
    if let Some(it) = &record.beam_hardening {
        let words = format!("{}, µ is that of {} keV", it.material, short(it.energy_kev));
        rows.push(TableRow::new("beam hardening", words));
    } else if let Some(beam) = record.beam.filter(|beam| beam.spectrum) {
        let words = format!("mean {} keV, µ not corrected for beam hardening", short(beam.kev));
        rows.push(TableRow::new("spectrum", words));
    }
    for (key, value) in [("mask", &record.mask), ("start", &record.start)] {
        rows.extend(value.iter().map(|value| TableRow::new(key, value.clone())));
    }
    if let Some(drift) = record.drift {
        let words =
            format!("{} rad rms, largest {} rad", short(drift.rms_rad), short(drift.largest_rad));
        rows.push(TableRow::new("mean angle of rows, subtracted", words));
    }
    for (name, counts) in &record.pixels {
        let filled = counts.without_answer + counts.dark;
        let value = format!("{filled} of {} filled, {} misfits", counts.pixels, counts.misfits);
        rows.push(TableRow::new(format!("pixels of {name}"), value));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_tables_are_short() {
        assert_eq!(short("1.23456789e-7"), "1.2346e−7");
        assert_eq!(short("rod"), "rod");
    }
}
