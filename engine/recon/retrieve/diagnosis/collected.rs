//! The diagnosis of a retrieval, view by view.

use super::below_zero::BelowZero;
use super::borders::Borders;
use super::chi_square::{self, PixelResiduals};
use super::empty_beam::{self, EmptyBeam, EmptyBeamOfView};
use super::excess::{Excess, PixelExcess};
use super::exchanged::{EXCESS, Exchanged};
use super::fitted::FittedCurve;
use super::leverage::Leverage;
use super::light::{self, LightCounts};
use super::moments::{MomentsCheck, MomentsErrors};
use super::steps::{self, PixelSteps, STEADY, STEADY_IN_AIR, Unsteady};
use super::transposed::Transposition;
use super::warnings;
use super::watched::Watched;
use crate::retrieve::curve_model::CurveModel;
use crate::retrieve::curves::Fits;
use crate::retrieve::images::Images;
use crate::retrieve::input::Input;
use crate::retrieve::misfit::median;
use crate::retrieve::model::Model;
use crate::retrieve::retriever::Corrected;
use crate::retrieve::value_noise::ValueNoise;
use crate::retrieve::{Method, Record, RetrieveOptions, Retriever, Weights};
use beamlet_core::{Result, numbers};
use ndarray::Array3;
use rayon::prelude::*;
use std::ops::Range;

/// Displacement in widths of the curve, and relative change of the width, below which a pixel counts as
/// air: a Gaussian leaves the same residuals there as in the flat, within 1e-3 of the height.
const IN_AIR: f64 = 0.03;
/// Residuals of the flat that all pixels share, beyond the method's own misfit, rms over the height, that show a wrong
/// list of offsets: leaking bars, thick bars and spots that are no Gaussian leave less. Of the curve of the masks, whose
/// residuals a wrong distance or aperture leaves, and of other curves.
const MISFIT: [f64; 2] = [0.005, 0.02];

/// Light of a sample over the flat's below which it is none.
const DARK: f64 = 1e-3;

/// Data of flat and views for the diagnosis of faults.
#[derive(Debug)]
pub(crate) struct Diagnosis {
    options: RetrieveOptions,
    model: Option<CurveModel>,
    /// Offsets of the sample's steps if equal to the flat's; else empty.
    offsets: Vec<[f64; 2]>,
    flat: Watched,
    sample: Watched,
    empty: Option<Empty>,
    /// For the method `moments`.
    moments: Option<MomentsCheck>,
    found: Findings,
}

/// A view that was retrieved.
#[derive(Clone, Copy)]
pub(crate) struct ExaminedView<'a> {
    /// The retriever with the curves of its flat.
    pub(crate) retriever: &'a Retriever,
    pub(crate) images: &'a Images,
    /// Mask offsets of its frames, m.
    pub(crate) offsets: &'a [[f64; 2]],
    /// Corrections of the frames.
    pub(crate) corrected: Corrected<'a>,
    /// Refraction angles along x and z that were subtracted, rad.
    pub(crate) subtracted: [f64; 2],
}

/// Pixels that are named as empty beam.
#[derive(Debug)]
struct Empty {
    /// Rows and columns of pixels.
    pixels: [Range<usize>; 2],
    /// Rows and columns of the images in rectangles; none before the flat was taken.
    images: Vec<[Range<usize>; 2]>,
    flat: Watched,
    sample: Watched,
    views: Vec<EmptyBeamOfView>,
}

/// A pixel with the fits of flat and sample.
struct FittedPixel<'a> {
    /// Values of flat and sample.
    values: [&'a [f64]; 2],
    residuals: PixelResiduals,
    steps: PixelSteps,
    /// Height of the curve of the sample.
    height: f64,
    /// The curve of the sample lies as in the flat.
    in_air: bool,
    /// Residuals of the flat over the height of its curve.
    shape: Vec<f64>,
    excess: PixelExcess,
}

/// Findings of the views so far, with the units of their sizes.
#[derive(Debug)]
pub(super) struct Findings {
    pub(super) views: usize,
    pub(super) light: LightCounts,
    /// Values of the sample below zero.
    negative: u64,
    /// For each view the reduced chi squared of the fits, and beyond the residuals of the flat.
    pub(super) chi_squares: Vec<[f64; 2]>,
    /// True if the gain is known, not assumed.
    pub(super) is_noise_known: bool,
    pub(super) unsteady: Vec<(usize, Unsteady)>,
    /// Residuals of the flat that all pixels share, rms, over the height of the curve, by view.
    misfits: Vec<f64>,
    pub(super) excesses: Vec<(usize, Excess)>,
    pub(super) exchanged: Vec<(usize, Exchanged)>,
    /// Frames of the flat, and of views of the sample.
    pub(super) below_zero: [Vec<(usize, BelowZero)>; 2],
    pub(super) moments: Vec<(usize, MomentsErrors)>,
    pub(super) borders: Vec<(usize, Borders)>,
    /// Views that do not follow the flat.
    pub(super) divided: usize,
    pub(super) transposed: Transposition,
    /// Sums of the values of flat and sample.
    sums: [f64; 2],
    /// True if values were measured: simulated ones have no faults of a laboratory.
    pub(super) measured: bool,
    /// Median widths of the flat's curves along x and z, m.
    pub(super) widths: [f64; 2],
    /// Refraction angle per shift of a centre, rad/m.
    pub(super) angle_per_shift: f64,
    pub(super) is_beamlet: bool,
}

