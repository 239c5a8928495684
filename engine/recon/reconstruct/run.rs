//! A whole reconstruction: from sinograms to a folder of volumes.

mod making;

use super::input::Input;
use super::memory::Memory;
use super::plan::VolumePlan;
use super::record::VolumeRecord;
use super::truth::Truth;
use super::write::VolumeFormat;
use beamlet_core::cancel::Aside;
use beamlet_core::numbers::whole;
use beamlet_core::reserve::require_memory;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::whole_file::write_file;
use beamlet_core::{Result, setters};
use beamlet_files::layout::{ERRORS, RECORD, RESIDUALS};
use beamlet_files::{ImageDirectory, InputHashes, Kind, now, refuse_overlap};
use beamlet_gpu::Compute;
use making::{Making, Tables};
use std::path::Path;
use std::time::Instant;

/// Name of the volume of labels, the objects of the scene: 0 in the surroundings, 1 + the index of the object.
pub const LABELS: &str = "labels";
/// Columns for each view beyond which views are few.
const MANY_COLUMNS: usize = 4;
/// Where volumes go.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct VolumesTo<'a> {
    /// Folder of the volumes.
    pub path: &'a Path,
    /// Their format.
    pub format: VolumeFormat,
    /// Replace existing volumes.
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
    /// [`beamlet_core::Error::File`].
    pub fn check(&self, input: &Input) -> Result<()> {
        refuse_overlap(self.path, &input.paths())?;
        ImageDirectory::check(self.path, Kind::Volume, self.overwrite)
    }
}

/// Summary of a written reconstruction.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Reconstructed {
    /// volume.json.
    pub record: VolumeRecord,
    /// Errors by material, as CSV.
    pub errors: Option<String>,
}

/// Reconstructs the quantities of a plan into a folder, whole or not at all. With a `truth` its volumes
/// are written, too, and the errors by material.
///
/// # Errors
/// As [`VolumePlan::check`], [`Input::sinograms`] and the method of the plan; [`beamlet_core::Error::File`] where the
/// place is taken or cannot be written; [`beamlet_core::Error::Memory`] beyond the limit of the engine;
/// [`beamlet_core::Error::Interrupted`]. Nothing is left behind then.
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
    compute: &Compute,
    input: &Input,
    plan: &VolumePlan,
    truth: Option<&Truth>,
    to: VolumesTo<'_>,
    control: &mut RowsControl<'_>,
) -> Result<Reconstructed> {
    let since = Instant::now();
    to.check(input)?;
    refuse_overlap(to.path, &plan.paths())?;
    plan.check(input)?;
    truth.map_or(Ok(()), |truth| truth.require_grid(&plan.grid))?;
    let geometry = input.geometry();
    if plan.method.filtered().is_some() {
        geometry.require_circle("fbp")?;
    }
    warn_of_few_views(geometry.angles.len(), geometry.columns.len());
    let memory = Memory::on(compute, geometry, plan, truth.is_some())?;
    require_memory(memory.host, "a reconstruction")?;
    let record = VolumeRecord::begin(compute, geometry, plan, to.format);
    let hashes = input_hashes(input, plan);
    let images = ImageDirectory::begin(
        to.path,
        Kind::Volume,
        to.format.of_images(),
        to.overwrite,
        record.about(),
    )?;
    let mask = plan.mask.as_ref().map(|mask| mask.on(&plan.grid)).transpose()?;
    // Within the memory that there is.
    let method = plan.method.with_at_once(memory.at_once);
    let plan = &VolumePlan { method, ..plan.clone() };
    let format = to.format;
    let mut making = Making {
        compute,
        input,
        plan,
        truth,
        mask,
        format,
        images,
        record,
        tables: Tables::default(),
        mu: None,
        reaching: None,
    };
    let parts = plan.ordered().count() as u64;
    for (number, quantity) in (0..).zip(plan.ordered()) {
        let mut advance = |done: u64, all: u64| {
            if let Some(progress) = &mut control.progress {
                let share = 1000.0 * done as f64 / all.max(1) as f64;
                progress(1000 * number + whole::<u64>(share), 1000 * parts);
            }
        };
        let cancel = control.cancel.clone();
        making.quantity(quantity, &mut RowsControl { progress: Some(&mut advance), cancel })?;
    }
    let Making { mut images, mut record, tables, .. } = making;
    let Tables { errors, residuals } = tables;
    for (name, table) in [(ERRORS, &errors), (RESIDUALS, &residuals)] {
        if !table.is_empty() {
            write_file(&images.file(name)?, table.as_bytes())?;
            record.files.push(name.to_owned());
        }
    }
    let InputHashes { hashes, stamps } = hashes.wait(&control.cancel, &mut || {})??;
    (record.inputs, record.input_stamps) = (hashes, stamps);
    record.command = to.command.map(str::to_owned);
    record.labels = truth.map(Truth::names).unwrap_or_default();
    record.written = now();
    record.duration_s = since.elapsed().as_secs_f64();
    images.finish(Some(&record.text()?))?;
    let errors = (!errors.is_empty()).then_some(errors);
    Ok(Reconstructed { record, errors })
}

/// Begins to find the hashes of everything that is read, with the inputs of retrieved images.
fn input_hashes(input: &Input, plan: &VolumePlan) -> Aside<Result<InputHashes>> {
    let (own, beside) = (input.paths(), plan.paths());
    Aside::begin(move |end| {
        let mut found = InputHashes::of(&[&own[..], &beside].concat(), end)?;
        own.iter().try_for_each(|folder| found.inherit(folder, RECORD))?;
        Ok(found)
    })
}

/// Warns of views that are far fewer than the columns.
fn warn_of_few_views(views: usize, columns: usize) {
    if views.saturating_mul(MANY_COLUMNS) < columns {
        let needed = columns as f64 * std::f64::consts::FRAC_PI_2;
        log::warn!(
            "{views} views are few for {columns} columns: slices will have streaks, which about {needed:.0} \
             views avoid"
        );
    }
}
