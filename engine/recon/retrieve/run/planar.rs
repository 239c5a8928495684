//! Retrieval of every view in two directions.

use super::begun::{Described, begun};
use super::{Image, Output, put_angles};
use crate::retrieve::input::Input;
use crate::retrieve::misfit::median;
use crate::retrieve::noise_factors::NoiseFactors;
use crate::retrieve::options::RetrieveOptions;
use crate::retrieve::phase::PhaseImages;
use crate::retrieve::planar::{Design, Fits, PlanarFit, PlanarRetriever};
use crate::retrieve::record::Record;
use crate::retrieve::response;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, numbers, reserve};
use beamlet_files::GeometryFile;
use std::ops::Range;

/// Bytes of a band of rows with all its steps.
const BAND: usize = 16 << 20;

/// Receiver of images and of the record.
type Put<'a> = dyn FnMut(&Record, Image<'_>) -> Result<()> + 'a;

/// Retrieves every view in two directions and hands over the images, the flat's first. Returns the record, and
/// the text of geometry.json of images of pixels.
pub(super) fn retrieve_planar(
    input: &Input,
    design: &Design,
    options: &RetrieveOptions,
    control: &mut RowsControl<'_>,
    put: &mut Put<'_>,
) -> Result<(Record, Option<String>)> {
    let frame = input.frame();
    let angles = input.angles()?;
    ask_memory(input, design, options)?;
    let whole = matches!(design, Design::Beamlets(_));
    let first = input.flat_rows(0, 0..if whole { numbers::count(frame[0]) } else { 1 })?;
    let set_up = (input.scene(), design);
    let retriever = PlanarRetriever::new(set_up, options, input.pitch(), first.view())?;
    let mut work = Work { input, retriever: &retriever, control, done: 0, all: 0 };
    let flats = if input.has_flats() { angles } else { 1 };
    work.all = (frame[0] * (angles + flats)) as u64;
    let mut flat = work.fits(Of::Flat(0), None)?;
    refuse_without_answer(&flat)?;
    let shape = retriever.shape(frame[0]);
    let described = described(input, &retriever, design, &flat);
    let mut record = begun(input, described, options, [angles, shape[0], shape[1]]);
    let blind = retriever.blind(&flat);
    record.warnings.extend((0..2).filter(|axis| blind[*axis]).map(|axis| blind_axis(input, axis)));
    let value = if input.counts() { "counts" } else { "open pixels" };
    let mut output = Output { put, record, value, cancel: work.control.cancel.clone() };
    for name in retriever.names().iter().flatten() {
        output.enter(name);
    }
    if !input.has_flats() {
        for (name, image) in retriever.images_of_flat(&flat, frame[0]).iter() {
            output.put(name, 1, image.view())?;
        }
    }
    let with_columns =
        || GeometryFile::with_columns(&input.image_scene(), input.columns_m(), angles);
    let geometry = (!whole).then(with_columns);
    let phases = geometry.clone().filter(|_| options.phase).map(PhaseImages::new).transpose()?;
    let bad = input.bad_pixels();
    put_angles(&mut output, phases, |view| {
        if view > 0 && input.has_flats() {
            flat = work.fits(Of::Flat(view), None)?;
        }
        let of_flat = input.has_flats().then(|| retriever.images_of_flat(&flat, frame[0]));
        let sample = work.fits(Of::Sample(view), Some(&flat))?;
        let mut images = retriever.images(&flat, &sample, frame[0]);
        if let Some(bad) = &bad {
            retriever.mark_bad(&mut images, bad);
        }
        Ok((images, of_flat))
    })?;
    let mut record = output.record;
    record.warnings.extend(input.warnings().iter().cloned());
    record.warnings.iter().for_each(|warning| log::warn!("{warning}"));
    let scene = input.scene();
    let response_of = |other: &RetrieveOptions| {
        PlanarRetriever::new((scene, design), other, input.pitch(), first.view())?.response(scene)
    };
    response::enter(&mut record, options, retriever.response(scene)?, response_of)?;
    let geometry = geometry.filter(|_| input.has_angles()).map(|geometry| geometry.text());
    Ok((record, geometry.transpose()?))
}

/// Frames of flat or of a view of the sample.
#[derive(Clone, Copy)]
enum Of {
    Flat(usize),
    Sample(usize),
}

/// Fits of frames, band by band.
struct Work<'a, 'b> {
    input: &'a Input,
    retriever: &'a PlanarRetriever,
    control: &'a mut RowsControl<'b>,
    done: u64,
    all: u64,
}

