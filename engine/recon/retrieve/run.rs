//! A whole retrieval: from an input to a directory of images.

mod begun;
mod flat;
mod views;

use super::correct::{Corrector, table, undetermined};
use super::diagnosis::Diagnosis;
use super::images::{FLAGS, Images, PHASE, sample, unit};
use super::input::Input;
use super::joined::JoinedColumns;
use super::misfit::median;
use super::options::RetrieveOptions;
use super::phase::PhaseImages;
use super::record::Record;
use super::response;
use super::retriever::Retriever;
use super::rims::{RimError, phase_errors};
use beamlet_core::parallel::start_threads;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::whole_file::write_file;
use beamlet_core::{Cancel, Error, Result, numbers, reserve, setters};
use beamlet_files::layout::{CORRECTIONS, GEOMETRY};
use beamlet_files::{
    Format, ImageDirectory, InputHashes, Kind, now, refuse_overlap, working_directory,
};
use beamlet_gpu::Compute;
use begun::{about, begun, count};
use flat::{blind_axes, put_flat, take_flat};
use ndarray::{Array3, ArrayView2};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::time::Instant;
use views::Views;

/// Share of pixels without a result of a sample whose values are noise: a few may have one by chance.
const SOME: f64 = 0.8;

/// Where images go.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct ImagesTo<'a> {
    /// Directory of the images: `RUN/retrieved`, or any other.
    pub path: &'a Path,
    /// Their format.
    pub format: Format,
    /// Replace existing images.
    pub overwrite: bool,
    /// Command line, for the record.
    pub command: Option<&'a str>,
}

impl<'a> ImagesTo<'a> {
    /// A directory that must not hold images yet.
    #[must_use]
    pub const fn new(path: &'a Path, format: Format) -> Self {
        Self { path, format, overwrite: false, command: None }
    }

    setters! {
        /// Replaces images that are there.
        with_overwrite(overwrite: bool);
        /// Sets the command line of the record.
        with_command(command: Option<&'a str>);
    }
}

/// Retrieves every view of an input into a directory, whole or not at all.
///
/// # Errors
/// As [`Retriever::new`] and [`Retriever::retrieve`]; [`Error::File`] where the place is taken
/// or cannot be written; [`Error::Interrupted`]. Nothing is left behind then.
///
/// # Example
///
/// ```no_run
/// use beamlet::RowsControl;
/// use beamlet::retrieve::{ImagesTo, Input, RetrieveOptions, retrieve};
/// use beamlet::stack::{Format, OpenRun};
/// use beamlet::{Engine, EngineOptions};
///
/// let engine = Engine::open(&EngineOptions::default())?;
/// // Intensities; `true` takes the counts of a detector with noise.
/// let input = Input::of_run(&OpenRun::open("run")?, false)?;
/// let to = ImagesTo::new("run/retrieved".as_ref(), Format::Npy);
/// let options = RetrieveOptions::default();
/// let record = retrieve(&engine, input, &options, to, &mut RowsControl::default())?;
/// println!("{} pixels without a result", record.without_answer);
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn retrieve(
    compute: &Compute,
    input: Input,
    options: &RetrieveOptions,
    to: ImagesTo<'_>,
    control: &mut RowsControl<'_>,
) -> Result<Record> {
    start_threads()?;
    refuse_overlap(to.path, &input.paths())?;
    ImageDirectory::check(to.path, Kind::Images, to.overwrite)?;
    let scan = input.scene().scan.clone();
    let mut directory = None;
    let begin = |record: &Record| {
        ImageDirectory::begin(to.path, Kind::Images, to.format, to.overwrite, about(record))
            .map(|directory| directory.with_pitch(record.pitch))
    };
    let mut put = |record: &Record, image: Image<'_>| {
        let directory = match &mut directory {
            Some(directory) => directory,
            none => none.insert(begin(record)?),
        };
        directory.put(image.name, image.unit, sample(image.name), image.views, image.values)
    };
    let (mut record, geometry) = retrieve_to(compute, input, options, control, &mut put)?;
    record.command = to.command.map(str::to_owned);
    if let Some(mut images) = directory {
        if let Some(geometry) = geometry {
            write_file(&images.file(GEOMETRY)?, geometry.as_bytes())?;
        }
        if !record.corrections.is_empty() {
            let offsets = |view| scan.offsets_of(view).to_vec();
            let text = table(&record.corrections, offsets);
            write_file(&images.file(CORRECTIONS)?, text.as_bytes())?;
        }
        images.finish(Some(&record.text()?))?;
    }
    Ok(record)
}