impl Diagnosis {
    /// Ready for the rows of the frames of an input.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Argument`] where the empty beam is no part of the frame.
    pub(crate) fn begin(
        retriever: &Retriever,
        options: &RetrieveOptions,
        input: &Input,
    ) -> Result<Self> {
        let (frame, measured) = (input.frame(), input.is_measured());
        let [rows, columns] = frame;
        let steps = retriever.steps();
        let saturation = options.saturation;
        let empty = match &options.empty_beam {
            None => None,
            Some(region) => {
                let pixels = region.within(frame)?;
                let flat = Watched::over(&pixels, columns, steps, saturation);
                let (sample, images, views) = (flat.again(), Vec::new(), Vec::new());
                Some(Empty { pixels, images, flat, sample, views })
            }
        };
        let flat = Watched::over(&[0..rows, 0..columns], columns, steps, saturation);
        let [of_flat, of_sample] = retriever.offsets();
        let is_one = of_flat == of_sample;
        let is_moments = options.method() == Method::Moments;
        let model = retriever.layout().curve_model().filter(|of| !of.model.is_list());
        Ok(Self {
            options: options.clone(),
            model: model.cloned(),
            offsets: if is_one { of_flat.to_vec() } else { Vec::new() },
            sample: flat.again(),
            flat,
            empty,
            moments: is_moments.then(MomentsCheck::default),
            found: Findings {
                views: 0,
                light: LightCounts::default(),
                negative: 0,
                chi_squares: Vec::new(),
                is_noise_known: options.gain.is_some() && !options.gain_assumed,
                unsteady: Vec::new(),
                misfits: Vec::new(),
                excesses: Vec::new(),
                exchanged: Vec::new(),
                below_zero: [Vec::new(), Vec::new()],
                moments: Vec::new(),
                borders: Vec::new(),
                divided: 0,
                transposed: Transposition::new(input.frame_order(), input.extent_of_files()),
                sums: [0.0; 2],
                measured,
                widths: [f64::NAN; 2],
                angle_per_shift: retriever.angle_per_shift(),
                is_beamlet: retriever.layout().has_beamlets(),
            },
        })
    }

    /// Finds the empty beam in the images, when the first flat was taken.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Argument`] where no whole beamlet is in it.
    pub(crate) fn place(&mut self, retriever: &Retriever) -> Result<()> {
        if let Some(empty) = &mut self.empty {
            empty.images = retriever.curves_within(&empty.pixels)?;
        }
        Ok(())
    }

    /// Keeps values of rows of the flat, `[step][row][column]`.
    pub(crate) fn take_flat(&mut self, data: &Array3<f32>, rows: &Range<u32>) {
        let of_empty = self.empty.as_mut().map(|empty| &mut empty.flat);
        [Some(&mut self.flat), of_empty].into_iter().flatten().for_each(|of| of.take(data, rows));
    }

    /// Keeps values of rows of the view to come, `[step][row][column]`.
    pub(crate) fn take_sample(&mut self, data: &Array3<f32>, rows: &Range<u32>) {
        let of_empty = self.empty.as_mut().map(|empty| &mut empty.sample);
        [Some(&mut self.sample), of_empty].into_iter().flatten().for_each(|of| of.take(data, rows));
    }

