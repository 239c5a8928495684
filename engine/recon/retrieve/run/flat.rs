//! The flat of a retrieval: its curves and images.

use super::Output;
use crate::retrieve::diagnosis::Diagnosis;
use crate::retrieve::input::Input;
use crate::retrieve::joined::JoinedColumns;
use crate::retrieve::retriever::Retriever;
use crate::retrieve::{Curves, flags};
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, numbers};
use std::ops::Range;

/// Takes the flat, the first where views have their own, and returns the columns of its curves.
///
/// # Errors
/// As [`Retriever::set_flat`]; [`Error::Argument`] where no curve can be fitted.
pub(super) fn take_flat(
    input: &Input,
    retriever: &mut Retriever,
    diagnosis: &mut Diagnosis,
    control: &mut RowsControl<'_>,
) -> Result<usize> {
    let [rows, columns] = input.frame();
    let mut read = |band: Range<u32>| {
        let data = input.flat_rows(0, band.clone())?;
        diagnosis.take_flat(&data, &band);
        Ok(data)
    };
    let noise = input.flat_noise(0);
    retriever.set_flat_with(numbers::count(rows), columns, noise, &mut read, control)?;
    let Some(flat) = retriever.flat_curves() else { return Err(Error::Interrupted) };
    if (0..flat.len()).all(|at| !flat.has_answer(at)) {
        let allowed = retriever.overlap_of_curves().unwrap_or_else(|| {
            "a flat with a curve that can be fitted in some pixel: check its values, the mask offsets, the saturation \
             and the read noise"
                .to_owned()
        });
        return Err(Error::argument("flat", no_answers(flat), allowed));
    }
    Ok(flat.len() / rows.max(1))
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

/// Reasons for missing answers, for a message.
fn no_answers(flat: &Curves) -> String {
    let found: Vec<String> = flags::MEANINGS
        .iter()
        .map(|(bit, _, meaning)| (flat.flags.iter().filter(|f| *f & bit != 0).count(), meaning))
        .filter(|(count, _)| *count > 0)
        .map(|(count, meaning)| format!("{count} pixels: {meaning}"))
        .collect();
    format!("no pixel with a result ({})", found.join("; "))
}
