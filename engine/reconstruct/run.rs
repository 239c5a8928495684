//! A whole reconstruction: from sinograms to a folder of volumes.

use super::estimate::host_bytes;
use super::gradient_bias::add_gradient_bias;
use super::input::Input;
use super::method::Made;
use super::plan::VolumePlan;
use super::quantity::Quantity;
use super::record::VolumeRecord;
use super::regions::{Region, region_table};
use super::rings::suppress_rings;
use super::sigma::{fbp_mean_sigma, fbp_sigma};
use super::truth::Truth;
use super::write::{VolumeFormat, write};
use crate::cancel::Aside;
use crate::retrieve::path_hash;
use crate::run::{RowsControl, require_memory};
use crate::stack::layout::{ERRORS, REGIONS, RESIDUALS};
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

/// Summary of a written reconstruction.
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
/// As [`Input::sinograms`] and [`super::Method::volume`]; [`Error::File`] where the place is taken or
/// cannot be written; [`Error::Interrupted`]. Nothing is left behind then.
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
    plan.quantities.iter().try_for_each(|quantity| plan.method.check(*quantity))?;
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
    let [mut regions, mut errors, mut residuals] = [const { String::new() }; 3];
    let mut mu = None;
    let parts = plan.quantities.len() as u64;
    for (number, quantity) in (0..).zip(plan.quantities.iter().copied()) {
        let (mut sinograms, counts) = input.sinograms(quantity, &control.cancel)?;
        record.pixels.insert(quantity.name().to_owned(), counts);
        if plan.rings {
            suppress_rings(geometry, sinograms.view_mut())?;
        }
        let cancel = control.cancel.clone();
        let mut advance = |done: u64, all: u64| {
            if let Some(progress) = &mut control.progress {
                let share = 1000.0 * done as f64 / all.max(1) as f64;
                progress(1000 * number + crate::numbers::whole::<u64>(share), 1000 * parts);
            }
        };
        let mut inner = RowsControl { progress: Some(&mut advance), cancel: cancel.clone() };
        let weights = (plan.sigma && plan.method.filtered().is_none())
            .then(|| input.sigmas(quantity, &cancel).map(weights_of))
            .transpose()?;
        let made = plan.method.volume(
            engine,
            geometry,
            (sinograms.view(), weights.as_ref().map(|weights| weights.view())),
            quantity,
            &plan.grid,
            &mut inner,
        )?;
        drop(sinograms);
        append(&mut residuals, &residual_table(quantity, &made));
        let mut volume = made.volume;
        if let (Quantity::Delta, Some(k), Some(mu)) = (quantity, plan.gradient_bias, &mu) {
            add_gradient_bias(&mut volume, mu, k)?;
            record.gradient_bias_m = Some(k);
        }
        let mut put = |name: &str, unit: &str, values: &Array3<f32>| {
            record.units.insert(name.to_owned(), unit.to_owned());
            let files = write(&mut images, to.format, (name, unit), &plan.grid, values, &cancel)?;
            record.files.extend(files);
            Ok::<(), Error>(())
        };
        put(quantity.name(), quantity.unit(), &volume.values)?;
        let mut of_means = None;
        if let (true, Some(options)) = (plan.sigma, plan.method.filtered()) {
            let sigmas = input.filled_sigmas(quantity, &cancel)?;
            let given = (geometry, sigmas.view(), quantity);
            let mut quiet = RowsControl { progress: None, cancel: cancel.clone() };
            let map = fbp_sigma(engine, given, &plan.grid, options, &mut quiet)?;
            put(&format!("{}_sigma", quantity.name()), quantity.unit(), &map.values)?;
            let of = |region: &Region| {
                let voxels = region.voxels(&plan.grid);
                let mut quiet = RowsControl { progress: None, cancel: cancel.clone() };
                fbp_mean_sigma(given, &plan.grid, &voxels, options, &mut quiet)
            };
            of_means = Some(plan.regions.iter().map(of).collect::<Result<Vec<f64>>>()?);
        }
        if !plan.regions.is_empty() {
            append(&mut regions, &region_table(&plan.regions, &volume, of_means.as_deref())?);
        }
        if quantity == Quantity::Mu && plan.gradient_bias.is_some() {
            mu = Some(volume.clone());
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
    for (name, table) in [(REGIONS, &regions), (ERRORS, &errors), (RESIDUALS, &residuals)] {
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

/// One over the squares of deviations, 0 where there is none. Deviations below a tenth of the median
/// count as this.
fn weights_of(mut sigmas: Array3<f32>) -> Array3<f32> {
    let mut known: Vec<f32> = sigmas.iter().copied().filter(|sigma| *sigma > 0.0).collect();
    let middle = known.len() / 2;
    let least = match known.is_empty() {
        true => 1.0,
        false => *known.select_nth_unstable_by(middle, f32::total_cmp).1 / 10.0,
    };
    let weight = |sigma: f32| if sigma.is_nan() { 0.0 } else { sigma.max(least).powi(-2) };
    sigmas.mapv_inplace(weight);
    sigmas
}

/// Residuals of the iterations, as CSV; empty without.
fn residual_table(quantity: Quantity, made: &Made) -> String {
    let mut text = String::new();
    for (n, residual) in made.residuals.iter().enumerate() {
        if n == 0 {
            text.push_str("quantity,iteration,residual,taken\n");
        }
        let taken = u8::from(n == made.best);
        text.push_str(&format!("{},{n},{residual:e},{taken}\n", quantity.name()));
    }
    text
}

/// Appends a table to one with the same heading.
fn append(to: &mut String, table: &str) {
    let body = table.split_once('\n').map_or("", |(_, body)| body);
    to.push_str(if to.is_empty() { table } else { body });
}