    /// Examines a view whose rows were taken.
    ///
    /// # Errors
    /// As [`Retriever::response`].
    pub(crate) fn view(&mut self, of: &ExaminedView<'_>) -> Result<()> {
        let ExaminedView { retriever, images, corrected, subtracted, .. } = *of;
        let Some(flat) = retriever.flat_curves() else { return Ok(()) };
        if self.found.views == 0 {
            self.found.widths = retriever.flat_widths();
        }
        let view = self.found.views;
        self.found.views += 1;
        self.found.negative += self.sample.negative();
        let below_zero = [&self.flat, &self.sample].map(BelowZero::of);
        for (all, found) in self.found.below_zero.iter_mut().zip(below_zero) {
            all.extend(found.filter(|_| self.found.measured).map(|found| (view, found)));
        }
        if let Some(check) = &mut self.moments {
            let errors = check.view(retriever, of.offsets)?;
            self.found.moments.extend(errors.map(|errors| (view, errors)));
        }
        self.found.transposed.add([&self.flat, &self.sample]);
        let values = [&self.flat, &self.sample].map(Watched::sum);
        self.found.sums = [0, 1].map(|of| self.found.sums[of] + values[of]);
        let divided = self.found.measured && light::is_divided(&self.flat, &self.sample);
        self.found.divided += usize::from(divided);
        let offsets = corrected.offsets.filter(|_| !self.offsets.is_empty());
        let of_view = offsets.map_or_else(|| self.offsets.clone(), <[_]>::to_vec);
        let known = self.found.chi_squares.len();
        self.fits(of, flat, view, &of_view);
        self.found.light.add(images, self.noise_share(known));
        if let Some(empty) = &mut self.empty {
            let model = self.model.as_ref();
            let curve = |at: usize| FittedCurve::of_flat(model?, flat, at);
            let pixels = empty_beam::pixels(&empty.flat, &empty.sample, curve);
            let found = EmptyBeamOfView::of(
                images,
                &empty.images,
                self.found.angle_per_shift,
                subtracted,
                &pixels,
                [&self.offsets, &of_view],
            );
            empty.views.push(found);
            empty.sample = empty.sample.again();
        } else if self.found.measured {
            let per_shift = self.found.angle_per_shift;
            let angles = self.found.widths.map(|width| (width * per_shift).abs());
            let borders = Borders::of(images, retriever.shape(), angles);
            self.found.borders.extend(borders.map(|borders| (view, borders)));
        }
        self.sample = self.sample.again();
        Ok(())
    }

    /// Share of noise in the uncertainties of the view whose chi squared has this place: fits without
    /// weights take their residuals for noise, and a Gaussian leaves residuals in noise-free frames.
    fn noise_share(&self, view: usize) -> f32 {
        match self.found.chi_squares.get(view) {
            Some([own, beyond]) if self.options.weights == Weights::None && *own > 0.0 => {
                numbers::single((beyond / own).clamp(0.0, 1.0).sqrt())
            }
            _ => 1.0,
        }
    }

    /// Residuals of the fits of a view.
    fn fits(&mut self, of: &ExaminedView<'_>, flat: &Fits, view: usize, of_view: &[[f64; 2]]) {
        let ExaminedView { retriever, images, corrected, .. } = *of;
        let [of_flat, of_sample] = [retriever.flat_noise(), corrected.noise]
            .map(|factors| ValueNoise::relative(&self.options, factors));
        let Some(model) = &self.model else { return };
        let unknowns = model.equations().count();
        if self.offsets.len() <= unknowns {
            return;
        }
        if matches!(self.options.method(), Method::Moments | Method::ThreeStep) {
            return;
        }
        let pairs: Vec<_> = self.flat.iter().zip(self.sample.iter()).collect();
        let pixels = pairs.par_iter().filter_map(|((at, flat_values), (_, sample_values))| {
            let (at, values) = (*at, [&flat_values[..], &sample_values[..]]);
            let curves = [
                FittedCurve::of_flat(model, flat, at)?,
                FittedCurve::of_sample(model, images, at)?,
            ];
            let by_flat = Leverage::of(&curves[0], &self.offsets, of_flat)?;
            let by_sample = Leverage::of(&curves[1], of_view, of_sample)?;
            let leverages = [&by_flat, &by_sample];
            let heights = curves.each_ref().map(|curve| curve.amplitude);
            let shapes = [0, 1].map(|k| leverages[k].residuals(values[k], heights[k]));
            let [flat, sample] = [0, 1].map(|k| leverages[k].squares(values[k]));
            let excess = PixelExcess { flat, sample, residual: rms(&shapes[1]) };
            let [shape, _] = shapes;
            Some(FittedPixel {
                values,
                residuals: PixelResiduals::of(leverages, values, heights),
                steps: PixelSteps::of(leverages, values, heights, curves[1].widths_of_steps())?,
                height: heights[1],
                in_air: is_in_air(&curves, model.axes()),
                shape,
                excess,
            })
        });
        let pixels: Vec<_> = pixels.collect();
        let freedom = self.offsets.len() - unknowns;
        let own = chi_square::reduced(pixels.iter().map(|of| of.residuals.own), freedom);
        let beyond = chi_square::reduced(pixels.iter().map(|of| of.residuals.beyond_flat), freedom);
        if let (Some(own), Some(beyond), true) = (own, beyond, self.options.gain.is_some()) {
            self.found.chi_squares.push([own, beyond]);
        }
        if !self.found.measured {
            return;
        }
        self.found.add(view, &pixels, freedom);
        let is_of_masks = matches!(model.model, Model::Masks(_)) && model.model.repeats() == 1;
        let excess = pixels.iter().map(|of| &of.excess);
        let has_shape = self.found.misfits.last().is_some_and(|misfit| *misfit > MISFIT[0]);
        let is_other = Excess::ratio_of(excess, freedom).is_some_and(|ratio| ratio > EXCESS);
        if is_of_masks && (is_other || has_shape) {
            let values: Vec<_> = pixels.iter().map(|of| of.values).collect();
            let found = Exchanged::of(model, of_view, of_sample, &values);
            self.found.exchanged.extend(found.map(|found| (view, found)));
        }
    }

