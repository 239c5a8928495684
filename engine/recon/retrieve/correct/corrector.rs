//! Corrections of one view after the other.

use super::chosen::{Corrections, Plane, ViewCorrection};
use super::equations::Unknowns;
use super::frames;
use super::pixels::{FlatPixel, PixelSet, Rectangle, chosen_pixels, curves_of};
use super::plane::{FittedPlane, Slopes};
use crate::retrieve::curve_model::CurveModel;
use crate::retrieve::diagnosis::{Borders, is_usable};
use crate::retrieve::images::{FLAGS, Images};
use crate::retrieve::input::Input;
use crate::retrieve::retriever::{Corrected, ImagePlaces};
use crate::retrieve::value_noise::NoiseFactors;
use crate::retrieve::{RetrieveOptions, Retriever};
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result, numbers};
use ndarray::Array3;
use std::ops::Range;

/// Fewest pixels of empty beam.
const FEWEST: usize = 16;
/// Bytes of a band of rows with all its frames.
const BAND: usize = 16 << 20;

/// Corrections by empty beam.
#[derive(Debug)]
pub(crate) struct Corrector {
    chosen: Corrections,
    options: RetrieveOptions,
    /// Curves of the pixels of frames, where their doses or offsets are corrected.
    curves: Option<CurveModel>,
    places: ImagePlaces,
    /// Pixels of empty beam of the images, where they are named.
    named: Option<Vec<Rectangle>>,
    /// Frames of a view or of the flat, the greater number.
    frames: usize,
    /// Pixels of the flat of all views, with the pixels that they are of.
    flat: Option<(Vec<usize>, Vec<Option<FlatPixel>>)>,
}

/// Doses and mask offsets of the frames of a view, as they are found.
#[derive(Debug)]
pub(crate) struct FrameCorrection {
    doses: Vec<f32>,
    /// Values from here on are left out of fits.
    saturation: Option<f32>,
    /// x and z, m, without whole periods.
    offsets: Option<Vec<[f64; 2]>>,
}

impl FrameCorrection {
    /// Offsets and noise of the values, for fits.
    pub(crate) fn corrected(&self) -> Corrected<'_> {
        let factors = self.doses.iter().map(|dose| f64::from(*dose).recip());
        let factor = factors.sum::<f64>() / self.doses.len() as f64;
        Corrected { offsets: self.offsets.as_deref(), noise: NoiseFactors::multiplied(factor) }
    }

    /// Divides values `[step][row][column]` by the doses; saturated values stay.
    pub(crate) fn apply(&self, data: &mut Array3<f32>) {
        let most = self.saturation.unwrap_or(f32::INFINITY);
        for (mut frame, dose) in data.outer_iter_mut().zip(&self.doses) {
            frame.mapv_inplace(|y| if y < most { y / dose } else { y });
        }
    }
}

impl Corrector {
    /// `None` where nothing is to be corrected.
    ///
    /// # Errors
    /// [`Error::Argument`] for corrections that the method or the set-up does not have, and where the empty beam is no
    /// part of the frame.
    pub(crate) fn of(
        retriever: &Retriever,
        input: &Input,
        options: &RetrieveOptions,
    ) -> Result<Option<Self>> {
        let chosen = options.correct;
        if chosen.is_none() {
            return Ok(None);
        }
        let refused =
            |found: &str, allowed: &str| Err(Error::argument("correct", found.to_owned(), allowed));
        let layout = retriever.layout();
        if layout.has_beamlets() && chosen.steps {
            return refused(
                "steps with beamlets",
                "offset: a frame at one mask offset has one shift",
            );
        }
        if chosen.of_frames() && layout.is_of_list() {
            let allowed = "offset and plane: a curve with a peak for each opening does not tell a dose from a \
                           displacement";
            return refused("dose or steps with a list of apertures", allowed);
        }
        let of_frames = chosen.of_frames() && !layout.has_beamlets();
        let curves = if of_frames { curves_of(layout) } else { None };
        if of_frames && curves.is_none() {
            return refused("dose or steps without two masks", "offset and plane");
        }
        Ok(Some(Self {
            chosen,
            options: options.clone(),
            curves,
            places: retriever.image_places(input),
            named: match &options.empty_beam {
                Some(region) => Some(retriever.curves_within(&region.within(input.frame())?)?),
                None => None,
            },
            frames: retriever.steps().max(1),
            flat: None,
        }))
    }

    /// The empty beam that was named, in pixels of the images; `None` where it is to be found.
    pub(crate) fn named(&self) -> Option<&[Rectangle]> {
        self.named.as_deref()
    }

