//! Corrections and images of one view after the other.

use crate::retrieve::correct::{Corrector, FrameCorrection, Rectangle, ViewCorrection};
use crate::retrieve::diagnosis::{Diagnosis, ExaminedView};
use crate::retrieve::images::Images;
use crate::retrieve::input::Input;
use crate::retrieve::joined::JoinedColumns;
use crate::retrieve::retriever::{Corrected, Retriever};
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Result, numbers};
use ndarray::Array2;
use std::ops::Range;

/// The views of an input, with what retrieves, examines and corrects them.
pub(super) struct Views<'a> {
    pub(super) input: &'a Input,
    pub(super) joined: Option<&'a JoinedColumns>,
    /// Bad pixels of the images.
    pub(super) bad: Option<&'a Array2<bool>>,
    pub(super) retriever: &'a mut Retriever,
    pub(super) diagnosis: &'a mut Diagnosis,
    pub(super) corrector: Option<Corrector>,
    /// Corrections of the views so far.
    pub(super) corrections: Vec<ViewCorrection>,
}

/// Corrections of a view before its curves are fitted.
struct OfView {
    empty: Vec<Rectangle>,
    frames: Option<FrameCorrection>,
    record: ViewCorrection,
}

impl Views<'_> {
    /// The images of an angle, and of its flats if views have their own; dithers are side by side.
    pub(super) fn angle(
        &mut self,
        angle: usize,
        control: &mut RowsControl<'_>,
    ) -> Result<(Images, Option<Images>)> {
        let Some(joined) = self.joined else { return self.view(angle, control) };
        let dithers = self.input.scene().scan.dithers_of_angle();
        let views = angle * dithers..(angle + 1) * dithers;
        let (images, flats): (Vec<Images>, Vec<Option<Images>>) = views
            .map(|view| self.view(view, control))
            .collect::<Result<Vec<_>>>()?
            .into_iter()
            .unzip();
        let flats: Option<Vec<Images>> = flats.into_iter().collect();
        Ok((joined.images(&images), flats.map(|flats| joined.images(&flats))))
    }

    /// The images of a view, and of its flat if views have their own.
    fn view(
        &mut self,
        view: usize,
        control: &mut RowsControl<'_>,
    ) -> Result<(Images, Option<Images>)> {
        let of_flat = self.flat(view, control)?;
        let mut correction = self.correction(view, control)?;
        let frames = correction.as_ref().and_then(|of| of.frames.as_ref());
        let (input, diagnosis) = (self.input, &mut *self.diagnosis);
        let mut read = |band: Range<u32>| {
            let mut data = input.sample_rows(view, band.clone())?;
            if let Some(frames) = frames {
                frames.apply(&mut data);
            }
            diagnosis.take_sample(&data, &band);
            Ok(data)
        };
        let corrected = frames.map_or(Corrected::NONE, FrameCorrection::corrected);
        let columns = input.frame()[1];
        let retriever = &*self.retriever;
        let mut images =
            retriever.retrieve_corrected(view, corrected, columns, &mut read, control)?;
        if let Some(bad) = self.bad {
            retriever.mark_bad(&mut images, bad);
        }
        let mut subtracted = [0.0; 2];
        if let (Some(corrector), Some(OfView { empty, record, .. })) =
            (&self.corrector, &mut correction)
        {
            corrector.images(&mut images, view, empty, record)?;
            subtracted =
                [record.offset, record.offset_z].map(|of| of.map_or(0.0, |[angle, _]| angle));
            self.corrections.push(record.clone());
        }
        let frames = correction.as_ref().and_then(|of| of.frames.as_ref());
        let corrected = frames.map_or(Corrected::NONE, FrameCorrection::corrected);
        let nominal = retriever.offsets_of_view(view)?;
        self.diagnosis.view(&ExaminedView {
            retriever,
            images: &images,
            offsets: corrected.offsets.unwrap_or(&nominal),
            corrected,
            subtracted,
        })?;
        Ok((images, of_flat))
    }

    /// Takes the flat of a view, where views have their own, and returns its images.
    fn flat(&mut self, view: usize, control: &mut RowsControl<'_>) -> Result<Option<Images>> {
        let (input, diagnosis) = (self.input, &mut *self.diagnosis);
        if !input.has_flats() {
            return Ok(None);
        }
        // The first was taken to begin with.
        if view > 0 {
            let mut read = |band: Range<u32>| {
                let data = input.flat_rows(view, band.clone())?;
                diagnosis.take_flat(&data, &band);
                Ok(data)
            };
            let ([rows, columns], noise) = (input.frame(), input.flat_noise(view));
            let rows = numbers::count(rows);
            self.retriever.set_flat_with(rows, columns, noise, &mut read, control)?;
        }
        Ok(self.retriever.images_of_flat())
    }

    /// Finds the empty beam of a view where it is not named, and the doses and offsets of its frames.
    fn correction(&mut self, view: usize, control: &mut RowsControl<'_>) -> Result<Option<OfView>> {
        let (input, retriever) = (self.input, &*self.retriever);
        let Some(corrector) = &mut self.corrector else { return Ok(None) };
        let empty = match corrector.named() {
            Some(empty) => empty.to_vec(),
            None => {
                let mut read = |band: Range<u32>| input.sample_rows(view, band);
                // The view is read once more: no progress.
                let mut quiet = RowsControl { progress: None, cancel: control.cancel.clone() };
                let columns = input.frame()[1];
                let mut images = retriever.retrieve(view, columns, &mut read, &mut quiet)?;
                if let Some(bad) = self.bad {
                    retriever.mark_bad(&mut images, bad);
                }
                Corrector::found(&images, view, retriever)?
            }
        };
        let found = corrector.frames(input, retriever, view, &empty, &control.cancel)?;
        let (frames, record) = match found {
            Some((frames, record)) => (Some(frames), record),
            None => (None, Corrector::begun(&empty)),
        };
        Ok(Some(OfView { empty, frames, record }))
    }
}