/// Retrieved images in memory.
#[derive(Debug)]
#[non_exhaustive]
pub struct RetrievedArrays {
    /// Images by name, `[view][row][column]`; images of the flat have one view.
    pub images: BTreeMap<String, Array3<f32>>,
    /// Units by name, flags and their counts.
    pub record: Record,
    /// Text of geometry.json: angles, vectors and columns of the images; `None` where the scene has
    /// other angles than the input has views.
    pub geometry: Option<String>,
}

/// Retrieves every view of an input into memory.
///
/// # Errors
/// As [`Retriever::new`] and [`Retriever::retrieve`]; [`Error::Memory`]; [`Error::Interrupted`].
///
/// # Example
///
/// ```no_run
/// use beamlet::retrieve::{Input, RetrieveOptions, retrieve_arrays};
/// use beamlet::{Engine, EngineOptions, RowsControl, stack::OpenRun};
///
/// let engine = Engine::open(&EngineOptions::default())?;
/// let input = Input::of_run(&OpenRun::open("run")?, false)?;
/// let options = RetrieveOptions::default();
/// let found = retrieve_arrays(&engine, input, &options, &mut RowsControl::default())?;
/// println!("{:?}", found.images["transmission"].dim());
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn retrieve_arrays(
    compute: &Compute,
    input: Input,
    options: &RetrieveOptions,
    control: &mut RowsControl<'_>,
) -> Result<RetrievedArrays> {
    start_threads()?;
    let mut values: BTreeMap<String, Vec<f32>> = BTreeMap::new();
    let mut put = |_: &Record, image: Image<'_>| {
        let all = match values.entry(image.name.to_owned()) {
            Entry::Occupied(found) => found.into_mut(),
            Entry::Vacant(none) => {
                let needed = image.views * image.values.len();
                none.insert(reserve::room(needed, "retrieved images")?)
            }
        };
        all.extend(image.values.iter());
        Ok(())
    };
    let (record, geometry) = retrieve_to(compute, input, options, control, &mut put)?;
    let [_, rows, columns] = record.shape;
    let shaped = |(name, values): (String, Vec<f32>)| {
        let views = values.len() / (rows * columns).max(1);
        let image = Array3::from_shape_vec((views, rows, columns), values)
            .map_err(|error| Error::argument(&name, error.to_string(), "one shape of all views"))?;
        Ok((name, image))
    };
    let images = values.into_iter().map(shaped).collect::<Result<_>>()?;
    Ok(RetrievedArrays { images, record, geometry })
}

/// An image of a view.
struct Image<'a> {
    name: &'a str,
    unit: &'a str,
    /// Views that there will be of this name.
    views: usize,
    /// `[row][column]`.
    values: ArrayView2<'a, f32>,
}

/// Refuses frames of other pixels than the scene, which gives the places of pixels.
///
/// # Errors
/// [`Error::Scene`] with both.
fn require_pixels(input: &Input) -> Result<()> {
    let [rows, columns] = input.whole_frame();
    let [across, along] = input.scene().detector.pixels;
    if [across, along] == [columns, rows].map(numbers::count) {
        return Ok(());
    }
    let allowed = format!("[{columns}, {rows}], the pixels of the frames");
    Err(Error::scene("detector.pixels", format!("[{across}, {along}]"), allowed))
}

/// Receiver of images, and the record that describes them.
struct Output<'a> {
    put: &'a mut dyn FnMut(&Record, Image<'_>) -> Result<()>,
    record: Record,
    /// Unit of recorded values.
    value: &'static str,
    cancel: Cancel,
}

impl Output<'_> {
    /// Enters the unit of an image into the record.
    fn enter(&mut self, name: &str) {
        self.record.units.insert(name.to_owned(), unit(name, self.value).to_owned());
    }

    /// Hands over an image, one of `views` of this name.
    fn put(&mut self, name: &str, views: usize, values: ArrayView2<'_, f32>) -> Result<()> {
        self.cancel.check()?;
        let unit = unit(name, self.value);
        (self.put)(&self.record, Image { name, unit, views, values })
    }
}