    /// Empty beam at both sides of the images of a view: strips that have one transmission, one refraction
    /// and no dark field.
    ///
    /// # Errors
    /// [`Error::Argument`] where the sides do not look empty.
    pub(crate) fn found(
        images: &Images,
        view: usize,
        retriever: &Retriever,
    ) -> Result<Vec<Rectangle>> {
        // Refraction of a shift by a width of the flat's curve.
        let angles =
            retriever.flat_widths().map(|width| (width * retriever.angle_per_shift()).abs());
        let (rows, columns) = images.get(FLAGS).map_or((0, 0), ndarray::Array2::dim);
        match Borders::of(images, [rows, columns], angles) {
            Some(borders) => {
                let width = borders.width;
                Ok([0..width, columns - width..columns].map(|strip| [0..rows, strip]).to_vec())
            }
            None => Err(Error::argument(
                "correct",
                format!("no empty beam at both sides of view {view}"),
                "columns with nothing in the beam, given as empty beam (--empty-beam)",
            )),
        }
    }

    /// Doses and offsets of the frames of a view by the pixels of empty beam, and their record.
    ///
    /// # Errors
    /// As [`Input::sample_rows`]; [`Error::Argument`] where too few pixels have a curve, or no frame has a
    /// value that they determine; [`Error::Interrupted`].
    pub(crate) fn frames(
        &mut self,
        input: &Input,
        retriever: &Retriever,
        view: usize,
        empty: &[Rectangle],
        cancel: &Cancel,
    ) -> Result<Option<(FrameCorrection, ViewCorrection)>> {
        let Some(curves) = &self.curves else { return Ok(None) };
        let (pixels, count) = chosen_pixels(input.frame(), empty, curves.axes().len());
        let nominal = retriever.offsets_of_view(view)?;
        let flat_offsets = retriever.flat_offsets();
        if self.flat.as_ref().is_none_or(|(of, _)| *of != pixels) || input.has_flats() {
            let mut read = |rows| input.flat_rows(view, rows);
            let values = self.values(input.frame(), &pixels, &mut read, cancel)?;
            let flat = FlatPixel::all(values, flat_offsets, curves, &self.options);
            self.flat = Some((pixels.clone(), flat));
        }
        let mut read = |rows| input.sample_rows(view, rows);
        let sample = self.values(input.frame(), &pixels, &mut read, cancel)?;
        let flat = self.flat.as_ref().map_or(&[][..], |(_, flat)| flat);
        let offsets = [flat_offsets, &nominal[..]];
        // They decide on which side of the peak a frame lies; with doses unknown as well they do not.
        let inner = self.chosen.steps && !self.chosen.dose;
        let set = PixelSet::of(flat, sample, count, inner, offsets, curves, &self.options);
        if set.empty.len() < FEWEST {
            let found = format!(
                "{} pixels with a curve and with values in all frames of view {view}",
                set.empty.len()
            );
            let allowed = format!("{FEWEST} pixels or more with nothing in the beam");
            return Err(Error::argument("empty_beam", found, allowed));
        }
        let (dose, steps) = (self.chosen.dose, self.chosen.steps);
        let of = Unknowns { frames: nominal.len(), dose, steps, axes: curves.axes().len() };
        let unsolved = |what: &str| {
            let allowed = "frames on both slopes of the illumination curve";
            Err(Error::argument("correct", format!("{what} of view {view}: unknown"), allowed))
        };
        let Some(found) = frames::solve(&set, of, cancel)? else {
            return unsolved("doses and offsets");
        };
        let [doses, along_x, along_z] = found.known(set.widths);
        let is_unknown = |values: &[Option<[f64; 2]>]| values.iter().all(Option::is_none);
        // Of both nothing may be known: fields are empty, and a warning names the choice.
        if dose && !steps && is_unknown(&doses) {
            return unsolved("doses");
        }
        if steps && !dose && is_unknown(&along_x) && (of.axes == 1 || is_unknown(&along_z)) {
            return unsolved("offsets");
        }
        let value = |(chosen, pair): (bool, &[f64; 2])| if chosen { pair[0] } else { 1.0 };
        let correction = FrameCorrection {
            saturation: self.options.saturation,
            doses: found.dose.iter().map(|pair| numbers::single(value((dose, pair)))).collect(),
            offsets: steps.then(|| {
                let [x, z] = &found.shift;
                let moved = nominal.iter().zip(x.iter().zip(z));
                moved.map(|(at, ([x, _], [z, _]))| [at[0] + x, at[1] + z]).collect()
            }),
        };
        let record = ViewCorrection {
            dose: if dose { doses } else { Vec::new() },
            steps: if steps { along_x } else { Vec::new() },
            steps_z: if steps && of.axes == 2 { along_z } else { Vec::new() },
            ..Self::begun(empty)
        };
        Ok(Some((correction, record)))
    }

    /// The record of a view without corrections.
    pub(crate) fn begun(empty: &[Rectangle]) -> ViewCorrection {
        let of = |[rows, columns]: &Rectangle| [columns.start, columns.end, rows.start, rows.end];
        ViewCorrection { empty_beam: empty.iter().map(of).collect(), ..ViewCorrection::default() }
    }