    /// True if the sample has next to no light of the flat.
    pub(crate) fn is_dark(&self) -> bool {
        let [flat, sample] = self.found.sums;
        sample < DARK * flat
    }

    /// True if a fault of all values explains pixels without a result.
    pub(crate) fn names_fault(&self) -> bool {
        self.found.divided > 0 || self.found.transposed.is_likely()
    }

    /// Writes the findings into the record, and logs the warnings, behind those about the files.
    ///
    /// # Errors
    /// As [`Retriever::misfit_of_masks`].
    pub(crate) fn finish(
        self,
        record: &mut Record,
        retriever: &Retriever,
        of_files: &[String],
    ) -> Result<()> {
        let found = &self.found;
        let misfits = median(found.misfits.clone());
        let least = MISFIT[usize::from(self.options.method() != Method::ExactCurve)];
        let misfit = match misfits.filter(|misfit| *misfit > least) {
            Some(misfit) => Some([misfit, retriever.misfit_of_masks()?]),
            None => None,
        };
        let middle = |at: usize| median(found.chi_squares.iter().map(|pair| pair[at]).collect());
        record.reduced_chi_square = middle(0);
        record.chi_square_beyond_flat = middle(1);
        record.above_one = found.light.bright;
        record.negative_values = found.negative + self.flat.negative();
        record.empty_beam = self.empty.map(|empty| {
            let [rows, columns] = empty.pixels.map(|range| [range.start, range.end]);
            EmptyBeam { columns, rows, views: empty.views }
        });
        let misfit = misfit.filter(|[misfit, of_masks]| *misfit > of_masks + least);
        let found = warnings::of(found, misfit, record.empty_beam.as_ref());
        record.warnings.extend(of_files.iter().cloned().chain(found));
        for warning in &record.warnings {
            log::warn!("{warning}");
        }
        Ok(())
    }
}

impl Findings {
    /// Adds what the residuals of a measured view show.
    fn add(&mut self, view: usize, pixels: &[FittedPixel<'_>], freedom: usize) {
        self.misfits.extend(common(pixels));
        let excess = Excess::of(pixels.iter().map(|of| &of.excess), freedom);
        self.excesses.extend(excess.map(|excess| (view, excess)));
        // Pixels with little light are noisier than the rest.
        let least = median(pixels.iter().map(|of| of.height).collect()).unwrap_or(0.0) / 2.0;
        let steps = |of_air: bool| -> Vec<&PixelSteps> {
            let chosen = pixels.iter().filter(|of| of.height > least && (of.in_air || !of_air));
            chosen.map(|of| &of.steps).collect()
        };
        let found = steps::unsteady(&steps(false), STEADY, freedom)
            .or_else(|| steps::unsteady(&steps(true), STEADY_IN_AIR, freedom));
        self.unsteady.extend(found.map(|found| (view, found)));
    }
}

/// Decides whether the curve of the sample lies where the flat's does, and is as wide, along these axes.
fn is_in_air([flat, sample]: &[FittedCurve; 2], axes: &[usize]) -> bool {
    axes.iter().all(|axis| {
        let width = flat.widths[*axis];
        let moved = (sample.centre()[*axis] - flat.centre()[*axis]).abs() / width;
        moved < IN_AIR && (sample.widths[*axis] / width - 1.0).abs() < IN_AIR
    })
}

/// Residuals of the flat over the height that all pixels share: the median of each step, rms over the steps; `None`
/// without pixels.
fn common(pixels: &[FittedPixel<'_>]) -> Option<f64> {
    let steps = pixels.first()?.shape.len();
    let of_step = |step: usize| median(pixels.iter().map(|of| of.shape[step]).collect());
    Some(rms(&(0..steps).map(of_step).collect::<Option<Vec<f64>>>()?))
}

fn rms(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    (values.iter().map(|value| value * value).sum::<f64>() / count).sqrt()
}
