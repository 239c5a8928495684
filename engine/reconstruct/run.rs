//! A whole reconstruction: from sinograms to a folder of volumes.

use super::estimate::host_bytes;
use super::input::Input;
use super::plan::VolumePlan;
use super::record::VolumeRecord;
use super::regions::region_table;
use super::truth::Truth;
use super::write::{VolumeFormat, write};
use crate::cancel::Aside;
use crate::retrieve::path_hash;
use crate::run::{RowsControl, require_memory};
use crate::stack::layout::{ERRORS, REGIONS};
use crate::stack::{ImageDirectory, Kind, now, refuse_overlap};
use crate::whole_file::write_file;
use crate::{Engine, Error, Result};
use ndarray::Array3;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Where volumes go.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct VolumesTo<'a> {
    /// Folder of the volumes.
    pub path: &'a Path,
    /// Their format.
    pub format: VolumeFormat,
    /// Replace volumes that are there.
    pub overwrite: bool,
    /// Command line, for the record.
    pub command: Option<&'a str>,
}

impl<'a> VolumesTo<'a> {
    /// A folder that must not hold volumes yet.
    #[must_use]
    pub const fn new(path: &'a Path, format: VolumeFormat) -> Self {
        Self { path, format, overwrite: false, command: None }
    }

    setters! {
        /// Replaces volumes that are there.
        with_overwrite(overwrite: bool);
        /// Sets the command line of the record.
        with_command(command: Option<&'a str>);
    }

    /// Refuses a place that is taken, or that is read, before any work is done.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn check(&self, input: &Input) -> Result<()> {
        refuse_overlap(self.path, &input.paths())?;
        ImageDirectory::check(self.path, Kind::Volume, self.overwrite)
    }
}

/// What a reconstruction wrote.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Reconstructed {
    /// volume.json.
    pub record: VolumeRecord,
    /// Means of the regions, as CSV.
    pub regions: Option<String>,
    /// Errors by material, as CSV.
    pub errors: Option<String>,
}

/// Reconstructs the quantities of a plan into a folder, whole or not at all. With a `truth` its volumes
/// are written, too, and the errors by material.
///
/// # Errors
/// As [`Input::sinograms`] and [`Method::volume`]; [`Error::File`] where the place is taken or cannot be
/// written; [`Error::Interrupted`]. Nothing is left behind then.
///
/// # Example
///
/// ```no_run
/// use beamlet::reconstruct::{
///     GridChoice, Input, Method, VolumeFormat, VolumePlan, VolumesTo, reconstruct,
/// };
/// use beamlet::{Engine, EngineOptions, RowsControl};
///
/// let input = Input::of_images(&["run/retrieved".into()])?;
/// let grid = GridChoice::default().grid(input.geometry())?;
/// let plan = VolumePlan::new(input.quantities(), grid, Method::default());
/// let engine = Engine::open(&EngineOptions::default())?;
/// let to = VolumesTo::new("volume".as_ref(), VolumeFormat::Tiff);
/// let done = reconstruct(&engine, &input, &plan, None, to, &mut RowsControl::default())?;
/// println!("{:?}", done.record.units);
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn reconstruct(
    engine: &Engine,
    input: &Input,
    plan: &VolumePlan,
    truth: Option<&Truth>,
    to: VolumesTo<'_>,
    control: &mut RowsControl<'_>,
) -> Result<Reconstructed> {
    let since = Instant::now();
    to.check(input)?;
    plan.regions.iter().try_for_each(|region| region.check(&plan.grid))?;
    let geometry = input.geometry();
    require_memory(host_bytes(geometry, &plan.grid), "a reconstruction")?;
    let mut record = VolumeRecord::begin(engine, geometry, plan, to.format);
    let paths = input.paths();
    let hashes: Aside<Result<BTreeMap<String, String>>> = Aside::begin(move |end| {
        let hash =
            |path: &std::path::PathBuf| Ok((path.display().to_string(), path_hash(path, end)?));
        paths.iter().map(hash).collect()
    });
    let mut images = ImageDirectory::begin(
        to.path,
        Kind::Volume,
        to.format.of_images(),
        to.overwrite,
        record.about(),
    )?;
    let (mut regions, mut errors) = (String::new(), String::new());
    let parts = plan.quantities.len() as u64;
    for (number, quantity) in (0..).zip(plan.quantities.iter().copied()) {
        let (sinograms, counts) = input.sinograms(quantity, &control.cancel)?;
        record.pixels.insert(quantity.name().to_owned(), counts);
        let cancel = control.cancel.clone();
        let mut advance = |done: u64, all: u64| {
            if let Some(progress) = &mut control.progress {
                let share = 1000.0 * done as f64 / all.max(1) as f64;
                progress(1000 * number + crate::numbers::whole::<u64>(share), 1000 * parts);
            }
        };
        let mut inner = RowsControl { progress: Some(&mut advance), cancel: cancel.clone() };
        let volume = plan.method.volume(
            engine,
            geometry,
            sinograms.view(),
            quantity,
            &plan.grid,
            &mut inner,
        )?;
        drop(sinograms);
        let mut put = |name: &str, unit: &str, values: &Array3<f32>| {
            record.units.insert(name.to_owned(), unit.to_owned());
            let files = write(&mut images, to.format, (name, unit), &plan.grid, values, &cancel)?;
            record.files.extend(files);
            Ok::<(), Error>(())
        };
        put(quantity.name(), quantity.unit(), &volume.values)?;
        if !plan.regions.is_empty() {
            append(&mut regions, &region_table(&plan.regions, &[&volume])?);
        }
        if let Some(truth) = truth {
            if let Some(values) = truth.values(quantity) {
                put(&format!("{}_truth", quantity.name()), quantity.unit(), &values)?;
                append(&mut errors, &truth.errors(&volume));
            }
            if number == 0 {
                put("labels", "1", truth.labels())?;
            }
        }
    }
    for (name, table) in [(REGIONS, &regions), (ERRORS, &errors)] {
        if !table.is_empty() {
            write_file(&images.file(name)?, table.as_bytes())?;
            record.files.push(name.to_owned());
        }
    }
    record.inputs = hashes.wait(&control.cancel, &mut || {})??;
    record.command = to.command.map(str::to_owned);
    record.labels = truth.map(Truth::names).unwrap_or_default();
    record.written = now();
    record.duration_s = since.elapsed().as_secs_f64();
    images.finish(Some(&record.text()?))?;
    let table = |text: String| (!text.is_empty()).then_some(text);
    Ok(Reconstructed { record, regions: table(regions), errors: table(errors) })
}

/// Appends a table to one with the same heading.
fn append(to: &mut String, table: &str) {
    let body = table.split_once('\n').map_or("", |(_, body)| body);
    to.push_str(if to.is_empty() { table } else { body });
}
