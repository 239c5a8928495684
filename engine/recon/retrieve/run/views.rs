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

/// Corrections by empty beam, view by view.
pub(super) struct Correcting {
    corrector: Corrector,
    /// Pixels of empty beam of the images, where they are named.
    empty: Option<Vec<Rectangle>>,
    views: Vec<ViewCorrection>,
}

/// Tools that look at views or correct them.
pub(super) struct Tools<'a> {
    diagnosis: &'a mut Diagnosis,
    correcting: Option<&'a mut Correcting>,
}

/// Inputs of the images of an angle.
#[derive(Clone, Copy)]
pub(super) struct ScanOf<'a> {
    pub(super) input: &'a Input,
    joined: Option<&'a JoinedColumns>,
    /// Bad pixels of the images.
    bad: Option<&'a Array2<bool>>,
}

impl<'a> Tools<'a> {
    pub(super) const fn new(
        diagnosis: &'a mut Diagnosis,
        correcting: Option<&'a mut Correcting>,
    ) -> Self {
        Self { diagnosis, correcting }
    }
}

impl<'a> ScanOf<'a> {
    /// `bad`: bad pixels of the images.
    pub(super) const fn new(
        input: &'a Input,
        joined: Option<&'a JoinedColumns>,
        bad: Option<&'a Array2<bool>>,
    ) -> Self {
        Self { input, joined, bad }
    }

    /// The images of an angle, and of its flats if views have their own; dithers are side by side.
    pub(super) fn angle(
        self,
        angle: usize,
        retriever: &mut Retriever,
        tools: &mut Tools<'_>,
        control: &mut RowsControl<'_>,
    ) -> Result<(Images, Option<Images>)> {
        let Some(joined) = self.joined else {
            return self.view(angle, retriever, tools, control);
        };
        let dithers = self.input.scene().scan.dithers_of_angle();
        let views = angle * dithers..(angle + 1) * dithers;
        let (images, flats): (Vec<Images>, Vec<Option<Images>>) = views
            .map(|view| self.view(view, retriever, tools, control))
            .collect::<Result<Vec<_>>>()?
            .into_iter()
            .unzip();
        let flats: Option<Vec<Images>> = flats.into_iter().collect();
        Ok((joined.images(&images), flats.map(|flats| joined.images(&flats))))
    }

    /// The images of a view, and of its flat if views have their own.
    fn view(
        self,
        view: usize,
        retriever: &mut Retriever,
        tools: &mut Tools<'_>,
        control: &mut RowsControl<'_>,
    ) -> Result<(Images, Option<Images>)> {
        let input = self.input;
        let [rows, columns] = input.frame();
        let mut of_flat = None;
        if input.has_flats() {
            // The first was taken to begin with.
            if view > 0 {
                let mut read = |band: Range<u32>| {
                    let data = input.flat_rows(view, band.clone())?;
                    tools.diagnosis.take_flat(&data, &band);
                    Ok(data)
                };
                let (rows, noise) = (numbers::count(rows), input.flat_noise(view));
                retriever.set_flat_with(rows, columns, noise, &mut read, control)?;
            }
            of_flat = retriever.images_of_flat();
        }
        let mut correction = match &mut tools.correcting {
            Some(correcting) => Some(correcting.begin(self, view, retriever, control)?),
            None => None,
        };
        let frames = correction.as_ref().and_then(|of| of.frames.as_ref());
        let diagnosis = &mut *tools.diagnosis;
        let mut read = |band: Range<u32>| {
            let mut data = input.sample_rows(view, band.clone())?;
            if let Some(frames) = frames {
                frames.apply(&mut data);
            }
            diagnosis.take_sample(&data, &band);
            Ok(data)
        };
        let corrected = frames.map_or(Corrected::NONE, FrameCorrection::corrected);
        let mut images =
            retriever.retrieve_corrected(view, corrected, columns, &mut read, control)?;
        if let Some(bad) = self.bad {
            retriever.mark_bad(&mut images, bad);
        }
        if let (Some(correcting), Some(of_view)) = (&mut tools.correcting, &mut correction) {
            correcting.corrector.images(&mut images, view, &of_view.empty, &mut of_view.record)?;
            correcting.views.push(of_view.record.clone());
        }
        let frames = correction.as_ref().and_then(|of| of.frames.as_ref());
        let corrected = frames.map_or(Corrected::NONE, FrameCorrection::corrected);
        let subtracted = correction.as_ref().map_or([0.0; 2], |of| {
            [of.record.offset, of.record.offset_z].map(|of| of.map_or(0.0, |of| of[0]))
        });
        let nominal = retriever.offsets_of_view(view)?;
        tools.diagnosis.view(&ExaminedView {
            retriever,
            images: &images,
            offsets: corrected.offsets.unwrap_or(&nominal),
            corrected,
            subtracted,
        });
        Ok((images, of_flat))
    }
}

/// Corrections of a view before its curves are fitted.
struct OfView {
    empty: Vec<Rectangle>,
    frames: Option<FrameCorrection>,
    record: ViewCorrection,
}

impl Correcting {
    /// `empty`: pixels of empty beam of the images, where they are named.
    pub(super) const fn new(corrector: Corrector, empty: Option<Vec<Rectangle>>) -> Self {
        Self { corrector, empty, views: Vec::new() }
    }

    /// Corrections of the views.
    pub(super) fn views(self) -> Vec<ViewCorrection> {
        self.views
    }

    /// Finds the empty beam of a view where it is not named, and the doses and offsets of its frames.
    fn begin(
        &mut self,
        scan: ScanOf<'_>,
        view: usize,
        retriever: &Retriever,
        control: &mut RowsControl<'_>,
    ) -> Result<OfView> {
        let input = scan.input;
        let empty = match &self.empty {
            Some(empty) => empty.clone(),
            None => {
                let mut read = |band: Range<u32>| input.sample_rows(view, band);
                // The view is read once more: no progress.
                let mut quiet = RowsControl { progress: None, cancel: control.cancel.clone() };
                let columns = input.frame()[1];
                let mut images = retriever.retrieve(view, columns, &mut read, &mut quiet)?;
                if let Some(bad) = scan.bad {
                    retriever.mark_bad(&mut images, bad);
                }
                Corrector::found(&images, view, retriever)?
            }
        };
        let cancel = &control.cancel;
        let found = self.corrector.frames(input, retriever, view, &empty, cancel)?;
        let (frames, record) = match found {
            Some((frames, record)) => (Some(frames), record),
            None => (None, Corrector::begun(&empty)),
        };
        Ok(OfView { empty, frames, record })
    }
}
