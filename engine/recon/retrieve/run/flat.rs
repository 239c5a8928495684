//! The flat of a retrieval: its curves and images.

use super::Output;
use crate::retrieve::curves::{Curve, Fits};
use crate::retrieve::diagnosis::Diagnosis;
use crate::retrieve::flags;
use crate::retrieve::input::Input;
use crate::retrieve::joined::JoinedColumns;
use crate::retrieve::retriever::{Layout, Retriever};
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, numbers};
use std::ops::Range;

/// Takes the flat, the first where views have their own, and returns the rows and columns of its images.
///
/// # Errors
/// As [`Retriever::set_flat`]; [`Error::Argument`] where no curve can be fitted.
pub(super) fn take_flat(
    input: &Input,
    retriever: &mut Retriever,
    diagnosis: &mut Diagnosis,
    control: &mut RowsControl<'_>,
) -> Result<[usize; 2]> {
    let [rows, columns] = input.frame();
    let mut read = |band: Range<u32>| {
        let data = input.flat_rows(0, band.clone())?;
        diagnosis.take_flat(&data, &band);
        Ok(data)
    };
    let noise = input.flat_noise(0);
    retriever.set_flat_with(numbers::count(rows), columns, noise, &mut read, control)?;
    let Some(flat) = retriever.flat_curves() else { return Err(Error::Interrupted) };
    diagnosis.place(retriever)?;
    if flat.known().next().is_none() {
        let allowed = retriever.overlap_of_curves().unwrap_or_else(|| {
            "a flat with a curve that can be fitted in some pixel: check its values, the mask offsets or the lattice, \
             the saturation and the read noise"
                .to_owned()
        });
        return Err(Error::argument("flat", no_answers(flat), allowed));
    }
    Ok(retriever.shape())
}

/// Enters the units of all images into the record, and hands over the images of a flat that serves all
/// views.
pub(super) fn put_flat(
    input: &Input,
    retriever: &Retriever,
    joined: Option<&JoinedColumns>,
    output: &mut Output<'_>,
) -> Result<()> {
    for name in retriever.names_of_images().iter().flatten() {
        output.enter(name);
    }
    if input.has_flats() {
        return Ok(());
    }
    let Some(flat) = retriever.images_of_flat() else { return Err(Error::Interrupted) };
    for (name, image) in flat.iter() {
        let of_dithers = joined.map(|joined| joined.flat(image.view()));
        output.put(name, 1, of_dithers.as_ref().unwrap_or(image).view())?;
    }
    Ok(())
}

/// Warnings of axes along which steps do not change the light of most curves of the flat, with the size of the period if
/// pixels see it.
pub(super) fn blind_axes(retriever: &Retriever, input: &Input) -> Vec<String> {
    let Layout::Steps(_) = retriever.layout() else { return Vec::new() };
    let known: Vec<Curve> = retriever.flat_curves().into_iter().flat_map(Fits::known).collect();
    let is_blind = |axis: &usize| {
        2 * known.iter().filter(|curve| curve.uncentred[*axis]).count() > known.len()
    };
    let warning = |axis: usize| {
        let scene = input.scene();
        let along = ["x", "z"][axis];
        let periods = scene.sample_mask.as_ref().filter(|_| scene.detector_mask.is_none());
        let periods = periods.and_then(|mask| {
            let period = if axis == 0 { Some(mask.period) } else { mask.period_z };
            Some(period? * scene.magnification() / scene.detector.pitch[axis])
        });
        let reason = periods.map_or_else(String::new, |pixels| {
            format!(
                " (a period of the sample mask is {pixels:.3} pixels: a pixel sees the light of whole periods)"
            )
        });
        format!(
            "steps along {along} do not change the light of the flat{reason}: refraction and dark field along {along} \
             are NaN. Use a detector mask, or a period that is no whole number of pixels"
        )
    };
    [0, 1].into_iter().filter(is_blind).map(warning).collect()
}

/// Reasons for missing answers, for a message.
fn no_answers(flat: &Fits) -> String {
    let found: Vec<String> = flags::MEANINGS
        .iter()
        .map(|(bit, _, meaning)| {
            (flat.iter().filter(|curve| curve.flags & bit != 0).count(), meaning)
        })
        .filter(|(count, _)| *count > 0)
        .map(|(count, meaning)| format!("{count} pixels: {meaning}"))
        .collect();
    format!("no pixel with a result ({})", found.join("; "))
}