/// Retrieves every view of an input and hands over each image, the flat's first. Returns the record, and
/// the text of geometry.json if the angles of the views are known.
fn retrieve_to(
    compute: &Compute,
    input: Input,
    options: &RetrieveOptions,
    control: &mut RowsControl<'_>,
    put: &mut dyn FnMut(&Record, Image<'_>) -> Result<()>,
) -> Result<(Record, Option<String>)> {
    let (began, since) = (now(), Instant::now());
    options.check_saturation()?;
    let input = input.limited_to(options.saturation);
    let options = options_for(&input, &options.resolved(input.scene())?)?;
    let scene = input.scene().clone();
    let mut retriever = Retriever::new(compute, &scene, &options)?;
    refuse_parts_of_beamlets(&input, &retriever)?;
    let input = input.fitted_to(retriever.steps())?;
    if !options.correct.is_none() || options.phase || retriever.layout().is_of_list() {
        require_pixels(&input)?;
    }
    let [rows, _] = input.frame();
    let angles = input.angles()?;
    retriever.check_views(input.views())?;
    let flats = if input.has_flats() { input.views() } else { 1 };
    let all = u64::from(numbers::count(rows)) * (input.views() + flats) as u64;
    let mut done = 0;
    let mut outer = control.progress.take();
    let mut advance = |rows: u64, _: u64| {
        done += rows;
        if let Some(progress) = &mut outer {
            progress(done, all);
        }
    };
    let cancel = control.cancel.clone();
    let mut inner = RowsControl { progress: Some(&mut advance), cancel: cancel.clone() };
    let hashes = input.hashes();
    let mut diagnosis = Diagnosis::begin(&retriever, &options, &input)?;
    let [down, across] = take_flat(&input, &mut retriever, &mut diagnosis, &mut inner)?;
    let joined = retriever.joined(&input);
    let across = joined.as_ref().map_or(across, |joined| joined.order().len());
    let mut record = begun(&input, &retriever, &options, [angles, down, across]);
    record.columns = joined.as_ref().map(JoinedColumns::order).unwrap_or_default().to_vec();
    record.warnings = blind_axes(&retriever, &input);
    let value = if input.counts() { "counts" } else { "open pixels" };
    let mut output = Output { put, record, value, cancel: cancel.clone() };
    put_flat(&input, &retriever, joined.as_ref(), &mut output)?;
    let bad = input.bad_pixels();
    let corrector = Corrector::of(&retriever, &input, &options)?;
    let views = Views {
        input: &input,
        joined: joined.as_ref(),
        bad: bad.as_ref(),
        retriever: &mut retriever,
        diagnosis: &mut diagnosis,
        corrector,
        corrections: Vec::new(),
    };
    retrieve_views(views, &options, &mut output, &mut inner)?;
    let mut record = output.record;
    let of_input = input.warnings().iter().cloned().chain(input.other_optics(options.method()));
    let of_input = of_input.chain(input.full_scale()).chain(of_rims(&input, &options));
    diagnosis.finish(&mut record, &retriever, &of_input.collect::<Vec<_>>())?;
    let response_of = |other: &RetrieveOptions| Retriever::new(compute, &scene, other)?.response();
    response::enter(&mut record, &options, retriever.response()?, response_of)?;
    finish(&mut record, hashes.wait(&cancel, &mut || {})??, (began, since));
    let has_columns = retriever.layout().lattice().is_none();
    let geometry = match has_columns && input.has_angles() {
        true => Some(retriever.geometry(&input, angles).text()?),
        false => None,
    };
    Ok((record, geometry))
}

/// Enters inputs and times into a record.
fn finish(record: &mut Record, inputs: InputHashes, (began, since): (String, Instant)) {
    (record.inputs, record.input_stamps) = (inputs.hashes, inputs.stamps);
    record.working_directory = working_directory().filter(|_| !record.inputs.is_empty());
    record.began = Some(began);
    record.written = Some(now());
    record.duration_s = since.elapsed().as_secs_f64();
}

/// Warnings of integrals that miss the rims of the bodies of the scene.
fn of_rims(input: &Input, options: &RetrieveOptions) -> Vec<String> {
    let errors = if options.phase { phase_errors(input.scene()) } else { Vec::new() };
    let warning = |error: RimError| {
        format!(
            "{}: apertures see a part of each pixel, and miss rims or take them for wider ones (docs/retrieval.md, \"Phase\"); \
             scan.dithers over a pixel see all of it",
            error.of_phase()
        )
    };
    errors.into_iter().map(warning).collect()
}

/// Refuses beamlets, and curves of a list of apertures, among a part of the pixels.
fn refuse_parts_of_beamlets(input: &Input, retriever: &Retriever) -> Result<()> {
    let layout = retriever.layout();
    if !(layout.has_beamlets() || layout.is_of_list()) || input.selection() == (None, None) {
        return Ok(());
    }
    let allowed = match layout.is_of_list() {
        true => "every pixel: their places are before the list of apertures",
        false => "every pixel: beamlets are found among all of them",
    };
    Err(Error::argument("columns", "a part of the pixels", allowed))
}

/// Options with the saturation, the read noise and the steps of an input.
///
/// # Errors
/// [`Error::Argument`] for corrections of frames behind masks with shifts.
fn options_for(input: &Input, options: &RetrieveOptions) -> Result<RetrieveOptions> {
    if input.group() > 1 && options.correct.of_frames() {
        let allowed = "offset and plane: the points of a curve are columns, not frames";
        return Err(Error::argument("correct", "dose or steps with shifts of the masks", allowed));
    }
    let noise = options.read_noise * (input.added() as f64).sqrt();
    let z = options.offsets_z.iter().enumerate();
    let kept = z.filter(|(step, _)| !input.omitted_steps().contains(step)).map(|(_, z)| *z);
    let options = options.clone().with_offsets_z(kept.collect());
    Ok(options.with_saturation(input.saturation()).with_read_noise(noise))
}

/// Refuses a sample without light: no pixel of any view has a result, or next to none where values are those of noise.
///
/// # Errors
/// [`Error::Argument`] with the reasons and their numbers of pixels.
fn refuse_darkness(record: &Record, diagnosis: &Diagnosis) -> Result<()> {
    let pixels = record.shape.iter().product::<usize>() as u64;
    let share = if diagnosis.is_dark() { SOME } else { 1.0 };
    if diagnosis.names_fault() || (record.without_answer as f64) < share * pixels as f64 {
        return Ok(());
    }
    let counted = record.flagged.iter().filter(|(_, count)| **count > 0);
    let reasons: Vec<String> =
        counted.map(|(bit, count)| format!("{count} pixels: {}", record.flags[bit])).collect();
    let without = record.without_answer;
    let found = format!("{without} of {pixels} pixels without a result ({})", reasons.join("; "));
    let allowed = "a sample with light: check its values, the dark and the order of frames";
    Err(Error::argument("sample", found, allowed))
}

/// Retrieves and hands over the images of every angle, and of its flat if it has one, with corrections and phase where
/// `options` has them, and enters the results of all into the record.
fn retrieve_views(
    mut views: Views<'_>,
    options: &RetrieveOptions,
    output: &mut Output<'_>,
    control: &mut RowsControl<'_>,
) -> Result<()> {
    let [angles, ..] = output.record.shape;
    let mut phases = match options.phase {
        true => Some(PhaseImages::new(views.retriever.geometry(views.input, angles))?),
        false => None,
    };
    if phases.is_some() {
        output.enter(PHASE);
    }
    let mut residuals = Vec::new();
    for angle in 0..angles {
        let (retrieved, of_flats) = views.angle(angle, control)?;
        for (name, image) in of_flats.iter().flat_map(Images::iter).chain(retrieved.iter()) {
            output.put(name, angles, image.view())?;
        }
        if let (Some(phases), Some(angles_of_view)) = (&mut phases, retrieved.get("refraction")) {
            output.put(PHASE, angles, phases.of(angles_of_view).view())?;
        }
        count(&mut output.record, retrieved.get(FLAGS));
        let left = retrieved.get("residual_sample").into_iter().flatten();
        residuals.extend(median(left.map(|left| f64::from(*left)).collect()));
    }
    let record = &mut output.record;
    refuse_darkness(record, views.diagnosis)?;
    record.residual = median(residuals).filter(|residual| *residual > 0.0);
    record.drift = phases.map(|phases| phases.drift());
    record.correct = options.correct.names();
    record.corrections = views.corrections;
    record.warnings.extend(undetermined(&record.corrections));
    Ok(())
}