impl Work<'_, '_> {
    /// Fits of all rows; `flat`: the flat's fits, for a sample.
    fn fits(&mut self, of: Of, flat: Option<&Fits>) -> Result<Fits> {
        let [rows, columns] = self.input.frame();
        let steps = self.input.steps()[0];
        let height = match self.retriever.needs_whole_frames() {
            true => rows,
            false => (BAND / (4 * steps * columns).max(1)).clamp(1, rows.max(1)),
        };
        let mut fits = Fits::new();
        let mut start = 0;
        while start < rows {
            let end = rows.min(start + height);
            let band: Range<u32> = numbers::count(start)..numbers::count(end);
            let (frames, noise) = match of {
                Of::Flat(view) => (self.input.flat_rows(view, band)?, self.input.flat_noise(view)),
                Of::Sample(view) => (self.input.sample_rows(view, band)?, NoiseFactors::ONE),
            };
            let known = flat.map(|flat| match self.retriever.needs_whole_frames() {
                true => &flat[..],
                false => &flat[start * columns..end * columns],
            });
            fits.extend(self.retriever.fits(
                (frames.view(), start),
                noise,
                known,
                &self.control.cancel,
            )?);
            self.done += (end - start) as u64;
            if let Some(progress) = &mut self.control.progress {
                progress(self.done, self.all);
            }
            start = end;
        }
        Ok(fits)
    }
}

/// Reserves memory for the fits of flat and sample, and of the images of a view.
fn ask_memory(input: &Input, design: &Design, options: &RetrieveOptions) -> Result<()> {
    let [rows, columns] = input.frame();
    // The images of flat and view.
    let numbers = if options.gain.is_some() { 29 } else { 23 };
    let fit = 2 * size_of::<Option<PlanarFit>>() + 4 * numbers;
    let (curves, frames) = match design {
        // Beamlets are 4 pixels apart at least.
        Design::Beamlets(_) => (rows * columns / 12, 8 * rows * columns),
        Design::Steps(_) => (rows * columns, BAND),
    };
    let purpose = format!("the images of a view of {rows} x {columns} pixels in two directions");
    reserve::ask((curves * fit + frames) as u64, &purpose, "retrieve frames with fewer pixels")
}

/// Refuses a flat without any curve.
fn refuse_without_answer(flat: &Fits) -> Result<()> {
    if flat.iter().flatten().any(|fit| fit.curve.has_answer()) {
        return Ok(());
    }
    let count = flat.iter().flatten().count();
    let allowed = "a flat with a curve that can be fitted in some place: check its values, the lattice or the mask \
                   offsets, the saturation and the read noise";
    Err(Error::argument("flat", format!("{count} curves without a result"), allowed))
}

/// Properties of the retriever for the record.
fn described(
    input: &Input,
    retriever: &PlanarRetriever,
    design: &Design,
    flat: &Fits,
) -> Described {
    let pitch = match retriever.lattice() {
        Some([a, b, _]) => [a[0].hypot(a[1]), b[0].hypot(b[1])],
        None => input.pitch(),
    };
    let widths = flat.iter().flatten().map(|fit| fit.curve.moments[0].sqrt());
    Described {
        columns_m: retriever.columns_m().unwrap_or_else(|| input.columns_m()),
        pitch,
        whole_periods: retriever.whole_periods(),
        flat_width: median(widths.collect()),
        angle_per_shift: retriever.angle_per_shift(),
        lattice: retriever.lattice(),
        offsets_z: design.offsets_z(),
        expected_sigma: retriever
            .expected(flat)
            .into_iter()
            .flatten()
            .map(|(name, sigma)| (name.to_owned(), sigma))
            .collect(),
        curve: None,
    }
}

/// Warning of steps along an axis that do not change the light, with the size of the period if pixels see it.
fn blind_axis(input: &Input, axis: usize) -> String {
    let scene = input.scene();
    let along = ["x", "z"][axis];
    let periods = scene.sample_mask.as_ref().filter(|_| scene.detector_mask.is_none());
    let periods = periods.and_then(|mask| {
        let period = if axis == 0 { Some(mask.period) } else { mask.period_z };
        Some(period? * scene.magnification() / scene.detector.pitch[axis])
    });
    let reason = periods.map_or_else(String::new, |pixels| {
        format!(" (a period of the sample mask is {pixels:.3} pixels: a pixel sees the light of whole periods)")
    });
    format!(
        "steps along {along} do not change the light of the flat{reason}: refraction and dark field along {along} \
         are NaN. Use a detector mask, or a period that is no whole number of pixels"
    )
}