    /// Corrects the images of a view, and adds to its record.
    ///
    /// # Errors
    /// [`Error::Argument`] where the pixels do not determine the corrections.
    pub(crate) fn images(
        &self,
        images: &mut Images,
        view: usize,
        empty: &[Rectangle],
        record: &mut ViewCorrection,
    ) -> Result<()> {
        if self.chosen.dose && self.curves.is_none() {
            let values = self.points(images, "transmission", empty);
            let dose = FittedPlane::through(&values, Slopes { x: false, z: false });
            let Some(dose) = dose.map(|plane| plane.value).filter(|[dose, _]| *dose > 0.0) else {
                return Err(Self::too_few(view, values.len()));
            };
            for name in ["transmission", "transmission_sigma"] {
                if let Some(image) = images.get_mut(name) {
                    image.mapv_inplace(|value| value / numbers::single(dose[0]));
                }
            }
            record.dose = vec![Some(dose)];
        }
        if !self.chosen.of_refraction() {
            return Ok(());
        }
        if let Some((offset, plane)) = self.subtract(images, "refraction", (view, empty))? {
            (record.offset, record.plane) = (Some(offset), plane);
        }
        if let Some((offset, plane)) = self.subtract(images, "refraction_z", (view, empty))? {
            (record.offset_z, record.plane_z) = (Some(offset), plane);
        }
        Ok(())
    }

    /// Subtracts the angle of the empty beam, or a plane through it, from an image of refraction. Returns what was
    /// subtracted; `None` without this image, and where steps do not determine it.
    fn subtract(
        &self,
        images: &mut Images,
        name: &str,
        (view, empty): (usize, &[Rectangle]),
    ) -> Result<Option<([f64; 2], Option<Plane>)>> {
        if images.get(name).is_none_or(|image| image.iter().all(|value| value.is_nan())) {
            return Ok(None);
        }
        let points = self.points(images, name, empty);
        let has_rows = self.places.rows() > 1;
        let slopes = Slopes { x: self.chosen.plane, z: self.chosen.plane && has_rows };
        if points.len() < FEWEST {
            return Err(Self::too_few(view, points.len()));
        }
        let Some(plane) = FittedPlane::through(&points, slopes) else {
            let found = format!("pixels of one row or column of view {view}");
            let allowed =
                "pixels of several columns (and rows, where images have several) for a plane";
            return Err(Error::argument("empty_beam", found, allowed));
        };
        if let Some(image) = images.get_mut(name) {
            for ((row, column), value) in image.indexed_iter_mut() {
                let [x, z] = self.places.at(row, column);
                *value = numbers::single(f64::from(*value) - plane.at(x, z));
            }
        }
        let [x, z] = plane.slopes;
        let slopes = self.chosen.plane.then_some(Plane { x, z: has_rows.then_some(z) });
        Ok(Some((plane.value, slopes)))
    }

    fn too_few(view: usize, count: usize) -> Error {
        let found = format!("{count} pixels with a result in view {view}");
        let allowed = format!("{FEWEST} pixels or more with nothing in the beam");
        Error::argument("empty_beam", found, allowed)
    }

    /// Place (x, z) and value of the pixels of empty beam that have a result without a flag of doubt.
    fn points(&self, images: &Images, name: &str, empty: &[Rectangle]) -> Vec<[f64; 3]> {
        let (Some(image), Some(bits)) = (images.get(name), images.get(FLAGS)) else {
            return Vec::new();
        };
        let mut points = Vec::new();
        for [rows, columns] in empty {
            for (row, column) in rows.clone().flat_map(|r| columns.clone().map(move |c| (r, c))) {
                let value = f64::from(image[[row, column]]);
                let bits = numbers::whole::<u32>(f64::from(bits[[row, column]]));
                if is_usable(bits) && value.is_finite() {
                    let [x, z] = self.places.at(row, column);
                    points.push([x, z, value]);
                }
            }
        }
        points
    }

    /// Values of pixels of frames, by pixel; NaN for values that are left out.
    fn values(
        &self,
        [rows, columns]: [usize; 2],
        pixels: &[usize],
        read: &mut dyn FnMut(Range<u32>) -> Result<Array3<f32>>,
        cancel: &Cancel,
    ) -> Result<Vec<Vec<f64>>> {
        let saturation = self.options.saturation.unwrap_or(f32::INFINITY);
        let mut by_row: Vec<Vec<usize>> = vec![Vec::new(); rows];
        for (at, pixel) in pixels.iter().enumerate() {
            by_row[pixel / columns].push(at);
        }
        let mut values = vec![Vec::new(); pixels.len()];
        let mut start = 0;
        while start < rows {
            if by_row[start].is_empty() {
                start += 1;
                continue;
            }
            cancel.check()?;
            let height = (BAND / (4 * columns * self.frames).max(1)).max(1);
            let end = rows.min(start + height);
            let data = read(numbers::count(start)..numbers::count(end))?;
            for (row, of_row) in by_row.iter().enumerate().take(end).skip(start) {
                for at in of_row {
                    let column = pixels[*at] % columns;
                    let frames = data.slice(ndarray::s![.., row - start, column]);
                    let value = |y: &f32| if *y < saturation { f64::from(*y) } else { f64::NAN };
                    values[*at] = frames.iter().map(value).collect();
                }
            }
            start = end;
        }
        Ok(values)
    }
}
